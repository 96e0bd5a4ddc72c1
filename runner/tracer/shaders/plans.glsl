// What the optimal contraction decided about an inner node: see contract/optimal/mod.rs.

#ifndef PLANS_GLSL
#define PLANS_GLSL

// ARITY words a node: the costs of its subtree as a forest of up to 1, 2, … ARITY - 1 trees, and the decisions.
layout(buffer_reference, scalar, buffer_reference_align = 4) coherent buffer Plans {
    uint v[];
};

const uint PLAN_LEAF = 0x80000000u;

// Of up to `roots` trees, how many may lie below the left child; 0 where one fewer in all is as good.
uint plan_left(uint decisions, uint roots) {
    return decisions >> (3 * (roots - 2)) & 7;
}

#endif
