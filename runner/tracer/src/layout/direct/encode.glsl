// See layout/direct/mod.rs.

void write_direct(uint64_t base, uint index, uint fst, uint snd, Box box, uint item_idx, uint item_count) {
    Words to = Words(base + uint64_t(index) * STRIDE);
    to.v[0] = fst;
    to.v[1] = snd;
    [[unroll]] for (uint axis = 0; axis < 3; axis++) {
        to.v[2 + axis] = floatBitsToUint(box.lo[axis]);
        to.v[6 + axis] = floatBitsToUint(box.hi[axis]);
    }
    to.v[5] = item_idx;
    to.v[9] = item_count;
}

// The children of the wide tree's node i, and with the first of them the root.
void encode(uint64_t base, uint i, WideNode node, Box box[2]) {
    if (i == 0) {
        Box all = node.children > 1 ? box_union(box[0], box[1]) : box[0];
        write_direct(base, 0, 1, 2, all, 0, 0);
    }
    uint next_triangle = node.first_triangle;
    [[unroll]] for (uint slot = 0; slot < 2; slot++) {
        uint index = 2 * i + 1 + slot;
        if (slot < node.leaves) {
            uint count = node.size[slot] + 1;
            write_direct(base, index, 0, 0, box[slot], next_triangle, count);
            next_triangle += count;
        } else if (slot < node.children) {
            uint inner = node.first_node + slot - node.leaves;
            write_direct(base, index, 2 * inner + 1, 2 * inner + 2, box[slot], 0, 0);
        } else {
            write_direct(base, index, 0, 0, box[slot], 0, 0);
        }
    }
}
