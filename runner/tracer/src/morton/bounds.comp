#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_GOOGLE_include_directive : require
#include "scene_bounds.glsl"
#include "input.glsl"

// Reduces the boxes of all triangles, and the centres of these boxes, to two boxes: each invocation over
// a stride, then each subgroup, then each workgroup, then twelve atomics a workgroup.

layout(local_size_x_id = 0) in;

layout(push_constant, scalar) uniform Push {
    Triangles triangles;
    SceneBounds bounds;
    uint count;
};

#define INFINITY uintBitsToFloat(0x7f800000u)

shared uint partial[12];

void main() {
    for (uint i = gl_LocalInvocationIndex; i < 12; i += gl_WorkGroupSize.x) {
        partial[i] = ~0u;
    }
    barrier();

    Box centers = Box(vec3(INFINITY), vec3(-INFINITY));
    Box boxes = centers;
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint i = gl_GlobalInvocationID.x; i < count; i += stride) {
        Box box = triangle_box(triangles.v[i]);
        vec3 center = box_center(box);
        centers = box_union(centers, Box(center, center));
        boxes = box_union(boxes, box);
    }
    centers = Box(subgroupMin(centers.lo), subgroupMax(centers.hi));
    boxes = Box(subgroupMin(boxes.lo), subgroupMax(boxes.hi));
    if (subgroupElect()) {
        for (uint axis = 0; axis < 3; ++axis) {
            atomicMin(partial[axis], ordered_from_float(centers.lo[axis]));
            atomicMin(partial[3 + axis], ~ordered_from_float(centers.hi[axis]));
            atomicMin(partial[6 + axis], ordered_from_float(boxes.lo[axis]));
            atomicMin(partial[9 + axis], ~ordered_from_float(boxes.hi[axis]));
        }
    }
    barrier();
    if (gl_LocalInvocationIndex == 0) {
        for (uint axis = 0; axis < 3; ++axis) {
            atomicMin(bounds.centroid_lo[axis], partial[axis]);
            atomicMin(bounds.centroid_hi_inverted[axis], partial[3 + axis]);
            atomicMin(bounds.box_lo[axis], partial[6 + axis]);
            atomicMin(bounds.box_hi_inverted[axis], partial[9 + axis]);
        }
    }
}
