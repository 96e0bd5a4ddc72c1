// Statements of closest_hit.glsl: a lane tests one triangle of its leaf. After the last, what is on the stack takes its place.
uint tested_leaf = SPECULATE != 0 ? leaf : node;
uint index = tested_leaf & 0x7FFFFFFu;
#include "traverse/meet_triangle.glsl"
bool is_last = (tested_leaf & 0x78000000u) == 0u;
tested_leaf += 1u - (1u << 27);  // one triangle further, one fewer left
if (SPECULATE != 0) {
    leaf = is_last ? NONE : tested_leaf;
#include "traverse/postpone.glsl"
} else {
    node = tested_leaf;
    if (is_last) {
        node = stack[top--];
    }
}
