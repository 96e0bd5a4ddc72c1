#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "ploc.glsl"
#include "input.glsl"

// One leaf a triangle, in Morton order; and the first step's state. State and levels were zeroed before.

layout(push_constant, scalar) uniform Push {
    Triangles triangles;
    Indices order;
    Bvh2Nodes nodes;
    State state;
    Levels levels;
    uint count;
};

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i == 0) {
        state.steps[0] = Step(count, 0);
        state.arguments[0] = DispatchArguments(count > gl_WorkGroupSize.x ? blocks_of(count) : 0, 1, 1);
        levels.leaves = count;
        levels.first[0] = count;
    }
    if (i < count) {
        uint primitive = order.v[i];
        nodes.v[i] = bvh2_node(triangle_box(triangles.v[primitive]), primitive, BVH2_LEAF);
    }
}
