// Tests a ray against the children of a node: see layout/reduced/mod.rs.
#include "load.glsl"

const uint ALIGN = (STRIDE & 15) == 0 ? 16 : 8;

// How much wider boxes are taken to be: planes are exact once they are rounded.
const float PAD = EXACT_PAD;
#include "ray_slab.glsl"

// Iterations of the loops in `meet`, each with its last, empty one.
const uint MEET_STEPS = 0;

// Triangles of the leaf with this second item, less one: items that are not 0, after the first.
uint further(uvec4 items) {
    uvec4 low = min(items & 0xffffu, uvec4(1));
    uvec4 high = min(items >> 16, uvec4(1));
    return low.x + low.y + low.z + high.x + high.y + high.z + high.w;
}

// The children, each with the distance at which the ray enters its box, or infinity where it misses; how
// many it hits is returned, how many there are is `tested`. A node is known by its tag, the root by 0.
uint meet(uint64_t nodes, uint tag, Slab slab, float t_min, float t_max, out float t[ARITY],
          out uint child[ARITY], out uint tested) {
    if (tag == 0) {
        tag = Words1(nodes).v[3];
    }
    uint64_t at = nodes + uint64_t(tag & 0x3fffffffu) * STRIDE;
    uint64_t beside = at + ((tag & 0x40000000u) != 0 ? 2 * STRIDE : STRIDE);
    uint hits = 0;
    [[unroll]] for (uint slot = 0; slot < 2; slot++) {
        uvec4 item = load4(at, ALIGN);
        vec2 x = unpackHalf2x16(item.x), y = unpackHalf2x16(item.y), z = unpackHalf2x16(item.z);
        t[slot] = enter(slab, vec3(x.x, y.x, z.x), vec3(x.y, y.y, z.y), t_min, t_max);
        child[slot] = item.w;
        if (t[slot] < INFINITY) {
            hits++;
            if (int(item.w) < 0) {
                child[slot] |= further(load4(at + STRIDE, ALIGN)) << 27;
            }
        }
        at = beside;
    }
    tested = 2;
    return hits;
}
