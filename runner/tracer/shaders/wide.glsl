// The wide tree between contraction and layout: see contract/mod.rs.

#ifndef WIDE_GLSL
#define WIDE_GLSL

// Nodes of 4 + arity words:
//   first_node      the children that are nodes follow each other from here on
//   first_triangle  the triangles of the children that are leaves, from here on, leaf by leaf
//   counts          children << 4 | leaves
//   triangles       in the whole subtree
//   child[arity]    leaves first: index in the binary tree, and for a leaf (triangles - 1) << 28
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer WideNodes {
    uint v[];
};

const uint WIDE_HEADER = 4;
const uint WIDE_CHILD_MASK = 0x0fffffffu;
const uint WIDE_COUNT_SHIFT = 28;

// How far a contraction has come. Coherent and volatile, because invocations wait for each other's words
// in one of its forms.
layout(buffer_reference, scalar, buffer_reference_align = 4) coherent volatile buffer Progress {
    uint nodes;      // that have a place
    uint finished;   // whose children have been chosen
    uint triangles;  // that have a place in a leaf
    uint claimed;    // nodes that an invocation has taken or waits for
    uint depth;      // nodes on the longest way down so far
    uint stack;      // entries that a traversal's stack needs at most
    uint groups_done;
    uint begin;      // the level being processed, by node
    uint end;
    uint x, y, z;    // workgroups it takes
};

// Whether all nodes that have a place have been made. Where more levels were needed than recorded, some
// have not, and what stands in their places leads anywhere.
bool wide_complete(Progress progress) {
    return progress.finished == progress.nodes;
}

#endif
