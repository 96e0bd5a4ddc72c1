// Closest hit: speculative while-while traversal with persistent threads (Aila and Laine 2009; thesis 2.3,
// 4.1 and 4.4). One ray a lane. One source for every layout: `node.glsl` of a layout says how a node's
// children are tested.
//
// Three schedules. As packets, which packet.glsl describes, in phases, for rays that stay together:
//
//   until the queue is empty and no lane has a ray:
//       when few lanes have a ray, idle lanes fetch new ones
//       until all lanes but few have a leaf to test (or no ray): inner nodes; with SPECULATE, the first leaf found is
//       postponed
//       until few lanes have a leaf while others could go on: triangles
//   with END_STEPS, what rays are left then, the subgroups of a workgroup end together: end_phases.glsl
//
// By vote, for rays that go their own ways:
//
//   until the queue is empty and no lane has a ray:
//       when few lanes have a ray, idle lanes fetch new ones
//       an inner node or a triangle, whichever more lanes are ready for
//
// All loops are uniform in the subgroup: lanes without work take part idle, so votes mean the same on every
// driver, whether or not it reconverges diverged lanes.
#include "traverse/tree.glsl"

#if defined(LAYOUT_COMPRESSED)
#include "traverse/groups/closest_hits.glsl"
#else
// A child: a node's index, or a leaf with its top bit set: 4 bits of count minus one, 27 bits of the first
// triangle (thesis figure 12). NONE cannot be a leaf: its triangles would exceed 27 bits.
const uint NONE = 0xFFFFFFFFu;
const uint LEAF_BIT = 0x80000000u;

#if defined(LAYOUT_QUANTIZED)
#include "layout/quantized/node.glsl"
#elif defined(LAYOUT_WIDE)
#include "layout/wide/node.glsl"
#elif defined(LAYOUT_DIRECT)
#include "layout/direct/node.glsl"
#elif defined(LAYOUT_REDUCED)
#include "layout/reduced/node.glsl"
#else
#include "layout/binary/node.glsl"
#endif
#include "traverse/order.glsl"

// Iterations that count towards QUOTA for one node. Loops that are to be unrolled count too, and their last,
// empty rounds: drivers that end loops count those they did not unroll.
const uint NODE_STEPS = 1 + MEET_STEPS + ARITY;

bool is_inner(uint child) {
    return int(child) >= 0;
}
bool is_leaf(uint child) {
    return int(child) < 0 && child != NONE;
}

// With BARRIER, how many subgroups have no ray left. None may leave while others wait, so they go on idle until all
// have none. In even turns they look at the first number and in odd ones at the second: who reads one after a barrier
// can be sure that nobody adds to it until the next. Whoever leaves has added one to each.
shared uint leaving[2];
const uint ALL = 1u << 16;  // more than there are

#if defined(LAYOUT_WIDE)
#include "intervals.glsl"
// Keys of a packet's children: at least as many as a node has.
const uint KEYS = 8;
// Of packets, a stack a subgroup: a node times ARITY plus the slot of a child, and the child's key.
const uint PACKET_ENTRIES = PACKETS > 0 ? STACK_SIZE * PACKETS : 1;
shared uvec2 packet_stack[PACKET_ENTRIES];

// The r-th ray that a lane has of a packet, which begins at `first`, or MISS.
uint ray_of_packet(uint first, uint r, uint count) {
    uint index = first + r * gl_SubgroupSize + gl_SubgroupInvocationID;
    return index < count ? index : MISS;
}
#endif

// With END_STEPS, what the subgroups of a workgroup tell each other when the queue is empty: how many have ended; how each
// stands, in two places by turns, because not all have read what is told when some tell more; what lanes leave to others:
// ray, child, and the ray's number; and of the rays that were left, one for each invocation, what is nearest and what they
// cost.
shared uint ended;
const uint BUSY = 1, MORE = 2, LATE = 4;
shared uvec4 told_by[2 * SUBGROUPS];
const uint LEFT_RAYS = END_STEPS > 0 ? gl_WorkGroupSize.x : 1;
shared uvec3 left_to_others[LEFT_RAYS];
shared uint shared_t[LEFT_RAYS];
shared uint shared_triangle[LEFT_RAYS];
const uint COUNTED_RAYS = COUNT == RAYS ? LEFT_RAYS : 1;
shared uint shared_nodes[COUNTED_RAYS];
shared uint shared_boxes[COUNTED_RAYS];
shared uint shared_triangles[COUNTED_RAYS];

#if defined(BY_OCTANT)
// The octant that the rays of all lanes which have one point into, or MIXED.
uint octant_of_all(bool has_ray, OrderedSlab slab) {
    uint octant = 0;
    [[unroll]] for (uint axis = 0; axis < 3; axis++) {
        bool falls = slab.inverse[axis] < 0.0;
        bool all_fall = subgroupAll(falls || !has_ray);
        bool all_rise = subgroupAll(!falls || !has_ray);
        octant |= all_fall ? 1 << axis : (all_rise ? 0 : MIXED);
    }
    return min(octant, MIXED);
}
#endif

