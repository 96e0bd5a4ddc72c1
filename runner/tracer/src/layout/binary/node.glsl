// Tests a ray against the children of a node: see layout/binary/mod.rs.
#include "load.glsl"

const uint ALIGN = (STRIDE & 15) == 0 ? 16 : 8;

// What a kernel keeps of a ray for this layout.
const float PAD = EXACT_PAD;
// Iterations of the loops in `meet`, each with its last, empty one.
const uint MEET_STEPS = 0;

// The children, each with the distance at which the ray enters its box, or infinity where it misses; how
// many it hits is returned, how many there are is `tested`.
uint meet(uint64_t nodes, uint index, Slab slab, float t_min, float t_max, out float t[ARITY],
          out uint child[ARITY], out uint tested) {
    uint64_t at = nodes + uint64_t(index) * STRIDE;
    vec4 a = uintBitsToFloat(load4(at, ALIGN));
    vec4 b = uintBitsToFloat(load4(at + 16, ALIGN));
    vec4 c = uintBitsToFloat(load4(at + 32, ALIGN));
    uvec2 children = load2(at + 48, ALIGN);
    t[0] = enter(slab, a.xyz, vec3(a.w, b.xy), t_min, t_max);
    t[1] = enter(slab, vec3(b.zw, c.x), c.yzw, t_min, t_max);
    child[0] = children.x;
    child[1] = children.y;
    tested = 2;
    return (t[0] < INFINITY ? 1 : 0) + (t[1] < INFINITY ? 1 : 0);
}
