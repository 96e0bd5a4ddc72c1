#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "sort.glsl"

// How many keys of each digit a tile holds.

shared uint histogram[DIGITS];

void main() {
    for (uint d = gl_LocalInvocationIndex; d < DIGITS; d += gl_WorkGroupSize.x) {
        histogram[d] = 0;
    }
    barrier();
    uint begin = gl_WorkGroupID.x * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
    for (uint j = 0; j < ITEMS; ++j) {
        uint i = begin + j * gl_WorkGroupSize.x;
        if (i < count) {
            atomicAdd(histogram[(keys_in.v[i * WORDS + word] >> shift) & (DIGITS - 1)], 1);
        }
    }
    barrier();
    for (uint d = gl_LocalInvocationIndex; d < DIGITS; d += gl_WorkGroupSize.x) {
        counts.v[d * tiles + gl_WorkGroupID.x] = histogram[d];
    }
}
