#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "bvh2.glsl"
#include "wide.glsl"
#include "layout/leaf_triangle.glsl"

// Stores each triangle where its leaf expects it, 48 bytes, as the test of the traversal wants it: see LeafTriangles in
// layout/triangles.rs. An invocation serves one leaf of a wide node.

layout(local_size_x_id = 0) in;

layout(push_constant, scalar) uniform Push {
    Bvh2Nodes nodes;
    WideNodes wide;
    Progress progress;
    Triangles triangles;
    LeafTriangles leaf_triangles;
    Indices indices;
    uint leaves;
    uint arity;
};

void main() {
    uint wide_nodes = wide_complete(progress) ? progress.nodes : 0;
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint task = gl_GlobalInvocationID.x; task / arity < wide_nodes; task += stride) {
        uint at = (WIDE_HEADER + arity) * (task / arity);
        uint slot = task % arity;
        if (slot >= (wide.v[at + 2] & 15)) {
            continue;
        }
        uint place = wide.v[at + 1];
        for (uint before = 0; before < slot; before++) {
            place += (wide.v[at + WIDE_HEADER + before] >> WIDE_COUNT_SHIFT) + 1;
        }
        // Left before right; of 16 triangles at most 15 wait.
        uint waiting[16];
        uint top = 0;
        uint node = wide.v[at + WIDE_HEADER + slot] & WIDE_CHILD_MASK;
        for (;;) {
            if (node >= leaves) {
                waiting[top++] = nodes.v[node].hi_right.w;
                node = nodes.v[node].lo_left.w;
                continue;
            }
            uint primitive = nodes.v[node].lo_left.w;
            write_triangle(leaf_triangles, indices, place++, triangles.v[primitive], primitive);
            if (top == 0) {
                break;
            }
            node = waiting[--top];
        }
    }
}
