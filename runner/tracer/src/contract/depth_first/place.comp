#version 460
#extension GL_GOOGLE_include_directive : require
#include "contract/depth_first/depth_first.glsl"

// Writes each wide node to its place, and where its children and triangles begin: see contract/depth_first/mod.rs. What
// comes before it is added up on the way to the root.

void main() {
    uint count = wide_complete(progress) ? progress.nodes : 0;
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint i = gl_GlobalInvocationID.x; i < count; i += stride) {
        uint first_node = 1;  // of its own children
        uint first_triangle = 0;
        uint before_siblings = 0;  // what its own siblings add to the first
        uint which = 0;            // of its siblings
        uint child = i;
        for (uint parent = subtrees.v[i].parent; parent != NONE; parent = subtrees.v[parent].parent) {
            uint at = (WIDE_HEADER + arity) * parent;
            uint first = wide.v[at];
            uint leaves = wide.v[at + 2] & 15;
            uint nodes = nodes_of(parent);
            for (uint leaf = 0; leaf < leaves; leaf++) {
                first_triangle += (wide.v[at + WIDE_HEADER + leaf] >> WIDE_COUNT_SHIFT) + 1;
            }
            for (uint k = first; k < child; k++) {
                nodes += subtrees.v[k].nodes - 1;
                first_triangle += wide.v[(WIDE_HEADER + arity) * k + 3];
            }
            first_node += nodes;
            if (child == i) {
                before_siblings = nodes;
                which = child - first;
            }
            child = parent;
        }
        uint place = i == 0 ? 0 : first_node - before_siblings + which;
        uint from = (WIDE_HEADER + arity) * i, to = (WIDE_HEADER + arity) * place;
        uint counts = wide.v[from + 2];
        placed.v[to] = nodes_of(i) > 0 ? first_node : 0;
        placed.v[to + 1] = (counts & 15) > 0 ? first_triangle : 0;
        for (uint word = 2; word < WIDE_HEADER + (counts >> 4); word++) {
            placed.v[to + word] = wide.v[from + word];
        }
        placed_tasks.v[place] = tasks.v[i];
    }
}
