//! Scenes: files and generators become triangles, materials and views.

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
    /// What a ray that leaves the scene sees.
    pub sky: Sky,
}

/// A Lambertian surface, linear RGB.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The name in the file, or an empty string.
    pub name: String,
    /// Diffuse reflectance, each channel in 0 to 1.
    pub albedo: [f32; 3],
    /// Emitted radiance; zero for most.
    pub emission: [f32; 3],
}

/// A pinhole camera.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// For people and for `--view NAME`.
    pub name: String,
    /// Position of the pinhole.
    pub eye: [f32; 3],
    /// A point the camera looks at.
    pub target: [f32; 3],
    /// Which way is up; need not be orthogonal to the viewing direction.
    pub up: [f32; 3],
    /// Vertical field of view in degrees.
    pub vfov_degrees: f32,
}

/// Radiance from outside the scene: `horizon` to `zenith` by the direction's height, `ground` below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Straight up.
    pub zenith: [f32; 3],
    /// At the horizon.
    pub horizon: [f32; 3],
    /// Below the horizon.
    pub ground: [f32; 3],
}
