// The affine map that takes a triangle to the unit triangle: UnitTriangle in layout/triangles.rs explains it.
#ifndef UNIT_TRIANGLE_GLSL
#define UNIT_TRIANGLE_GLSL

#include "twofold.glsl"
#include "woop.glsl"

float squared_length(vec3 v) {
    // Which edge is the longest is to be the same here and in the twin.
    precise float sum = v.x * v.x + v.y * v.y + v.z * v.z;
    return sum;
}

vec2[3] twofold_cross(vec2 a[3], vec2 b[3]) {
    return vec2[3](twofold_determinant(a[1], a[2], b[1], b[2]), twofold_determinant(a[2], a[0], b[2], b[0]),
                   twofold_determinant(a[0], a[1], b[0], b[1]));
}

vec2 twofold_dot(vec2 a[3], vec2 b[3]) {
    return twofold_add(twofold_add(twofold_multiply(a[0], b[0]), twofold_multiply(a[1], b[1])),
                       twofold_multiply(a[2], b[2]));
}

// A row whose value at `corner` is zero.
vec4 row_from(vec3 row, vec3 corner) {
    vec2 offset = twofold_dot(vec2[3](vec2(row.x, 0.0), vec2(row.y, 0.0), vec2(row.z, 0.0)),
                              vec2[3](vec2(corner.x, 0.0), vec2(corner.y, 0.0), vec2(corner.z, 0.0)));
    return vec4(row, -offset.x);
}

UnitTriangle unit_triangle(vec3 a, vec3 b, vec3 c) {
    // One over the power of two just below the largest extent.
    vec3 extents = max(abs(b - a), max(abs(c - b), abs(a - c)));
    float largest = max(extents.x, max(extents.y, extents.z));
    float scale = largest < 1.7014118e38 ? uintBitsToFloat((254u << 23) - (floatBitsToUint(largest) & 0x7F800000u)) : 0.0;

    float ab = squared_length((b - a) * scale);
    float bc = squared_length((c - b) * scale);
    float ca = squared_length((a - c) * scale);
    vec3 v0 = a, v1 = b, v2 = c;
    if (ca > ab && ca >= bc) {
        v0 = b, v1 = c, v2 = a;
    } else if (ab >= bc && ab >= ca) {
        v0 = c, v1 = a, v2 = b;
    }
    vec2 e1[3], e2[3];
    for (uint k = 0; k < 3; k++) {
        e1[k] = two_sum(v1[k], -v0[k]) * scale;
        e2[k] = two_sum(v2[k], -v0[k]) * scale;
    }
    vec2 normal[3] = twofold_cross(e1, e2);
    float squared = twofold_dot(normal, normal).x;
    float lengths = twofold_dot(e1, e1).x * twofold_dot(e2, e2).x;
    if (!(squared > lengths * 5.6843419e-14)) {  // 2^-44
        vec4 nowhere = vec4(0.0, 0.0, 0.0, 1.0);
        return UnitTriangle(nowhere, nowhere, nowhere);
    }
    vec2 u[3] = twofold_cross(e2, normal);
    vec2 v[3] = twofold_cross(normal, e1);
    return UnitTriangle(row_from(vec3(normal[0].x, normal[1].x, normal[2].x), v0),
                        row_from(vec3(u[0].x, u[1].x, u[2].x) / squared * scale, v0),
                        row_from(vec3(v[0].x, v[1].x, v[2].x) / squared * scale, v0));
}

#endif
