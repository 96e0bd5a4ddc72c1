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
    Costs costs;
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
    return lone_triangle(area_of(nodes.v[node], scale), costs);
}

void visit(uint index, uint leaves, float scale) {
    Bvh2Node node = nodes.v[index];
    Subtree l = subtree_of(node.lo_left.w, leaves, scale);
    Subtree r = subtree_of(node.hi_right.w, leaves, scale);
    bool root = index == 2 * leaves - 2;
    uvec4 decided = pack_subtree(join_subtrees(l, r, area_of(node, scale), root, BY_SIZE != 0, costs));
    subtrees.v[index - leaves] = decided;
}

#include "upwards.glsl"
