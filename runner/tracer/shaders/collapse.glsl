// What the collapse knows about the subtree of an inner node: see collapse/mod.rs.

#ifndef COLLAPSE_GLSL
#define COLLAPSE_GLSL

#include "box.glsl"

struct Subtree {
    // Expected cost of a ray that meets the scene, not divided by the scene's area.
    float cost;
    uint triangles;
    // Inner nodes after the collapse; 0 if this node became a leaf.
    uint inner;
    // Inner nodes on the longest way down, this one included; 0 if it became a leaf.
    uint height;
    // The same before the collapse.
    uint levels;
};

// What decides.
struct Costs {
    float traversal;
    float intersection;
    uint max_leaf;
};

// One 16-byte load. Coherent, because one workgroup reads what it wrote a level before.
layout(buffer_reference, scalar, buffer_reference_align = 16) coherent buffer Subtrees {
    uvec4 v[];
};

Subtree unpack_subtree(uvec4 bits) {
    return Subtree(uintBitsToFloat(bits.x), bits.y, bits.z, bits.w & 0xffff, bits.w >> 16);
}

uvec4 pack_subtree(Subtree s) {
    return uvec4(floatBitsToUint(s.cost), s.triangles, s.inner, s.height | s.levels << 16);
}

// Of a leaf of the binary tree, whose box has half an area of `area`.
Subtree lone_triangle(float area, Costs costs) {
    precise float cost = costs.intersection * area;
    return Subtree(cost, 1, 0, 0, 0);
}

// Of a node with two children: is it cheaper as a leaf of all their triangles, or is it one whatever it costs, `by_size`?
// The root stays, because layouts keep a child's box in its parent, so there has to be one.
Subtree join_subtrees(Subtree l, Subtree r, float area, bool root, bool by_size, Costs costs) {
    uint triangles = l.triangles + r.triangles;
    uint levels = 1 + max(l.levels, r.levels);
    precise float as_inner = costs.traversal * area + (l.cost + r.cost);
    precise float as_leaf = costs.intersection * area * float(triangles);
    if (triangles <= costs.max_leaf && (by_size || as_leaf <= as_inner) && !root) {
        return Subtree(as_leaf, triangles, 0, 0, levels);
    }
    return Subtree(as_inner, triangles, 1 + l.inner + r.inner, 1 + max(l.height, r.height), levels);
}

#endif
