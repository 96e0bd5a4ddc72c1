#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "levels.glsl"
#include "wide.glsl"

// What a contraction starts from: the root, which is to be made of the binary tree's.

layout(local_size_x_id = 0) in;

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Words {
    uint v[];
};

layout(push_constant, scalar) uniform Push {
    Levels levels;
    WideNodes wide;
    Words tasks;
    Words ways;
    Progress progress;
    // Levels of the binary tree that the collapse has had a dispatch each for.
    uint large_levels;
};

void main() {
    if (gl_GlobalInvocationID.x != 0) {
        return;
    }
    uint leaves = levels.leaves;
    bool alone = leaves == 1;
    // While the binary tree or its collapse is incomplete there is nothing to do.
    bool ready = levels.count > 0 && levels.tail <= large_levels && !alone;
    progress.nodes = ready || alone ? 1 : 0;
    progress.finished = alone ? 1 : 0;
    progress.triangles = alone ? 1 : 0;
    progress.claimed = 0;
    progress.depth = alone ? 1 : 0;
    progress.stack = 1;
    progress.groups_done = 0;
    progress.begin = 0;
    progress.end = ready ? 1 : 0;
    progress.x = ready ? 1 : 0;
    progress.y = 1;
    progress.z = 1;
    tasks.v[0] = ready ? 2 * leaves - 2 : 0xffffffffu;
    ways.v[0] = 0;
    if (alone) {
        // A lone triangle still needs a node that holds its box.
        uint words[5] = uint[5](0, 0, 1 << 4 | 1, 1, 0);
        for (uint i = 0; i < 5; i++) {
            wide.v[i] = words[i];
        }
    }
}
