// Writes a triangle as the test of the traversal wants it: see LeafTriangles in layout/triangles.rs.
#ifndef LEAF_TRIANGLE_GLSL
#define LEAF_TRIANGLE_GLSL

#include "input.glsl"
#include "layout/unit_triangle.glsl"

// What triangles are stored as: `TriangleFormat` in traverse/triangle.rs. With MAPS, indices lie apart.
layout(constant_id = 1) const uint FORMAT = 0;
const uint CORNERS = 0, EDGES = 1, MAPS = 2;

layout(buffer_reference, scalar, buffer_reference_align = 16) writeonly buffer LeafTriangles {
    uvec4 v[];
};

layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer Indices {
    uint items[];
};

// The triangle `primitive` of the scene, to a place in leaf order.
void write_triangle(LeafTriangles to, Indices indices, uint place, Triangle t, uint primitive) {
    uint at = 3 * place;
    if (FORMAT == MAPS) {
        UnitTriangle map = unit_triangle(t.a, t.b, t.c);
        to.v[at + 0] = floatBitsToUint(map.z);
        to.v[at + 1] = floatBitsToUint(map.u);
        to.v[at + 2] = floatBitsToUint(map.v);
        indices.items[place] = primitive;
        return;
    }
    to.v[at + 0] = uvec4(floatBitsToUint(t.a), primitive);
    if (FORMAT == EDGES) {
        // As the twin has it, to the last bit.
        precise vec3 e1 = t.b - t.a, e2 = t.c - t.a;
        precise float x = e1.y * e2.z - e1.z * e2.y;
        precise float y = e1.z * e2.x - e1.x * e2.z;
        to.v[at + 1] = floatBitsToUint(vec4(e1, x));
        to.v[at + 2] = floatBitsToUint(vec4(e2, y));
        return;
    }
    to.v[at + 1] = uvec4(floatBitsToUint(t.b), 0);
    to.v[at + 2] = uvec4(floatBitsToUint(t.c), 0);
}

#endif
