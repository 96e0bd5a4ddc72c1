#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "ploc.glsl"
#include "workgroup.glsl"

// The last iterations, in one workgroup and its shared memory, once a workgroup holds all clusters.
//
// Their number is bounded (ploc/mod.rs, `Step`), so the loop is too.

layout(push_constant, scalar) uniform Push {
    Bvh2Nodes nodes;
    // Of even and of odd steps.
    Indices clusters[2];
    State state;
    Levels levels;
    SceneBounds bounds;
};

shared uint node_of[gl_WorkGroupSize.x];
shared uint nearest[gl_WorkGroupSize.x];

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint step = state.current;
    Step now = state.steps[step];
    if (now.clusters > gl_WorkGroupSize.x) {
        // Not enough iterations were recorded; the host sees that `levels.count` is still 0.
        return;
    }
    float scale = scene_scale(bounds);
    uint first_node = levels.first[step];
    uint iterations = step;
    // Else an iteration before this kernel set it.
    bool tail_begins = step == 0 || state.steps[step - 1].clusters > FEW;

    for (uint slot = lane; slot < BOXES; slot += gl_WorkGroupSize.x) {
        share_box(slot, no_box());
    }
    barrier();
    if (lane < now.clusters) {
        uint node = step == 0 ? lane : clusters[step % 2].v[lane];
        node_of[lane] = node;
        share_box(lane + RADIUS, bvh2_box(nodes.v[node]));
    }

    while (now.clusters > 1 && step < MAX_LEVELS) {
        barrier();
        uint partner = lane;
        if (lane < now.clusters) {
            if (now.forced != 0) {
                partner = (lane ^ 1) < now.clusters ? lane ^ 1 : lane;
            } else {
                partner = nearest_cluster(lane, lane + RADIUS, scale);
            }
        }
        nearest[lane] = partner;
        barrier();
        if (nearest[partner] != lane) {
            partner = lane;
        }

        bool survives = lane < now.clusters && partner >= lane;
        bool merges = survives && partner > lane;
        uint total;
        uint packed = workgroup_exclusive_add(uint(survives) + (merges ? 1 << 16 : 0), total);
        Box box = shared_box(lane + RADIUS);
        uint node = node_of[lane];
        if (merges) {
            box = box_union(box, shared_box(partner + RADIUS));
            uint made = first_node + (packed >> 16);
            nodes.v[made] = bvh2_node(box, node, node_of[partner]);
            node = made;
        }
        barrier();
        share_box(lane + RADIUS, no_box());
        barrier();
        if (survives) {
            node_of[packed & 0xffff] = node;
            share_box((packed & 0xffff) + RADIUS, box);
        }

        now = step_after(now, step, total & 0xffff);
        first_node += total >> 16;
        ++step;
        if (lane == 0) {
            levels.first[step] = first_node;
            state.steps[step] = now;
        }
    }
    if (lane == 0) {
        if (tail_begins) {
            levels.tail = iterations;
        }
        levels.iterations = iterations;
        levels.count = step;
    }
}
