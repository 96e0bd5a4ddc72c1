// Axis-aligned boxes.
//
// Sums and products are `precise`, so that no compiler fuses them: the CPU twins compute the same bits,
// and a tree is the same on every device.

#ifndef BOX_GLSL
#define BOX_GLSL

struct Box {
    vec3 lo;
    vec3 hi;
};

Box box_union(Box a, Box b) {
    return Box(min(a.lo, b.lo), max(a.hi, b.hi));
}

// Half the surface area of a box whose edges are first multiplied by `scale`.
//
// The scale is the scene's (see scene_bounds.glsl). With edges of about one at most, neither a scene of
// 1e18 units nor one of 1e-18 leaves the range of a float when edges are multiplied.
float box_half_area(vec3 lo, vec3 hi, float scale) {
    precise vec3 e = (hi - lo) * scale;
    precise float area = e.x * e.y + e.y * e.z + e.z * e.x;
    return area;
}

#endif
