#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "bvh2.glsl"
#include "wide.glsl"
#include "layout/leaf_triangle.glsl"

// Stores each triangle where its leaf expects it, 48 bytes, as the test of the traversal wants it: see LeafTriangles in
// layout/triangles.rs. An invocation serves the leaves of one wide node.

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
    for (uint i = gl_GlobalInvocationID.x; i < wide_nodes; i += stride) {
        uint at = (WIDE_HEADER + arity) * i;
        uint place = wide.v[at + 1];
        uint own_leaves = wide.v[at + 2] & 15;
        for (uint slot = 0; slot < own_leaves; slot++) {
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
}
