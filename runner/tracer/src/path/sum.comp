#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
// What the rays of a wavefront cost, added up by each invocation over some of them. The host adds up the rest in 64
// bits: a sum over all rays would not fit into 32, and one invocation has too few rays for that.

layout(local_size_x_id = 0) in;

// Nodes, boxes and triangles of a ray, or of many.
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Sums {
    uvec4 v[];
};

layout(push_constant, scalar) uniform Arguments {
    Sums counts;
    Sums sums;
    uint rays;
    uint invocations;
};

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= invocations) {
        return;
    }
    uvec4 sum = uvec4(0);
    for (uint ray = index; ray < rays; ray += invocations) {
        sum += counts.v[ray];
    }
    sums.v[index] = sum;
}
