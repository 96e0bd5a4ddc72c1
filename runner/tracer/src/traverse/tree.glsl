// What all traversals have in common: how they are specialized, where the tree and the counters are, and what is counted.
#ifndef TREE_GLSL
#define TREE_GLSL

#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_vote : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_shuffle : require

#include "kensler_shirley.glsl"
#include "load.glsl"
#include "moeller_trumbore.glsl"
#include "ray.glsl"
#include "slab.glsl"
#include "triangle.glsl"
#include "woop.glsl"

layout(constant_id = 1) const uint STACK_SIZE = 64;
// Lanes with a ray under which idle lanes fetch new ones.
layout(constant_id = 2) const uint FETCH_BELOW = 20;
// Loop iterations after which a subgroup leaves, 0 for none: some drivers end loops silently.
layout(constant_id = 3) const uint QUOTA = 0;
// What is counted: NOTHING, what rays cost and how well subgroups are used, or how often each node is visited.
layout(constant_id = 4) const uint COUNT = 0;
const uint RAYS = 1, VISITS = 2;
// Lanes that, when no more than these still test triangles, keep theirs postponed while others go on.
layout(constant_id = 5) const uint POSTPONE = 8;
// Bytes from one node to the next.
layout(constant_id = 6) const uint STRIDE = 4;
// 0 for phases; else the schedule is by vote, in which so many lanes at an inner node weigh as much as 32 with
// a triangle.
layout(constant_id = 7) const uint VOTE = 0;
// Whether the subgroups of a workgroup wait for each other between nodes and triangles (thesis 5.3). In phases only.
layout(constant_id = 8) const uint BARRIER = 0;
// Whether a triangle's distance is computed before it is known to be hit (thesis 5.2).
layout(constant_id = 9) const uint HOIST = 0;
// How rays are tested against triangles, which are stored for that test: `TriangleTest` in traverse/triangle.rs.
layout(constant_id = 10) const uint TRIANGLE_TEST = 0;
const uint WATERTIGHT = 0, MOELLER_TRUMBORE = 1, KENSLER_SHIRLEY = 2, WOOP = 3;
// Subgroups of a workgroup, where the lanes of each walk the tree together; else 0.
layout(constant_id = 18) const uint PACKETS = 0;
// Rays a lane, there.
layout(constant_id = 19) const uint PACKET_RAYS = 1;
// Nodes that lanes visit between two votes on whether to go on, in phases.
layout(constant_id = 23) const uint VISITS_A_VOTE = 1;
// Lanes that, when no more than these still look for a leaf, are not waited for, there.
layout(constant_id = 24) const uint SEARCH_ABOVE = 0;
// Once the queue is empty, steps between two looks at what other subgroups of the workgroup have left; 0 where each subgroup
// ends what it has begun.
layout(constant_id = 25) const uint END_STEPS = 0;
// Subgroups of a workgroup, there.
layout(constant_id = 26) const uint SUBGROUPS = 1;
// So many of them have to have nothing left before the others share what they have.
layout(constant_id = 27) const uint END_WHEN = 1;
// Whether lanes that have found a leaf visit nodes on until all have one, in phases.
layout(constant_id = 28) const uint SPECULATE = 1;

// Per ray: nodes visited, boxes tested, triangles tested, nothing.
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Counts {
    uvec4 items[];
};
// Sums over subgroups, `Utilization` in traverse/mod.rs: each is a number of 64 bits as two words, the lower first,
// because not every device adds 64 bits atomically.
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Utilization {
    uvec2 items[];
};
// Per node, how many rays have visited it.
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Visits {
    uint items[];
};

// Per triangle in leaf order, its index in file order. With WOOP, whose format leaves no room for it.
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Indices {
    uint items[];
};

// `Tree` in traverse/mod.rs, and where the counters go.
struct Tree {
    uint64_t nodes;
    Triangles triangles;
    Indices indices;
    Counts counts;
    Visits visits;
    Utilization utilization;
    float extent;
};

// What the triangle test needs of a ray beside its origin: the shear, or in its registers the direction as it is.
Shear aim(vec3 direction) {
    if (TRIANGLE_TEST == WATERTIGHT) {
        return shear_of(direction);
    }
    return Shear(direction, 0);
}

uint lanes(bool which) {
    return subgroupBallotBitCount(subgroupBallot(which));
}

// What a subgroup counts of a kind of step: such steps, and lanes that took part in them. A step without lanes is none.
uvec2 step_of(uint lanes_in_it) {
    return uvec2(min(lanes_in_it, 1), lanes_in_it);
}

void add(Utilization sums, uint at, uint counted) {
    uint low = atomicAdd(sums.items[at].x, counted);
    if (low + counted < low) {
        atomicAdd(sums.items[at].y, 1);
    }
}

// A subgroup adds what it has counted to what others have, also in earlier launches over the same queue. Its own share
// fits 32 bits: few subgroups trace many rays only where each leaves after its QUOTA.
void add_up(Utilization sums, uvec2 node_steps, uvec2 triangle_steps, uvec2 fetches) {
    if (subgroupElect()) {
        add(sums, 0, node_steps.x);
        add(sums, 1, node_steps.y);
        add(sums, 2, triangle_steps.x);
        add(sums, 3, triangle_steps.y);
        add(sums, 4, fetches.x);
        add(sums, 5, fetches.y);
    }
}

#endif
