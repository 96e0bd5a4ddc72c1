#version 460
// All stages of a path in one launch (thesis 4.4, 5.1.1): persistent workgroups go from stage to stage
// together, with a software barrier between.
//
// A barrier over workgroups holds only among those that run at once, and no more than those may wait in it.
// So every workgroup that starts first asks to take part; when all that were launched do, or none came for
// a while, the list is closed and later ones leave (Sorensen et al., "Portable Inter-workgroup Barrier
// Synchronisation for GPUs", OOPSLA 2016).
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_shader_realtime_clock : require
#define SINGLE_KERNEL

layout(local_size_x_id = 0) in;

#include "path/generate.glsl"
#include "path/shade.glsl"
#include "traverse/closest_hit.glsl"

const uint MAX_DEPTH = 64;

layout(buffer_reference, scalar, buffer_reference_align = 8) coherent volatile buffer Grid {
    uint joined;        // workgroups that asked to take part, and CLOSED
    uint participants;  // once the list is closed
    uint arrived;       // at all barriers so far
    uint unused;
    uvec2 began;
    uvec2 ended;
    uvec2 clock[2 * MAX_DEPTH];  // before and after each traversal
};
const uint CLOSED = 0x80000000u;

layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Arguments {
    Camera camera;
    uint depths;
    Rays rays[2];
    Paths paths[2];
    Hits hits;
    uint64_t queues;  // one Queue a depth, and one
    Scene scene;
    Image image;
    uint64_t nodes;
    Triangles triangles;
    Indices indices;
    Grid grid;
    float extent;
    Shading shading;
};

layout(push_constant, scalar) uniform Push {
    Arguments arguments;
};

shared uint own;
shared uint all;

void join(Grid grid) {
    if (gl_LocalInvocationIndex == 0) {
        own = atomicAdd(grid.joined, 1);
        all = 0;
        if ((own & CLOSED) == 0) {
            for (uint polls = 0; polls < 1000; polls++) {
                uint joined = atomicAdd(grid.joined, 0);
                if ((joined & CLOSED) != 0 || joined == gl_NumWorkGroups.x) {
                    break;
                }
            }
            uint joined = atomicOr(grid.joined, CLOSED);
            if ((joined & CLOSED) == 0) {
                atomicExchange(grid.participants, joined);
            }
            do {
                all = atomicAdd(grid.participants, 0);
            } while (all == 0);
        }
    }
    barrier();
}

void wait_for_all(Grid grid, inout uint barriers) {
    barriers++;
    memoryBarrierBuffer();
    barrier();
    if (gl_LocalInvocationIndex == 0) {
        atomicAdd(grid.arrived, 1);
        while (atomicAdd(grid.arrived, 0) < barriers * all) {
        }
    }
    barrier();
    memoryBarrierBuffer();
}

void main() {
    Grid grid = arguments.grid;
    join(grid);
    if (all == 0) {
        return;
    }
    uint barriers = 0;
    uint first = own * gl_WorkGroupSize.x;
    uint stride = all * gl_WorkGroupSize.x;
    bool clerk = own == 0 && gl_LocalInvocationIndex == 0;
    if (clerk) {
        grid.began = clockRealtime2x32EXT();
    }

    Camera camera = arguments.camera;
    uint count = primary_rays(camera);
    for (uint base = first; base < count; base += stride) {
        uint index = base + gl_LocalInvocationIndex;
        if (index < count) {
            generate(camera, arguments.rays[0], arguments.paths[0], index);
        }
    }
    if (clerk) {
        Queue(arguments.queues).count = count;
    }
    wait_for_all(grid, barriers);

    Tree tree = Tree(arguments.nodes, arguments.triangles, arguments.indices, Counts(uint64_t(0)), Visits(uint64_t(0)),
                     Utilization(uint64_t(0)), arguments.extent);
    for (uint depth = 0; depth < arguments.depths; depth++) {
        uint now = depth & 1;
        Queue queue = Queue(arguments.queues + 16 * depth);
        Queue next_queue = Queue(arguments.queues + 16 * depth + 16);
        if (clerk) {
            grid.clock[2 * depth] = clockRealtime2x32EXT();
        }
        closest_hits(tree, arguments.rays[now], arguments.hits, queue);
        wait_for_all(grid, barriers);
        if (clerk) {
            grid.clock[2 * depth + 1] = clockRealtime2x32EXT();
        }
        Wavefront wavefront = Wavefront(arguments.rays[now], arguments.hits, arguments.paths[now], queue,
                                        arguments.scene, arguments.image, camera.sample_, camera.seed,
                                        arguments.shading);
        uint rays_now = queue.count;
        bool last = depth + 1 == arguments.depths;
        for (uint base = first; base < rays_now; base += stride) {
            shade(wavefront, base + gl_LocalInvocationIndex, depth, last, arguments.rays[now ^ 1],
                  arguments.paths[now ^ 1], next_queue);
        }
        wait_for_all(grid, barriers);
    }
    if (clerk) {
        grid.ended = clockRealtime2x32EXT();
    }
}
