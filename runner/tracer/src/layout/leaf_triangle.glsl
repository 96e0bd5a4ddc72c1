// Writes a triangle as the test of the traversal wants it: see LeafTriangles in layout/triangles.rs.
#ifndef LEAF_TRIANGLE_GLSL
#define LEAF_TRIANGLE_GLSL

#include "input.glsl"
#include "layout/unit_triangle.glsl"

// Whether triangles are stored as maps to the unit triangle, with their indices apart.
layout(constant_id = 1) const uint MAPS = 0;

layout(buffer_reference, scalar, buffer_reference_align = 16) writeonly buffer LeafTriangles {
    uvec4 v[];
};

layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer Indices {
    uint items[];
};

// The triangle `primitive` of the scene, to a place in leaf order.
void write_triangle(LeafTriangles to, Indices indices, uint place, Triangle t, uint primitive) {
    uint at = 3 * place;
    if (MAPS != 0) {
        UnitTriangle map = unit_triangle(t.a, t.b, t.c);
        to.v[at + 0] = floatBitsToUint(map.z);
        to.v[at + 1] = floatBitsToUint(map.u);
        to.v[at + 2] = floatBitsToUint(map.v);
        indices.items[place] = primitive;
        return;
    }
    to.v[at + 0] = uvec4(floatBitsToUint(t.a), primitive);
    to.v[at + 1] = uvec4(floatBitsToUint(t.b), 0);
    to.v[at + 2] = uvec4(floatBitsToUint(t.c), 0);
}

#endif
