// Statements of closest_hit.glsl: a lane tests one triangle of its postponed leaf; after the last, a second
// leaf takes its place.
uint index = leaf & 0x7FFFFFFu;
#include "traverse/meet_triangle.glsl"
if ((leaf & 0x78000000u) != 0u) {
    leaf += 1u - (1u << 27);  // one triangle further, one fewer left
} else {
    leaf = NONE;
#include "traverse/postpone.glsl"
}
