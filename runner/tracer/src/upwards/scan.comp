#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "upwards/heights.glsl"
#include "workgroup.glsl"

// One workgroup: where the nodes of each height begin, and what it takes to process them.

// bvh2.rs
const uint TAIL_NODES = 1024;

void main() {
    uint leaves = tree.leaves;
    uint carry = 0;
    clear_histogram();
    for (uint begin = 0; begin < MAX_LEVELS; begin += gl_WorkGroupSize.x) {
        uint k = begin + gl_LocalInvocationIndex;
        uint size = k < MAX_LEVELS ? cursors.v[k] : 0;
        uint total;
        uint before = carry + workgroup_exclusive_add(size, total);
        carry += total;
        if (k < MAX_LEVELS) {
            cursors.v[k] = before;
            levels.first[k] = leaves + before;
            bool dispatched = size > 0 && k < most_large;
            levels.arguments[k] = DispatchArguments(dispatched ? (size + level_group - 1) / level_group : 0, 1, 1);
            if (size > 0) {
                atomicMax(histogram[0], k + 1);
            }
            if (size > TAIL_NODES) {
                atomicMax(histogram[1], k + 1);
            }
        }
    }
    barrier();
    if (gl_LocalInvocationIndex == 0) {
        levels.first[MAX_LEVELS] = leaves + carry;
        levels.leaves = leaves;
        levels.iterations = 0;
        levels.tail = min(histogram[1], most_large);
        levels.count = histogram[0];
    }
}
