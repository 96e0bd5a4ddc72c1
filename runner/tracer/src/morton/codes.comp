#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "scene_bounds.glsl"
#include "input.glsl"

// The Morton code of each triangle: the bits of its centre's grid cell, interleaved as …x1y1z1x0y0z0.

layout(local_size_x_id = 0) in;
// Bits an axis, 1 to 21.
layout(constant_id = 1) const uint BITS = 10;
// 32-bit words a key: 1 up to 10 bits an axis, else 2.
layout(constant_id = 2) const uint WORDS = 1;

layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer Keys {
    uint v[];
};

layout(push_constant, scalar) uniform Push {
    Triangles triangles;
    SceneBounds bounds;
    Keys keys;
    uint count;
};

// Ten bits apart by two zeros each, by moving ever smaller halves:
//   ......................9876543210
//   ......98..............76543210
//   ......98........7654....3210      and so on.
uint spread(uint x) {
    x &= 0x3ff;
    x = (x | x << 16) & 0x030000ff;
    x = (x | x << 8) & 0x0300f00f;
    x = (x | x << 4) & 0x030c30c3;
    x = (x | x << 2) & 0x09249249;
    return x;
}

uint interleave(uvec3 cell) {
    return spread(cell.x) << 2 | spread(cell.y) << 1 | spread(cell.z);
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= count) {
        return;
    }
    vec3 lo = floats_from_ordered(bounds.centroid_lo, 0);
    vec3 hi = floats_from_ordered(bounds.centroid_hi_inverted, ~0u);
    vec3 center = box_center(triangle_box(triangles.v[i]));
    // Cells are cubes whose edge is a power of two: no division, whose last bits differ between devices,
    // and the grid follows the scene's scale. The longest axis covers between half of the grid and all of
    // it. Halves, because hi - lo may not fit a float.
    vec3 extent = 0.5 * hi - 0.5 * lo;
    uint exponent = floatBitsToUint(max(extent.x, max(extent.y, extent.z))) >> 23;
    float to_grid = exponent == 0 ? 0.0 : uintBitsToFloat((253 - min(exponent, 252)) << 23);
    precise vec3 unit = (0.5 * center - 0.5 * lo) * to_grid;
    uvec3 cell = uvec3(clamp(unit * float(1u << BITS), vec3(0.0), vec3(float((1u << BITS) - 1))));

    uint low = interleave(cell);
    if (WORDS == 1) {
        keys.v[i] = low;
    } else {
        uint middle = interleave(cell >> 10);
        uint high = interleave(cell >> 20);
        keys.v[2 * i] = low | middle << 30;
        keys.v[2 * i + 1] = middle >> 2 | high << 28;
    }
}
