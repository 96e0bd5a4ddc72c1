#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout/leaf_triangle.glsl"

// Stores the scene's triangles in the order of its file, an invocation each.

layout(local_size_x_id = 0) in;

layout(push_constant, scalar) uniform Push {
    Triangles triangles;
    LeafTriangles stored;
    Indices indices;
    uint count;
};

void main() {
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint i = gl_GlobalInvocationID.x; i < count; i += stride) {
        write_triangle(stored, indices, i, triangles.v[i], i);
    }
}
