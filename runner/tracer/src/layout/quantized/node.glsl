// Tests a ray against the children of a node: see layout/quantized/mod.rs.
#include "load.glsl"

const uint ALIGN = (STRIDE & 15) == 0 ? 16 : ((STRIDE & 7) == 0 ? 8 : 4);

// How much wider boxes are taken to be. Two more roundings than exact boxes need: that of a node's
// origin along the ray, and that of what is added to it.
const float PAD = EXACT_PAD * 1.5;
#include "ray_slab.glsl"

// Iterations of the loops in `meet`, each with its last, empty one.
const uint MEET_STEPS = 2 * ARITY + 2;

// The children, each with the distance at which the ray enters its box, or infinity where it misses; how
// many it hits is returned, how many there are is `tested`.
//
// Planes are not decoded in space: along an axis of the ray they are crossed at distances
//     (origin + line * step) * inverse + bias = line * (step * inverse) + (origin * inverse + bias),
// one fused multiply-add a plane as with exact boxes, where `bias` widens the box by the pad.
uint meet(uint64_t nodes, uint index, Slab slab, float t_min, float t_max, out float t[ARITY],
          out uint child[ARITY], out uint tested) {
    uint64_t at = nodes + uint64_t(index) * STRIDE;
    uvec4 head = load4(at, ALIGN);
    uvec4 links = load4(at + 16, ALIGN);
    // In x and y of each child, then in z of each two.
    uint lines[ARITY + ARITY / 2];
    lines[0] = links.w;
    [[unroll]] for (uint quad = 0; quad < (ARITY + ARITY / 2 - 1) / 4; quad++) {
        uvec4 w = load4(at + 32 + 16 * quad, ALIGN);
        [[unroll]] for (uint k = 0; k < 4; k++) {
            lines[1 + 4 * quad + k] = w[k];
        }
    }
    // What is left of 5, 8 or 11 words.
#if ARITY == 4
    lines[5] = Words1(at + 48).v[0];
#elif ARITY == 8
    uvec2 left = load2(at + 64, ALIGN);
    lines[9] = left.x;
    lines[10] = left.y;
    lines[11] = Words1(at + 72).v[0];
#endif
    vec3 origin = uintBitsToFloat(head.xyz);
    uvec3 exponents = uvec3(head.w & 255, head.w >> 8 & 255, head.w >> 16 & 255);
    vec3 step_ = uintBitsToFloat(exponents << 23) * slab.inverse;
    vec3 lower = fma(origin, slab.inverse, slab.lower);
    vec3 upper = fma(origin, slab.inverse, slab.upper);
    uint leaves = head.w >> 24 & 15;
    uint count = head.w >> 28;
    uint next_triangle = links.y;
    uint sizes = links.z;
    uint hits = 0;
    [[unroll]] for (uint i = 0; i < ARITY; i++) {
        uint xy = lines[i];
        uint z = lines[ARITY + i / 2] >> (16 * (i & 1));
        vec3 lo = vec3(xy & 255, xy >> 16 & 255, z & 255);
        vec3 hi = vec3(xy >> 8 & 255, xy >> 24, z >> 8 & 255);
        vec3 a = fma(lo, step_, lower);
        vec3 b = fma(hi, step_, upper);
        vec3 near = min(a, b);
        vec3 far = max(a, b);
        float enters = max(max(near.x, near.y), max(near.z, t_min));
        float leaves_at = min(min(far.x, far.y), min(far.z, t_max));
        bool hit = i < count && enters <= leaves_at;
        t[i] = hit ? enters : INFINITY;
        hits += hit ? 1 : 0;
        uint size = sizes >> (4 * i) & 15;
        child[i] = i < leaves ? LEAF_BIT | size << 27 | next_triangle : links.x + (i - leaves);
        next_triangle += size + 1;
    }
    tested = count;
    return hits;
}
