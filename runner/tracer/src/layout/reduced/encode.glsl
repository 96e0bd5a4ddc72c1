// See layout/reduced/mod.rs.
#include "layout/reduced/half.glsl"

const uint LEAF = 1u << 31;
const uint LEAF_FIRST = 1u << 30;

void write_item(uint64_t base, uint index, uvec3 data, uint tag) {
    Words to = Words(base + uint64_t(index) * STRIDE);
    to.v[0] = data.x;
    to.v[1] = data.y;
    to.v[2] = data.z;
    to.v[3] = tag;
}

uvec3 halves(Box box) {
    uvec3 planes;
    [[unroll]] for (uint axis = 0; axis < 3; axis++) {
        planes[axis] = half_below(box.lo[axis]) | half_above(box.hi[axis]) << 16;
    }
    return planes;
}

// Items k and k + 1 of a leaf.
uint pair(uint k, uint count) {
    return (k < count ? k : 0) | (k + 1 < count ? k + 1 : 0) << 16;
}

// Where the children of a node of the wide tree are.
uint tag_of(uint node) {
    uint leaves = wide.v[(WIDE_HEADER + ARITY) * node + 2] & 15;
    return arranged.v[node].place | (leaves > 0 ? LEAF_FIRST : 0);
}

// The children of the wide tree's node i, and with the first of them the root.
void encode(uint64_t base, uint i, WideNode node, Box box[2]) {
    if (i == 0) {
        Box all = node.children > 1 ? box_union(box[0], box[1]) : box[0];
        write_item(base, 0, halves(all), tag_of(0));
    }
    uint at = arranged.v[i].place;
    uint next_triangle = node.first_triangle;
    [[unroll]] for (uint slot = 0; slot < 2; slot++) {
        if (slot < node.leaves) {
            uint count = node.size[slot] + 1;
            write_item(base, at, halves(box[slot]), LEAF | next_triangle);
            uvec3 items = uvec3(pair(2, count), pair(4, count), pair(6, count));
            write_item(base, at + 1, items, pair(0, count));
            next_triangle += count;
            at += 2;
        } else if (slot < node.children) {
            write_item(base, at, halves(box[slot]), tag_of(node.first_node + slot - node.leaves));
            at += 1;
        } else {
            write_item(base, at, uvec3(0x7c007c00u), LEAF);
            write_item(base, at + 1, uvec3(0), 0);
            at += 2;
        }
    }
}
