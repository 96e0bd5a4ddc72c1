// Triangles as the scene delivers them: nine floats, 36 bytes, in file order.

#ifndef INPUT_GLSL
#define INPUT_GLSL

#include "box.glsl"

struct Triangle {
    vec3 a;
    vec3 b;
    vec3 c;
};

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Triangles {
    Triangle v[];
};

Box triangle_box(Triangle t) {
    return Box(min(min(t.a, t.b), t.c), max(max(t.a, t.b), t.c));
}

// Halves first: the sum of two corners near the end of a float's range would not fit.
vec3 box_center(Box box) {
    precise vec3 center = 0.5 * box.lo + 0.5 * box.hi;
    return center;
}

#endif
