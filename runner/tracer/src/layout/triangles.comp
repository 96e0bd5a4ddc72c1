#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "bvh2.glsl"
#include "wide.glsl"
#include "input.glsl"
#include "layout/unit_triangle.glsl"

// Stores each triangle where its leaf expects it, 48 bytes, as the test of the traversal wants it: see LeafTriangles in
// layout/triangles.rs. An invocation serves one leaf of a wide node.

layout(local_size_x_id = 0) in;
// Whether triangles are stored as maps to the unit triangle, with their indices apart.
layout(constant_id = 1) const uint MAPS = 0;

layout(buffer_reference, scalar, buffer_reference_align = 16) writeonly buffer LeafTriangles {
    uvec4 v[];
};

layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer Indices {
    uint items[];
};

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

void write_triangle(uint place, uint leaf) {
    uint primitive = nodes.v[leaf].lo_left.w;
    Triangle t = triangles.v[primitive];
    uint at = 3 * place;
    if (MAPS != 0) {
        UnitTriangle map = unit_triangle(t.a, t.b, t.c);
        leaf_triangles.v[at + 0] = floatBitsToUint(map.z);
        leaf_triangles.v[at + 1] = floatBitsToUint(map.u);
        leaf_triangles.v[at + 2] = floatBitsToUint(map.v);
        indices.items[place] = primitive;
        return;
    }
    leaf_triangles.v[at + 0] = uvec4(floatBitsToUint(t.a), primitive);
    leaf_triangles.v[at + 1] = uvec4(floatBitsToUint(t.b), 0);
    leaf_triangles.v[at + 2] = uvec4(floatBitsToUint(t.c), 0);
}

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
            write_triangle(place++, node);
            if (top == 0) {
                break;
            }
            node = waiting[--top];
        }
    }
}
