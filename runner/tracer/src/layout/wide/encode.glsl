// See layout/wide/mod.rs.

void encode(uint to, WideNode node, Box box[ARITY]) {
    uint next_node = node.first_node;
    uint next_triangle = node.first_triangle;
    [[unroll]] for (uint slot = 0; slot < ARITY; slot++) {
        [[unroll]] for (uint axis = 0; axis < 3; axis++) {
            staged[to + 6 * slot + axis] = floatBitsToUint(box[slot].lo[axis]);
            staged[to + 6 * slot + 3 + axis] = floatBitsToUint(box[slot].hi[axis]);
        }
        staged[to + 6 * ARITY + slot] = child_code(node, slot, next_node, next_triangle);
    }
    staged[to + 7 * ARITY] = node.children;
    staged[to + 7 * ARITY + 1] = node.triangles;
}
