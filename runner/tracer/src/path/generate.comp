#version 460
// Primary rays, one a pixel, along the Z-order curve so that the rays of a subgroup stay together.
#extension GL_GOOGLE_include_directive : require
#include "ray.glsl"
#include "random.glsl"
#include "scene.glsl"

layout(local_size_x_id = 0) in;

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Order {
    uint items[];
};

layout(push_constant, scalar) uniform Arguments {
    Rays rays;
    Paths paths;
    Queue queue;
    Order order;  // pixels in the order in which rays are made
    vec3 eye;
    vec3 right;   // from the picture's centre to its right edge, at distance 1
    vec3 up;      // from the centre to the top edge
    vec3 forward;
    uint width;
    uint height;
    uint sample_;
    uint seed;
};

void main() {
    uint index = gl_GlobalInvocationID.x;
    uint pixels = width * height;
    if (index == 0) {
        queue.count = pixels;
    }
    if (index >= pixels) {
        return;
    }
    uint pixel = order.items[index];
    vec2 position = vec2(pixel % width, pixel / width) + random2(pixel, sample_, 0xFFFFFFFFu, seed);
    vec2 ndc = position / vec2(width, height) * vec2(2.0, -2.0) + vec2(-1.0, 1.0);
    vec3 direction = normalize(forward + ndc.x * right + ndc.y * up);
    rays.items[index] = Ray(eye, 0.0, direction, INFINITY);
    paths.items[index] = Path(pixel, vec3(1.0));
}
