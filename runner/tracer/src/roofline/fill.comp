#version 460
// Writes a table, so that what is read from it can be checked.
#extension GL_GOOGLE_include_directive : require
#include "roofline/table.glsl"

layout(local_size_x_id = 0) in;

layout(push_constant, scalar) uniform Arguments {
    Pieces pieces;
    uint count;
    uint invocations;
};

void main() {
    for (uint at = gl_GlobalInvocationID.x; at < count; at += invocations) {
        pieces.items[at] = uvec4(word(4 * at), word(4 * at + 1), word(4 * at + 2), word(4 * at + 3));
    }
}
