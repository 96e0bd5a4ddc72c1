//! A closed room, after the box that Cornell University photographed: six walls, a lamp in the ceiling,
//! two blocks. Two units wide, high and deep; the floor is at y = 0.

use glam::Vec3;

use super::{Mesh, assemble, material};
use crate::scene::Geometry;
use crate::scene::random::Random;

/// A parallelogram: origin, two edges, material.
type Surface = (Vec3, Vec3, Vec3, u32);

pub(super) fn generate(triangles: u64, seed: u64) -> Geometry {
    let materials = vec![
        material("white", [0.73, 0.73, 0.71]),
        material("red", [0.63, 0.06, 0.05]),
        material("green", [0.14, 0.45, 0.09]),
        material("back", [0.55, 0.58, 0.68]),
        material("block", [0.72, 0.62, 0.45]),
        material("light", [0.78, 0.78, 0.78]),
    ];
    let surfaces = surfaces(seed);
    // The count falls as cells grow: halve the interval until the size fits.
    let (mut small, mut large) = (1e-4f32, 4.0f32);
    for _ in 0..60 {
        let middle = (small * large).sqrt();
        if count(&surfaces, middle) > triangles { small = middle } else { large = middle }
    }
    let nearer = |size: f32| count(&surfaces, size).abs_diff(triangles);
    let size = if nearer(small) < nearer(large) { small } else { large };
    let mut mesh = Mesh::default();
    for &(origin, u, v, material) in &surfaces {
        mesh.grid(origin, u, v, cells(u, v, size), material);
    }
    assemble(vec![mesh], materials)
}

fn cells(u: Vec3, v: Vec3, size: f32) -> (u32, u32) {
    let along = |edge: Vec3| (edge.length() / size).round().max(1.0) as u32;
    (along(u), along(v))
}

fn count(surfaces: &[Surface], size: f32) -> u64 {
    surfaces
        .iter()
        .map(|&(_, u, v, _)| {
            let (nu, nv) = cells(u, v, size);
            2 * u64::from(nu) * u64::from(nv)
        })
        .sum()
}

fn surfaces(seed: u64) -> Vec<Surface> {
    let (x, y, z) = (2.0 * Vec3::X, 2.0 * Vec3::Y, 2.0 * Vec3::Z);
    let corner = Vec3::new(-1.0, 0.0, -1.0);
    let mut all = vec![
        (corner, z, x, 0),
        (corner + y, x, z, 0),
        (corner, x, y, 3),
        (corner + z, y, x, 0),
        (corner, y, z, 1),
        (corner + x, z, y, 2),
        (Vec3::new(-0.65, 1.985, -0.65), 1.3 * Vec3::X, 1.3 * Vec3::Z, 5),
    ];
    let mut random = Random::new(seed);
    let mut block = |centre: Vec3, width: f32, height: f32, angle: f32, material: u32| {
        let angle = angle + random.range(-0.12, 0.12);
        let height = height * random.range(0.95, 1.05);
        let (sin, cos) = angle.sin_cos();
        let (u, w) = (Vec3::new(cos, 0.0, -sin) * width, Vec3::new(sin, 0.0, cos) * width);
        let h = Vec3::Y * height;
        let low = centre - (u + w) / 2.0;
        all.extend([
            (low + h, w, u, material),
            (low + w, u, h, material),
            (low + u, h, w, material),
            (low, h, u, material),
            (low, w, h, material),
        ]);
    };
    block(Vec3::new(-0.36, 0.0, -0.35), 0.58, 1.2, 0.3, 0);
    block(Vec3::new(0.38, 0.0, 0.25), 0.58, 0.6, -0.3, 4);
    all
}
