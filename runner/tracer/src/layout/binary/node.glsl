// Tests a ray against the children of a node: see layout/binary/mod.rs.
#include "load.glsl"

const uint ALIGN = (STRIDE & 15) == 0 ? 16 : 8;

// What a kernel keeps of a ray for this layout.
const float PAD = EXACT_PAD;
// Iterations of loops for a node.
const uint MEET_STEPS = 0;

#if defined(BY_OCTANT)
#define RaySlab OrderedSlab

RaySlab slab_of_ray(vec3 origin, vec3 direction, float extent) {
    return ordered_slab_of(slab_of(origin, direction, extent, PAD));
}
#define MEETS(lo, hi, enters) meets_in_octant(slab, OCTANT, lo, hi, best.t, enters)
#else
#define RaySlab SignedSlab

RaySlab slab_of_ray(vec3 origin, vec3 direction, float extent) {
    return signed_slab_of(slab_of(origin, direction, extent, PAD));
}
#define MEETS(lo, hi, enters) meets(slab, lo, hi, t_min, best.t, enters)
#endif

// A node as it is loaded.
struct BinaryNode {
    vec3 lo[2];
    vec3 hi[2];
    uvec2 child;
};

BinaryNode load_binary(uint64_t nodes, uint index) {
    uint64_t at = nodes + uint64_t(index) * STRIDE;
    vec4 a = uintBitsToFloat(load4(at, ALIGN));
    vec4 b = uintBitsToFloat(load4(at + 16, ALIGN));
    vec4 c = uintBitsToFloat(load4(at + 32, ALIGN));
    uvec2 child = load2(at + 48, ALIGN);
    return BinaryNode(vec3[2](a.xyz, vec3(b.zw, c.x)), vec3[2](vec3(a.w, b.xy), c.yzw), child);
}
