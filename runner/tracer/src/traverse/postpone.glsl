// Statements of closest_hit.glsl: a lane that has found its first leaf keeps it, and its next node is on the stack.
if (is_leaf(node) && leaf == NONE) {
    leaf = node;
    node = stack[top--];
}
