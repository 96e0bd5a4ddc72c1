#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "ploc.glsl"
#include "workgroup.glsl"

// Second half of an iteration: makes a node of each pair, at the place of its first cluster, and closes
// the gaps that the second ones leave.

layout(push_constant, scalar) uniform Push {
    Bvh2Nodes nodes;
    Indices clusters;
    Indices next_clusters;
    Indices partners;
    Indices block_counts;
    Indices super_counts;
    State state;
    Levels levels;
    uint step;
    // Nodes a workgroup takes when a level is later processed by a dispatch.
    uint level_group;
};

shared uint sums[2];

// Survivors and pairs of all blocks before this one: whole superblocks first, then single blocks.
uvec2 before_block(uint block) {
    if (gl_LocalInvocationIndex < 2) {
        sums[gl_LocalInvocationIndex] = 0;
    }
    barrier();
    uint whole = block / SUPERBLOCK;
    uint rest = block % SUPERBLOCK;
    uvec2 sum = uvec2(0);
    for (uint i = gl_LocalInvocationIndex; i < whole + rest; i += gl_WorkGroupSize.x) {
        uint counted =
            i < rest ? block_counts.v[whole * SUPERBLOCK + i] : super_counts.v[i - rest];
        sum += uvec2(counted & 0xffff, counted >> 16);
    }
    sum = subgroupAdd(sum);
    if (subgroupElect()) {
        atomicAdd(sums[0], sum.x);
        atomicAdd(sums[1], sum.y);
    }
    barrier();
    return uvec2(sums[0], sums[1]);
}

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint block = gl_WorkGroupID.x;
    Step now = state.steps[step];
    uint i = block * OWN + lane;

    uint partner = 0;
    uint counted = 0;
    bool own = lane < OWN && i < now.clusters;
    if (own) {
        partner = partners.v[i];
        counted = (partner >= i ? 1 : 0) + (partner > i ? 1 << 16 : 0);
    }
    uvec2 before = before_block(block);
    uint block_total;
    uint packed = workgroup_exclusive_add(counted, block_total);
    uint place = before.x + (packed & 0xffff);
    uint first_node = levels.first[step];

    if (own && partner >= i) {
        uint node = step == 0 ? i : clusters.v[i];
        if (partner > i) {
            uint other = step == 0 ? partner : clusters.v[partner];
            Box box = box_union(bvh2_box(nodes.v[node]), bvh2_box(nodes.v[other]));
            uint made = first_node + before.y + (packed >> 16);
            nodes.v[made] = bvh2_node(box, node, other);
            node = made;
        }
        next_clusters.v[place] = node;
    }

    if (block == gl_NumWorkGroups.x - 1 && lane == 0) {
        uint clusters_left = before.x + (block_total & 0xffff);
        uint pairs = before.y + (block_total >> 16);
        // What fits one workgroup is left to the tail.
        uint blocks = clusters_left > gl_WorkGroupSize.x ? blocks_of(clusters_left) : 0;
        state.current = step + 1;
        state.steps[step + 1] = step_after(now, step, clusters_left);
        state.arguments[step + 1] = DispatchArguments(blocks, 1, 1);
        levels.first[step + 1] = first_node + pairs;
        bool few = now.clusters <= FEW;
        uint level_groups = few ? 0 : (pairs + level_group - 1) / level_group;
        levels.arguments[step] = DispatchArguments(level_groups, 1, 1);
        if (few && (step == 0 || state.steps[step - 1].clusters > FEW)) {
            levels.tail = step;
        }
    }
}
