// Statements of turn.glsl: a lane that has finished its part of a ray hands in its hit. Of all such hits, the nearest is
// kept; distances are in the order of their bits.
bool merges = ray != MISS && FINISHED && divided;
if (subgroupAny(merges)) {
    bool hit = merges && best.triangle != MISS;
    HitBits nearest = HitBits(uint64_t(hits));
    uint distance_ = floatBitsToUint(best.t);
    if (hit) {
        atomicMin(nearest.items[ray].x, distance_);
    }
    subgroupMemoryBarrierBuffer();
    // Another lane may have handed in a nearer one.
    if (hit && atomicOr(nearest.items[ray].x, 0) == distance_) {
        hits.items[ray].triangle =
            TRIANGLE_TEST == WOOP ? tree.indices.items[best.triangle] : best.triangle;
    }
    subgroupMemoryBarrierBuffer();
    if (merges) {
        if (COUNT == RAYS) {
            atomicAdd(tree.counts.items[ray].x, nodes_visited);
            atomicAdd(tree.counts.items[ray].y, boxes_tested);
            atomicAdd(tree.counts.items[ray].z, triangles_tested);
        }
        finished += helps ? 0 : 1;
        ray = MISS;
    }
}
