// Statements of closest_hit.glsl: a lane at an inner node tests its children, goes on with the nearest, and
// stacks the others. (A function would have to be handed the stack.)
float t[ARITY];
uint child[ARITY];
uint tested;
uint hits_now = meet(tree.nodes, node, slab, t_min, best.t, t, child, tested);
if (COUNT == RAYS) {
    nodes_visited++;
    boxes_tested += tested;
}
if (COUNT == VISITS) {
    atomicAdd(tree.visits.items[node], 1);
}
order(t, child);
// All but the nearest, farthest first: each case falls through to the next.
[[unroll]] for (uint k = 1; k < ARITY; k++) {
    if (ARITY - k < hits_now) {
        stack[++top] = child[ARITY - k];
    }
}
node = hits_now > 0 ? child[0] : stack[top--];
if (is_leaf(node) && leaf == NONE) {
    leaf = node;
    node = stack[top--];
}
