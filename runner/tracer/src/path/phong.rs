//! Local shading with mirror reflections, as RTRS has it (Lewis 2024): the plain twin of what `shade.glsl` and `phong.glsl`
//! make of a picture.
//!
//! ```text
//! light to the viewer = albedo (ambience + diffuse Σ s max(0, n·l)) + specular Σ s max(0, n·h)^shininess
//!                       over the lights and the camera's, of strengths s
//!                     + emission + reflective × what comes in the mirror's direction
//! ```
//!
//! `l` points to the light, `h` halfway between it and the viewer (Blinn), and a light behind a surface adds nothing. The
//! paper names the terms and not how they are put together. Lights do not grow weaker with distance, since its examples
//! have strengths near 1 at distances of tens; nothing is in their way; highlights are white. A ray that leaves the scene
//! sees the sky, and a surface that mirrors nothing ends a path.

use super::{Integrator, Shading};
use crate::{
    layout::LeafTriangles,
    scene::{Phong, Scene},
    traverse::{Hit, Ray, TriangleTest, cpu},
};
use glam::Vec3;

/// How a surface is lit whose material does not say: diffuse alone.
pub const MATTE: Phong = Phong { diffuse: 1.0, specular: 0.0, reflective: 0.0, shininess: 1.0 };

/// What [`Integrator::Phong`] gathers along the path of a primary ray, of up to `depth` rays; linear RGB. The ray starts at
/// the camera.
///
/// # Panics
/// The integrator is another.
pub fn radiance(scene: &Scene, shading: &Shading, ray: &Ray, depth: u32) -> [f32; 3] {
    assert_eq!(shading.integrator, Integrator::Phong, "the path tracer's light is random");
    let triangles = LeafTriangles::in_file_order(TriangleTest::Watertight, &scene.positions);
    let extent = scene.positions.as_flattened().as_flattened().iter().fold(0f32, |m, x| m.max(x.abs()));
    let camera = Vec3::from_array(ray.origin);
    let (mut ray, mut throughput, mut sum) = (*ray, 1.0, Vec3::ZERO);
    for _ in 0..depth {
        let direction = Vec3::from_array(ray.direction).normalize();
        let hit = cpu::brute_force(&triangles, &ray);
        if hit.triangle == Hit::MISS {
            sum += throughput * Vec3::from_array(scene.sky.radiance(ray.direction));
            break;
        }
        let material = &scene.materials[scene.material_ids[hit.triangle as usize] as usize];
        let phong = material.phong.unwrap_or(MATTE);
        let [a, b, c] = scene.positions[hit.triangle as usize].map(Vec3::from_array);
        let normal = (b - a).cross(c - a).normalize_or(-direction);
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        let on_surface = Vec3::from_array(ray.origin) + hit.t * Vec3::from_array(ray.direction);
        let position = on_surface + normal * (extent * 2f32.powi(-18));
        let lights = scene.lights.iter().map(|light| (Vec3::from_array(light.position), light.strength));
        let (mut diffuse, mut specular) = (0.0, 0.0);
        for (place, strength) in lights.chain([(camera, shading.camera_light)]) {
            let to_light = (place - position).normalize_or_zero();
            let cosine = normal.dot(to_light);
            if cosine > 0.0 {
                let aligned = normal.dot((to_light - direction).normalize_or_zero());
                diffuse += strength * cosine;
                specular += strength * if aligned > 0.0 { aligned.powf(phong.shininess) } else { 0.0 };
            }
        }
        let lit = Vec3::from_array(material.albedo) * (shading.ambience + phong.diffuse * diffuse);
        sum += throughput * (Vec3::from_array(material.emission) + lit + phong.specular * specular);
        if phong.reflective == 0.0 {
            break;
        }
        throughput *= phong.reflective;
        let mirrored = direction - 2.0 * normal.dot(direction) * normal;
        ray = Ray {
            origin: position.to_array(),
            t_min: 0.0,
            direction: mirrored.to_array(),
            t_max: f32::INFINITY,
        };
    }
    sum.to_array()
}
