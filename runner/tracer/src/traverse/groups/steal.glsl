// Statements of turn.glsl: lanes without a ray take over what others have on their stacks, so that the last rays of a
// wavefront do not take as long as a lane alone needs for the longest of them.
//
// A lane looks at one other a turn, each turn at another, and the two look at each other, so that nobody gives twice. What
// is taken is the top of the stack: the nearest that is left. Of a ray that is divided, every lane hands in what it has
// found (finish_divided.glsl).
turn++;
uint partner = gl_SubgroupInvocationID ^ (turn & (gl_SubgroupSize - 1));
const uint POOR = 0, IDLE = 1, RICH = 2;
uint own = ray == MISS ? IDLE : (top > 0 ? RICH : POOR);
uint its = subgroupShuffle(own, partner);
bool takes = own == IDLE && its == RICH;
if (subgroupAny(takes)) {
    uvec2 entry = uvec2(0);
    if (own == RICH && its == IDLE) {
        POP(entry)
        if (!divided) {
            divided = true;
            hits.items[ray] = Hit(INFINITY, MISS);
            if (COUNT == RAYS) {
                tree.counts.items[ray] = uvec4(0);
            }
        }
    }
    subgroupMemoryBarrierBuffer();
    uint taken = subgroupShuffle(ray, partner);
    float t_max = subgroupShuffle(best.t, partner);
    entry = subgroupShuffle(entry, partner);
    if (takes) {
        ray = taken;
#include "traverse/take_ray.glsl"
        best.t = t_max;
        group = entry;
        divided = true;
        helps = true;
    }
}
