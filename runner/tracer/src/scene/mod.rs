//! Scenes: files and generators become triangles, materials and views.
//!
//! ```text
//! "sponza"            → descriptor (TOML) → file found on the search path → glTF or OBJ loader ┐
//! "city:seed=3"       → descriptor (TOML) → generator                                          ├→ Scene
//! "out/tea.toml"      → descriptor (TOML) → models, each in its place                           │
//! "thing.json"        → scene of RTRS                                                           │
//! "models/thing.glb"  → glTF or OBJ loader, views from thing.views.json or placed by probing   ┘
//! ```
//!
//! Start at [`load`]. Whatever a file contains, loading ends in a [`Scene`] of finite triangles or in a
//! [`SceneError`]; what was skipped on the way is counted in the [`LoadReport`].

mod catalog;
mod compose;
mod descriptor;
mod error;
mod generate;
mod gltf;
mod keep;
#[cfg(test)]
mod light_tests;
mod load;
mod obj;
mod probe;
mod random;
mod rtrs;
mod search;
mod views;

pub use catalog::{BuiltIn, built_in};
pub use compose::{CameraPath, MOST_VIEWS, Model, Surface};
pub use descriptor::{Descriptor, Emissive, MaterialKey, Region, Source};
pub use error::SceneError;
pub use generate::Generator;
pub use keep::keep_view;
pub(crate) use load::hex;
pub use load::{Inspected, check, describe, inspect, load, sha256};
pub use search::{ENVIRONMENT, SearchPath};
pub use views::place as place_views;

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// At most this many triangles are held, counted after instancing: 2²⁷, which takes 5 GB here.
pub const MAX_TRIANGLES: u64 = 1 << 27;

/// What is traced: triangles with materials, the sky, and the views it is looked at from.
///
/// Units are the file's own; y is up.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The descriptor's name, or the file's stem.
    pub name: String,
    /// Corner positions of each triangle in file order. Every value is finite.
    pub positions: Vec<[[f32; 3]; 3]>,
    /// Index into `materials` for each triangle; as long as `positions`.
    pub material_ids: Vec<u32>,
    /// At least one.
    pub materials: Vec<Material>,
    /// At least one; eight for descriptors and for automatic placement.
    pub views: Vec<View>,
    /// Points that shine, for the integrator `phong`. The path tracer does not see them: to it, what shines is what emits,
    /// and the sky.
    pub lights: Vec<Light>,
    /// What a ray that leaves the scene sees.
    pub sky: Sky,
    /// Where it came from.
    pub provenance: Provenance,
    /// What happened while it was loaded.
    pub report: LoadReport,
}

/// A surface, linear RGB: Lambertian, unless `phong` says that it mirrors.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The name in the file, or an empty string.
    pub name: String,
    /// Diffuse reflectance, each channel in 0 to 1.
    pub albedo: [f32; 3],
    /// Emitted radiance; zero for most.
    pub emission: [f32; 3],
    /// How the integrator `phong` lights it; absent where nobody said. To the path tracer its `reflective` is the share of
    /// light that is mirrored, the rest being diffuse.
    pub phong: Option<Phong>,
}

impl Material {
    /// A surface of that colour that does not emit.
    pub fn diffuse(name: &str, albedo: [f32; 3]) -> Self {
        Self { name: name.to_owned(), albedo, emission: [0.0; 3], phong: None }
    }
}

/// Weights of the parts of light that a surface sends back by the shading model of RTRS, Lambert's and Blinn's and Phong's
/// with mirror reflections (Lewis 2024, appendix B.1).
///
/// The paper calls the first three the components of the albedo, without telling them apart. Their order is inferred from
/// its examples: `0.6 0.3 0.1` with a shininess of 50 and `0.9 0.1 0.0` with 10 are ivory and red rubber of a well-known
/// tutorial (tinyraytracer), where they are these.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Phong {
    /// Share of diffuse light.
    pub diffuse: f32,
    /// Share of highlights of the lights.
    pub specular: f32,
    /// Share of what is mirrored.
    pub reflective: f32,
    /// Exponent of the highlights: larger ones are smaller.
    pub shininess: f32,
}

