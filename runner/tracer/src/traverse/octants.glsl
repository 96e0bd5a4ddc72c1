// Statements of closest_hit.glsl: the search by the code for the octant that all rays point into, which few comparisons find.
if (OCTANTS == 0 || octant == MIXED) {
#include "traverse/search.glsl"
} else {
    if (octant < 4) {
        if (octant < 2) {
            if (octant == 0) {
#undef OCTANT
#define OCTANT 0
#include "traverse/search.glsl"
            } else {
#undef OCTANT
#define OCTANT 1
#include "traverse/search.glsl"
            }
        } else {
            if (octant == 2) {
#undef OCTANT
#define OCTANT 2
#include "traverse/search.glsl"
            } else {
#undef OCTANT
#define OCTANT 3
#include "traverse/search.glsl"
            }
        }
    } else {
        if (octant < 6) {
            if (octant == 4) {
#undef OCTANT
#define OCTANT 4
#include "traverse/search.glsl"
            } else {
#undef OCTANT
#define OCTANT 5
#include "traverse/search.glsl"
            }
        } else {
            if (octant == 6) {
#undef OCTANT
#define OCTANT 6
#include "traverse/search.glsl"
            } else {
#undef OCTANT
#define OCTANT 7
#include "traverse/search.glsl"
            }
        }
    }
}
#undef OCTANT
#define OCTANT MIXED
