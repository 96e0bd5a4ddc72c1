#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_vote : require
#include "bvh2.glsl"
#include "collapse.glsl"
#include "scene_bounds.glsl"

// The whole clustering and the collapse in one launch: see hploc/mod.rs.
//
// An invocation climbs from its leaf, and of the two that meet at a node of the radix hierarchy the later one goes on.
// Where a range has grown larger than half a window, all invocations of the subgroup together cluster it, one range
// after the other.

layout(local_size_x_id = 0) in;
// How far along a window a cluster looks for its neighbour, to either side.
layout(constant_id = 1) const uint RADIUS = 8;
// Clusters that are looked at together; at most half as many are handed on.
layout(constant_id = 2) const uint WINDOW = 32;
// 32-bit words a key: 1 or 2.
layout(constant_id = 3) const uint WORDS = 1;
layout(constant_id = 4) const uint LANES = 32;
layout(constant_id = 5) const uint SUBGROUPS = 2;

const uint HALF = WINDOW / 2;
// A lane has the slots lane, LANES + lane, … of the window.
const uint ROWS = (WINDOW + LANES - 1) / LANES;
const uint NONE = 0xffffffffu;
// hploc/mod.rs
const uint PATIENCE = 128;

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Keys {
    uint v[];
};

// For each boundary between two leaves, who has reached it from one side: the other end of that range.
layout(buffer_reference, scalar, buffer_reference_align = 4) coherent buffer Visits {
    uint v[];
};

// What a range of leaves has become, from its first place on: node, and a number for a node to come.
layout(buffer_reference, scalar, buffer_reference_align = 8) coherent buffer Clusters {
    uvec2 v[];
};

// What one subgroup writes another reads.
layout(buffer_reference, scalar, buffer_reference_align = 16) coherent buffer Nodes {
    Bvh2Node v[];
};

layout(push_constant, scalar) uniform Push {
    Nodes nodes;
    Keys keys;
    Visits visits;
    Clusters clusters;
    Subtrees subtrees;
    SceneBounds bounds;
    Costs costs;
    uint count;
};

// The window of each subgroup.
shared vec2 box_x[SUBGROUPS * WINDOW];
shared vec2 box_y[SUBGROUPS * WINDOW];
shared vec2 box_z[SUBGROUPS * WINDOW];
shared uvec4 subtree_of[SUBGROUPS * WINDOW];
shared uint node_of[SUBGROUPS * WINDOW];
shared uint nearest[SUBGROUPS * WINDOW];
// The numbers that its clusters brought with them.
shared uint numbers[SUBGROUPS * WINDOW];

void share_subgroup() {
    subgroupMemoryBarrierShared();
    subgroupBarrier();
}

Box shared_box(uint slot) {
    vec2 x = box_x[slot], y = box_y[slot], z = box_z[slot];
    return Box(vec3(x.x, y.x, z.x), vec3(x.y, y.y, z.y));
}

void share_box(uint slot, Box box) {
    box_x[slot] = vec2(box.lo.x, box.hi.x);
    box_y[slot] = vec2(box.lo.y, box.hi.y);
    box_z[slot] = vec2(box.lo.z, box.hi.z);
}

float united(Box a, Box b, float scale) {
    Box box = box_union(a, b);
    return box_half_area(box.lo, box.hi, scale);
}

// How different the keys of leaf i and the next are: the larger the higher the first bit is in which they differ. Equal
// codes differ by their places.
uvec3 difference(uint i) {
    uvec2 bits = uvec2(0, keys.v[WORDS * i] ^ keys.v[WORDS * (i + 1)]);
    if (WORDS == 2) {
        bits = uvec2(keys.v[2 * i + 1] ^ keys.v[2 * i + 3], bits.y);
    }
    return uvec3(bits, bits == uvec2(0) ? i ^ (i + 1) : 0);
}

// Whether a range's sibling is to its right: there the keys differ less.
bool goes_right(uint first, uint last) {
    if (first == 0) {
        return true;
    }
    if (last == count - 1) {
        return false;
    }
    uvec3 l = difference(first - 1), r = difference(last);
    return r.x != l.x ? r.x < l.x : r.y != l.y ? r.y < l.y : r.z < l.z;
}

