// What the kernels of PLOC share: see ploc/mod.rs.

#ifndef PLOC_GLSL
#define PLOC_GLSL

#include "bvh2.glsl"
#include "levels.glsl"
#include "scene_bounds.glsl"

layout(local_size_x_id = 0) in;
// How far along the curve a cluster looks for its neighbour, to either side.
layout(constant_id = 1) const uint RADIUS = 16;

// Clusters a workgroup decides about. It also finds the neighbours of RADIUS clusters on either side,
// because whether a pair is mutual depends on them; for that it reads the boxes of 2 RADIUS.
//
//      boxes    [ RADIUS | RADIUS |  own  | RADIUS | RADIUS ]
//      nearest           [ RADIUS |  own  | RADIUS ]           one an invocation
//      decided                    [  own  ]
const uint OWN = gl_WorkGroupSize.x - 2 * RADIUS;
const uint BOXES = gl_WorkGroupSize.x + 2 * RADIUS;
// Blocks whose counts are also summed up in one word, so that no workgroup has to read all of them.
const uint SUPERBLOCK = 32;

// When to stop trusting nearest neighbours: ploc/mod.rs, `Step`.
const uint SMALL = 1024;
const uint PATIENCE = 128;

// From this many clusters on, passes over the levels take one workgroup. A level then has a tenth as many
// nodes.
const uint FEW = 4096;

struct Step {
    uint clusters;
    uint forced;
};

// What the iterations hand on to each other. Iteration k reads steps[k] and leaves steps[k + 1].
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer State {
    uint current;
    Step steps[MAX_LEVELS + 1];
    DispatchArguments arguments[MAX_LEVELS + 1];
};

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Indices {
    uint v[];
};

uint blocks_of(uint clusters) {
    return (clusters + OWN - 1) / OWN;
}

Step step_after(Step now, uint step, uint clusters) {
    bool stuck = clusters > SMALL && clusters > now.clusters - now.clusters / 64;
    return Step(clusters, uint(now.forced == 0 && (stuck || step + 1 >= PATIENCE)));
}

// Boxes of neighbouring clusters, one axis an array: lanes read consecutive words without bank conflicts.
shared vec2 box_x[BOXES];
shared vec2 box_y[BOXES];
shared vec2 box_z[BOXES];

Box shared_box(uint slot) {
    vec2 x = box_x[slot], y = box_y[slot], z = box_z[slot];
    return Box(vec3(x.x, y.x, z.x), vec3(x.y, y.y, z.y));
}

void share_box(uint slot, Box box) {
    box_x[slot] = vec2(box.lo.x, box.hi.x);
    box_y[slot] = vec2(box.lo.y, box.hi.y);
    box_z[slot] = vec2(box.lo.z, box.hi.z);
}

// What stands where there is no cluster: a box so far away that its union with any other is infinite.
Box no_box() {
    return Box(vec3(uintBitsToFloat(0x7f800000)), vec3(uintBitsToFloat(0x7f800000)));
}

// The cluster within RADIUS of `own` (at `slot`) with which it makes the smallest box; itself if none.
//
// Of equally good ones that with the smallest own ^ other. As this is the same seen from either side, the
// best pair of all is always mutual; and where everything is equal, 2k pairs with 2k + 1 at once, not one
// pair an iteration.
uint nearest_cluster(uint own, uint slot, float scale) {
    Box box = shared_box(slot);
    uint best = own;
    // The largest float: infinite areas never win.
    float best_area = uintBitsToFloat(0x7f7fffff);
    uint best_tie = ~0u;
    for (uint distance = 1; distance <= RADIUS; ++distance) {
        for (uint side = 0; side < 2; ++side) {
            uint offset = side == 0 ? distance : -distance;
            Box merged = box_union(box, shared_box(slot + offset));
            float area = box_half_area(merged.lo, merged.hi, scale);
            uint tie = own ^ (own + offset);
            if (area < best_area || (area == best_area && tie < best_tie)) {
                best = own + offset;
                best_area = area;
                best_tie = tie;
            }
        }
    }
    return best;
}

#endif
