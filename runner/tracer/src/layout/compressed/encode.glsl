// See layout/compressed/mod.rs, which draws the format.
#include "grid.glsl"

void encode(Words to, WideNode node, Box box[ARITY], uint slots) {
    Box all = box[0];
    [[unroll]] for (uint child = 1; child < ARITY; child++) {
        if (child < node.children) {
            all = box_union(all, box[child]);
        }
    }
    Grid grid[3];
    [[unroll]] for (uint axis = 0; axis < 3; axis++) {
        grid[axis] = grid_of(all.lo[axis], all.hi[axis], BITS);
        to.v[axis] = floatBitsToUint(all.lo[axis]);
    }
    // Of leaves, which come first among the children, the first triangle.
    uint offset[ARITY];
    uint triangles = 0;
    [[unroll]] for (uint child = 0; child < ARITY; child++) {
        offset[child] = triangles;
        triangles += child < node.leaves ? node.size[child] + 1 : 0;
    }
    uint imask = 0;
    [[unroll]] for (uint four = 0; four < 2; four++) {
        uint meta = 0;
        // Lower planes in x, y and z, then upper ones.
        uint lines[6] = uint[6](0xffffffffu, 0xffffffffu, 0xffffffffu, 0, 0, 0);
        for (uint k = 0; k < 4; k++) {
            uint slot = 4 * four + k;
            uint child = slots >> (4 * slot) & 15;
            if (child == NO_CHILD) {
                continue;
            }
            bool leaf = child < node.leaves;
            imask |= leaf ? 0 : 1 << slot;
            uint size = leaf ? node.size[child] + 1 : 0;
            meta |= (leaf ? ((1 << size) - 1) << 5 | offset[child] : 0x20 | (24 + slot)) << (8 * k);
            for (uint axis = 0; axis < 3; axis++) {
                uint below = line_below(grid[axis], box[child].lo[axis]);
                uint above = line_above(grid[axis], box[child].hi[axis]);
                lines[axis] ^= (0xff ^ below) << (8 * k);
                lines[3 + axis] |= above << (8 * k);
            }
        }
        to.v[6 + four] = meta;
        [[unroll]] for (uint row = 0; row < 6; row++) {
            to.v[8 + 2 * row + four] = lines[row];
        }
    }
    to.v[3] = grid[0].exponent | grid[1].exponent << 8 | grid[2].exponent << 16 | imask << 24;
    to.v[4] = node.first_node;
    to.v[5] = node.first_triangle;
}
