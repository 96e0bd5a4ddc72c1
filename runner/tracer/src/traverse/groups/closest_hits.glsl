// Closest hits by groups of nodes and triangles: see traverse/groups/mod.rs.

// Entries of the stack in shared memory.
layout(constant_id = 11) const uint SHARED_STACK = 8;
// Whether rays are fetched by the number of idle lanes, and not by the work that they have lost.
layout(constant_id = 12) const uint BY_INACTIVE = 0;
// N_w, N_d and N_t, for this size of subgroup.
layout(constant_id = 13) const uint LOST_WORK = 16;
layout(constant_id = 14) const uint FORGIVEN = 4;
layout(constant_id = 15) const uint INACTIVE = 8;
// R_t in 1/1024.
layout(constant_id = 16) const uint LEAST_TESTING = 205;
// `Order` in traverse/groups/mod.rs.
layout(constant_id = 17) const uint ORDER = 0;
const uint OCTANT = 0, DISTANCE = 1, RANDOM = 2;

// Subgroups of a workgroup, where the lanes of each test triangles together; else 0.
layout(constant_id = 20) const uint SHARING = 0;
// Lanes with a ray under which others take over parts of theirs when none is left to fetch.
layout(constant_id = 21) const uint STEAL_BELOW = 0;
// Pairs of a triangle and a ray, fewer than which wait for more.
layout(constant_id = 22) const uint LEAST_PAIRS = 1;

#include "layout/compressed/node.glsl"

// Above this, a group's second word has a hit, so it is one of nodes.
const uint IS_NODES = 0x00ffffffu;
// The root alone, whichever bit it has.
const uvec2 ROOT = uvec2(0, 0x80000000u);

const uint SHARED_ENTRIES = SHARED_STACK > 0 ? SHARED_STACK : 1;
shared uvec2 shared_stack[SHARED_ENTRIES * gl_WorkGroupSize.x];

// Pairs of a triangle and a lane that a subgroup has room for, and those itself.
const uint PAIRS = 64;
shared uvec2 shared_pairs[SHARING > 0 ? SHARING * PAIRS : 1];
// Of each lane's ray, the nearest hit that others have found just now: its distance as an integer, and its triangle.
const int NO_HIT = 0x7fffffff;
shared int shared_nearest[SHARING > 0 ? gl_WorkGroupSize.x : 1];
shared uint shared_winner[SHARING > 0 ? gl_WorkGroupSize.x : 1];

// Hits, whose distances are compared as integers.
layout(buffer_reference, scalar, buffer_reference_align = 8) BETWEEN_STAGES buffer HitBits {
    uvec2 items[];
};

#define PUSH(entry)                                                                          \
    if (uint(top) < SHARED_STACK) {                                                          \
        shared_stack[uint(top) * gl_WorkGroupSize.x + gl_LocalInvocationIndex] = entry;      \
    } else {                                                                                 \
        stack[uint(top) - SHARED_STACK] = entry;                                             \
    }                                                                                        \
    top++;

#define POP(entry)                                                                           \
    top--;                                                                                   \
    if (uint(top) < SHARED_STACK) {                                                          \
        entry = shared_stack[uint(top) * gl_WorkGroupSize.x + gl_LocalInvocationIndex];      \
    } else {                                                                                 \
        entry = stack[uint(top) - SHARED_STACK];                                             \
    }

// 7 - octant, of a ray whose direction has these signs, at the children from `first_node` on.
uint inverse_octant(vec3 inverse, uint first_node) {
    if (ORDER == RANDOM) {
        // Any good mixture of bits (Wang 2007 begins like this).
        uint h = (first_node ^ 61u ^ first_node >> 16) * 9u;
        h = (h ^ h >> 4) * 0x27d4eb2du;
        return (h ^ h >> 15) & 7;
    }
    return (inverse.x < 0.0 ? 0 : 1) | (inverse.y < 0.0 ? 0 : 2) | (inverse.z < 0.0 ? 0 : 4);
}

#define FINISHED (group.y == 0 && (LEAST_PAIRS <= 1 || int(tested - queued_own) >= 0))

void closest_hits(Tree tree, Rays rays, Hits hits, Queue queue) {
    uint ray = MISS;
    uvec2 group = uvec2(0);      // nodes to visit next, or triangles that were put off
    uvec2 triangles = uvec2(0);  // to test now
    vec3 origin;
    float t_min;
    RaySlab slab;
    Shear shear;
    Hit best;

    uvec2 stack[STACK_SIZE];
    int top = 0;

    uint nodes_visited = 0;
    uint boxes_tested = 0;
    uint triangles_tested = 0;
    uvec2 node_steps = uvec2(0);  // these three of the subgroup: steps, and lanes in them
    uvec2 triangle_steps = uvec2(0);
    uvec2 fetches = uvec2(0);
    uint finished = 0;
    uint steps = 0;    // loop iterations, for drivers that count them
    int lost = 0;      // turns, since rays were fetched
    bool more = true;  // rays may be left in the queue
    // Of the pairs that lanes share, counted from the first one on: how many have been tested, how many are left over, and
    // the last one of this lane.
    uint tested = 0;
    uint left_over = 0;
    uint queued_own = 0;
    const uint count = queue.count;
    if (SHARING != 0) {
        shared_nearest[gl_LocalInvocationIndex] = NO_HIT;
    }

#define LAST_RAYS 0
    for (;;) {
#include "traverse/groups/turn.glsl"
    }
#undef LAST_RAYS
#define LAST_RAYS 1
    bool divided = false;  // whether other lanes have parts of the ray
    bool helps = false;    // whether it was another's first
    uint turn = 0;
    while (STEAL_BELOW != 0) {
#include "traverse/groups/turn.glsl"
    }

    if (COUNT == RAYS) {
        add_up(tree.utilization, node_steps, triangle_steps, fetches);
    }
    finished = subgroupAdd(finished);
    if (subgroupElect()) {
        atomicAdd(queue.finished, finished);
    }
}