// The cluster within RADIUS of `slot` with which it makes the smallest box, itself if there is none. Of equally good ones
// the nearer, and of two equally near ones that of the pair that begins at an even slot, or else at the lower one: see
// hploc/mod.rs. To be called by all lanes.
uint nearest_cluster(uint base, uint slot, uint now, float scale) {
    const float INFINITE = uintBitsToFloat(0x7f800000);
    uint best = slot;
    // The largest float: infinite areas never win.
    float best_area = uintBitsToFloat(0x7f7fffff);
    Box box = shared_box(base + min(slot, WINDOW - 1));
    // Eight at a time, because compilers take long over all of a wide radius.
    for (uint nearer = 0; nearer < RADIUS; nearer += 8) {
        [[unroll]] for (uint further = 1; further <= 8; ++further) {
            uint distance = nearer + further;
            bool within = distance <= RADIUS;
            float after = INFINITE;
            if (within && slot + distance < now) {
                after = united(box, shared_box(base + slot + distance), scale);
            }
            float before;
            if (ROWS == 1) {
                // A box around two is the same from either side.
                before = subgroupShuffle(after, (gl_SubgroupInvocationID - distance) & (LANES - 1));
                before = slot < distance ? INFINITE : before;
            } else {
                before = INFINITE;
                if (within && slot >= distance && slot < now) {
                    before = united(box, shared_box(base + slot - distance), scale);
                }
            }
            bool even = (slot & distance & 1) < (distance & 1);
            bool forward = even ? after <= before : after < before;
            float area = forward ? after : before;
            if (area < best_area) {
                best_area = area;
                best = forward ? slot + distance : slot - distance;
            }
        }
    }
    return best;
}

