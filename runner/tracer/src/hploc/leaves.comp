#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "bvh2.glsl"
#include "input.glsl"
#include "levels.glsl"

// One leaf a triangle, in Morton order; and what the climb starts from: nobody has been anywhere.

layout(local_size_x_id = 0) in;

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Indices {
    uint v[];
};

layout(push_constant, scalar) uniform Push {
    Triangles triangles;
    Indices order;
    Bvh2Nodes nodes;
    Indices visits;
    Levels levels;
    uint count;
};

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i == 0) {
        levels.count = UNORDERED;
        levels.tail = 0;
        levels.leaves = count;
        levels.iterations = 0;
        levels.first[0] = count;
    }
    if (i < count) {
        uint primitive = order.v[i];
        nodes.v[i] = bvh2_node(triangle_box(triangles.v[primitive]), primitive, BVH2_LEAF);
        visits.v[i] = 0xffffffffu;
    }
}
