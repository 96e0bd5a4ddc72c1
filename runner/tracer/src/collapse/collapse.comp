#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "bvh2.glsl"
#include "collapse.glsl"
#include "levels.glsl"
#include "scene_bounds.glsl"

// Bottom up, a level a dispatch: is a node cheaper as a leaf of all its triangles?

layout(local_size_x_id = 0) in;
// Whether all that is small enough becomes a leaf.
layout(constant_id = 1) const uint BY_SIZE = 0;

layout(push_constant, scalar) uniform Push {
    Bvh2Nodes nodes;
    Levels levels;
    Subtrees subtrees;
    SceneBounds bounds;
    float traversal_cost;
    float intersection_cost;
    uint max_leaf;
    uint level;  // see upwards.glsl
};

float area_of(Bvh2Node node, float scale) {
    Box box = bvh2_box(node);
    return box_half_area(box.lo, box.hi, scale);
}

Subtree subtree_of(uint node, uint leaves, float scale) {
    if (node >= leaves) {
        return unpack_subtree(subtrees.v[node - leaves]);
    }
    precise float cost = intersection_cost * area_of(nodes.v[node], scale);
    return Subtree(cost, 1, 0, 0);
}

void visit(uint index, uint leaves, float scale) {
    Bvh2Node node = nodes.v[index];
    float area = area_of(node, scale);
    Subtree l = subtree_of(node.lo_left.w, leaves, scale);
    Subtree r = subtree_of(node.hi_right.w, leaves, scale);
    uint triangles = l.triangles + r.triangles;
    precise float as_inner = traversal_cost * area + (l.cost + r.cost);
    precise float as_leaf = intersection_cost * area * float(triangles);
    Subtree result = Subtree(as_inner, triangles, 1 + l.inner + r.inner, 1 + max(l.height, r.height));
    // The root stays: layouts keep a child's box in its parent, so there has to be one.
    bool root = index == 2 * leaves - 2;
    if (triangles <= max_leaf && (BY_SIZE != 0 || as_leaf <= as_inner) && !root) {
        result = Subtree(as_leaf, triangles, 0, 0);
    }
    subtrees.v[index - leaves] = pack_subtree(result);
}

#include "upwards.glsl"
