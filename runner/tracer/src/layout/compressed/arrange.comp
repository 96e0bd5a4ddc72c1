#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "bvh2.glsl"
#include "wide.glsl"
#include "arranged.glsl"
#include "layout/compressed/assign.glsl"

// Gives the children of each wide node their slots, and those that are nodes their places among their siblings: an
// invocation a node.

layout(local_size_x_id = 0) in;
// `Assignment` in layout/compressed/mod.rs.
layout(constant_id = 1) const uint ASSIGNMENT = 0;

layout(push_constant, scalar) uniform Push {
    Bvh2Nodes nodes;
    WideNodes wide;
    Progress progress;
    Arrangement arranged;
};

void main() {
    const uint arity = 8;
    uint count = wide_complete(progress) ? progress.nodes : 0;
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint i = gl_GlobalInvocationID.x; i < count; i += stride) {
        uint at = (WIDE_HEADER + arity) * i;
        uint first_node = wide.v[at];
        uint children = wide.v[at + 2] >> 4;
        uint leaves = wide.v[at + 2] & 15;
        uint seed = wide.v[at + WIDE_HEADER] & WIDE_CHILD_MASK;
        uint slots[8];
        if (ASSIGNMENT == RANDOM) {
            slots = random_slots(seed);
        } else {
            Box all;
            precise vec3 center[8];
            for (uint child = 0; child < children; child++) {
                Box box = bvh2_box(nodes.v[wide.v[at + WIDE_HEADER + child] & WIDE_CHILD_MASK]);
                if (child == 0) {
                    all = box;
                } else {
                    all = box_union(all, box);
                }
                precise vec3 middle = 0.5 * box.lo + 0.5 * box.hi;
                center[child] = middle;
            }
            precise vec3 middle = 0.5 * all.lo + 0.5 * all.hi;
            vec3 offset[8];
            for (uint child = 0; child < children; child++) {
                precise vec3 o = center[child] - middle;
                offset[child] = o;
            }
            if (ASSIGNMENT == GREEDY) {
                slots = greedy(offset, children);
            } else {
                slots = auction(offset, children);
            }
        }
        uint packed = 0xffffffffu;
        uint inner = 0;
        for (uint child = 0; child < children; child++) {
            packed ^= (NO_CHILD ^ child) << (4 * slots[child]);
            inner |= child < leaves ? 0 : 1 << slots[child];
        }
        arranged.v[i].slots = packed;
        if (i == 0) {
            arranged.v[0].place = 0;
        }
        for (uint child = leaves; child < children; child++) {
            uint before = bitCount(inner & ((1 << slots[child]) - 1));
            arranged.v[first_node + child - leaves].place = first_node + before;
        }
    }
}
