// Tests a ray against the children of a node: see layout/compressed/mod.rs.
#include "load.glsl"
#extension GL_EXT_shader_explicit_arithmetic_types_int8 : require
layout(constant_id = 19) const uint EXPERIMENT = 0;

const uint ALIGN = (STRIDE & 15) == 0 ? 16 : ((STRIDE & 7) == 0 ? 8 : 4);

// What a kernel keeps of a ray for this layout. Two more roundings than exact boxes need: that of a node's
// origin along the ray, and that of what is added to it.
const float PAD = EXACT_PAD * 1.5;
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

// The hits of a node group in the upper byte and those of a triangle group in the others (Ylitie et al. 2017, 4.2
// and 4.3); `octinv` is 7 - octant. `t` are the distances at which the ray enters boxes that it meets.
//
// Planes are not decoded in space: along an axis of the ray they are crossed at distances
//     (origin + line * step) * inverse + bias = line * (step * inverse) + (origin * inverse + bias),
// one fused multiply-add a plane (equations 10 and 11), where `bias` widens the box by the pad.
#define BYTES_BY_LOGIC (EXPERIMENT & 1)
#define INT_MINMAX (EXPERIMENT & 2)
#define MASKS (EXPERIMENT & 4)
#define MIXED (EXPERIMENT & 8)
#define INT8 (EXPERIMENT & 16)

float line_of(uint word, uint k, bool logic) {
    if (logic) {
        if (INT8 != 0) {
            u8vec4 b = unpack8(word);
            return uintBitsToFloat(pack32(u8vec4(uint8_t(0), b[k], uint8_t(0), uint8_t(0x47))));
        }
        uint w = k == 0 ? word << 8 : word >> (8 * (k - 1));
        return uintBitsToFloat((w & 0xff00u) | 0x47000000u);
    }
    return float(word >> (8 * k) & 255);
}

uint meet(Compressed c, Slab slab, uint octinv, float t_min, float t_max, out float t[8]) {
    vec3 step_ = uintBitsToFloat(c.exponents << 23) * slab.inverse;
    bvec3 negative = lessThan(slab.inverse, vec3(0.0));
    vec3 near_bias = fma(c.origin, slab.inverse, mix(slab.lower, slab.upper, negative));
    vec3 far_bias = fma(c.origin, slab.inverse, mix(slab.upper, slab.lower, negative));
    vec3 near_bias2 = fma(step_, vec3(-32768.0), near_bias) - abs(step_) * 0.00390625;
    vec3 far_bias2 = fma(step_, vec3(-32768.0), far_bias) + abs(step_) * 0.00390625;
    uint met = 0;
    uint hits = 0;
    [[unroll]] for (uint four = 0; four < 2; four++) {
        uint meta4 = c.meta[four];
        uint is_inner4 = meta4 & (meta4 << 1) & 0x10101010u;
        uint inner_mask4 = (is_inner4 >> 4) * 0xffu;
        uint bit_index4 = (meta4 ^ (octinv * 0x01010101u & inner_mask4)) & 0x1f1f1f1fu;
        uint child_bits4 = meta4 >> 5 & 0x07070707u;
        uvec3 lo = uvec3(c.lo[0][four], c.lo[1][four], c.lo[2][four]);
        uvec3 hi = uvec3(c.hi[0][four], c.hi[1][four], c.hi[2][four]);
        uvec3 near_lines = mix(lo, hi, negative);
        uvec3 far_lines = mix(hi, lo, negative);
        [[unroll]] for (uint k = 0; k < 4; k++) {
            bool logic = BYTES_BY_LOGIC != 0 && (MIXED == 0 || (k == 1 || k == 2));
            vec3 nb = logic ? near_bias2 : near_bias;
            vec3 fb = logic ? far_bias2 : far_bias;
            vec3 near = fma(vec3(line_of(near_lines.x, k, logic), line_of(near_lines.y, k, logic), line_of(near_lines.z, k, logic)), step_, nb);
            vec3 far = fma(vec3(line_of(far_lines.x, k, logic), line_of(far_lines.y, k, logic), line_of(far_lines.z, k, logic)), step_, fb);
            bool hit;
            if (INT_MINMAX != 0) {
                ivec3 n = floatBitsToInt(near);
                ivec3 f = floatBitsToInt(far);
                int enters = max(max(max(n.x, n.y), n.z), floatBitsToInt(t_min));
                int leaves_at = min(min(min(f.x, f.y), f.z), floatBitsToInt(t_max));
                t[4 * four + k] = intBitsToFloat(enters);
                hit = enters <= leaves_at;
            } else {
                float enters = max(max(near.x, near.y), max(near.z, t_min));
                float leaves_at = min(min(far.x, far.y), min(far.z, t_max));
                t[4 * four + k] = enters;
                hit = enters <= leaves_at;
            }
            if (MASKS != 0) {
                hits |= hit ? 1 << (4 * four + k) : 0;
            } else if (hit) {
                met |= (child_bits4 >> (8 * k) & 255) << (bit_index4 >> (8 * k) & 255);
            }
        }
    }
    if (MASKS != 0) {
        uint inner = hits & c.imask;
        inner = (octinv & 1) != 0 ? (inner & 0x55) << 1 | (inner >> 1 & 0x55) : inner;
        inner = (octinv & 2) != 0 ? (inner & 0x33) << 2 | (inner >> 2 & 0x33) : inner;
        inner = (octinv & 4) != 0 ? (inner & 0x0f) << 4 | (inner >> 4 & 0x0f) : inner;
        met = inner << 24;
        uint leaves = hits & ~c.imask;
        while (leaves != 0) {
            uint k = findLSB(leaves);
            leaves &= leaves - 1;
            uint meta = (k < 4 ? c.meta[0] : c.meta[1]) >> (8 * (k & 3));
            met |= (meta >> 5 & 7) << (meta & 31);
        }
    }
    return met;
}
