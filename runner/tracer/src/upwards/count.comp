#version 460
#extension GL_GOOGLE_include_directive : require
#include "upwards/heights.glsl"

// How many inner nodes there are of each height.

void main() {
    clear_histogram();
    uint inner = tree.leaves - 1;
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint i = gl_GlobalInvocationID.x; i < inner; i += stride) {
        atomicAdd(histogram[height_of(i)], 1);
    }
    barrier();
    for (uint k = gl_LocalInvocationIndex; k < MAX_LEVELS; k += gl_WorkGroupSize.x) {
        if (histogram[k] > 0) {
            atomicAdd(cursors.v[k], histogram[k]);
        }
    }
}
