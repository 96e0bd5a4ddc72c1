#version 460
#extension GL_GOOGLE_include_directive : require
#include "path/shade.glsl"

layout(local_size_x_id = 0) in;

layout(push_constant, scalar) uniform Arguments {
    Rays rays;
    Hits hits;
    Paths paths;
    Queue queue;
    Rays next_rays;
    Paths next_paths;
    Queue next_queue;
    Scene scene;
    Image image;
    uint sample_;
    uint depth;  // of the rays that are shaded, 0 for primary
    uint seed;
    uint last;   // 1 where no further rays are wanted
    Shading shading;
};

void main() {
    Wavefront wavefront = Wavefront(rays, hits, paths, queue, scene, image, sample_, seed, shading);
    shade(wavefront, gl_GlobalInvocationID.x, depth, last != 0, next_rays, next_paths, next_queue);
}
