// Statements of closest_hit.glsl: a lane at an inner node tests its children, goes on with the nearest, and
// stacks the others. (A function would have to be handed the stack.) OCTANT is what its ray points into, or MIXED where
// that is not known.
#if defined(LAYOUT_BINARY)
BinaryNode loaded = load_binary(tree.nodes, node);
if (COUNT == RAYS) {
    nodes_visited++;
    boxes_tested += 2;
}
if (COUNT == VISITS) {
    atomicAdd(tree.visits.items[node], 1);
}
int t[2];
bool left = MEETS(loaded.lo[0], loaded.hi[0], t[0]);
bool right = MEETS(loaded.lo[1], loaded.hi[1], t[1]);
// (With && and ||, some compilers branch.)
bool both = all(bvec2(left, right));
bool right_first = any(bvec2(!left, all(bvec2(both, t[1] < t[0]))));
if (both) {
    stack[++top] = right_first ? loaded.child.x : loaded.child.y;
}
node = right_first ? loaded.child.y : loaded.child.x;
if (!left && !right) {
    node = stack[top--];
}
#else
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
#endif
if (SPECULATE != 0) {
#include "traverse/postpone.glsl"
}
