#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "levels.glsl"
#include "wide.glsl"

// Visits that a traversal counted by its nodes, by the nodes of the binary tree that those were made of.

layout(local_size_x_id = 0) in;

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Words {
    uint v[];
};

layout(push_constant, scalar) uniform Push {
    Levels levels;
    Words tasks;
    Progress progress;
    Words by_node;
    Words by_inner;
};

void main() {
    uint leaves = levels.leaves;
    uint nodes = leaves == 1 ? 0 : progress.nodes;
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint i = gl_GlobalInvocationID.x; i < nodes; i += stride) {
        by_inner.v[tasks.v[i] - leaves] = by_node.v[i];
    }
}
