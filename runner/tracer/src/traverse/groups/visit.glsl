// Statements of closest_hits.glsl: a lane takes the next node of its group, tests the children, and has a group of
// nodes and one of triangles of those that the ray meets.
uint octinv = inverse_octant(slab.inverse, group.x);
uint bit = findMSB(group.y);
group.y ^= 1u << bit;
uint slot = (bit - 24) ^ octinv;
uint node = group.x + bitCount(group.y & 0xffu & ((1u << slot) - 1));
if (group.y > IS_NODES) {
    PUSH(group)
}
Compressed c = load_compressed(tree.nodes, node);
if (COUNT == RAYS) {
    nodes_visited++;
    boxes_tested += children_of(c);
}
if (COUNT == VISITS) {
    atomicAdd(tree.visits.items[node], 1);
}
octinv = inverse_octant(slab.inverse, c.first_node);
float t[8];
uint met = meet(c, slab, octinv, t_min, best.t, t);
group = uvec2(c.first_node, met & 0xff000000u | c.imask);
triangles = uvec2(c.first_triangle, met & IS_NODES);
if (ORDER == DISTANCE) {
    // The farthest first, each as a group of its own; the nearest stays.
    while (bitCount(group.y & 0xff000000u) > 1) {
        uint farthest = 0;
        float distance_ = -INFINITY;
        [[unroll]] for (uint i = 0; i < 8; i++) {
            uint its = 24 + (i ^ octinv);
            if ((group.y >> its & 1) != 0 && t[i] > distance_) {
                distance_ = t[i];
                farthest = its;
            }
        }
        group.y ^= 1u << farthest;
        uvec2 alone = uvec2(group.x, 1u << farthest | c.imask);
        PUSH(alone)
    }
}
