// See layout/quantized/mod.rs, which draws the format and gives the reasons.

#include "grid.glsl"

void encode(uint to, WideNode node, Box box[ARITY]) {
    Box all = box[0];
    [[unroll]] for (uint slot = 1; slot < ARITY; slot++) {
        if (slot < node.children) {
            all = box_union(all, box[slot]);
        }
    }
    // Per slot, the grid's lines below and above: 8 bits each.
    uint lo[ARITY][3];
    uint hi[ARITY][3];
    uint exponents = 0;
    [[unroll]] for (uint axis = 0; axis < 3; axis++) {
        float origin = all.lo[axis];
        Grid grid = grid_of(origin, all.hi[axis], 8);
        exponents |= grid.exponent << (8 * axis);
        [[unroll]] for (uint slot = 0; slot < ARITY; slot++) {
            lo[slot][axis] = 0;
            hi[slot][axis] = 0;
            if (slot < node.children) {
                lo[slot][axis] = line_below(grid, box[slot].lo[axis]);
                hi[slot][axis] = line_above(grid, box[slot].hi[axis]);
            }
        }
        staged[to + axis] = floatBitsToUint(origin);
    }
    staged[to + 3] = exponents | node.leaves << 24 | node.children << 28;
    staged[to + 4] = node.first_node;
    staged[to + 5] = node.first_triangle;
    uint sizes = 0;
    [[unroll]] for (uint slot = 0; slot < ARITY; slot++) {
        if (slot < node.leaves) {
            sizes |= node.size[slot] << (4 * slot);
        }
        staged[to + 7 + slot] = lo[slot][0] | hi[slot][0] << 8 | lo[slot][1] << 16 | hi[slot][1] << 24;
    }
    staged[to + 6] = sizes;
    [[unroll]] for (uint pair = 0; pair < ARITY / 2; pair++) {
        uint even = lo[2 * pair][2] | hi[2 * pair][2] << 8;
        uint odd = lo[2 * pair + 1][2] | hi[2 * pair + 1][2] << 8;
        staged[to + 7 + ARITY + pair] = even | odd << 16;
    }
}