// Whether a subgroup stays with the code for an octant while its rays do.
#if defined(BY_OCTANT)
#define STAYS_IN_OCTANT true
#else
#define STAYS_IN_OCTANT false
#endif
// The octant that rays are taken to point into, where nodes are visited.
#define OCTANT MIXED
// The leaf that a lane is to test: with SPECULATE one that it keeps while it goes on, else its node.
#define HAS_LEAF (SPECULATE != 0 ? leaf != NONE : is_leaf(node))
#define LOOKS_FOR_LEAF (is_inner(node) && leaf == NONE)
#define FINISHED (node == NONE && leaf == NONE)

// Closest hits of the rays in a queue, until none is left.
//
// The steps that both schedules are made of are included, so that all they work on are variables of this
// function, which drivers keep in registers but for the stack.
void closest_hits(Tree tree, Rays rays, Hits hits, Queue queue) {
    uint ray = MISS;
    uint node = NONE;  // to visit next: inner node or leaf
    uint leaf = NONE;  // postponed, with SPECULATE
    vec3 origin;
    float t_min;
    RaySlab slab;
    Shear shear;
    Hit best;

    uint stack[STACK_SIZE];
    int top = 0;
    stack[0] = NONE;

    uint nodes_visited = 0;
    uint boxes_tested = 0;
    uint triangles_tested = 0;
    uvec2 node_steps = uvec2(0);  // these three of the subgroup: steps, and lanes in them
    uvec2 triangle_steps = uvec2(0);
    uvec2 fetches = uvec2(0);
    uint finished = 0;
    uint steps = 0;             // loop iterations, for drivers that count them
    bool more = true;           // rays may be left in the queue
#if defined(BY_OCTANT)
    uint octant = MIXED;        // that all rays of the subgroup point into
#endif
    const uint count = queue.count;

#if defined(LAYOUT_WIDE)
    if (PACKETS != 0) {
#include "traverse/packet.glsl"
    } else
#endif
    if (VOTE == 0) {
        uint turn = 0;
        uint told = 0;
        bool again = true;
        if (BARRIER != 0) {
            if (gl_LocalInvocationIndex < 2) {
                leaving[gl_LocalInvocationIndex] = 0;
            }
            barrier();
        }
        while (again) {
            again = false;
            if (END_STEPS != 0) {
                turn = 0;
                if (gl_LocalInvocationIndex == 0) {
                    ended = 0;
                }
                barrier();
            }
            bool leaves = false;
            while (!leaves) {
                steps++;
                uint busy = lanes(ray != MISS);
                if (more && busy < FETCH_BELOW) {
#include "traverse/fetch.glsl"
                    busy = lanes(ray != MISS);
#if defined(BY_OCTANT)
                    octant = octant_of_all(ray != MISS, slab);
#endif
                }
                if (BARRIER == 0 && busy == 0) {
                    break;
                }
#if defined(BY_OCTANT)
#include "traverse/octants.glsl"
#else
#include "traverse/phases.glsl"
#endif
#include "traverse/finish.glsl"
            }
            if (END_STEPS != 0) {
                if (subgroupElect()) {
                    atomicAdd(ended, 1);
                }
                subgroupMemoryBarrierShared();
#include "traverse/end_phases.glsl"
            }
        }
    } else {
        while (QUOTA == 0 || steps <= QUOTA) {
            steps++;
            uint busy = lanes(!FINISHED);
            if (busy < FETCH_BELOW && (more || busy == 0)) {
#include "traverse/finish.glsl"
                if (!more) {
                    break;
                }
#include "traverse/fetch.glsl"
                continue;
            }
            bool inner = is_inner(node);
            uint visiting = lanes(inner);
            uint testing = lanes(HAS_LEAF);
            if (visiting * 32 >= testing * VOTE) {
                steps += NODE_STEPS;
                if (COUNT == RAYS) {
                    node_steps += step_of(visiting);
                }
                if (inner) {
#include "traverse/visit_node.glsl"
                }
            } else {
                if (COUNT == RAYS) {
                    triangle_steps += step_of(testing);
                }
                bool uncertain = false;
                if (HAS_LEAF) {
#include "traverse/test_triangle.glsl"
                }
                if (QUOTA != 0) {
                    steps += subgroupAny(uncertain) ? 3 : 0;
                }
            }
        }
        // Where the quota has ended the loop, of rays that were done just then.
#include "traverse/finish.glsl"
    }

    if (COUNT == RAYS) {
        add_up(tree.utilization, node_steps, triangle_steps, fetches);
    }
    finished = subgroupAdd(finished);
    if (subgroupElect()) {
        atomicAdd(queue.finished, finished);
    }
}

#endif
