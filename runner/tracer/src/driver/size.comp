#version 460
// How many rays are launched, which only the device knows: those of the queue, in rows.
#extension GL_GOOGLE_include_directive : require
#include "ray.glsl"

layout(local_size_x_id = 0) in;

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Launch {
    uint width;
    uint height;
    uint depth;
};

layout(push_constant, scalar) uniform Arguments {
    Queue queue;
    Launch launch;
    uint row;  // rays in a row; 0 for a single one
    uint unused;
};

void main() {
    if (gl_GlobalInvocationID.x == 0) {
        uint width = row == 0 ? queue.count : min(row, queue.count);
        launch.width = width;
        launch.height = (queue.count + max(width, 1) - 1) / max(width, 1);
        launch.depth = 1;
    }
}
