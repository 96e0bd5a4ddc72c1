// Chooses the children of one wide node: the greedy top-down conversion of Benthin et al. 2024 (H-PLOC;
// thesis 2.1.4 and 4.2), with several ways of saying which candidate is best opened, or by a plan that was made
// before.
//
//   binary tree below N, arity 4: N has A and B, A has C and D, D has E and F
//
//       candidates   A B
//       A is opened  C B D
//       D is opened  C B E F     four: these are N's children
//
// A candidate that became a leaf in the collapse is never opened.
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_vote : require
#include "bvh2.glsl"
#include "collapse.glsl"
#include "levels.glsl"
#include "plans.glsl"
#include "scene_bounds.glsl"
#include "wide.glsl"

layout(local_size_x_id = 0) in;
// `Contraction` in contract/mod.rs.
layout(constant_id = 1) const uint METHOD = 0;
const uint SAH = 0, SATC = 1, CBTC = 2, RDTC = 3, WALD = 4, AFRA = 5, FIXED = 6, OPTIMAL = 7;

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Visits {
    uint v[];
};

// The binary node that a wide node is made of, by wide node; NONE until its parent has been processed.
layout(buffer_reference, scalar, buffer_reference_align = 4) coherent volatile buffer Tasks {
    uint v[];
};

// Of the way down to a wide node: nodes << 16 | entries that a traversal may have left on its stack.
layout(buffer_reference, scalar, buffer_reference_align = 4) coherent buffer Ways {
    uint v[];
};

layout(push_constant, scalar) uniform Push {
    Bvh2Nodes nodes;
    Levels levels;
    Subtrees subtrees;
    SceneBounds bounds;
    Visits visits;  // by inner node of the binary tree
    Plans plans;    // likewise, of the optimal contraction
    WideNodes wide;
    Tasks tasks;
    Ways ways;
    Progress progress;
    uint threshold;
    float alpha;
    uint capacity;  // wide nodes that `wide`, `tasks` and `ways` have room for
};

const uint NONE = 0xffffffffu;

struct Parent {
    float area;
    uint visits;
};

// How much a candidate of `area`, with `triangles` below it and visited by so many sample rays, is worth
// opening; negative for not at all. `above` is what the node was worth whose child it is. No division, whose
// rounding Vulkan leaves open: the twin on the CPU has to find the same bits.
float worth(Parent parent, float area, uint triangles, uint visits, float above) {
    if (METHOD == SAH) {
        // Thesis 4.2.1: surface area times primitives.
        precise float product = area * float(triangles);
        return product;
    }
    if (METHOD == SATC) {
        precise float least = alpha * parent.area;
        return area > least ? area : -1.0;
    }
    if (METHOD == RDTC) {
        precise float least = alpha * float(parent.visits);
        return parent.visits > threshold && float(visits) > least ? float(visits) : -1.0;
    }
    if (METHOD == WALD || METHOD == AFRA) {
        return area;
    }
    if (METHOD == FIXED) {
        return above - 1.0;  // a level lower
    }
    // CBTC (Gu et al. 2015; thesis 2.1.2): visits / parent's visits above the threshold, else area /
    // parent's area; both multiplied by both parents' to be comparable without dividing. No child is
    // visited more often than its parent, so at or below the threshold only areas are compared.
    if (parent.visits <= threshold) {
        return area;
    }
    precise float by_view = float(visits) * parent.area;
    precise float by_area = area * float(parent.visits);
    return visits > threshold ? by_view : by_area;
}

// Adds a child with so many triangles, 0 for a node.
#define ADD_CHILD(node_, triangles_)                    \
    [[unroll]] for (uint i = 0; i < ARITY; i++) {       \
        if (i == count) {                               \
            id[i] = node_;                              \
            size[i] = triangles_;                       \
        }                                               \
    }                                                   \
    count++;

