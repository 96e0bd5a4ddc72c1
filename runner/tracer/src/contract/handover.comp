#version 460
#extension GL_GOOGLE_include_directive : require
#include "contract/contract.glsl"

// A single launch (Benthin et al. 2024; thesis 2.1.4): every invocation takes a wide node that may not
// exist yet, looks again and again whether its parent has said what it is made of, makes it, and takes
// another.
//
// Where we leave the paper: nodes are taken from a counter instead of by invocation index, and the loop is
// uniform in the subgroup, so nobody depends on the order in which workgroups start or on lanes that wait
// apart. What is left to be guaranteed is that a workgroup that has started goes on while another one
// waits; see `DeviceInfo::hands_work_over`.

void main() {
    uint index = NONE;
    for (;;) {
        bool idle = index == NONE;
        uvec4 wanting = subgroupBallot(idle);
        uint wanted = subgroupBallotBitCount(wanting);
        if (wanted > 0) {
            uint first;
            if (subgroupElect()) {
                first = atomicAdd(progress.claimed, wanted);
            }
            first = subgroupBroadcastFirst(first);
            if (idle) {
                index = first + subgroupBallotExclusiveBitCount(wanting);
            }
        }
        uint from = index < capacity ? tasks.v[index] : NONE;
        bool ready = from != NONE;
        uint now = subgroupBallotBitCount(subgroupBallot(ready));
        if (now > 0) {
            memoryBarrierBuffer();
            contract(ready, index, from);
            // Only now may these count as finished: their children have places.
            memoryBarrierBuffer();
            if (subgroupElect()) {
                atomicAdd(progress.finished, now);
            }
            index = ready ? NONE : index;
        } else {
            // In this order: all that had a place had then been finished.
            bool over = false;
            if (subgroupElect()) {
                uint finished = atomicAdd(progress.finished, 0);
                memoryBarrierBuffer();
                over = finished == atomicAdd(progress.nodes, 0);
            }
            if (subgroupAny(over)) {
                break;
            }
        }
    }
}
