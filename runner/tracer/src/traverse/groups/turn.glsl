// Statements of closest_hits.glsl: one turn of its loops. A lane visits a node, or takes triangles that were put off, and
// triangles are tested. While there may be rays in the queue, lanes without one fetch some; with LAST_RAYS they take over
// parts of others' rays.
steps++;
uint busy = lanes(ray != MISS);
#if LAST_RAYS
if (busy > 0 && busy < STEAL_BELOW) {
#include "traverse/groups/steal.glsl"
    busy = lanes(ray != MISS);
}
#else
uint idle_lanes = gl_SubgroupSize - busy;
lost += int(idle_lanes) - int(FORGIVEN);
bool few = BY_INACTIVE != 0 ? idle_lanes > INACTIVE : lost > int(LOST_WORK);
if (more && (few && idle_lanes > 0 || busy == 0)) {
#include "traverse/fetch.glsl"
    busy = lanes(ray != MISS);
    lost = 0;
}
#endif
if (busy == 0 || (LAST_RAYS == 0 && STEAL_BELOW != 0 && !more)) {
    break;
}
// Of all lanes alike: where it ends `more` or the loop for some lanes only, votes no longer mean the subgroup.
steps += NODE_STEPS;
if (COUNT == RAYS) {
    node_steps += step_of(lanes(group.y > IS_NODES));
}
if (group.y > IS_NODES) {
#include "traverse/groups/visit.glsl"
} else {
    triangles = group;
    group = uvec2(0);
}
if (SHARING != 0) {
#include "traverse/groups/share.glsl"
} else {
    for (;;) {
        uint testing = lanes(triangles.y != 0);
        if (testing == 0) {
            break;
        }
        if (testing * 1024 < busy * LEAST_TESTING) {
            if (triangles.y != 0) {
                PUSH(triangles)
                triangles.y = 0;
            }
            break;
        }
        steps++;
        if (COUNT == RAYS) {
            triangle_steps += step_of(testing);
        }
        bool uncertain = false;
        if (triangles.y != 0) {
            uint index = triangles.x + findLSB(triangles.y);
            triangles.y &= triangles.y - 1;
#include "traverse/meet_triangle.glsl"
        }
        if (QUOTA != 0) {
            steps += subgroupAny(uncertain) ? 3 : 0;  // the loop in exact_distance
            if (steps > QUOTA) {
                break;
            }
        }
    }
}
if (group.y <= IS_NODES) {
    group = uvec2(0);
    if (top > 0) {
        POP(group)
    }
}
#if LAST_RAYS
#include "traverse/groups/finish_divided.glsl"
#endif
#include "traverse/finish.glsl"
if (QUOTA != 0 && steps > QUOTA) {
    break;
}
