#version 460
// The traversal of one wavefront through binary nodes, with code for each octant that the rays of a subgroup point into.
#extension GL_GOOGLE_include_directive : require

#define LAYOUT_BINARY
#define ARITY 2
#define BY_OCTANT
#include "traverse/wavefront.glsl"
