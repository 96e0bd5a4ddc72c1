// Statements of closest_hit.glsl: a turn of nodes and triangles, where all rays point into OCTANT. What is chosen by octants goes
// on until so many lanes have no ray that they fetch new ones, or the subgroup leaves; in other kernels, compilers make more of
// a single loop.
for (;;) {
#include "traverse/search.glsl"
    if (BARRIER != 0) {
        bool late = QUOTA != 0 && steps > QUOTA;
        if (subgroupElect() && (late || busy == 0 && told < 2)) {
            atomicAdd(leaving[turn & 1], late ? ALL : 1);
        }
        told += busy == 0 ? 1 : 0;
        barrier();
        if (leaving[turn & 1] >= gl_NumSubgroups) {
            leaves = true;
            break;
        }
        turn++;
    }
    // Triangles, of the leaf and of another one where that comes next.
    for (;;) {
        uint testing = lanes(HAS_LEAF);
        if (testing == 0 || (testing <= POSTPONE && subgroupAny(LOOKS_FOR_LEAF))) {
            break;
        }
        steps++;
        if (COUNT == RAYS) {
            triangle_steps += step_of(testing);
        }
        bool uncertain = false;
        if (HAS_LEAF) {
#include "traverse/test_triangle.glsl"
        }
        if (QUOTA != 0) {
            steps += subgroupAny(uncertain) ? 3 : 0;  // the loop in exact_distance
            if (steps > QUOTA) {
                break;
            }
        }
    }
    if (END_STEPS != 0) {
        // Devices that end loops may run one subgroup after the other, and none has then anything left to share.
        subgroupMemoryBarrierShared();
        leaves = subgroupAny(ended >= END_WHEN || (QUOTA != 0 && ++turn == END_STEPS));
    }
    steps++;
    busy = lanes(!FINISHED);
    leaves = leaves || (BARRIER == 0 && QUOTA != 0 && steps > QUOTA);
    if (!STAYS_IN_OCTANT || leaves || busy == 0 || (more && busy < FETCH_BELOW)) {
        break;
    }
}
