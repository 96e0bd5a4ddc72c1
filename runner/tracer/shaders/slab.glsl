// Conservative slab test of a ray against axis-aligned boxes.
#ifndef SLAB_GLSL
#define SLAB_GLSL

#extension GL_EXT_control_flow_attributes : require

// A plane at p is crossed at t = (p - origin) / direction = p * inverse - origin * inverse, one fused
// multiply-add a plane. Rounding of that, of the inverse and of the product is worth at most 8 units in
// the last place of the largest coordinate involved, so every box is taken to be wider by that much on
// each side: the origin is moved up for lower planes and down for upper ones. A box that contains a
// triangle is then never missed by a ray that the watertight test counts as hitting it, but for one that
// passes a sliver's edges far beyond their end, where all three edge functions are lost to rounding: a hit
// that is false, and that no neighbour relies on. Hits of the other tests may be lost where they are false,
// too (reports/2026-11-22-triangle-tests).
struct Slab {
    vec3 inverse;  // 1 / direction, components near zero replaced by a small number of the same sign
    vec3 lower;    // -(origin + pad) * inverse
    vec3 upper;    // -(origin - pad) * inverse
};

// How much wider boxes are taken to be, in units of the largest coordinate: 8 units in the last place.
const float EXACT_PAD = 4.76837158203125e-7;  // 2^-21

// `extent` is the largest absolute coordinate of the scene, `pad` is at least EXACT_PAD.
Slab slab_of(vec3 origin, vec3 direction, float extent, float pad) {
    const float tiny = 1e-18;
    vec3 sign_ = vec3(
        direction.x < 0.0 ? -1.0 : 1.0, direction.y < 0.0 ? -1.0 : 1.0, direction.z < 0.0 ? -1.0 : 1.0);
    vec3 inverse = sign_ / max(abs(direction), vec3(tiny));
    vec3 wider = max(abs(origin), vec3(extent)) * pad;
    return Slab(inverse, -(origin + wider) * inverse, -(origin - wider) * inverse);
}

// Entry distance of the ray into the box, or infinity when it misses the box between t_min and t_max.
// A box at infinity is always missed, because t_max is finite.
float enter(Slab slab, vec3 lo, vec3 hi, float t_min, float t_max) {
    vec3 a = fma(lo, slab.inverse, slab.lower);
    vec3 b = fma(hi, slab.inverse, slab.upper);
    vec3 near = min(a, b);
    vec3 far = max(a, b);
    float enters = max(max(near.x, near.y), max(near.z, t_min));
    float leaves = min(min(far.x, far.y), min(far.z, t_max));
    return enters <= leaves ? enters : INFINITY;
}

// The same for who selects the plane of each axis where the ray enters, which is the upper one where its direction falls.
struct OrderedSlab {
    vec3 inverse;
    vec3 near;  // added to planes where a ray enters
    vec3 far;   // and where it leaves
};

OrderedSlab ordered_slab_of(Slab slab) {
    bvec3 falls = lessThan(slab.inverse, vec3(0.0));
    return OrderedSlab(slab.inverse, mix(slab.lower, slab.upper, falls), mix(slab.upper, slab.lower, falls));
}

// The last entry of three, and the first of three exits and t_max, as the bits of distances. Whether the first is no more than
// the second is whether a ray meets a box between its origin and t_max.
//
// Some devices find the largest of three integers at once. Bits of floats are in the order of the floats unless both are below
// zero: then they are in the opposite order. So where a ray starts in the box, it enters somewhere below zero, no matter where;
// and where the box is behind it, it enters and leaves below zero, and the last entry is at least as far behind as the first
// exit, which is no less as an integer.
int last_entry(vec3 near) {
    ivec3 n = floatBitsToInt(near);
    return max(max(n.x, n.y), n.z);
}
int first_exit(vec3 far, float t_max) {
    ivec3 f = floatBitsToInt(far);
    return min(min(min(f.x, f.y), f.z), floatBitsToInt(t_max));
}

// Whether it meets a box, which it enters and leaves through these planes, between its origin and t_max, and the bits of the
// distance at which it enters. A box before t_min counts as met: few are, and nothing in them is hit. So does one at infinity,
// where the direction falls on all axes.
bool meets_planes(OrderedSlab slab, vec3 entry, vec3 exit, float t_max, out int enters) {
    enters = last_entry(fma(entry, slab.inverse, slab.near));
    return enters <= first_exit(fma(exit, slab.inverse, slab.far), t_max);
}

// Octants have a bit an axis, set where directions fall. MIXED stands for any.
const uint MIXED = 8;

// The same for a box whose planes are in order. Where the octant that the ray points into is known when the kernel is compiled,
// nothing has to be selected.
bool meets_in_octant(OrderedSlab slab, uint octant, vec3 lo, vec3 hi, float t_max, out int enters) {
    bvec3 falls = octant == MIXED ? lessThan(slab.inverse, vec3(0.0)) : bvec3(octant & 1, octant & 2, octant & 4);
    return meets_planes(slab, mix(lo, hi, falls), mix(hi, lo, falls), t_max, enters);
}

// The same, but between t_min, which is at least 0, and t_max, by the signs of the ray's direction alone: it enters through
//     lo * rising + hi * falling + near
// of which one product is zero, so that nothing but what `enter` computes comes out. Two fused multiply-adds a plane
// are cheaper than one and a selection, or the least and the greatest of two, where these have half the rate.
struct SignedSlab {
    vec3 rising;   // 1 / direction, where it is positive, else 0
    vec3 falling;  // where it is negative
    vec3 near;     // added to planes where a ray enters
    vec3 far;      // and where it leaves
};

SignedSlab signed_slab_of(Slab slab) {
    OrderedSlab ordered = ordered_slab_of(slab);
    return SignedSlab(max(slab.inverse, vec3(0.0)), min(slab.inverse, vec3(0.0)), ordered.near, ordered.far);
}

bool meets(SignedSlab slab, vec3 lo, vec3 hi, float t_min, float t_max, out int enters) {
    enters = max(last_entry(fma(lo, slab.rising, fma(hi, slab.falling, slab.near))), floatBitsToInt(t_min));
    return enters <= first_exit(fma(hi, slab.rising, fma(lo, slab.falling, slab.far)), t_max);
}

#endif
