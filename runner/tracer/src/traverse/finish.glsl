// Statements of closest_hit.glsl: a ray that has nothing left to visit hands in its hit.
if (ray != MISS && FINISHED) {
    if (TRIANGLE_TEST == WOOP && best.triangle != MISS) {
        best.triangle = tree.indices.items[best.triangle];
    }
    hits.items[ray] = Hit(best.triangle == MISS ? INFINITY : best.t, best.triangle);
    if (COUNT == RAYS) {
        tree.counts.items[ray] = uvec4(nodes_visited, boxes_tested, triangles_tested, 0);
    }
    finished++;
    ray = MISS;
}
