// Statements of closest_hits.glsl: the lanes of a subgroup test the triangles of all their rays together, so that few
// lanes are idle, whichever rays the triangles are of. Pairs of a triangle and the lane that has its ray are written to
// shared memory, then every lane takes one, borrows the ray, and tells the ray's lane of a hit. Pairs that would leave
// most lanes idle may be left over for the next turn (LEAST_PAIRS): their place is a ring, in which `tested` pairs have
// gone and `left_over` are next.
const uint ring = gl_SubgroupID * PAIRS;
for (;;) {
    uint own = bitCount(triangles.y);
    // A sum over lanes before, spelled out: in a loop, some compilers make one that minds lanes which have left.
    uint sum = own;
    [[unroll]] for (uint d = 1; d < gl_SubgroupSize; d *= 2) {
        uint others = subgroupShuffle(sum, gl_SubgroupInvocationID - d);
        sum += gl_SubgroupInvocationID >= d ? others : 0;
    }
    uint at = sum - own;
    uint all = subgroupShuffle(sum, gl_SubgroupSize - 1);
    steps += 32;  // most triangles of a group, and the rounds below
    // What finds no room waits.
    uint room = PAIRS - left_over;
    at += left_over;
    while (triangles.y != 0 && at < PAIRS) {
        shared_pairs[ring + (tested + at) % PAIRS] =
            uvec2(triangles.x + findLSB(triangles.y), gl_SubgroupInvocationID);
        triangles.y &= triangles.y - 1;
        triangles_tested++;
        at++;
    }
    if (own != 0) {
        queued_own = tested + at;
    }
    subgroupMemoryBarrierShared();
    subgroupBarrier();
    uint pairs = left_over + min(all, room);
    if (LEAST_PAIRS > 1) {
        // Too few are left over for more to come; those that did not come in this turn are not waited for.
        left_over = pairs % gl_SubgroupSize;
        left_over = left_over < LEAST_PAIRS && all > 0 && all <= room ? left_over : 0;
        pairs -= left_over;
    }
    for (uint first_pair = 0; first_pair < pairs; first_pair += gl_SubgroupSize) {
        uint its = first_pair + gl_SubgroupInvocationID;
        bool testing = its < pairs;
        uvec2 pair = shared_pairs[ring + (tested + min(its, pairs - 1)) % PAIRS];
        if (COUNT == RAYS) {
            triangle_steps += step_of(lanes(testing));
        }
        float t_max = subgroupShuffle(best.t, pair.y);
        Hit found_by_lane = Hit(t_max, MISS);
        {
            uint index = pair.x;
            uint ray = subgroupShuffle(ray, pair.y);
            vec3 origin = subgroupShuffle(origin, pair.y);
            float t_min = subgroupShuffle(t_min, pair.y);
            Shear shear = Shear(subgroupShuffle(shear.shear, pair.y),
                                TRIANGLE_TEST == WATERTIGHT ? subgroupShuffle(shear.axis, pair.y) : 0);
            Hit best = found_by_lane;
            uint triangles_tested = 0;
            bool uncertain = false;
            if (testing) {
#include "traverse/meet_triangle.glsl"
            }
            found_by_lane = best;
            if (QUOTA != 0) {
                steps += subgroupAny(uncertain) ? 3 : 0;  // the loop in exact_distance
            }
        }
        bool hit = found_by_lane.triangle != MISS;
        if (subgroupAny(hit)) {
            // Of the hits of one ray, the nearest; floats are in the order of these integers.
            uint of = gl_SubgroupID * gl_SubgroupSize + pair.y;
            int key = floatBitsToInt(found_by_lane.t);
            key ^= key >> 31 & 0x7fffffff;
            if (hit) {
                atomicMin(shared_nearest[of], key);
            }
            subgroupMemoryBarrierShared();
            subgroupBarrier();
            if (hit && shared_nearest[of] == key) {
                shared_winner[of] = found_by_lane.triangle;
            }
            subgroupMemoryBarrierShared();
            subgroupBarrier();
            uint mine = gl_SubgroupID * gl_SubgroupSize + gl_SubgroupInvocationID;
            int nearest = shared_nearest[mine];
            if (nearest != NO_HIT) {
                best = Hit(intBitsToFloat(nearest ^ (nearest >> 31 & 0x7fffffff)), shared_winner[mine]);
                shared_nearest[mine] = NO_HIT;
            }
        }
        // Before pairs and hits are written again.
        subgroupMemoryBarrierShared();
        subgroupBarrier();
    }
    tested += LEAST_PAIRS > 1 ? pairs : 0;
    if (all <= room) {
        break;
    }
}
