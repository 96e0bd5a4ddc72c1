// What the kernels of contract/depth_first/ share.
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#include "wide.glsl"

layout(local_size_x_id = 0) in;

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Words {
    uint v[];
};

struct Subtree {
    uint parent;  // of its root, or NONE
    uint nodes;   // in it, its root included
};

layout(buffer_reference, scalar, buffer_reference_align = 4) coherent buffer WideSubtrees {
    Subtree v[];
};

layout(push_constant, scalar) uniform Push {
    WideNodes wide;
    Words tasks;
    Progress progress;
    WideSubtrees subtrees;
    WideNodes placed;
    Words placed_tasks;
    uint arity;
};

const uint NONE = 0xffffffffu;

uint first_node_of(uint node) {
    return wide.v[(WIDE_HEADER + arity) * node];
}

// How many of a node's children are nodes.
uint nodes_of(uint node) {
    uint counts = wide.v[(WIDE_HEADER + arity) * node + 2];
    return (counts >> 4) - (counts & 15);
}
