// Statements of closest_hit.glsl: the lanes of a subgroup take rays together and walk the tree as one, along the union
// of their ways, for rays that stay together (packets: Wald et al. 2001; their intervals: Boulos et al. 2006).
//
//   until the queue is empty:
//       every lane fetches a ray; intervals of origins and inverse directions are found
//       until the stack is empty:
//           the box of a node or leaf, which all rays are tested against
//           where any of them meets it, the boxes of a node's children, a lane each, against the intervals; or the
//           triangles of a leaf against all rays
//
// Where to go next is the same for all lanes, so that no lane waits for another, and the stack is in shared memory
// once. A ray is tested against boxes that only its neighbours need; they cannot give it a wrong hit.
const uint base = gl_SubgroupID * STACK_SIZE;
const uint lane = gl_SubgroupInvocationID;
while (more) {
    // Of lanes that get no ray: all boxes are too far away.
    best = Hit(-1.0, MISS);
    t_min = 0.0;
    slab = Slab(vec3(0.0), vec3(0.0), vec3(0.0));
#include "traverse/fetch.glsl"
    bool has_ray = ray != MISS;
    if (!subgroupAny(has_ray)) {
        break;
    }
    steps += 8;
    Packet packet;
    {
        // Twice the pad that a single ray has: one for it, and one for the rounding of what is done with intervals.
        vec3 pad = max(abs(origin), vec3(tree.extent)) * (2.0 * PAD);
        [[unroll]] for (uint axis = 0; axis < 3; axis++) {
            packet.origin_lo[axis] = least_of(has_ray ? origin[axis] - pad[axis] : INFINITY);
            packet.origin_hi[axis] = -least_of(has_ray ? -origin[axis] - pad[axis] : INFINITY);
            packet.inverse_lo[axis] = least_of(has_ray ? slab.inverse[axis] : INFINITY);
            packet.inverse_hi[axis] = -least_of(has_ray ? -slab.inverse[axis] : INFINITY);
        }
        packet.t_min = least_of(has_ray ? t_min : INFINITY);
    }
    // The farthest that any ray still looks.
    float t_max = max(-least_of(-best.t), 0.0);
    uint at = 0;           // a node to visit, or NONE
    bool meets = has_ray;  // whether the lane's ray meets it
    uint height = 0;
    for (;;) {
        steps += 3;  // with the last, empty rounds of the loops below
        uint next = NONE;  // the child's node and slot
        float t = INFINITY;
        if (at != NONE) {
            if (COUNT == RAYS) {
                nodes_visited += meets ? 1 : 0;
                node_steps += step_of(lanes(meets));
            }
            if (COUNT == VISITS) {
                if (meets) {
                    atomicAdd(tree.visits.items[at], 1);
                }
            }
            // Its children, a lane each.
            if (lane < ARITY) {
                vec3 lo, hi;
                load_box(tree.nodes, at, lane, lo, hi);
                t = enter(packet, lo, hi, t_max);
            }
            // Distances, which are at least 0, are in the order of the integers that have their bits. The last of these
            // make way for the lane, and KEYS is added so that 0 stands for none; entering is early by a few units in
            // the last place.
            uint key = t < INFINITY ? (floatBitsToUint(t) & ~(KEYS - 1) | lane) + KEYS : 0;
            // The farthest first.
            uint met = lanes(key != 0);
            for (; met > 1; met--) {
                steps += 2;
                uint farthest = subgroupMax(key);
                packet_stack[base + height++] = uvec2(at * ARITY + farthest % KEYS, farthest);
                key = key == farthest ? 0 : key;
            }
            if (met == 1) {
                next = at * ARITY + subgroupMax(key) % KEYS;
            }
            at = NONE;
        }
        while (next == NONE && height > 0) {
            steps++;
            uvec2 entry = packet_stack[base + --height];
            if (uintBitsToFloat(entry.y - entry.y % KEYS - KEYS) <= t_max) {
                next = entry.x;
            }
        }
        if (next == NONE || (QUOTA != 0 && steps > QUOTA)) {
            break;
        }
        // Drivers that keep what is uniform in registers of a kind of its own know it from this.
        next = subgroupBroadcastFirst(next);
        vec3 lo, hi;
        uint parent = next / ARITY, slot = next % ARITY;
        load_box(tree.nodes, parent, slot, lo, hi);
        uint child = load_link(tree.nodes, parent, slot);
        meets = enter(slab, lo, hi, t_min, best.t) < INFINITY;
        if (COUNT == RAYS) {
            boxes_tested++;
        }
        if (!subgroupAny(meets)) {
            continue;
        }
        if (is_inner(child)) {
            at = child;
            continue;
        }
        uint last = (child & 0x7FFFFFFu) + (child >> 27 & 15);
        for (uint index = child & 0x7FFFFFFu; index <= last; index++) {
            steps++;
            if (COUNT == RAYS) {
                triangle_steps += step_of(lanes(meets));
            }
            bool uncertain = false;
            if (meets) {
#include "traverse/meet_triangle.glsl"
            }
            if (QUOTA != 0) {
                steps += subgroupAny(uncertain) ? 3 : 0;  // the loop in exact_distance
            }
        }
        t_max = max(-least_of(-best.t), 0.0);
    }
    if (QUOTA != 0 && steps > QUOTA) {
        break;
    }
    node = NONE;
#include "traverse/finish.glsl"
}
