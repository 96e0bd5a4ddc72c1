// What a kernel keeps of a ray for layouts whose boxes are tested by `enter`. Before it stands the layout's PAD.
#include "slab.glsl"

#define RaySlab Slab

RaySlab slab_of_ray(vec3 origin, vec3 direction, float extent) {
    return slab_of(origin, direction, extent, PAD);
}
