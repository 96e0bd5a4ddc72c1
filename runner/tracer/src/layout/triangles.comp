#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "bvh2.glsl"
#include "levels.glsl"
#include "input.glsl"

// Copies each triangle to where its leaf expects it, 48 bytes: see LeafTriangle in layout/mod.rs.

layout(local_size_x_id = 0) in;

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Positions {
    uint v[];
};

layout(buffer_reference, scalar, buffer_reference_align = 16) writeonly buffer LeafTriangles {
    uvec4 v[];
};

layout(push_constant, scalar) uniform Push {
    Bvh2Nodes nodes;
    Levels levels;
    Positions positions;
    Triangles triangles;
    LeafTriangles leaf_triangles;
    uint count;
};

void main() {
    uint i = gl_GlobalInvocationID.x;
    // Without a complete tree there are no positions.
    bool complete = levels.count > 0 || count == 1;
    if (i >= count || !complete) {
        return;
    }
    uint primitive = nodes.v[i].lo_left.w;
    Triangle t = triangles.v[primitive];
    uint at = 3 * positions.v[i];
    leaf_triangles.v[at + 0] = uvec4(floatBitsToUint(t.a), primitive);
    leaf_triangles.v[at + 1] = uvec4(floatBitsToUint(t.b), 0);
    leaf_triangles.v[at + 2] = uvec4(floatBitsToUint(t.c), 0);
}
