#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "sort.glsl"
#include "workgroup.glsl"

// One workgroup a digit: the tiles' counts become sums over the earlier tiles.

void main() {
    uint row = gl_WorkGroupID.x * tiles;
    uint carry = 0;
    for (uint begin = 0; begin < tiles; begin += gl_WorkGroupSize.x) {
        uint t = begin + gl_LocalInvocationIndex;
        uint own = t < tiles ? counts.v[row + t] : 0;
        uint total;
        uint before = workgroup_exclusive_add(own, total);
        if (t < tiles) {
            counts.v[row + t] = carry + before;
        }
        carry += total;
    }
    if (gl_LocalInvocationIndex == 0) {
        totals.v[gl_WorkGroupID.x] = carry;
    }
}
