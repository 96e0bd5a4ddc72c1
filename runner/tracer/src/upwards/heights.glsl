// What the kernels share that bring the nodes of a tree without levels into the order of their heights: see
// upwards/mod.rs.
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#include "collapse.glsl"
#include "levels.glsl"

layout(local_size_x_id = 0) in;

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Words {
    uint v[];
};

layout(push_constant, scalar) uniform Push {
    Levels tree;
    Subtrees subtrees;
    Levels levels;
    Words order;
    // For each height, how many nodes there are of it; then, where the next one goes.
    Words cursors;
    // Nodes a workgroup takes when a level is processed by a dispatch, and how many levels have one at most.
    uint level_group;
    uint most_large;
};

shared uint histogram[MAX_LEVELS];

void clear_histogram() {
    for (uint k = gl_LocalInvocationIndex; k < MAX_LEVELS; k += gl_WorkGroupSize.x) {
        histogram[k] = 0;
    }
    barrier();
}

// From 0, of nodes whose children are leaves.
uint height_of(uint inner) {
    return min(unpack_subtree(subtrees.v[inner]).levels, MAX_LEVELS) - 1;
}
