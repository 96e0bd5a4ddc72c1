#version 460
#extension GL_GOOGLE_include_directive : require
#include "contract/depth_first/depth_first.glsl"

// Counts the nodes of each subtree: see contract/depth_first/mod.rs. Each node counts itself in all subtrees that it is
// in.

void main() {
    uint count = wide_complete(progress) ? progress.nodes : 0;
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint i = gl_GlobalInvocationID.x; i < count; i += stride) {
        for (uint above = subtrees.v[i].parent; above != NONE; above = subtrees.v[above].parent) {
            atomicAdd(subtrees.v[above].nodes, 1);
        }
    }
}
