#version 460
// Nothing was hit.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_tracing : require
#include "ray.glsl"

layout(location = 0) rayPayloadInEXT Hit hit;

void main() {
    hit = Hit(INFINITY, MISS);
}
