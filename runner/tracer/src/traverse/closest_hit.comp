#version 460
// The traversal of one wavefront.
#extension GL_GOOGLE_include_directive : require

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
