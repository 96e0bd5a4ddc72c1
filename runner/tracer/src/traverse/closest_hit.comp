#version 460
// The traversal of one wavefront.
#extension GL_GOOGLE_include_directive : require

#include "traverse/wavefront.glsl"
