// A kernel that traces one wavefront: closest_hit.glsl, and its arguments.
#ifndef WAVEFRONT_GLSL
#define WAVEFRONT_GLSL

// Before what is sized by it.
layout(local_size_x_id = 0) in;

#include "traverse/closest_hit.glsl"

layout(push_constant, scalar) uniform Arguments {
    Rays rays;
    Hits hits;
    uint64_t nodes;
    Triangles triangles;
    Indices indices;
    Queue queue;
    Counts counts;
    Visits visits;
    Utilization utilization;
    float extent;
};

void main() {
    closest_hits(Tree(nodes, triangles, indices, counts, visits, utilization, extent), rays, hits, queue);
}

#endif
