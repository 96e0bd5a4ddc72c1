// Statements of closest_hit.glsl: the lanes of a subgroup take rays together and walk the tree as one, along the union
// of their ways, for rays that stay together (Wald et al. 2001, with one stack for as many rays as a subgroup has
// lanes).
//
//   until the queue is empty:
//       every lane fetches a ray
//       until the stack is empty:
//           an inner node, whose children all lanes test: those that any ray meets, by the least distance at which one
//           of them enters
//           or a leaf, whose triangles all lanes test
//
// Where to go next is the same for all lanes, so that no lane waits for another, a node is loaded once for all, and
// the stack is in shared memory once. A ray is tested against nodes that only its neighbours need; their boxes cannot
// give it a wrong hit.
const uint base = gl_SubgroupID * STACK_SIZE;
while (more) {
    // Of lanes that get no ray: all boxes are too far away.
    best = Hit(-1.0, MISS);
    t_min = 0.0;
    slab = Slab(vec3(0.0), vec3(0.0), vec3(0.0));
#include "traverse/fetch.glsl"
    if (!subgroupAny(ray != MISS)) {
        break;
    }
    uint next = 0;
    uint height = 0;
    while (next != NONE && (QUOTA == 0 || steps <= QUOTA)) {
        // Drivers that keep what is uniform in registers of a kind of its own know it from this.
        next = subgroupBroadcastFirst(next);
        if (is_inner(next)) {
            steps += NODE_STEPS + PACKET_STEPS;
            float t[ARITY];
            uint child[ARITY];
            uint tested;
            meet(tree.nodes, next, slab, t_min, best.t, t, child, tested);
            if (COUNT == RAYS) {
                nodes_visited++;
                boxes_tested += tested;
            }
            if (COUNT == VISITS) {
                if (ray != MISS) {
                    atomicAdd(tree.visits.items[next], 1);
                }
            }
            // Floats above zero are in the order of the integers that have their bits, of which the least of a
            // subgroup is found by one instruction on some devices. Below zero they are not, and none is left out.
            [[unroll]] for (uint i = 0; i < ARITY; i++) {
                int least = subgroupMin(floatBitsToInt(t[i]));
                t[i] = least < 0 ? -LARGEST : intBitsToFloat(least);
            }
            order(t, child);
            [[unroll]] for (uint k = 1; k < ARITY; k++) {
                if (t[ARITY - k] < INFINITY) {
                    packet_stack[base + height++] = uvec2(child[ARITY - k], floatBitsToUint(t[ARITY - k]));
                }
            }
            next = t[0] < INFINITY ? child[0] : NONE;
        } else {
            steps++;
            uint last = (next & 0x7FFFFFFu) + (next >> 27 & 15);
            for (uint index = next & 0x7FFFFFFu; index <= last; index++) {
                steps++;
                bool uncertain = false;
                if (ray != MISS) {
#include "traverse/meet_triangle.glsl"
                }
                if (QUOTA != 0) {
                    steps += subgroupAny(uncertain) ? 3 : 0;  // the loop in exact_distance
                }
            }
            next = NONE;
        }
        // What all rays have found something in front of is left out.
        steps += 2;
        while (next == NONE && height > 0) {
            steps++;
            uvec2 entry = packet_stack[base + --height];
            if (subgroupAny(uintBitsToFloat(entry.y) < best.t)) {
                next = entry.x;
            }
        }
    }
    if (QUOTA != 0 && next != NONE) {
        break;
    }
    node = NONE;
#include "traverse/finish.glsl"
}