/// A point that shines in all directions.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// Where it is.
    pub position: [f32; 3],
    /// How much, in the unit of RTRS, of which its paper says nothing; not negative.
    pub strength: f32,
}

/// A pinhole camera.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// For people and for `--view NAME`.
    pub name: String,
    /// Position of the pinhole.
    pub eye: [f32; 3],
    /// A point the camera looks at.
    pub target: [f32; 3],
    /// Which way is up; need not be orthogonal to the viewing direction.
    #[serde(default = "y_up")]
    pub up: [f32; 3],
    /// Vertical field of view in degrees.
    pub vfov_degrees: f32,
}

fn y_up() -> [f32; 3] {
    [0.0, 1.0, 0.0]
}

/// Radiance from outside the scene: `horizon` to `zenith` by the direction's height, `ground` below.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Sky {
    /// Straight up.
    pub zenith: [f32; 3],
    /// At the horizon.
    pub horizon: [f32; 3],
    /// Below the horizon.
    pub ground: [f32; 3],
}

impl Default for Sky {
    /// A bright overcast day, with some light from below so that no side of a lone object is black.
    fn default() -> Self {
        Self { zenith: [0.9, 1.0, 1.2], horizon: [1.0, 1.0, 1.0], ground: [0.35, 0.33, 0.30] }
    }
}

/// Where a scene came from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Provenance {
    /// The file or generator that gave the triangles.
    pub origin: Origin,
    /// Licence of the geometry; empty where unknown.
    pub licence: String,
    /// Who is to be credited; empty where unknown.
    pub credit: String,
}

/// The file or generator behind a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Origin {
    /// A model file, or a descriptor that puts several together.
    File {
        /// Where it was found.
        path: PathBuf,
        /// Hash of its bytes, in lower-case hexadecimal. External buffers and MTL files are not covered; the models of a
        /// descriptor are where it has their hashes.
        sha256: String,
    },
    /// A procedural scene.
    Generated {
        /// Which generator.
        generator: Generator,
        /// The triangle count that was asked for; the scene has about as many.
        triangles: u64,
        /// The seed of its random numbers.
        seed: u64,
    },
}

/// What happened while a scene was loaded: skips are counted, never silent.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LoadReport {
    /// Wall-clock time from the first byte read to the finished scene, in seconds.
    pub seconds: f64,
    /// Triangles skipped because a corner was NaN or infinite, in the file or after its transform.
    pub non_finite: u64,
    /// Triangles (faces, in OBJ) skipped because an index pointed past the vertices.
    pub out_of_range: u64,
    /// Triangles without area. They are kept: real files have them and a benchmark should too.
    pub degenerate: u64,
    /// Points, lines, and primitives without positions, which were skipped.
    pub skipped_primitives: u64,
    /// Anything else worth telling, one sentence each.
    pub notes: Vec<String>,
}

impl LoadReport {
    /// Whether the file was taken as it is, with nothing skipped.
    pub fn is_clean(&self) -> bool {
        self.non_finite == 0 && self.out_of_range == 0 && self.skipped_primitives == 0
    }
}

/// What a loader or generator hands over.
#[derive(Debug, Default)]
pub(crate) struct Geometry {
    pub positions: Vec<[[f32; 3]; 3]>,
    pub material_ids: Vec<u32>,
    pub materials: Vec<Material>,
}

impl Scene {
    /// The smallest box around all triangles, as its lowest and highest corner.
    pub fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        bounds(&self.positions)
    }
}

pub(crate) fn bounds(triangles: &[[[f32; 3]; 3]]) -> ([f32; 3], [f32; 3]) {
    use rayon::prelude::*;
    const NONE: ([f32; 3], [f32; 3]) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    let merge = |a: ([f32; 3], [f32; 3]), b: ([f32; 3], [f32; 3])| {
        (std::array::from_fn(|k| a.0[k].min(b.0[k])), std::array::from_fn(|k| a.1[k].max(b.1[k])))
    };
    triangles
        .par_chunks(1 << 14)
        .map(|chunk| chunk.iter().flatten().fold(NONE, |sum, &corner| merge(sum, (corner, corner))))
        .reduce(|| NONE, merge)
}
