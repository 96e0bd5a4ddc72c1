// See layout/wide/mod.rs.

void encode(Words to, WideNode node, Box box[ARITY]) {
    uint next_node = node.first_node;
    uint next_triangle = node.first_triangle;
    [[unroll]] for (uint slot = 0; slot < ARITY; slot++) {
        [[unroll]] for (uint axis = 0; axis < 3; axis++) {
            to.v[6 * slot + axis] = floatBitsToUint(box[slot].lo[axis]);
            to.v[6 * slot + 3 + axis] = floatBitsToUint(box[slot].hi[axis]);
        }
        to.v[6 * ARITY + slot] = child_code(node, slot, next_node, next_triangle);
    }
    to.v[7 * ARITY] = node.children;
    to.v[7 * ARITY + 1] = node.triangles;
}
