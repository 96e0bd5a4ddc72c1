// The scene as the shading stages read it.
#ifndef SCENE_GLSL
#define SCENE_GLSL

#include "ray.glsl"

// Nine floats a triangle, in file order.
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Positions {
    vec3 items[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer MaterialIds {
    uint items[];
};
struct Material {
    vec3 albedo;
    vec3 emission;
    vec4 phong;  // diffuse, specular, reflective, shininess
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Materials {
    Material items[];
};
struct Light {
    vec3 position;
    float strength;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Lights {
    Light items[];
};
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Scene {
    Positions positions;
    MaterialIds material_ids;
    Materials materials;
    Lights lights;
    vec3 zenith;
    vec3 horizon;
    vec3 ground;
    float extent;  // the largest absolute coordinate
    uint light_count;
};

// A path on its way: where its light goes, and how much of it arrives. 16 bytes.
struct Path {
    uint pixel;
    vec3 throughput;
};
layout(buffer_reference, scalar, buffer_reference_align = 16) BETWEEN_STAGES buffer Paths {
    Path items[];
};

// Sums of radiance, one a pixel, row by row from the top.
layout(buffer_reference, scalar, buffer_reference_align = 16) BETWEEN_STAGES buffer Image {
    vec4 items[];
};

#endif
