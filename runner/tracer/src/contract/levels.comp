#version 460
#extension GL_GOOGLE_include_directive : require
#include "contract/contract.glsl"

// The portable form: a level a dispatch, no invocation waits for another. The nodes that a level's nodes
// get for children are the next level; whichever workgroup ends last writes down how large that is.

void main() {
    uint begin = progress.begin;
    uint end = progress.end;
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint first = begin + gl_WorkGroupID.x * gl_WorkGroupSize.x; first < end; first += stride) {
        uint index = first + gl_LocalInvocationIndex;
        bool active_ = index < end;
        contract(active_, index, active_ ? tasks.v[index] : 0);
    }
    memoryBarrierBuffer();
    barrier();
    if (gl_LocalInvocationIndex == 0 && atomicAdd(progress.groups_done, 1) == gl_NumWorkGroups.x - 1) {
        uint nodes_now = atomicAdd(progress.nodes, 0);
        progress.groups_done = 0;
        progress.finished = end;
        progress.begin = end;
        progress.end = nodes_now;
        progress.x = min((nodes_now - end + gl_WorkGroupSize.x - 1) / gl_WorkGroupSize.x, 65535u);
    }
}
