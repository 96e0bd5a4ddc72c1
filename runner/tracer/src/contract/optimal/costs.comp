#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_GOOGLE_include_directive : require
#include "bvh2.glsl"
#include "collapse.glsl"
#include "levels.glsl"
#include "plans.glsl"
#include "scene_bounds.glsl"

// Bottom up, the least cost of each subtree as a forest of so many wide trees: see contract/optimal/mod.rs.

layout(local_size_x_id = 0) in;

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Order {
    uint v[];
};

layout(push_constant, scalar) uniform Push {
    Bvh2Nodes nodes;
    Levels levels;
    Subtrees subtrees;
    SceneBounds bounds;
    Plans plans;
    Order order;  // 0 where the tree has levels
    float node_cost;
    float triangle_cost;
    uint max_leaf;
    uint level;  // see upwards.glsl
};

float area_of(uint node, float scale) {
    Box box = bvh2_box(nodes.v[node]);
    return box_half_area(box.lo, box.hi, scale);
}

// As a forest of up to 1, 2, … ARITY - 1 trees.
float[ARITY - 1] costs_of(uint node, uint leaves, float scale) {
    float costs[ARITY - 1];
    if (node >= leaves) {
        [[unroll]] for (uint i = 0; i < ARITY - 1; i++) {
            costs[i] = uintBitsToFloat(plans.v[ARITY * (node - leaves) + i]);
        }
    } else {
        precise float alone = triangle_cost * area_of(node, scale);
        [[unroll]] for (uint i = 0; i < ARITY - 1; i++) {
            costs[i] = alone;
        }
    }
    return costs;
}

void visit(uint index, uint leaves, float scale) {
    Bvh2Node node = nodes.v[index];
    float l[ARITY - 1] = costs_of(node.lo_left.w, leaves, scale);
    float r[ARITY - 1] = costs_of(node.hi_right.w, leaves, scale);
    // Equation 8, for up to 2, 3, … ARITY roots: of equals the fewest on the left.
    float distributed[ARITY - 1];
    uint left[ARITY - 1];
    [[unroll]] for (uint roots = 2; roots <= ARITY; roots++) {
        float best = uintBitsToFloat(0x7f800000);
        uint chosen = 1;
        [[unroll]] for (uint k = 1; k < roots; k++) {
            precise float cost = l[k - 1] + r[roots - k - 1];
            if (cost < best) {
                best = cost;
                chosen = k;
            }
        }
        distributed[roots - 2] = best;
        left[roots - 2] = chosen;
    }
    float area = area_of(index, scale);
    uint triangles = unpack_subtree(subtrees.v[index - leaves]).triangles;
    // Equations 6 and 7.
    precise float as_inner = distributed[ARITY - 2] + node_cost * area;
    precise float as_leaf = triangle_cost * area * float(triangles);
    bool leaf = triangles <= max_leaf && as_leaf <= as_inner;
    // Equation 5.
    uint decisions = (leaf ? PLAN_LEAF : 0) | left[ARITY - 2] << (3 * (ARITY - 2));
    float cost = leaf ? as_leaf : as_inner;
    uint at = ARITY * (index - leaves);
    plans.v[at] = floatBitsToUint(cost);
    [[unroll]] for (uint roots = 2; roots < ARITY; roots++) {
        if (distributed[roots - 2] < cost) {
            cost = distributed[roots - 2];
            decisions |= left[roots - 2] << (3 * (roots - 2));
        }
        plans.v[at + roots - 1] = floatBitsToUint(cost);
    }
    plans.v[at + ARITY - 1] = decisions;
}

#define ORDERED
uint ordered(uint at, uint leaves) {
    return uint64_t(order) == 0 ? at : order.v[at - leaves];
}

#include "upwards.glsl"