// Makes wide node `index` of binary node `from`, where `active_`; all invocations of the subgroup take part
// in the allocation.
void contract(bool active_, uint index, uint from) {
    uint leaves = levels.leaves;
    uint id[ARITY];
    float value[ARITY];
    uint size[ARITY];  // triangles of a leaf, 0 for a node
    uint count = 0;
    uint triangles = 0;
    if (active_) {
        triangles = unpack_subtree(subtrees.v[from - leaves]).triangles;
    }
    if (active_ && METHOD == OPTIMAL) {
        // Left to right, of what has been planned below `from`: a node, and how many children it may become.
        uint todo[ARITY];
        Bvh2Node node = nodes.v[from];
        uint left = plan_left(plans.v[ARITY * (from - leaves) + ARITY - 1], ARITY);
        todo[0] = (ARITY - left) << WIDE_COUNT_SHIFT | node.hi_right.w;
        todo[1] = left << WIDE_COUNT_SHIFT | node.lo_left.w;
        uint top = 2;
        while (top > 0) {
            uint word = todo[--top];
            uint roots = word >> WIDE_COUNT_SHIFT;
            uint child = word & WIDE_CHILD_MASK;
            if (child < leaves) {
                ADD_CHILD(child, 1)
                continue;
            }
            uint decisions = plans.v[ARITY * (child - leaves) + ARITY - 1];
            while (roots > 1 && plan_left(decisions, roots) == 0) {
                roots--;
            }
            if (roots == 1) {
                bool leaf = (decisions & PLAN_LEAF) != 0;
                uint below = leaf ? unpack_subtree(subtrees.v[child - leaves]).triangles : 0;
                ADD_CHILD(child, below)
                continue;
            }
            left = plan_left(decisions, roots);
            node = nodes.v[child];
            todo[top++] = (roots - left) << WIDE_COUNT_SHIFT | node.hi_right.w;
            todo[top++] = left << WIDE_COUNT_SHIFT | node.lo_left.w;
        }
    } else if (active_) {
        float scale = scene_scale(bounds);
        Bvh2Node node = nodes.v[from];
        Box box = bvh2_box(node);
        bool counted = METHOD == CBTC || METHOD == RDTC;
        Parent parent = Parent(box_half_area(box.lo, box.hi, scale), counted ? visits.v[from - leaves] : 0);
        // Two candidates, then one more for each that is opened: its left child in its place, its right
        // child at the end.
        uint opened = 0;
        bool open = true;
        bool in_leaf = false;              // the one that was opened last was a leaf
        float above = float(findMSB(ARITY)) - 1.0;  // what it was worth
        uint pair[2] = uint[2](node.lo_left.w, node.hi_right.w);
        [[unroll]] for (uint last = 1; last < ARITY; last++) {
            if (open) {
                [[unroll]] for (uint side = 0; side < 2; side++) {
                    uint child = pair[side];
                    Box b = bvh2_box(nodes.v[child]);
                    Subtree s = Subtree(0.0, 1, 0, 0, 0);
                    uint visited = 0;
                    if (child >= leaves) {
                        s = unpack_subtree(subtrees.v[child - leaves]);
                        visited = counted ? visits.v[child - leaves] : 0;
                    }
                    bool leaf = in_leaf || s.inner == 0;
                    float area = box_half_area(b.lo, b.hi, scale);
                    float w = leaf ? (METHOD == AFRA && s.triangles > 1 ? area : -1.0)
                                   : worth(parent, area, s.triangles, visited, above);
                    uint slot = side == 0 ? opened : last;
                    [[unroll]] for (uint i = 0; i < ARITY; i++) {
                        if (i == slot) {
                            id[i] = child;
                            value[i] = w;
                            size[i] = leaf ? s.triangles : 0;
                        }
                    }
                }
                count = last + 1;
                float best = -1.0;
                uint chosen = 0;
                // Nodes, and leaves where no node is left to open.
                [[unroll]] for (uint leaf = 0; leaf < (METHOD == AFRA ? 2 : 1); leaf++) {
                    if (best < 0.0) {
                        in_leaf = leaf == 1;
                        [[unroll]] for (uint i = 0; i <= last; i++) {
                            if (value[i] > best && (size[i] > 0) == in_leaf) {
                                best = value[i];
                                opened = i;
                                chosen = id[i];
                            }
                        }
                    }
                }
                above = best;
                open = best >= 0.0 && count < ARITY;
                if (open) {
                    Bvh2Node c = nodes.v[chosen];
                    pair = uint[2](c.lo_left.w, c.hi_right.w);
                }
            }
        }
    }
    uint leaf_count = 0;
    uint leaf_triangles = 0;
    [[unroll]] for (uint i = 0; i < ARITY; i++) {
        if (i < count && size[i] > 0) {
            leaf_count++;
            leaf_triangles += size[i];
        }
    }
    uint inner_count = count - leaf_count;

    // Nodes and triangles of the lanes before, in the halves of one word: a lane has at most 8 and 128.
    // One sum is also the way around NVIDIA's compiler (580.159), which for eight children made -1 of the sum
    // of nodes over a subgroup that had none.
    uint own = leaf_triangles << 16 | inner_count;
    uint before = subgroupExclusiveAdd(own);
    uint all = subgroupBroadcast(before + own, gl_SubgroupSize - 1);
    uint first_node, first_triangle;
    if (subgroupElect()) {
        first_node = atomicAdd(progress.nodes, all & 0xffff);
        first_triangle = atomicAdd(progress.triangles, all >> 16);
    }
    first_node = subgroupBroadcastFirst(first_node) + (before & 0xffff);
    first_triangle = subgroupBroadcastFirst(first_triangle) + (before >> 16);

    uint depth = 0;
    uint stack = 0;
    if (active_) {
        uint at = (WIDE_HEADER + ARITY) * index;
        // Of no children there is no first.
        wide.v[at + 0] = inner_count > 0 ? first_node : 0;
        wide.v[at + 1] = leaf_count > 0 ? first_triangle : 0;
        wide.v[at + 2] = count << 4 | leaf_count;
        wide.v[at + 3] = triangles;
        uint way = ways.v[index];
        way += (1u << 16) + (count - 1);
        depth = way >> 16;
        stack = way & 0xffffu;
        uint leaf = at + WIDE_HEADER;
        uint inner = leaf + leaf_count;
        uint next = first_node;
        [[unroll]] for (uint i = 0; i < ARITY; i++) {
            if (i < count) {
                if (size[i] > 0) {
                    wide.v[leaf++] = (size[i] - 1) << WIDE_COUNT_SHIFT | id[i];
                } else {
                    wide.v[inner++] = id[i];
                    ways.v[next++] = way;
                }
            }
        }
        // Whoever sees a task must see the way to it.
        memoryBarrierBuffer();
        next = first_node;
        [[unroll]] for (uint i = 0; i < ARITY; i++) {
            if (i < count && size[i] == 0) {
                tasks.v[next++] = id[i];
            }
        }
    }
    depth = subgroupMax(depth);
    stack = subgroupMax(stack);
    if (subgroupElect()) {
        if (depth > progress.depth) {
            atomicMax(progress.depth, depth);
        }
        if (stack + 1 > progress.stack) {
            atomicMax(progress.stack, stack + 1);  // one more entry marks the end
        }
    }
}
