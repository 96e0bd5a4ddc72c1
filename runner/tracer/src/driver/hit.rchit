#version 460
// The nearest triangle. All are one geometry, so that a primitive's number is the triangle's in file order.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_tracing : require
#include "ray.glsl"

layout(location = 0) rayPayloadInEXT Hit hit;

void main() {
    hit = Hit(gl_HitTEXT, gl_PrimitiveID);
}
