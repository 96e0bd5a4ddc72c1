#version 460
#extension GL_GOOGLE_include_directive : require
#include "upwards/heights.glsl"

// Writes the nodes in the order of their heights, those of one height in any order.

shared uint begin[MAX_LEVELS];

void main() {
    clear_histogram();
    uint leaves = tree.leaves;
    uint i = gl_GlobalInvocationID.x;
    bool inner = i < leaves - 1;
    uint height = inner ? height_of(i) : 0;
    uint rank = inner ? atomicAdd(histogram[height], 1) : 0;
    barrier();
    for (uint k = gl_LocalInvocationIndex; k < MAX_LEVELS; k += gl_WorkGroupSize.x) {
        begin[k] = histogram[k] > 0 ? atomicAdd(cursors.v[k], histogram[k]) : 0;
    }
    barrier();
    if (inner) {
        order.v[begin[height] + rank] = leaves + i;
    }
}
