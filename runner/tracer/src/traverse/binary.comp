#version 460
// Closest hit in a binary BVH: speculative while-while traversal with persistent threads (Aila and Laine
// 2009; thesis 2.3 and 4.1). One ray a lane.
//
//   until the queue is empty and no lane has a ray:
//       when few lanes have a ray, idle lanes fetch new ones
//       until every lane has a leaf to test (or no ray): inner nodes; the first leaf found is postponed
//       until few lanes have a leaf while others could go on: triangles
//
// All three loops are uniform in the subgroup: lanes without work take part idle, so votes mean the same
// on every driver, whether or not it reconverges diverged lanes.
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_vote : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require

#include "ray.glsl"
#include "slab.glsl"
#include "triangle.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint STACK_SIZE = 64;
// Lanes with a ray under which idle lanes fetch new ones.
layout(constant_id = 2) const uint FETCH_BELOW = 20;
// Loop iterations after which a subgroup leaves, 0 for none: some drivers end loops silently.
layout(constant_id = 3) const uint QUOTA = 0;
layout(constant_id = 4) const bool COUNT = false;
// Lanes that, when no more than these still test triangles, keep theirs postponed while others go on.
layout(constant_id = 5) const uint POSTPONE = 8;

// 56 bytes: the children's boxes, then their indices, in seven loads of 8 bytes.
struct Node {
    vec2 words[7];
};
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Nodes {
    Node items[];
};
// Per ray: inner nodes visited, boxes tested, triangles tested, nothing.
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Counts {
    uvec4 items[];
};

layout(push_constant, scalar) uniform Arguments {
    Rays rays;
    Hits hits;
    Nodes nodes;
    Triangles triangles;
    Queue queue;
    Counts counts;
    float extent;
};

// A child: an inner node's index, or a leaf with its top bit set: 4 bits of count minus one, 27 bits of
// the first triangle (thesis figure 12). NONE cannot be a leaf: its triangles would exceed 27 bits.
const uint NONE = 0xFFFFFFFFu;
bool is_inner(uint child) {
    return int(child) >= 0;
}
bool is_leaf(uint child) {
    return int(child) < 0 && child != NONE;
}

void main() {
    uint ray = MISS;
    uint node = NONE;  // to visit next: inner node or leaf
    uint leaf = NONE;  // postponed
    vec3 origin;
    float t_min;
    Slab slab;
    Shear shear;
    Hit best;

    uint stack[STACK_SIZE];
    int top = 0;
    stack[0] = NONE;

    uint nodes_visited = 0;
    uint triangles_tested = 0;
    uint finished = 0;
    uint steps = 0;
    bool more = true;
    const uint count = queue.count;

    for (;;) {
        steps++;
        // Fetch.
        uint busy = subgroupBallotBitCount(subgroupBallot(ray != MISS));
        if (more && busy < FETCH_BELOW) {
            uvec4 idle = subgroupBallot(ray == MISS);
            uint first;
            if (subgroupElect()) {
                first = atomicAdd(queue.next, subgroupBallotBitCount(idle));
            }
            first = subgroupBroadcastFirst(first);
            more = first < count && (QUOTA == 0 || steps < QUOTA / 2);
            uint index = first + subgroupBallotExclusiveBitCount(idle);
            if (ray == MISS && index < count) {
                ray = index;
                Ray r = rays.items[index];
                origin = r.origin;
                t_min = r.t_min;
                slab = slab_of(r.origin, r.direction, extent);
                shear = shear_of(r.direction);
                best = Hit(min(r.t_max, LARGEST), MISS);
                node = 0;
                top = 0;
                nodes_visited = 0;
                triangles_tested = 0;
            }
            busy = subgroupBallotBitCount(subgroupBallot(ray != MISS));
        }
        if (busy == 0) {
            break;
        }

        // Inner nodes, until every lane with a ray has a leaf or has nothing left.
        while (subgroupAny(is_inner(node) && leaf == NONE)) {
            steps++;
            if (is_inner(node)) {
                Node n = nodes.items[node];
                if (COUNT) {
                    nodes_visited++;
                }
                vec2 w0 = n.words[0], w1 = n.words[1], w2 = n.words[2], w3 = n.words[3], w4 = n.words[4],
                     w5 = n.words[5];
                uvec2 child = floatBitsToUint(n.words[6]);
                float t0 = enter(slab, vec3(w0, w1.x), vec3(w1.y, w2), t_min, best.t);
                float t1 = enter(slab, vec3(w3, w4.x), vec3(w4.y, w5), t_min, best.t);
                bool hit0 = t0 < INFINITY;
                bool hit1 = t1 < INFINITY;
                if (hit0 && hit1) {
                    bool swapped = t1 < t0;
                    node = swapped ? child.y : child.x;
                    stack[++top] = swapped ? child.x : child.y;
                } else if (hit0 || hit1) {
                    node = hit0 ? child.x : child.y;
                } else {
                    node = stack[top--];
                }
                if (is_leaf(node) && leaf == NONE) {
                    leaf = node;
                    node = stack[top--];
                }
            }
            if (QUOTA != 0 && steps > QUOTA) {
                break;
            }
        }

        // Triangles, of the postponed leaf and of a second one where the lane waits with it. The first round
        // tests at least one, because the loop above leaves no lane with a node but without a leaf.
        for (;;) {
            uint testing = subgroupBallotBitCount(subgroupBallot(leaf != NONE));
            if (testing == 0 || (testing <= POSTPONE && subgroupAny(is_inner(node) && leaf == NONE))) {
                break;
            }
            steps++;
            if (leaf != NONE) {
                uint index = leaf & 0x7FFFFFFu;
                vec4 v0 = triangles.items[index].v0_index;
                vec4 v1 = triangles.items[index].v1;
                vec4 v2 = triangles.items[index].v2;
                if (COUNT) {
                    triangles_tested++;
                }
                bool uncertain;
                float t = intersect(origin, shear, t_min, best.t, v0.xyz, v1.xyz, v2.xyz, uncertain);
                if (uncertain) {
                    t = exact_distance(rays, ray, triangles, index);
                }
                if (t > t_min && t < best.t) {
                    best = Hit(t, floatBitsToUint(v0.w));
                }
                if ((leaf & 0x78000000u) != 0u) {
                    leaf += 1u - (1u << 27);  // one triangle further, one fewer left
                } else {
                    leaf = NONE;
                    if (is_leaf(node)) {
                        leaf = node;
                        node = stack[top--];
                    }
                }
            }
            if (QUOTA != 0 && steps > QUOTA) {
                break;
            }
        }

        if (ray != MISS && node == NONE && leaf == NONE) {
            hits.items[ray] = Hit(best.triangle == MISS ? INFINITY : best.t, best.triangle);
            if (COUNT) {
                counts.items[ray] = uvec4(nodes_visited, 2u * nodes_visited, triangles_tested, 0);
            }
            finished++;
            ray = MISS;
        }
        if (QUOTA != 0 && steps > QUOTA) {
            break;
        }
    }

    finished = subgroupAdd(finished);
    if (subgroupElect()) {
        atomicAdd(queue.finished, finished);
    }
}
