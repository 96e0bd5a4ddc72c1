#version 460
#extension GL_GOOGLE_include_directive : require
#include "contract/depth_first/depth_first.glsl"

// Tells the children of each wide node whose they are, and begins to count: see contract/depth_first/mod.rs.

void main() {
    uint count = wide_complete(progress) ? progress.nodes : 0;
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint i = gl_GlobalInvocationID.x; i < count; i += stride) {
        subtrees.v[i].nodes = 1;
        uint first = first_node_of(i);
        uint nodes = nodes_of(i);
        for (uint k = 0; k < nodes; k++) {
            subtrees.v[first + k].parent = i;
        }
        if (i == 0) {
            subtrees.v[0].parent = NONE;
        }
    }
}
