// What the collapse knows about the subtree of an inner node: see collapse/mod.rs.

#ifndef COLLAPSE_GLSL
#define COLLAPSE_GLSL

struct Subtree {
    // Expected cost of a ray that meets the scene, not divided by the scene's area.
    float cost;
    uint triangles;
    // Inner nodes after the collapse; 0 if this node became a leaf.
    uint inner;
    // Inner nodes on the longest way down, this one included; 0 if it became a leaf.
    uint height;
};

// One 16-byte load. Coherent, because one workgroup reads what it wrote a level before.
layout(buffer_reference, scalar, buffer_reference_align = 16) coherent buffer Subtrees {
    uvec4 v[];
};

Subtree unpack_subtree(uvec4 bits) {
    return Subtree(uintBitsToFloat(bits.x), bits.y, bits.z, bits.w);
}

uvec4 pack_subtree(Subtree s) {
    return uvec4(floatBitsToUint(s.cost), s.triangles, s.inner, s.height);
}

#endif
