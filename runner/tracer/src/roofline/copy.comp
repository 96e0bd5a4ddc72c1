#version 460
// Copies memory, neighbouring lanes neighbouring pieces: what the memory can do at best.
#extension GL_GOOGLE_include_directive : require
#include "roofline/table.glsl"

layout(local_size_x_id = 0) in;

layout(push_constant, scalar) uniform Arguments {
    Pieces from;
    Pieces to;
    uint count;
    uint invocations;
};

void main() {
    for (uint at = gl_GlobalInvocationID.x; at < count; at += invocations) {
        to.items[at] = from.items[at];
    }
}
