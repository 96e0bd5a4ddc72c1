// Light that a surface sends to a viewer by point lights: see path/phong.rs.
#ifndef PHONG_GLSL
#define PHONG_GLSL

#include "scene.glsl"

// What the integrators go by, and where the camera is: `Shading` in path/shading.rs.
struct Shading {
    uint integrator;
    float specular;
    float ambience;
    float camera_light;
    vec3 eye;
};
const uint PHONG = 1;

// Lambert's and Blinn's terms of one light, added to the sums of all.
void add_light(vec3 to_light, float strength, vec3 normal, vec3 to_viewer, float shininess, inout vec2 sums) {
    to_light *= inversesqrt(max(dot(to_light, to_light), 1e-30));
    float cosine = dot(normal, to_light);
    if (cosine > 0.0) {
        vec3 between = to_light + to_viewer;
        float aligned = dot(normal, between) * inversesqrt(max(dot(between, between), 1e-30));
        sums += strength * vec2(cosine, aligned > 0.0 ? pow(aligned, shininess) : 0.0);
    }
}

vec3 local_light(Scene scene, Material material, Shading shading, vec3 position, vec3 normal, vec3 to_viewer) {
    float shininess = material.phong.w;
    vec2 sums = vec2(0.0);
    for (uint i = 0; i < scene.light_count; i++) {
        Light light = scene.lights.items[i];
        add_light(light.position - position, light.strength, normal, to_viewer, shininess, sums);
    }
    add_light(shading.eye - position, shading.camera_light, normal, to_viewer, shininess, sums);
    return material.albedo * (shading.ambience + material.phong.x * sums.x) + material.phong.y * sums.y;
}

#endif