// Clusters the leaves `first` to `last`, whose second part begins at `split`: at most HALF clusters of each part, to
// HALF or fewer, or at the root to one. All lanes do one range.
void cluster(uint first, uint last, uint split, float scale) {
    uint lane = gl_SubgroupInvocationID;
    uint base = gl_SubgroupID * WINDOW;
    bool leftmost = first == 0;
    bool root = leftmost && last == count - 1;

    uvec2 found[ROWS];
    uint lefts = 0;
    uint rights = 0;
    [[unroll]] for (uint row = 0; row < ROWS; row++) {
        uint j = row * LANES + lane;
        bool right = j >= HALF;
        uint q = right ? j - HALF : j;
        uint begin = right ? split : first;
        uint size = right ? last + 1 - split : split - first;
        found[row] = uvec2(NONE);
        if (j < WINDOW && q < size) {
            if (size > HALF) {
                found[row] = clusters.v[begin + q];
            } else {
                // Nobody has clustered these few leaves. Number 0 stands last.
                uint number = begin > 0 ? begin + q : q + 1 < size ? q + 1 : 0;
                found[row] = uvec2(begin + q, number);
            }
        }
        bool there = found[row].x != NONE;
        lefts += subgroupBallotBitCount(subgroupBallot(there && !right));
        rights += subgroupBallotBitCount(subgroupBallot(there && right));
    }
    uint now = lefts + rights;
    bool patient = true;
    [[unroll]] for (uint row = 0; row < ROWS; row++) {
        uint j = row * LANES + lane;
        if (found[row].x != NONE) {
            bool right = j >= HALF;
            uint q = right ? j - HALF : j;
            uint node = found[row].x;
            Bvh2Node n = nodes.v[node];
            Box box = bvh2_box(n);
            uvec4 subtree;
            if (node < count) {
                subtree = pack_subtree(lone_triangle(box_half_area(box.lo, box.hi, scale), costs));
            } else {
                subtree = subtrees.v[node - count];
                patient = patient && unpack_subtree(subtree).levels < PATIENCE;
            }
            uint slot = base + q + (right ? lefts : 0);
            share_box(slot, box);
            subtree_of[slot] = subtree;
            node_of[slot] = node;
            // Those that are never given to a node, or to the root, stay behind all others.
            uint place = q + (right ? lefts : 0);
            if (leftmost && !right && q == lefts - 1) {
                place = root ? now - 2 : now - 1;
            } else if (leftmost && right && !(root && q == rights - 1)) {
                place--;
            }
            numbers[base + place] = found[row].y;
        }
    }
    patient = subgroupAll(patient);
    share_subgroup();

    uint goal = root ? 1 : HALF;
    uint made = 0;
    while (now > goal) {
        uint partner[ROWS];
        [[unroll]] for (uint row = 0; row < ROWS; row++) {
            uint slot = row * LANES + lane;
            if (patient) {
                partner[row] = nearest_cluster(base, slot, now, scale);
            } else {
                partner[row] = (slot ^ 1) < now ? slot ^ 1 : slot;
            }
            if (slot < now) {
                nearest[base + slot] = partner[row];
            }
        }
        share_subgroup();
        Box box[ROWS];
        uvec4 subtree[ROWS];
        uint node[ROWS];
        uint target[ROWS];
        uint left = 0;
        [[unroll]] for (uint row = 0; row < ROWS; row++) {
            uint slot = row * LANES + lane;
            bool here = slot < now;
            uint other = partner[row];
            bool mutual = here && other != slot && nearest[base + other] == slot;
            bool merges = mutual && slot < other;
            bool survives = here && (!mutual || merges);
            uvec4 merging = subgroupBallot(merges);
            uvec4 surviving = subgroupBallot(survives);
            target[row] = survives ? left + subgroupBallotExclusiveBitCount(surviving) : NONE;
            if (survives) {
                box[row] = shared_box(base + slot);
                subtree[row] = subtree_of[base + slot];
                node[row] = node_of[base + slot];
            }
            if (merges) {
                box[row] = box_union(box[row], shared_box(base + other));
                uint number = numbers[base + made + subgroupBallotExclusiveBitCount(merging)];
                // Number 0 is the root's, which is the last node.
                uint index = number == 0 ? count - 2 : number - 1;
                Subtree l = unpack_subtree(subtree[row]);
                Subtree r = unpack_subtree(subtree_of[base + other]);
                float area = box_half_area(box[row].lo, box[row].hi, scale);
                subtree[row] = pack_subtree(join_subtrees(l, r, area, number == 0, false, costs));
                subtrees.v[index] = subtree[row];
                nodes.v[count + index] = bvh2_node(box[row], node[row], node_of[base + other]);
                node[row] = count + index;
            }
            left += subgroupBallotBitCount(surviving);
            made += subgroupBallotBitCount(merging);
        }
        share_subgroup();
        [[unroll]] for (uint row = 0; row < ROWS; row++) {
            if (target[row] != NONE) {
                share_box(base + target[row], box[row]);
                subtree_of[base + target[row]] = subtree[row];
                node_of[base + target[row]] = node[row];
            }
        }
        // Boxes too large for an area have no neighbours.
        patient = patient && left < now;
        now = left;
        share_subgroup();
    }

    if (!root) {
        [[unroll]] for (uint row = 0; row < ROWS; row++) {
            uint slot = row * LANES + lane;
            if (slot < HALF) {
                clusters.v[first + slot] =
                    slot < now ? uvec2(node_of[base + slot], numbers[base + made + slot]) : uvec2(NONE);
            }
        }
    }
    share_subgroup();
}

void main() {
    float scale = scene_scale(bounds);
    uint first = gl_GlobalInvocationID.x;
    uint last = first;
    bool climbing = first < count;
    for (;;) {
        uint split = 0;
        if (climbing) {
            bool right = goes_right(first, last);
            uint boundary = right ? last : first - 1;
            uint end = atomicExchange(visits.v[boundary], right ? first : last);
            if (end == NONE) {
                // The other side comes later, and goes on.
                climbing = false;
            } else if (right) {
                split = last + 1;
                last = end;
            } else {
                split = first;
                first = end;
            }
        }
        bool root = first == 0 && last == count - 1;
        bool waiting = climbing && (last - first >= HALF || root);
        uvec4 all = subgroupBallot(waiting);
        if (subgroupBallotBitCount(all) > 0) {
            // What others made of the range must be seen before it is read,
            memoryBarrierBuffer();
            do {
                uint turn = subgroupBallotFindLSB(all);
                cluster(subgroupShuffle(first, turn), subgroupShuffle(last, turn), subgroupShuffle(split, turn),
                        scale);
                waiting = waiting && gl_SubgroupInvocationID != turn;
                all = subgroupBallot(waiting);
            } while (subgroupBallotBitCount(all) > 0);
            // and what was made of it before the next one is told of it.
            memoryBarrierBuffer();
        }
        climbing = climbing && !root;
        if (!subgroupAny(climbing)) {
            break;
        }
    }
}
