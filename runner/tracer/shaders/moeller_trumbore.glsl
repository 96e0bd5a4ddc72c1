// Ray-triangle test of Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", JGT 1997.
//
// Cramer's rule for origin + t * direction = (1 - u - v) * v0 + u * v1 + v * v2.
//
// Where we leave the paper: no determinant is too small, because how small that is depends on the scene's scale.
// One of zero makes `u` infinite or NaN, which is a miss. The two triangles at an edge find out by different
// operations on which side a ray passes it, so a ray may slip between them or hit both.
#ifndef MOELLER_TRUMBORE_GLSL
#define MOELLER_TRUMBORE_GLSL

#include "ray.glsl"

// The distance along the ray, or infinity when it misses the triangle. It may lie outside the ray's limits.
float moeller_trumbore(vec3 origin, vec3 direction, vec3 v0, vec3 v1, vec3 v2) {
    vec3 e1 = v1 - v0, e2 = v2 - v0;
    vec3 p = cross(direction, e2);
    float inverse = 1.0 / dot(e1, p);
    vec3 s = origin - v0;
    float u = dot(s, p) * inverse;
    if (!(u >= 0.0 && u <= 1.0)) {
        return INFINITY;
    }
    vec3 q = cross(s, e1);
    float v = dot(direction, q) * inverse;
    return v >= 0.0 && u + v <= 1.0 ? dot(e2, q) * inverse : INFINITY;
}

#endif
