// Watertight ray-triangle test: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", JCGT 2013.
//
// The ray is made the z axis: vertices are moved to its origin, axes are permuted so that z is the
// direction's largest, and x and y are sheared. Each vertex is projected by the same operations in every
// triangle that shares it, so the mesh stays closed in the projection, and an edge's sign is the same for
// both of its sides.
//
// Where we leave the paper: an edge function that rounds to zero counts as inside, without a second look
// in double precision. A product of two floats rounds monotonically, so the sign of a difference of two
// products is never wrong, it only can be lost to zero; counting zero as inside on both sides of an edge
// keeps the edge closed. Triangles are not culled by facing, so the winding swap is left out.
#ifndef TRIANGLE_GLSL
#define TRIANGLE_GLSL

#include "ray.glsl"

// 48 bytes, three loads of 16: corners, and the triangle's index in file order.
struct Triangle {
    vec4 v0_index;
    vec4 v1;
    vec4 v2;
};

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Triangles {
    Triangle items[];
};

// What the test needs of a ray, computed once.
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

// Twice the signed areas that the ray's point makes with the edges, and the corners' depths: what both
// the distance and the barycentric coordinates are made of.
struct Projection {
    vec3 edges;
    vec3 depths;
};

Projection project(vec3 origin, Shear shear, vec3 v0, vec3 v1, vec3 v2) {
    vec3 a = permute(v0 - origin, shear.axis);
    vec3 b = permute(v1 - origin, shear.axis);
    vec3 c = permute(v2 - origin, shear.axis);
    // `precise` forbids contraction to fused multiply-adds, which would round the two sides of an edge
    // differently.
    precise vec2 pa = a.xy - shear.shear.xy * a.z;
    precise vec2 pb = b.xy - shear.shear.xy * b.z;
    precise vec2 pc = c.xy - shear.shear.xy * c.z;
    precise vec3 edges =
        vec3(pc.x * pb.y - pc.y * pb.x, pa.x * pc.y - pa.y * pc.x, pb.x * pa.y - pb.y * pa.x);
    return Projection(edges, vec3(a.z, b.z, c.z));
}

// The distance along the ray, or infinity when the triangle is missed or not nearer than `t_max`.
float intersect(vec3 origin, Shear shear, float t_min, float t_max, vec3 v0, vec3 v1, vec3 v2) {
    Projection p = project(origin, shear, v0, v1, v2);
    vec3 e = p.edges;
    if (min(e.x, min(e.y, e.z)) < 0.0 && max(e.x, max(e.y, e.z)) > 0.0) {
        return INFINITY;
    }
    float t = dot(e, p.depths) * shear.shear.z / (e.x + e.y + e.z);
    // A determinant of zero makes t infinite or NaN, which fails here.
    return t > t_min && t < t_max ? t : INFINITY;
}

#endif
