#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "bvh2.glsl"
#include "wide.glsl"
#include "arranged.glsl"

// Stores the nodes of a wide tree as a layout wants them, an invocation a node. How one is stored is in the
// layout's own `encode.glsl`.
//
// Nodes that stay in their order are first put into shared memory: a workgroup's nodes are one piece of memory, which
// neighbouring invocations then write word by word. A compressed node has a place of its own, and the children of a node of
// `Direct` and `Reduced`, which are what is stored there, are not beside those of the next one.

layout(local_size_x_id = 0) in;
// Bytes from one node to the next.
layout(constant_id = 1) const uint STRIDE = 4;
// Bits of a plane, where they can be chosen.
layout(constant_id = 2) const uint BITS = 8;

layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer Words {
    uint v[];
};

layout(push_constant, scalar) uniform Push {
    Bvh2Nodes nodes;
    WideNodes wide;
    Progress progress;
    Words nodes_out;
    Arrangement arranged;  // of the compressed and the reduced layout
};

struct WideNode {
    uint first_node;
    uint first_triangle;
    uint children;
    uint leaves;
    uint triangles;
    uint child[ARITY];  // index in the binary tree
    uint size[ARITY];   // triangles of a leaf less one, 0 for a node
};

// What stands in an absent slot, for every slab test to miss, whichever way the ray goes: a box without inside for those
// that know from the ray's signs which plane is met first, and a point at infinity for those that sort the two.
Box absent() {
#if defined(LAYOUT_BINARY)
    vec3 largest = vec3(uintBitsToFloat(0x7f7fffff));
    return Box(largest, -largest);
#else
    vec3 infinity = vec3(uintBitsToFloat(0x7f800000));
    return Box(infinity, infinity);
#endif
}

// See layout/binary/mod.rs.
uint child_code(WideNode node, uint slot, inout uint next_node, inout uint next_triangle) {
    if (slot >= node.children) {
        return 0x80000000u;
    }
    if (slot >= node.leaves) {
        return next_node++;
    }
    uint code = 0x80000000u | node.size[slot] << 27 | next_triangle;
    next_triangle += node.size[slot] + 1;
    return code;
}

#if defined(LAYOUT_COMPRESSED)
#include "layout/compressed/encode.glsl"
#elif defined(LAYOUT_DIRECT)
#include "layout/direct/encode.glsl"
#elif defined(LAYOUT_REDUCED)
#include "layout/reduced/encode.glsl"
#else
#define STAGED
// Words of a node, which may be followed by others up to the next one.
#if defined(LAYOUT_QUANTIZED)
const uint NODE_WORDS = 7 + ARITY + ARITY / 2;
#elif defined(LAYOUT_WIDE)
const uint NODE_WORDS = 7 * ARITY + 2;
#else
const uint NODE_WORDS = 14;
#endif
// An odd distance lets lanes write to different banks.
const uint PITCH = NODE_WORDS | 1;
shared uint staged[PITCH * gl_WorkGroupSize.x];
#if defined(LAYOUT_QUANTIZED)
#include "layout/quantized/encode.glsl"
#elif defined(LAYOUT_WIDE)
#include "layout/wide/encode.glsl"
#else
#include "layout/binary/encode.glsl"
#endif
#endif

void main() {
    uint count = wide_complete(progress) ? progress.nodes : 0;
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint first = gl_WorkGroupID.x * gl_WorkGroupSize.x; first < count; first += stride) {
        uint i = first + gl_LocalInvocationIndex;
        if (i < count) {
            uint at = (WIDE_HEADER + ARITY) * i;
            WideNode node;
            node.first_node = wide.v[at + 0];
            node.first_triangle = wide.v[at + 1];
            uint counts = wide.v[at + 2];
            node.children = counts >> 4;
            node.leaves = counts & 15;
            node.triangles = wide.v[at + 3];
            Box box[ARITY];
            [[unroll]] for (uint slot = 0; slot < ARITY; slot++) {
                box[slot] = absent();
                if (slot < node.children) {
                    uint word = wide.v[at + WIDE_HEADER + slot];
                    node.child[slot] = word & WIDE_CHILD_MASK;
                    node.size[slot] = word >> WIDE_COUNT_SHIFT;
                    box[slot] = bvh2_box(nodes.v[node.child[slot]]);
                }
            }
#if defined(LAYOUT_COMPRESSED)
            Arranged own = arranged.v[i];
            encode(Words(uint64_t(nodes_out) + uint64_t(own.place) * STRIDE), node, box, own.slots);
#elif defined(LAYOUT_DIRECT) || defined(LAYOUT_REDUCED)
            encode(uint64_t(nodes_out), i, node, box);
#else
            encode(PITCH * gl_LocalInvocationIndex, node, box);
#endif
        }
#if defined(STAGED)
        barrier();
        uint words = NODE_WORDS * min(gl_WorkGroupSize.x, count - first);
        Words to = Words(uint64_t(nodes_out) + uint64_t(first) * STRIDE);
        for (uint word = gl_LocalInvocationIndex; word < words; word += gl_WorkGroupSize.x) {
            uint node = word / NODE_WORDS, at = word % NODE_WORDS;
            to.v[STRIDE / 4 * node + at] = staged[PITCH * node + at];
        }
        barrier();
#endif
    }
}
