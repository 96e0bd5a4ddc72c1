// The binary tree that builders make: see bvh2.rs.

#ifndef BVH2_GLSL
#define BVH2_GLSL

#include "box.glsl"

// Two 16-byte loads: (lo.xyz, left) and (hi.xyz, right), both as bits, because the indices must not pass
// through floating-point registers that flush denormals.
struct Bvh2Node {
    uvec4 lo_left;
    uvec4 hi_right;
};

const uint BVH2_LEAF = 0xffffffffu;

layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Bvh2Nodes {
    Bvh2Node v[];
};

Box bvh2_box(Bvh2Node node) {
    return Box(uintBitsToFloat(node.lo_left.xyz), uintBitsToFloat(node.hi_right.xyz));
}

Bvh2Node bvh2_node(Box box, uint left, uint right) {
    return Bvh2Node(uvec4(floatBitsToUint(box.lo), left), uvec4(floatBitsToUint(box.hi), right));
}

#endif
