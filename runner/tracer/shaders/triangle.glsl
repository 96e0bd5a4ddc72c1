// Watertight ray-triangle test: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", JCGT 2013.
//
// The ray is made the z axis: vertices are moved to its origin, axes are permuted so that z is the
// direction's largest, and x and y are sheared. Each vertex is projected by the same operations in every
// triangle that shares it, so the mesh stays closed in the projection, and an edge's sign is the same for
// both of its sides.
//
// Where we leave the paper: an edge function that rounds to zero counts as inside, without a second look
// in double precision. A product of two floats rounds monotonically, so the sign of a difference of two
// products is never wrong, it only can be lost to zero (unless products leave the range of floats: scenes
// should measure between 1e-12 and 1e12 units); counting zero as inside on both sides of an edge
// keeps the edge closed. Triangles are not culled by facing, so the winding swap is left out.
#ifndef TRIANGLE_GLSL
#define TRIANGLE_GLSL

#extension GL_EXT_control_flow_attributes : require

#include "ray.glsl"
#include "twofold.glsl"

// 48 bytes, three loads of 16: corners, and the triangle's index in file order.
struct Triangle {
    vec4 v0_index;
    vec4 v1;
    vec4 v2;
};

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Triangles {
    Triangle items[];
};

// Rays or triangles, one number at a time.
layout(buffer_reference, scalar, buffer_reference_align = 4) BETWEEN_STAGES readonly buffer Floats {
    float items[];
};

// What the test needs of a ray, computed once. Other tests have the ray's direction in its place: see `aim` in
// traverse/closest_hit.glsl.
struct Shear {
    vec3 shear;  // direction.x / direction.z, direction.y / direction.z, 1 / direction.z, after permuting
    uint axis;   // the direction's largest component
};

vec3 permute(vec3 v, uint axis) {
    return axis == 0u ? v.yzx : (axis == 1u ? v.zxy : v);
}

Shear shear_of(vec3 direction) {
    vec3 a = abs(direction);
    uint axis = a.x > a.y ? (a.x > a.z ? 0u : 2u) : (a.y > a.z ? 1u : 2u);
    vec3 d = permute(direction, axis);
    return Shear(vec3(d.x / d.z, d.y / d.z, 1.0 / d.z), axis);
}

// What the distance, the barycentric coordinates and their errors are made of: twice the signed areas that
// the ray's point makes with the edges, the corners' depths, and where the corners lie across the ray.
struct Projection {
    vec3 edges;
    vec3 depths;
    vec2 corners[3];
};

Projection project(vec3 origin, Shear shear, vec3 v0, vec3 v1, vec3 v2) {
    vec3 a = permute(v0 - origin, shear.axis);
    vec3 b = permute(v1 - origin, shear.axis);
    vec3 c = permute(v2 - origin, shear.axis);
    // `precise` forbids contraction to fused multiply-adds, which would round the two sides of an edge
    // differently, and on some devices move a vertex from one triangle to the next.
    precise vec2 pa = a.xy - shear.shear.xy * a.z;
    precise vec2 pb = b.xy - shear.shear.xy * b.z;
    precise vec2 pc = c.xy - shear.shear.xy * c.z;
    precise vec3 edges =
        vec3(pc.x * pb.y - pc.y * pb.x, pa.x * pc.y - pa.y * pc.x, pb.x * pa.y - pb.y * pa.x);
    return Projection(edges, vec3(a.z, b.z, c.z), vec2[3](pa, pb, pc));
}

// The distance along the ray, or infinity when the triangle is missed or not nearer than `t_max`.
//
// The distance is a mean of the corners' depths. Over a sliver its weights lose as many digits as the
// sliver is longer than wide, so a ray that starts beside one could meet it by rounding alone, or pass
// through it. `uncertain` says that the error could decide between this side of `t_min` and the other; the
// distance returned is then to be replaced by `exact_distance`. The bound follows the error analysis of
// Pharr, Jakob, Humphreys, Physically Based Rendering, 3rd edition, 3.9.6, with a third of the worst case's
// constants: errors of either sign largely cancel, and four times as large a bound had every ray settle the
// surface it starts on.
//
// With `hoist`, which is constant, the distance is computed before the first condition, and not after (thesis 5.2).
float intersect(vec3 origin, Shear shear, float t_min, float t_max, vec3 v0, vec3 v1, vec3 v2, bool hoist,
                out bool uncertain) {
    uncertain = false;
    Projection p = project(origin, shear, v0, v1, v2);
    vec3 e = p.edges;
    float inverse, t;
    if (hoist) {
        inverse = shear.shear.z / (e.x + e.y + e.z);
        t = dot(e, p.depths) * inverse;
    }
    if (min(e.x, min(e.y, e.z)) < 0.0 && max(e.x, max(e.y, e.z)) > 0.0) {
        return INFINITY;
    }
    if (!hoist) {
        inverse = shear.shear.z / (e.x + e.y + e.z);
        t = dot(e, p.depths) * inverse;
    }
    // A determinant of zero makes t infinite or NaN, which fails here.
    if (!(t < t_max)) {
        return INFINITY;
    }
    float depth = max(abs(p.depths.x), max(abs(p.depths.y), abs(p.depths.z)));
    vec2 corner = max(abs(p.corners[0]), max(abs(p.corners[1]), abs(p.corners[2])));
    float across = max(corner.x, corner.y);
    float error = depth * (12.0 * across * (across + depth) * abs(inverse) + 4.0 * abs(shear.shear.z));
    uncertain = abs(t - t_min) < error * 1.1920929e-7;  // 2^-23: twice the unit roundoff
    return uncertain || t > t_min ? t : INFINITY;
}

// The distance to a triangle's plane, to about twice single precision, for the triangle and the ray at an
// index. Everything is read again and the loop is kept rolled, because registers that only this rare case
// needs would be taken from every ray: unrolled it cost nine, and with them 8% of all rays a second.
float exact_distance(Rays rays, uint ray, Triangles triangles, uint triangle) {
    Floats r = Floats(rays);
    Floats v = Floats(triangles);
    uint origin = 8 * ray, direction = origin + 4, v0 = 12 * triangle, v1 = v0 + 4, v2 = v0 + 8;
    vec2 above = vec2(0.0), along = vec2(0.0);
    float largest = 0.0;
    [[dont_unroll]] for (uint k = 0; k < 3; k++) {
        uint i = k == 2 ? 0 : k + 1, j = k == 0 ? 2 : k - 1;
        vec2 e1i = two_sum(v.items[v1 + i], -v.items[v0 + i]), e1j = two_sum(v.items[v1 + j], -v.items[v0 + j]);
        vec2 e2i = two_sum(v.items[v2 + i], -v.items[v0 + i]), e2j = two_sum(v.items[v2 + j], -v.items[v0 + j]);
        vec2 normal = twofold_determinant(e1i, e1j, e2i, e2j);
        vec2 offset = two_sum(v.items[v0 + k], -r.items[origin + k]);
        largest = max(largest, max(abs(e1i.x * e2j.x), abs(e1j.x * e2i.x)) * abs(offset.x));
        above = twofold_add(above, twofold_multiply(normal, offset));
        along = twofold_add(along, twofold_multiply(normal, vec2(r.items[direction + k], 0.0)));
    }
    // Nearer than this arithmetic can tell, the ray starts on the plane.
    return abs(above.x) <= largest * 9.094947e-13 ? 0.0 : above.x / along.x;  // 2^-40
}

#endif
