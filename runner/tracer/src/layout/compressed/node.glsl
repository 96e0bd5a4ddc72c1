// Tests a ray against the children of a node: see layout/compressed/mod.rs.
#include "load.glsl"
#include "slab.glsl"

const uint ALIGN = (STRIDE & 15) == 0 ? 16 : ((STRIDE & 7) == 0 ? 8 : 4);

// What a kernel keeps of a ray for this layout. Two more roundings than exact boxes need: that of a node's
// origin along the ray, and that of what is added to it.
const float PAD = EXACT_PAD * 1.5;
#define RaySlab OrderedSlab

RaySlab slab_of_ray(vec3 origin, vec3 direction, float extent) {
    return ordered_slab_of(slab_of(origin, direction, extent, PAD));
}

// Iterations of the loops in `meet` and in visit.glsl, each with its last, empty one.
const uint NODE_STEPS = 1 + 2 * 5 + 8 * 9;

// A node as it is loaded; planes are words of four children, those of slots 0 to 3 first.
struct Compressed {
    vec3 origin;
    uvec3 exponents;
    uint imask;
    uint first_node;
    uint first_triangle;
    uint meta[2];
    uint lo[3][2];
    uint hi[3][2];
};

Compressed load_compressed(uint64_t nodes, uint index) {
    uint64_t at = nodes + uint64_t(index) * STRIDE;
    uvec4 a = load4(at, ALIGN);
    uvec4 b = load4(at + 16, ALIGN);
    uvec4 c = load4(at + 32, ALIGN);
    uvec4 d = load4(at + 48, ALIGN);
    uvec4 e = load4(at + 64, ALIGN);
    return Compressed(uintBitsToFloat(a.xyz), uvec3(a.w & 255, a.w >> 8 & 255, a.w >> 16 & 255), a.w >> 24, b.x, b.y,
                      uint[2](b.z, b.w), uint[3][2](uint[2](c.x, c.y), uint[2](c.z, c.w), uint[2](d.x, d.y)),
                      uint[3][2](uint[2](d.z, d.w), uint[2](e.x, e.y), uint[2](e.z, e.w)));
}

// How many slots hold something.
uint children_of(Compressed c) {
    uint children = 0;
    [[unroll]] for (uint i = 0; i < 8; i++) {
        children += (c.meta[i / 4] >> (8 * (i & 3)) & 255) != 0 ? 1 : 0;
    }
    return children;
}

// A byte in bits 8 to 15 of a float whose other bits are those of LINE_OFFSET adds itself to that.
const float LINE_OFFSET = 32768.0;

vec3 lines_by_logic(uvec3 words, uint k) {
    uvec3 placed = k == 0 ? words << 8 : words >> (8 * (k - 1));
    return uintBitsToFloat(placed & 0xff00u | floatBitsToUint(LINE_OFFSET));
}

// The hits of a node group in the upper byte and those of a triangle group in the others (Ylitie et al. 2017, 4.2
// and 4.3); `octinv` is 7 - octant. `t` are the distances at which the ray enters boxes that it meets.
//
// Planes are not decoded in space: along an axis of the ray they are crossed at distances
//     (origin + line * step) * inverse + bias = line * (step * inverse) + (origin * inverse + bias),
// one fused multiply-add a plane (equations 10 and 11), where `bias` widens the box by the pad.
uint meet(Compressed c, RaySlab slab, uint octinv, float t_min, float t_max, out float t[8]) {
    vec3 step_ = uintBitsToFloat(c.exponents << 23) * slab.inverse;
    bvec3 negative = lessThan(slab.inverse, vec3(0.0));
    vec3 near_bias = fma(c.origin, slab.inverse, slab.near);
    vec3 far_bias = fma(c.origin, slab.inverse, slab.far);
    // Of lines that are LINE_OFFSET too large. What rounding makes of that is worth 1/512 of a step at most.
    vec3 loss = abs(step_) * 0.00390625;
    vec3 near_bias_of_offset = fma(step_, vec3(-LINE_OFFSET), near_bias) - loss;
    vec3 far_bias_of_offset = fma(step_, vec3(-LINE_OFFSET), far_bias) + loss;
    uint met = 0;
    // Four children at a time, a byte each.
    [[unroll]] for (uint four = 0; four < 2; four++) {
        uint meta4 = c.meta[four];
        // Bits 3 and 4 are set of nodes only, whose slots are told plus 24.
        uint is_inner4 = meta4 & (meta4 << 1) & 0x10101010u;
        uint inner_mask4 = (is_inner4 >> 4) * 0xffu;
        uint bit_index4 = (meta4 ^ (octinv * 0x01010101u & inner_mask4)) & 0x1f1f1f1fu;
        uint child_bits4 = meta4 >> 5 & 0x07070707u;
        uvec3 lo = uvec3(c.lo[0][four], c.lo[1][four], c.lo[2][four]);
        uvec3 hi = uvec3(c.hi[0][four], c.hi[1][four], c.hi[2][four]);
        uvec3 near_lines = mix(lo, hi, negative);
        uvec3 far_lines = mix(hi, lo, negative);
        [[unroll]] for (uint k = 0; k < 4; k++) {
            // Devices convert bytes at a fraction of the rate of arithmetic, and have less room for logic: half each.
            bool by_logic = k == 1 || k == 2;
            vec3 near = fma(by_logic ? lines_by_logic(near_lines, k) : vec3(near_lines >> (8 * k) & 255), step_,
                            by_logic ? near_bias_of_offset : near_bias);
            vec3 far = fma(by_logic ? lines_by_logic(far_lines, k) : vec3(far_lines >> (8 * k) & 255), step_,
                           by_logic ? far_bias_of_offset : far_bias);
            // What is before t_min counts as met.
            int enters = last_entry(near);
            t[4 * four + k] = max(intBitsToFloat(enters), t_min);
            if (enters <= first_exit(far, t_max)) {
                met |= (child_bits4 >> (8 * k) & 255) << (bit_index4 >> (8 * k) & 255);
            }
        }
    }
    return met;
}
