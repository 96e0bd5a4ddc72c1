// Statements of a traversal: a lane tests the triangle at `index` in leaf order and keeps it where it is the nearest
// so far. Of `best` that is the place, with WOOP, which finish.glsl replaces by the triangle's index. Whether the
// distance had to be found exactly is left in `uncertain`, which must be false before.
//
// In scope are `tree`, `rays`, `ray`, its `origin`, `t_min`, what `aim` made of its direction in `shear`, `best`, and the
// counter `triangles_tested`.
if (COUNT == RAYS) {
    triangles_tested++;
}
float t;
uint found;
if (TRIANGLE_TEST == WOOP) {
    t = woop(origin, shear.shear, t_min, best.t, UnitTriangles(tree.triangles), index);
    found = index;  // until the ray finishes
} else {
    vec4 v0 = tree.triangles.items[index].v0_index;
    vec4 v1 = tree.triangles.items[index].v1;
    vec4 v2 = tree.triangles.items[index].v2;
    if (TRIANGLE_TEST == MOELLER_TRUMBORE) {
        t = moeller_trumbore(origin, shear.shear, v0.xyz, v1.xyz, v2.xyz);
    } else {
        t = intersect(origin, shear, t_min, best.t, v0.xyz, v1.xyz, v2.xyz, HOIST != 0, uncertain);
        if (uncertain) {
            t = exact_distance(rays, ray, tree.triangles, index);
        }
    }
    found = floatBitsToUint(v0.w);
}
if (t > t_min && t < best.t) {
    best = Hit(t, found);
}
