// Statements of a traversal: a lane tests the triangle at `index` in leaf order and keeps it where it is the nearest
// so far. Of `best` that is the place, with WOOP, which finish.glsl replaces by the triangle's index. Whether the
// distance had to be found exactly is left in `uncertain`, which must be false before.
//
// In scope are `tree`, `rays`, `ray`, its `origin`, `t_min`, what `aim` made of its direction in `shear`, `best`, and the
// counter `triangles_tested`.
if (COUNT == RAYS) {
    triangles_tested++;
}
#include "traverse/try_triangle.glsl"
if (uncertain) {
    t = exact_distance(rays, ray, tree.triangles, index);
}
if (t > t_min && t < best.t) {
    best = Hit(t, found);
}
