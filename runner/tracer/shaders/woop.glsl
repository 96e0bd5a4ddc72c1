// Woop's ray-triangle test: Woop, "A Ray Tracing Hardware Architecture for Dynamic Scenes", 2004.
//
// Each triangle has an affine map, made when it is stored (layout/unit_triangle.glsl), that takes it to the one with
// corners (0,0,0), (1,0,0) and (0,1,0). The ray is mapped, and what is left is to see where it crosses z = 0. As
// Aila and Laine (2009) have it, the row of z comes first: most triangles are too far away, or behind the ray, and
// the rows of u and v are not loaded for them.
//
// The two triangles at an edge have maps of their own, so a ray may slip between them or hit both.
#ifndef WOOP_GLSL
#define WOOP_GLSL

#include "ray.glsl"

// Rows of the map: row.xyz * point + row.w. 48 bytes.
struct UnitTriangle {
    vec4 z;
    vec4 u;
    vec4 v;
};

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer UnitTriangles {
    UnitTriangle items[];
};

// The distance along the ray, or infinity when it misses the triangle or meets it outside its limits. A triangle
// without a map has (0,0,0,1) for z, which makes the distance infinite.
float woop(vec3 origin, vec3 direction, float t_min, float t_max, UnitTriangles triangles, uint index) {
    vec4 z = triangles.items[index].z;
    float t = -(dot(z.xyz, origin) + z.w) / dot(z.xyz, direction);
    if (!(t > t_min && t < t_max)) {
        return INFINITY;
    }
    vec4 row = triangles.items[index].u;
    float u = dot(row.xyz, origin) + row.w + t * dot(row.xyz, direction);
    if (!(u >= 0.0)) {
        return INFINITY;
    }
    row = triangles.items[index].v;
    float v = dot(row.xyz, origin) + row.w + t * dot(row.xyz, direction);
    return v >= 0.0 && u + v <= 1.0 ? t : INFINITY;
}

#endif
