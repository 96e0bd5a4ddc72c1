// Statements of a traversal: the distance `t` at which a lane's ray meets the triangle at `index` in leaf order, and the
// place or index `found` that stands for it in a hit. Where `uncertain`, which must be false before, is true after, the
// distance has to be found exactly. In scope is what meet_triangle.glsl has, too.
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
    } else if (TRIANGLE_TEST == KENSLER_SHIRLEY) {
        t = kensler_shirley(origin, shear.shear, v0.xyz, v1, v2);
    } else {
        t = intersect(origin, shear, t_min, best.t, v0.xyz, v1.xyz, v2.xyz, HOIST != 0, uncertain);
    }
    found = floatBitsToUint(v0.w);
}
