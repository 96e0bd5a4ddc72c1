#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "ploc.glsl"

// First half of an iteration: finds each cluster's partner, and counts what a block will leave.

layout(push_constant, scalar) uniform Push {
    Bvh2Nodes nodes;
    Indices clusters;
    // The cluster to merge with, or the cluster itself.
    Indices partners;
    // Of each block: surviving clusters, and merged pairs in the upper half.
    Indices block_counts;
    // The same summed over SUPERBLOCK blocks. The other half belongs to the next step, and is zeroed.
    Indices super_counts;
    Indices next_super_counts;
    State state;
    SceneBounds bounds;
    uint step;
};

shared uint nearest[gl_WorkGroupSize.x];
shared uint survivors_and_pairs;

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint block = gl_WorkGroupID.x;
    uint count = state.steps[step].clusters;
    bool forced = state.steps[step].forced != 0;
    // Cluster numbers wrap below zero, where `< count` then fails.
    uint first_own = block * OWN;
    uint first_box = first_own - 2 * RADIUS;
    uint cluster = first_own - RADIUS + lane;

    if (!forced) {
        for (uint slot = lane; slot < BOXES; slot += gl_WorkGroupSize.x) {
            uint other = first_box + slot;
            Box box = no_box();
            if (other < count) {
                // In the first step, cluster i is leaf i.
                box = bvh2_box(nodes.v[step == 0 ? other : clusters.v[other]]);
            }
            share_box(slot, box);
        }
    }
    if (lane == 0) {
        survivors_and_pairs = 0;
    }
    barrier();

    uint partner = cluster;
    if (cluster < count) {
        if (forced) {
            partner = (cluster ^ 1) < count ? cluster ^ 1 : cluster;
        } else {
            partner = nearest_cluster(cluster, lane + RADIUS, scene_scale(bounds));
        }
    }
    nearest[lane] = partner;
    barrier();

    bool own = lane >= RADIUS && lane < RADIUS + OWN && cluster < count;
    uint counted = 0;
    if (own) {
        if (nearest[partner - cluster + lane] != cluster) {
            partner = cluster;
        }
        partners.v[cluster] = partner;
        counted = (partner >= cluster ? 1 : 0) + (partner > cluster ? 1 << 16 : 0);
    }
    counted = subgroupAdd(counted);
    if (subgroupElect()) {
        atomicAdd(survivors_and_pairs, counted);
    }
    barrier();
    if (lane == 0) {
        block_counts.v[block] = survivors_and_pairs;
        atomicAdd(super_counts.v[block / SUPERBLOCK], survivors_and_pairs);
        if (block % SUPERBLOCK == 0) {
            next_super_counts.v[block / SUPERBLOCK] = 0;
        }
    }
}
