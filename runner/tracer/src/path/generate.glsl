// One primary ray.
#include "ray.glsl"
#include "random.glsl"
#include "scene.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Order {
    uint items[];
};

// A pinhole camera and the pixels it looks through.
struct Camera {
    Order order;  // pixels in the order in which rays are made
    vec3 eye;
    vec3 right;   // from the picture's centre to its right edge, at distance 1
    vec3 up;      // from the centre to the top edge
    vec3 forward;
    uint width;
    uint height;
    uint sample_;
    uint seed;
    uint every;   // rays go through each so-many-th pixel of the order
    uint unused;
};

uint primary_rays(Camera camera) {
    return (camera.width * camera.height + camera.every - 1) / camera.every;
}

void generate(Camera camera, Rays rays, Paths paths, uint index) {
    uint pixel = camera.order.items[index * camera.every];
    vec2 size = vec2(camera.width, camera.height);
    vec2 offset = random2(pixel, camera.sample_, 0xFFFFFFFFu, camera.seed);
    vec2 position = vec2(pixel % camera.width, pixel / camera.width) + offset;
    vec2 ndc = position / size * vec2(2.0, -2.0) + vec2(-1.0, 1.0);
    vec3 direction = normalize(camera.forward + ndc.x * camera.right + ndc.y * camera.up);
    rays.items[index] = Ray(camera.eye, 0.0, direction, INFINITY);
    paths.items[index] = Path(pixel, vec3(1.0));
}
