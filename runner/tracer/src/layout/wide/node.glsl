// Tests a ray against the children of a node: see layout/wide/mod.rs.
#include "load.glsl"

const uint ALIGN = (STRIDE & 15) == 0 ? 16 : 8;

// How much wider boxes are taken to be.
const float PAD = EXACT_PAD;
#include "ray_slab.glsl"

// Iterations of the loops in `meet`, each with its last, empty one.
const uint MEET_STEPS = ARITY / 2 + 1;

// Two boxes, 48 bytes.
struct Pair {
    vec4 a;  // lo0.xyz hi0.x
    vec4 b;  // hi0.yz lo1.xy
    vec4 c;  // lo1.z hi1.xyz
};

Pair load_pair(uint64_t at) {
    return Pair(uintBitsToFloat(load4(at, ALIGN)), uintBitsToFloat(load4(at + 16, ALIGN)),
                uintBitsToFloat(load4(at + 32, ALIGN)));
}

// One child's box.
void load_box(uint64_t nodes, uint index, uint slot, out vec3 lo, out vec3 hi) {
    uint64_t at = nodes + uint64_t(index) * STRIDE + 24 * slot;
    vec2 a = uintBitsToFloat(load2(at, 8)), b = uintBitsToFloat(load2(at + 8, 8)), c = uintBitsToFloat(load2(at + 16, 8));
    lo = vec3(a, b.x);
    hi = vec3(b.y, c);
}

// What one child is.
uint load_link(uint64_t nodes, uint index, uint slot) {
    return Words1(nodes + uint64_t(index) * STRIDE + 24 * ARITY + 4 * slot).v[0];
}

// The children, each with the distance at which the ray enters its box, or infinity where it misses; how
// many it hits is returned, how many there are is `tested`.
//
// Boxes are loaded one pair ahead of the one that is tested (thesis 4.4), and none that are absent.
uint meet(uint64_t nodes, uint index, Slab slab, float t_min, float t_max, out float t[ARITY],
          out uint child[ARITY], out uint tested) {
    uint64_t at = nodes + uint64_t(index) * STRIDE;
    Pair next = load_pair(at);
    uint64_t links = at + 24 * ARITY;
    uint count = Words1(links + 4 * ARITY).v[0];
    uint hits = 0;
    [[unroll]] for (uint i = 0; i < ARITY; i += 2) {
        Pair pair = next;
        if (i + 2 < ARITY) {
            if (i + 2 < count) {
                next = load_pair(at + 24 * (i + 2));
            }
        }
        t[i] = INFINITY;
        t[i + 1] = INFINITY;
        if (i < count) {
            // A pair's second box may be absent: then it is a point at infinity, which is missed.
            t[i] = enter(slab, pair.a.xyz, vec3(pair.a.w, pair.b.xy), t_min, t_max);
            t[i + 1] = enter(slab, vec3(pair.b.zw, pair.c.x), pair.c.yzw, t_min, t_max);
        }
        hits += (t[i] < INFINITY ? 1 : 0) + (t[i + 1] < INFINITY ? 1 : 0);
        uvec2 two = load2(links + 4 * i, 8);
        child[i] = two.x;
        child[i + 1] = two.y;
    }
    tested = count;
    return hits;
}
