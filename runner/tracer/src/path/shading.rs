//! What happens where a ray hits a surface: the two integrators.

use serde::{Deserialize, Serialize};

/// How light is gathered along a path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Integrator {
    /// Path tracing: rays go on in random directions, and light is what emits and the sky.
    #[default]
    Path,
    /// Local shading by point lights, with mirror reflections (Lewis 2024): see [`super::phong`].
    Phong,
}

/// What may be chosen about shading.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Shading {
    /// How light is gathered: `path` or `phong`.
    pub integrator: Integrator,
    /// Share of light, 0 to 1, that every surface mirrors in the path tracer, at least: its material may mirror more. With
    /// 0 and materials that say nothing, all surfaces are diffuse.
    pub specular: f32,
    /// Strength of the light that comes from everywhere, in `phong`. RTRS has none unless it is told.
    pub ambience: f32,
    /// Strength of a light where the camera is, in `phong`. RTRS has none unless it is told, and scenes without lights of
    /// their own are dark there.
    pub camera_light: f32,
}

impl Default for Shading {
    fn default() -> Self {
        Self { integrator: Integrator::Path, specular: 0.0, ambience: 0.1, camera_light: 0.5 }
    }
}

impl Shading {
    /// As shaders take it, with the camera's place.
    pub(super) fn arguments(&self, eye: [f32; 3]) -> Arguments {
        let Self { integrator, specular, ambience, camera_light } = *self;
        Arguments { integrator: integrator as u32, specular, ambience, camera_light, eye }
    }
}

/// `Shading` in `shade.glsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Arguments {
    pub integrator: u32,
    pub specular: f32,
    pub ambience: f32,
    pub camera_light: f32,
    pub eye: [f32; 3],
}
