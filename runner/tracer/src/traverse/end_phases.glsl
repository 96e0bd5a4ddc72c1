// Statements of closest_hit.glsl: the subgroups of a workgroup end together what rays they have left, so that the launch
// does not wait for few long ones, often neighbours: lanes without a ray take over parts of others' ways.
//
//   until none has anything left to visit:
//       each hands in what is nearest by now of its ray, and each subgroup tells how many lanes have a stack and how many
//       have nothing
//       (all wait for each other)
//       of as many as there are idle lanes, the lowest entry of the stack is left to others
//       (all wait for each other)
//       the i-th idle lane takes the i-th
//       END_STEPS times: a node, a triangle
//
// Of a ray, the least distance is kept by an atomic minimum, of bits, which are in the order of distances; its triangle by
// whoever has this very distance behind the wait.
const uint own = gl_SubgroupID;
const uint left = ray;  // the ray that it hands in at the end
uint number = ray != MISS ? gl_LocalInvocationIndex : NONE;  // of the ray that it works for
int bottom = 0;  // entries of the stack above it are the lane's
if (ray != MISS) {
    shared_t[number] = floatBitsToUint(best.t);
    shared_triangle[number] = best.triangle;
    if (COUNT == RAYS) {
        shared_nodes[number] = 0;
        shared_boxes[number] = 0;
        shared_triangles[number] = 0;
    }
}
bool any_late;
for (uint place = 0;; place ^= SUBGROUPS) {
    steps += 8;
    bool busy = ray != MISS && !FINISHED;
    if (number != NONE) {
        if (best.triangle != MISS) {
            atomicMin(shared_t[number], floatBitsToUint(best.t));
        }
        if (COUNT == RAYS) {
            atomicAdd(shared_nodes[number], nodes_visited);
            atomicAdd(shared_boxes[number], boxes_tested);
            atomicAdd(shared_triangles[number], triangles_tested);
            nodes_visited = 0;
            boxes_tested = 0;
            triangles_tested = 0;
        }
    }
    bool gives = busy && top > bottom;
    uvec4 idle = subgroupBallot(!busy), giving = subgroupBallot(gives);
    if (subgroupElect()) {
        uint takers = subgroupBallotBitCount(idle);
        uint state = (takers < gl_SubgroupSize ? BUSY : 0) | (more ? MORE : 0) | (QUOTA != 0 && steps > QUOTA ? LATE : 0);
        told_by[place + own] = uvec4(state, subgroupBallotBitCount(giving), takers, 0);
    }
    barrier();
    if (number != NONE) {
        uint nearest = shared_t[number];
        if (best.triangle != MISS && floatBitsToUint(best.t) == nearest) {
            shared_triangle[number] = best.triangle;
        }
        best = Hit(uintBitsToFloat(nearest), MISS);
    }
    // A subgroup a lane.
    uvec4 told_now = uvec4(MORE, 0, 0, 0);
    if (gl_SubgroupInvocationID < SUBGROUPS) {
        told_now = told_by[place + gl_SubgroupInvocationID];
    }
    any_late = subgroupAny((told_now.x & LATE) != 0);
    if (subgroupAll((told_now.x & BUSY) == 0) || any_late) {
        again = QUOTA != 0 && !any_late && subgroupAll((told_now.x & MORE) != 0);
        break;
    }
    uint pairs = min(subgroupAdd(told_now.y), subgroupAdd(told_now.z));
    if (pairs > 0) {
        uint giver = subgroupShuffle(subgroupExclusiveAdd(told_now.y), own) + subgroupBallotExclusiveBitCount(giving);
        uint taker = subgroupShuffle(subgroupExclusiveAdd(told_now.z), own) + subgroupBallotExclusiveBitCount(idle);
        if (gives && giver < pairs) {
            bottom++;
            left_to_others[giver] = uvec3(ray, stack[bottom], number);
            stack[bottom] = NONE;
        }
        barrier();
        if (!busy && taker < pairs) {
            uvec3 its = left_to_others[taker];
            ray = its.x;
            number = its.z;
#include "traverse/take_ray.glsl"
            best.t = uintBitsToFloat(shared_t[number]);
            bottom = 0;
            node = its.y;
            if (SPECULATE != 0 && is_leaf(node)) {
                leaf = node;
                node = NONE;
            }
        }
    }
    for (uint step = 0; step < END_STEPS; step++) {
        steps += 2 + NODE_STEPS;
        if (COUNT == RAYS) {
            node_steps += step_of(lanes(is_inner(node)));
        }
        if (is_inner(node)) {
#include "traverse/visit_node.glsl"
        }
        if (COUNT == RAYS) {
            triangle_steps += step_of(lanes(HAS_LEAF));
        }
        bool uncertain = false;
        if (HAS_LEAF) {
#include "traverse/test_triangle.glsl"
        }
        if (QUOTA != 0) {
            steps += subgroupAny(uncertain) ? 3 : 0;  // the loop in exact_distance
        }
    }
}
barrier();
ray = any_late ? MISS : left;
if (ray != MISS) {
    best = Hit(uintBitsToFloat(shared_t[gl_LocalInvocationIndex]), shared_triangle[gl_LocalInvocationIndex]);
    if (COUNT == RAYS) {
        nodes_visited = shared_nodes[gl_LocalInvocationIndex];
        boxes_tested = shared_boxes[gl_LocalInvocationIndex];
        triangles_tested = shared_triangles[gl_LocalInvocationIndex];
    }
}
#include "traverse/finish.glsl"
