// Statements of a traversal: a lane reads the ray at `ray`, and starts at the root.
Ray r = rays.items[ray];
origin = r.origin;
t_min = r.t_min;
slab = slab_of_ray(r.origin, r.direction, tree.extent);
shear = aim(r.direction);
best = Hit(min(r.t_max, LARGEST), MISS);
#if defined(LAYOUT_COMPRESSED)
group = ROOT;
#else
node = 0;
#endif
top = 0;
nodes_visited = 0;
boxes_tested = 0;
triangles_tested = 0;
