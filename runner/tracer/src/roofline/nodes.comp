#version 460
// Reads nodes of a table at random, as rays that have parted do, and nothing else.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_shuffle : require
#include "roofline/table.glsl"

layout(local_size_x_id = 0) in;
// Pieces of 16 bytes a node.
layout(constant_id = 1) const uint PIECES = 5;
// 0: each lane reads its node alone. 1: the lanes of a subgroup read the nodes of all of them together, one piece each
// at a time, so that pieces of one node are read by neighbours.
layout(constant_id = 2) const uint TOGETHER = 0;

layout(push_constant, scalar) uniform Arguments {
    Pieces pieces;
    Sums sums;
    uint nodes;
    uint turns;
};

// PCG (O'Neill 2014), so that lanes do not walk in step.
uint shuffled(uint state) {
    uint word = ((state >> ((state >> 28) + 4)) ^ state) * 277803737u;
    return (word >> 22) ^ word;
}

void main() {
    uint state = gl_GlobalInvocationID.x * 0x9E3779B1u;
    uint sum = 0;
    for (uint turn = 0; turn < turns; ++turn) {
        state = state * 747796405u + 2891336453u;
        uint node, unused;
        umulExtended(shuffled(state), nodes, node, unused);
        [[unroll]] for (uint k = 0; k < PIECES; ++k) {
            if (TOGETHER == 0) {
                sum += folded(pieces.items[node * PIECES + k]);
            } else {
                uint at = k * gl_SubgroupSize + gl_SubgroupInvocationID;
                uint its = subgroupShuffle(node, at / PIECES);
                sum += folded(pieces.items[its * PIECES + at % PIECES]);
            }
        }
    }
    sums.items[gl_GlobalInvocationID.x] = sum;
}
