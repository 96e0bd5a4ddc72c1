#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_GOOGLE_include_directive : require
#include "wide.glsl"
#include "arranged.glsl"
#include "workgroup.glsl"

// Gives the children of each wide node their items: the sum of what those of the nodes before take. One workgroup goes
// over `most` nodes from `first` on; launches follow each other, so that none takes more turns of a loop than drivers
// allow.

layout(local_size_x_id = 0) in;

layout(push_constant, scalar) uniform Push {
    WideNodes wide;
    Progress progress;
    Arrangement arranged;
    uint first;
    uint most;
};

const uint ARITY = 2;
// Nodes that an invocation takes at a time.
const uint OWN = 8;

// A node takes one item, a leaf two, and so does a child that is not there.
uint taken(uint node) {
    uint counts = wide.v[(WIDE_HEADER + ARITY) * node + 2];
    return 2 * ARITY - (counts >> 4) + (counts & 15);
}

void main() {
    uint count = wide_complete(progress) ? min(progress.nodes, first + most) : 0;
    // The root is item 0.
    uint next = 1;
    if (first > 0 && first < count) {
        next = arranged.v[first - 1].place + taken(first - 1);
    }
    for (uint begin = first; begin < count; begin += OWN * gl_WorkGroupSize.x) {
        uint own = begin + OWN * gl_LocalInvocationIndex;
        uint sum = 0;
        [[unroll]] for (uint k = 0; k < OWN; k++) {
            sum += own + k < count ? taken(own + k) : 0;
        }
        uint all;
        uint place = next + workgroup_exclusive_add(sum, all);
        [[unroll]] for (uint k = 0; k < OWN; k++) {
            if (own + k < count) {
                arranged.v[own + k].place = place;
                place += taken(own + k);
            }
        }
        next += all;
    }
}
