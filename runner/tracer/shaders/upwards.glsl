// The main function of passes up the binary tree: `visit` for every inner node, children before parents. See
// `Upwards` in upwards/mod.rs. Included behind the push constants, which have `levels`, `bounds` and `level`, and
// `visit`; and where the tree may have no levels, `ordered`, which says which node is listed at a place.

void main() {
    // 0 while the tree is incomplete; then nothing here is of use.
    uint levels_end = levels.count;
    // A level, or TAIL for all from `levels.tail` on in one workgroup.
    uint begin = level == TAIL ? levels.tail : level;
    uint end = level == TAIL ? levels_end : min(level + 1, levels_end);
    uint leaves = levels.leaves;
    float scale = scene_scale(bounds);
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint k = begin; k < end; ++k) {
        uint last = levels.first[k + 1];
        for (uint i = levels.first[k] + gl_GlobalInvocationID.x; i < last; i += stride) {
#ifdef ORDERED
            visit(ordered(i, leaves), leaves, scale);
#else
            visit(i, leaves, scale);
#endif
        }
        if (level == TAIL) {
            memoryBarrierBuffer();
            barrier();
        }
    }
}
