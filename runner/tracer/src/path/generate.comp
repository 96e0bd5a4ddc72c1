#version 460
// Primary rays, one a pixel, along the Z-order curve so that the rays of a subgroup stay together.
#extension GL_GOOGLE_include_directive : require
#include "path/generate.glsl"

layout(local_size_x_id = 0) in;

layout(push_constant, scalar) uniform Arguments {
    Rays rays;
    Paths paths;
    Queue queue;
    Camera camera;
};

void main() {
    uint index = gl_GlobalInvocationID.x;
    uint count = primary_rays(camera);
    if (index == 0) {
        queue.count = count;
    }
    if (index < count) {
        generate(camera, rays, paths, index);
    }
}
