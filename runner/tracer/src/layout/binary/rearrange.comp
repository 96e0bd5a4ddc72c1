#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "bvh2.glsl"
#include "collapse.glsl"
#include "levels.glsl"

// Top down, a level a dispatch: every node learns its place from its parent and tells its children theirs.
//
//   node p, of the triangles from f on          its left child:  node p + 1,           triangles from f
//                                               its right child: node p + 1 + inner(left),
//                                                                triangles from f + triangles(left)
//
// Thus nodes are numbered depth first and leaves' triangles lie in the order of the leaves, whatever the
// order in which invocations run. Inside a collapsed leaf only triangles have places.

layout(local_size_x_id = 0) in;

// Node (NONE inside a leaf) and first triangle of each inner node of the binary tree. Coherent, because
// one workgroup reads what it wrote a level before.
layout(buffer_reference, scalar, buffer_reference_align = 8) coherent buffer Places {
    uvec2 v[];
};

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Positions {
    uint v[];
};

// Seven 8-byte stores a node: see layout/binary/mod.rs.
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Nodes {
    uvec2 v[];
};

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Summary {
    uint nodes;
    uint depth;
    uint levels;
    uint large_levels;
    uint iterations;
};

layout(push_constant, scalar) uniform Push {
    Bvh2Nodes nodes;
    Levels levels;
    Subtrees subtrees;
    Places places;
    // Of each leaf of the binary tree, where its triangle goes.
    Positions positions;
    Nodes nodes_out;
    Summary summary;
    // A level, or TAIL for all from `levels.tail` on in one workgroup.
    uint level;
};

const uint NONE = 0xffffffffu;
const uint LEAF_BIT = 0x80000000u;
const uint COUNT_SHIFT = 27;

uint leaf_code(uint first, uint triangles) {
    return LEAF_BIT | (triangles - 1) << COUNT_SHIFT | first;
}

void write_node(uint place, Box a, Box b, uint child_a, uint child_b) {
    uint at = 7 * place;
    nodes_out.v[at + 0] = floatBitsToUint(a.lo.xy);
    nodes_out.v[at + 1] = uvec2(floatBitsToUint(a.lo.z), floatBitsToUint(a.hi.x));
    nodes_out.v[at + 2] = floatBitsToUint(a.hi.yz);
    nodes_out.v[at + 3] = floatBitsToUint(b.lo.xy);
    nodes_out.v[at + 4] = uvec2(floatBitsToUint(b.lo.z), floatBitsToUint(b.hi.x));
    nodes_out.v[at + 5] = floatBitsToUint(b.hi.yz);
    nodes_out.v[at + 6] = uvec2(child_a, child_b);
}

// Tells a child its place; returns what its parent writes down as child index.
uint place_child(uint child, Subtree subtree, uint node, uint triangle, uint leaves) {
    if (child < leaves) {
        positions.v[child] = triangle;
    } else {
        places.v[child - leaves] = uvec2(node, triangle);
    }
    return node != NONE ? node : leaf_code(triangle, subtree.triangles);
}

Subtree subtree_of(uint node, uint leaves) {
    return node < leaves ? Subtree(0.0, 1, 0, 0) : unpack_subtree(subtrees.v[node - leaves]);
}

void rearrange(uint index, uint leaves) {
    bool root = index == 2 * leaves - 2;
    uvec2 place = root ? uvec2(0) : places.v[index - leaves];
    Bvh2Node node = nodes.v[index];
    uint left = node.lo_left.w;
    uint right = node.hi_right.w;
    Subtree l = subtree_of(left, leaves);
    Subtree r = subtree_of(right, leaves);
    // Below a node that became a leaf, one that stayed inner is none either.
    bool inside_leaf = place.x == NONE;
    uint node_l = inside_leaf || l.inner == 0 ? NONE : place.x + 1;
    uint node_r = inside_leaf || r.inner == 0 ? NONE : place.x + 1 + l.inner;
    uint code_l = place_child(left, l, node_l, place.y, leaves);
    uint code_r = place_child(right, r, node_r, place.y + l.triangles, leaves);
    if (!inside_leaf) {
        write_node(place.x, bvh2_box(nodes.v[left]), bvh2_box(nodes.v[right]), code_l, code_r);
    }
}

void main() {
    uint levels_end = levels.count;
    uint leaves = levels.leaves;
    if (level == TAIL && gl_LocalInvocationIndex == 0) {
        Subtree whole = subtree_of(2 * leaves - 2, leaves);
        summary.nodes = max(whole.inner, 1);
        summary.depth = max(whole.height, 1);
        summary.levels = levels_end;
        summary.large_levels = levels.tail;
        summary.iterations = levels.iterations;
        if (leaves == 1) {
            // A lone triangle still needs a node that holds its box. The other child is absent: its box is
            // a point at infinity, which every slab test misses, whichever way the ray goes.
            positions.v[0] = 0;
            vec3 infinity = vec3(uintBitsToFloat(0x7f800000));
            write_node(0, bvh2_box(nodes.v[0]), Box(infinity, infinity), leaf_code(0, 1), leaf_code(0, 1));
        }
    }
    uint begin = level == TAIL ? levels.tail : level;
    uint end = level == TAIL ? levels_end : min(level + 1, levels_end);
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint k = end; k > begin; --k) {
        uint last = levels.first[k];
        for (uint i = levels.first[k - 1] + gl_GlobalInvocationID.x; i < last; i += stride) {
            rearrange(i, leaves);
        }
        if (level == TAIL) {
            memoryBarrierBuffer();
            barrier();
        }
    }
}
