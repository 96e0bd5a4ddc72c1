// Tests a ray against the children of a node: see layout/direct/mod.rs.
#include "load.glsl"

const uint ALIGN = (STRIDE & 15) == 0 ? 16 : 8;

// How much wider boxes are taken to be.
const float PAD = EXACT_PAD;
#include "ray_slab.glsl"

// Iterations of the loops in `meet`, each with its last, empty one.
const uint MEET_STEPS = 0;

// The children, each with the distance at which the ray enters its box, or infinity where it misses; how
// many it hits is returned, how many there are is `tested`. A node is known by its first child, the root by 0.
uint meet(uint64_t nodes, uint index, Slab slab, float t_min, float t_max, out float t[ARITY],
          out uint child[ARITY], out uint tested) {
    uint64_t at = nodes + uint64_t(max(index, 1)) * STRIDE;
    uint hits = 0;
    [[unroll]] for (uint slot = 0; slot < 2; slot++) {
        // fst, snd, minima.xy; minima.z, item_idx, maxima.xy; maxima.z, item_count.
        uvec4 a = load4(at, ALIGN);
        uvec4 b = load4(at + 16, ALIGN);
        uvec2 c = load2(at + 32, ALIGN);
        vec3 minima = uintBitsToFloat(uvec3(a.zw, b.x));
        vec3 maxima = uintBitsToFloat(uvec3(b.zw, c.x));
        t[slot] = enter(slab, minima, maxima, t_min, t_max);
        child[slot] = c.y == 0 ? a.x : LEAF_BIT | (c.y - 1) << 27 | b.y;
        hits += t[slot] < INFINITY ? 1 : 0;
        at += STRIDE;
    }
    tested = 2;
    return hits;
}
