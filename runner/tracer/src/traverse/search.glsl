// Statements of phases.glsl: where all rays point into OCTANT, lanes visit nodes until all, or all but few, have a leaf or
// have nothing left.
for (;;) {
    steps += 2 + VISITS_A_VOTE * NODE_STEPS;
    // Of several visits, lanes leave all as one loop, where they meet again; those of kernels that count vote in each.
    [[unroll]] for (uint visit = 0; visit < VISITS_A_VOTE; visit++) {
        if (COUNT == RAYS) {
            node_steps += step_of(lanes(is_inner(node)));
        } else if (VISITS_A_VOTE > 1 && !is_inner(node)) {
            break;
        }
        if (is_inner(node)) {
#include "traverse/visit_node.glsl"
        }
    }
    if (lanes(LOOKS_FOR_LEAF) <= SEARCH_ABOVE || (QUOTA != 0 && steps > QUOTA)) {
        break;
    }
}
