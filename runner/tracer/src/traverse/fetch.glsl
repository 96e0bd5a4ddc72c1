// Statements of closest_hit.glsl: lanes without a ray take the next ones of the queue.
uvec4 idle = subgroupBallot(ray == MISS);
uint first;
if (subgroupElect()) {
    first = atomicAdd(queue.next, subgroupBallotBitCount(idle));
}
first = subgroupBroadcastFirst(first);
// Of subgroups that wait for each other, one may have to idle for as long as another works.
more = first < count && (QUOTA == 0 || steps < QUOTA / (BARRIER == 0 && END_STEPS == 0 ? 2 : 4));
uint index = first + subgroupBallotExclusiveBitCount(idle);
if (COUNT == RAYS) {
    fetches += step_of(lanes(ray == MISS && index < count));
}
if (ray == MISS && index < count) {
    ray = index;
#include "traverse/take_ray.glsl"
}
