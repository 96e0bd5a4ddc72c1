// Statements of closest_hit.glsl: the lanes of a subgroup take rays together, PACKET of them each, and walk the tree as
// one, along the union of their ways, for rays that stay together (packets: Wald et al. 2001; their intervals: Boulos et
// al. 2006).
//
//   until the queue is empty:
//       every lane fetches rays; intervals of origins and inverse directions are found
//       until the stack is empty:
//           the box of a node or leaf, which all rays are tested against
//           where any of them meets it, the boxes of a node's children, a lane each, against the intervals; or the
//           triangles of a leaf against all rays
//
// Where to go next is the same for all lanes, so that no lane waits for another, what is loaded serves all rays, and the
// stack is in shared memory once. A ray is tested against boxes and triangles that only its neighbours need; they cannot
// give it a wrong hit.
const uint base = gl_SubgroupID * STACK_SIZE;
const uint lane = gl_SubgroupInvocationID;
vec3 origin_of[PACKET_RAYS];
float t_min_of[PACKET_RAYS];
OrderedSlab slab_of_[PACKET_RAYS];
Shear shear_of_[PACKET_RAYS];
Hit best_of[PACKET_RAYS];
bool meets[PACKET_RAYS];  // what is visited now
uvec2 counts_of[PACKET_RAYS];  // nodes and triangles
while (more) {
    // For all lanes at once.
    uint first;
    if (subgroupElect()) {
        first = atomicAdd(queue.next, PACKET_RAYS * gl_SubgroupSize);
    }
    first = subgroupBroadcastFirst(first);
    more = first < count && (QUOTA == 0 || steps < QUOTA / 2);
    if (first >= count) {
        break;
    }
    steps += 8 * PACKET_RAYS + 8;
    Packet packet = Packet(vec3(INFINITY), vec3(-INFINITY), vec3(INFINITY), vec3(-INFINITY), INFINITY);
    // The farthest that any ray still looks.
    float t_max = 0.0;
    [[unroll]] for (uint r = 0; r < PACKET_RAYS; r++) {
        uint index = ray_of_packet(first, r, count);
        // Of a lane that gets no ray: all boxes are too far away.
        best_of[r] = Hit(-1.0, MISS);
        t_min_of[r] = 0.0;
        origin_of[r] = vec3(0.0);
        slab_of_[r] = OrderedSlab(vec3(0.0), vec3(0.0), vec3(0.0));
        shear_of_[r] = Shear(vec3(0.0), 0);
        counts_of[r] = uvec2(0);
        meets[r] = index != MISS;
        if (meets[r]) {
            Ray its = rays.items[index];
            best_of[r] = Hit(min(its.t_max, LARGEST), MISS);
            t_min_of[r] = its.t_min;
            origin_of[r] = its.origin;
            slab_of_[r] = ordered_slab_of(slab_of(its.origin, its.direction, tree.extent, PAD));
            shear_of_[r] = aim(its.direction);
            // Twice the pad that a single ray has: one for it, and one for the rounding of what is done with intervals.
            vec3 pad = max(abs(its.origin), vec3(tree.extent)) * (2.0 * PAD);
            packet.origin_lo = min(packet.origin_lo, its.origin - pad);
            packet.origin_hi = max(packet.origin_hi, its.origin + pad);
            packet.inverse_lo = min(packet.inverse_lo, slab_of_[r].inverse);
            packet.inverse_hi = max(packet.inverse_hi, slab_of_[r].inverse);
            packet.t_min = min(packet.t_min, its.t_min);
            t_max = max(t_max, best_of[r].t);
        }
        if (COUNT == RAYS) {
            fetches += step_of(lanes(meets[r]));
        }
    }
    [[unroll]] for (uint axis = 0; axis < 3; axis++) {
        packet.origin_lo[axis] = least_of(packet.origin_lo[axis]);
        packet.origin_hi[axis] = -least_of(-packet.origin_hi[axis]);
        packet.inverse_lo[axis] = least_of(packet.inverse_lo[axis]);
        packet.inverse_hi[axis] = -least_of(-packet.inverse_hi[axis]);
    }
    packet.t_min = least_of(packet.t_min);
    // Where all rays point into one octant, they enter and leave through the same planes.
    bvec3 fall = lessThan(packet.inverse_hi, vec3(0.0));
    bool one_octant = all(equal(fall, lessThan(packet.inverse_lo, vec3(0.0))));
    if (one_octant) {
        packet = in_octant(packet, fall);
    }
    t_max = -least_of(-t_max);
    uint at = 0;  // a node to visit, or NONE
    boxes_tested = 0;
    uint height = 0;
    for (;;) {
        steps += 3;        // with the last, empty rounds of the loops below
        uint next = NONE;  // the child's node and slot
        if (at != NONE) {
            [[unroll]] for (uint r = 0; r < PACKET_RAYS; r++) {
                if (COUNT == RAYS) {
                    counts_of[r].x += meets[r] ? 1 : 0;
                    node_steps += step_of(lanes(meets[r]));
                }
                if (COUNT == VISITS) {
                    if (meets[r]) {
                        atomicAdd(tree.visits.items[at], 1);
                    }
                }
            }
            // Its children, a lane each, and the same again in each further KEYS lanes, because none may part from the others
            // here.
            uint child_of_lane = lane % KEYS;
            vec3 lo, hi;
            load_box(tree.nodes, at, min(child_of_lane, ARITY - 1), lo, hi);
            float t = one_octant ? enter_in_octant(packet, mix(lo, hi, fall), mix(hi, lo, fall), t_max)
                                 : enter(packet, lo, hi, t_max);
            // (Empty slots are at infinity, which intervals about 0 may meet.)
            //
            // Distances, which are at least 0, are in the order of the integers that have their bits. The last of these
            // make way for the child, and KEYS is added so that 0 stands for none; entering is early by a few units in
            // the last place.
            bool may_meet = all(bvec3(t < INFINITY, child_of_lane < ARITY, lo.x < INFINITY));
            uint key = may_meet ? (floatBitsToUint(t) & ~(KEYS - 1) | child_of_lane) + KEYS : 0;
            // The farthest first, and the nearest is next. Which others are farther than a child is asked by all lanes that
            // have this child, of one of the others each, in as many rounds as it takes.
            uint met = bitCount(subgroupBallot(key != 0).x % (1 << KEYS));
            uint groups = clamp(gl_SubgroupSize / KEYS, 1, KEYS);
            uint same_child = 0x01010101u << child_of_lane;
            uint farther = 0;
            steps += ARITY;
            [[unroll]] for (uint k = 0; k < (ARITY + groups - 1) / groups; k++) {
                uvec4 farther_ones = subgroupBallot(subgroupShuffle(key, lane / KEYS + k * groups) > key);
                farther += subgroupBallotBitCount(farther_ones & uvec4(same_child, same_child, 0, 0));
            }
            uvec4 nearest = subgroupBallot(key != 0 && farther + 1 == met);
            if (lane < KEYS && key != 0 && farther + 1 < met) {
                packet_stack[base + height + farther] = uvec2(at * ARITY + lane, key);
            }
            // All lanes read what one has written. (Mesa 22 takes a subgroup's barrier for one of the workgroup.)
            if (QUOTA == 0) {
                subgroupBarrier();
            } else {
                subgroupMemoryBarrierShared();
            }
            if (met > 0) {
                next = at * ARITY + subgroupBallotFindLSB(nearest);
                height += met - 1;
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
        uint parent = next / ARITY, slot = next % ARITY;
        vec3 lo, hi;
        load_box(tree.nodes, parent, slot, lo, hi);
        uint child = load_link(tree.nodes, parent, slot);
        steps += 4 * PACKET_RAYS + 4;
        boxes_tested++;
        bool any_meets = false;
        int enters;
        if (one_octant) {
            vec3 entry = mix(lo, hi, fall), exit = mix(hi, lo, fall);
            [[unroll]] for (uint r = 0; r < PACKET_RAYS; r++) {
                meets[r] = meets_planes(slab_of_[r], entry, exit, best_of[r].t, enters);
                any_meets = any_meets || meets[r];
            }
        } else {
            [[unroll]] for (uint r = 0; r < PACKET_RAYS; r++) {
                meets[r] = meets_in_octant(slab_of_[r], MIXED, lo, hi, best_of[r].t, enters);
                any_meets = any_meets || meets[r];
            }
        }
        if (!subgroupAny(any_meets)) {
            continue;
        }
        if (is_inner(child)) {
            at = child;
            continue;
        }
        uint last = (child & 0x7FFFFFFu) + (child >> 27 & 15);
        for (uint index = child & 0x7FFFFFFu; index <= last; index++) {
            steps += 1 + PACKET_RAYS;
            [[unroll]] for (uint r = 0; r < PACKET_RAYS; r++) {
                uint ray = ray_of_packet(first, r, count);
                vec3 origin = origin_of[r];
                float t_min = t_min_of[r];
                Shear shear = shear_of_[r];
                Hit best = best_of[r];
                uint triangles_tested = counts_of[r].y;
                bool uncertain = false;
#include "traverse/meet_triangle.glsl"
                best_of[r] = best;
                counts_of[r].y = triangles_tested;
                if (COUNT == RAYS) {
                    triangle_steps += step_of(lanes(ray != MISS));
                }
                if (QUOTA != 0) {
                    steps += subgroupAny(uncertain) ? 3 : 0;  // the loop in exact_distance
                }
            }
        }
        t_max = 0.0;
        [[unroll]] for (uint r = 0; r < PACKET_RAYS; r++) {
            t_max = max(t_max, best_of[r].t);
        }
        t_max = -least_of(-t_max);
    }
    if (QUOTA != 0 && steps > QUOTA) {
        break;
    }
    node = NONE;
    [[unroll]] for (uint r = 0; r < PACKET_RAYS; r++) {
        uint ray = ray_of_packet(first, r, count);
        Hit best = best_of[r];
        uint nodes_visited = counts_of[r].x, triangles_tested = counts_of[r].y;
#include "traverse/finish.glsl"
    }
}
