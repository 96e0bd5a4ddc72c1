// Random numbers from a hash, so that a path depends on nothing but its pixel, sample, depth and seed.
#ifndef RANDOM_GLSL
#define RANDOM_GLSL

// pcg4d of Jarzynski and Olano, "Hash Functions for GPU Rendering", JCGT 2020.
uvec4 pcg4d(uvec4 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> 16;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

// Two numbers in [0, 1).
vec2 random2(uint pixel, uint sample_, uint depth, uint seed) {
    return vec2(pcg4d(uvec4(pixel, sample_, depth, seed)).xy >> 8) * (1.0 / 16777216.0);
}

#endif
