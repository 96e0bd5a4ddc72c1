// Statements of closest_hit.glsl: turns by the code for the octant that all rays point into, which few comparisons find.
if (octant == MIXED) {
#include "traverse/phases.glsl"
} else {
    if (octant < 4) {
        if (octant < 2) {
            if (octant == 0) {
#undef OCTANT
#define OCTANT 0
#include "traverse/phases.glsl"
            } else {
#undef OCTANT
#define OCTANT 1
#include "traverse/phases.glsl"
            }
        } else {
            if (octant == 2) {
#undef OCTANT
#define OCTANT 2
#include "traverse/phases.glsl"
            } else {
#undef OCTANT
#define OCTANT 3
#include "traverse/phases.glsl"
            }
        }
    } else {
        if (octant < 6) {
            if (octant == 4) {
#undef OCTANT
#define OCTANT 4
#include "traverse/phases.glsl"
            } else {
#undef OCTANT
#define OCTANT 5
#include "traverse/phases.glsl"
            }
        } else {
            if (octant == 6) {
#undef OCTANT
#define OCTANT 6
#include "traverse/phases.glsl"
            } else {
#undef OCTANT
#define OCTANT 7
#include "traverse/phases.glsl"
            }
        }
    }
}
#undef OCTANT
#define OCTANT MIXED
