// Statements of closest_hit.glsl: a lane tests one triangle of its postponed leaf; after the last, a second
// leaf takes its place.
uint index = leaf & 0x7FFFFFFu;
vec4 v0 = tree.triangles.items[index].v0_index;
vec4 v1 = tree.triangles.items[index].v1;
vec4 v2 = tree.triangles.items[index].v2;
if (COUNT == RAYS) {
    triangles_tested++;
}
float t = intersect(origin, shear, t_min, best.t, v0.xyz, v1.xyz, v2.xyz, HOIST != 0, uncertain);
if (uncertain) {
    t = exact_distance(rays, ray, tree.triangles, index);
}
if (t > t_min && t < best.t) {
    best = Hit(t, floatBitsToUint(v0.w));
}
if ((leaf & 0x78000000u) != 0u) {
    leaf += 1u - (1u << 27);  // one triangle further, one fewer left
} else {
    leaf = NONE;
    if (is_leaf(node)) {
        leaf = node;
        node = stack[top--];
    }
}
