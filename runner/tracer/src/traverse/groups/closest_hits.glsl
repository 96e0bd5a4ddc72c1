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

#define FINISHED (group.y == 0)

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
    const uint count = queue.count;
    if (SHARING != 0) {
        shared_nearest[gl_LocalInvocationIndex] = NO_HIT;
    }

    for (;;) {
        steps++;
        uint busy = lanes(ray != MISS);
        uint idle_lanes = gl_SubgroupSize - busy;
        lost += int(idle_lanes) - int(FORGIVEN);
        bool few = BY_INACTIVE != 0 ? idle_lanes > INACTIVE : lost > int(LOST_WORK);
        if (more && (few && idle_lanes > 0 || busy == 0)) {
#include "traverse/fetch.glsl"
            busy = lanes(ray != MISS);
            lost = 0;
        }
        if (busy == 0) {
            break;
        }
        // Of all lanes alike: where it ends `more` or the loop for some lanes only, votes no longer mean the subgroup.
        steps += NODE_STEPS;
        if (COUNT == RAYS) {
            node_steps += step_of(lanes(group.y > IS_NODES));
        }
        if (group.y > IS_NODES) {
#include "traverse/groups/visit.glsl"
        } else {
            triangles = group;
            group = uvec2(0);
        }
        if (SHARING != 0) {
#include "traverse/groups/share.glsl"
        } else {
            for (;;) {
                uint testing = lanes(triangles.y != 0);
                if (testing == 0) {
                    break;
                }
                if (testing * 1024 < busy * LEAST_TESTING) {
                    if (triangles.y != 0) {
                        PUSH(triangles)
                        triangles.y = 0;
                    }
                    break;
                }
                steps++;
                if (COUNT == RAYS) {
                    triangle_steps += step_of(testing);
                }
                bool uncertain = false;
                if (triangles.y != 0) {
                    uint index = triangles.x + findLSB(triangles.y);
                    triangles.y &= triangles.y - 1;
#include "traverse/meet_triangle.glsl"
                }
                if (QUOTA != 0) {
                    steps += subgroupAny(uncertain) ? 3 : 0;  // the loop in exact_distance
                    if (steps > QUOTA) {
                        break;
                    }
                }
            }
        }
        if (group.y <= IS_NODES) {
            group = uvec2(0);
            if (top > 0) {
                POP(group)
            }
        }
#include "traverse/finish.glsl"
        if (QUOTA != 0 && steps > QUOTA) {
            break;
        }
    }

    if (COUNT == RAYS) {
        add_up(tree.utilization, node_steps, triangle_steps, fetches);
    }
    finished = subgroupAdd(finished);
    if (subgroupElect()) {
        atomicAdd(queue.finished, finished);
    }
}
