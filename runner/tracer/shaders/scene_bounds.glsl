// The scene's bounds as the reduction leaves them, and what later stages derive from them.

#ifndef SCENE_BOUNDS_GLSL
#define SCENE_BOUNDS_GLSL

// Floats as unsigned integers of the same order, so that integer atomics find their minimum. A maximum
// is the minimum of the complements; one fill with ~0 is then "nothing yet" for both.
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer SceneBounds {
    uint centroid_lo[3];
    uint centroid_hi_inverted[3];
    uint box_lo[3];
    uint box_hi_inverted[3];
};

uint ordered_from_float(float x) {
    uint bits = floatBitsToUint(x);
    return bits ^ ((bits >> 31) != 0 ? 0xffffffffu : 0x80000000u);
}

float float_from_ordered(uint x) {
    return uintBitsToFloat(x ^ ((x >> 31) != 0 ? 0x80000000u : 0xffffffffu));
}

vec3 floats_from_ordered(uint x[3], uint complement) {
    return vec3(float_from_ordered(x[0] ^ complement), float_from_ordered(x[1] ^ complement),
                float_from_ordered(x[2] ^ complement));
}

// The power of two that brings the scene's longest edge into [1, 2).
//
// Being a power of two it changes no mantissa, so it never decides which of two areas is larger.
float scene_scale(SceneBounds bounds) {
    vec3 e = floats_from_ordered(bounds.box_hi_inverted, ~0u) - floats_from_ordered(bounds.box_lo, 0);
    uint exponent = (floatBitsToUint(max(e.x, max(e.y, e.z))) >> 23) & 255;
    return exponent == 0 ? 1.0 : uintBitsToFloat((254 - min(exponent, 253)) << 23);
}

#endif
