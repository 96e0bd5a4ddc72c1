// Where the nodes of a layout whose slots mean something go, and what is in their slots: see
// layout/compressed/mod.rs.

#ifndef ARRANGED_GLSL
#define ARRANGED_GLSL

struct Arranged {
    uint place;  // in the layout, of this node
    uint slots;  // four bits each: the child's number, or NO_CHILD
};

layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Arrangement {
    Arranged v[];
};

const uint NO_CHILD = 15;

#endif
