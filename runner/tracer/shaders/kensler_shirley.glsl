// Ray-triangle test of Kensler and Shirley, "Optimizing Ray-Triangle Intersection via Automated Search", RT 2006.
//
// Cramer's rule, as Möller and Trumbore have it, in other words: all determinants are made of the triangle's normal, and of
// one cross product with the ray's direction in place of two. Edges are stored, and two numbers of the normal (EdgeTriangle
// in layout/triangles.rs), so that 27 multiplications and additions are left beside the division, of 37 (fused ones
// count once).
//
// Where we leave the paper: the division is the last, so that nothing waits for it. No determinant is too small: one of zero
// makes everything infinite or NaN, which is a miss. The two triangles at an edge find out by different operations on which
// side a ray passes it, so a ray may slip between them or hit both.
#ifndef KENSLER_SHIRLEY_GLSL
#define KENSLER_SHIRLEY_GLSL

#include "ray.glsl"

// The distance along the ray, or infinity when it misses the triangle. It may lie outside the ray's limits. In w, the edges
// have x and y of their cross product.
float kensler_shirley(vec3 origin, vec3 direction, vec3 corner, vec4 e1, vec4 e2) {
    vec3 normal = vec3(e1.w, e2.w, e1.x * e2.y - e1.y * e2.x);
    float inverse = 1.0 / dot(normal, direction);
    vec3 offset = corner - origin;
    vec3 moment = cross(direction, offset);
    float u = -dot(e2.xyz, moment) * inverse;
    float v = dot(e1.xyz, moment) * inverse;
    return u >= 0.0 && v >= 0.0 && u + v <= 1.0 ? dot(normal, offset) * inverse : INFINITY;
}

#endif
