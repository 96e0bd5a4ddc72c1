//! Thin strands that leave a core and curl around it: long triangles, boxes that overlap everywhere.
//! The ball of hair has a radius of about 1 and stands at the origin.

use glam::Vec3;
use rayon::prelude::*;

use super::{Mesh, assemble, material, ring};
use crate::scene::Geometry;
use crate::scene::random::Random;

/// Sides of a strand; it is open at its ends.
const SIDES: u32 = 3;
const CORE: f32 = 0.22;
const LENGTH: f32 = 2.6;

pub(super) fn generate(triangles: u64, seed: u64) -> Geometry {
    let materials = vec![
        material("dark strand", [0.32, 0.17, 0.08]),
        material("brown strand", [0.55, 0.32, 0.14]),
        material("light strand", [0.8, 0.62, 0.36]),
        material("core", [0.25, 0.22, 0.3]),
    ];
    let core_cells = if triangles < 4000 { 2 } else { 6 };
    let core_triangles = 12 * core_cells as u64 * core_cells as u64;
    let budget = triangles.saturating_sub(core_triangles).max(1);
    // Both the number of strands and their smoothness grow.
    let segments = ((budget as f64 / 60.0).powf(0.35)).clamp(6.0, 64.0) as u32;
    let per_strand = u64::from(2 * SIDES * segments);
    let strands = ((budget as f64 / per_strand as f64).round() as u64).max(1);
    let radius = (0.16 / (strands as f32).sqrt()).clamp(0.0006, 0.03);

    let random = Random::new(seed);
    let mut parts = vec![core(core_cells, 3)];
    let chunks: Vec<u64> = (0..strands).step_by(64).collect();
    parts.par_extend(chunks.into_par_iter().map(|first| {
        let mut mesh = Mesh::default();
        for index in first..(first + 64).min(strands) {
            strand(&mut mesh, random.fork(index), index, strands, segments, radius);
        }
        mesh
    }));
    assemble(parts, materials)
}

/// A cube blown up to a ball.
fn core(cells: u32, material: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for (u, v) in [
        (Vec3::X, Vec3::Y),
        (Vec3::Y, Vec3::X),
        (Vec3::Y, Vec3::Z),
        (Vec3::Z, Vec3::Y),
        (Vec3::Z, Vec3::X),
        (Vec3::X, Vec3::Z),
    ] {
        mesh.grid(u.cross(v) - u - v, 2.0 * u, 2.0 * v, (cells, cells), material);
    }
    for corner in mesh.triangles.iter_mut().flatten() {
        *corner = (Vec3::from_array(*corner).normalize() * CORE).to_array();
    }
    mesh
}

fn strand(mesh: &mut Mesh, mut random: Random, index: u64, strands: u64, segments: u32, radius: f32) {
    // Roots spread evenly: a Fibonacci sphere, a little shaken.
    let y = 1.0 - (2.0 * index as f32 + 1.0) / strands as f32;
    let angle = index as f32 * 2.399_963;
    let flat = (1.0 - y * y).max(0.0).sqrt();
    let shake = 0.3 / (strands as f32).sqrt();
    let root =
        (Vec3::new(flat * angle.cos(), y, flat * angle.sin()) + shake * random.direction()).normalize();

    let axis = random.direction();
    let wave = random.direction();
    let (curl, phase) = (random.range(1.5, 3.5), random.range(0.0, 6.0));
    let material = random.below(3);
    let step = LENGTH * random.range(0.85, 1.1) / segments as f32;
    let mut point = root * CORE * 0.98;
    let mut direction = root;
    let mut side = direction.any_orthonormal_vector();
    let mut rings = Vec::with_capacity(segments as usize + 1);
    for k in 0..=segments {
        let s = k as f32 / segments as f32;
        side = (side - direction * side.dot(direction)).normalize_or(direction.any_orthonormal_vector());
        let thin = radius * (1.0 - 0.85 * s);
        rings.push(ring(point, side * thin, direction.cross(side) * thin, SIDES));
        // Curl around an axis, and lean back where the strand leaves the ball.
        let out = point.length();
        let pull = -point * (out - 0.75).max(0.0) * 6.0;
        let bend = axis.cross(direction) * curl + wave * (8.0 * s + phase).sin() * 2.0 + pull;
        direction = (direction + bend * step).normalize_or(direction);
        point += direction * step;
    }
    mesh.tube(&rings, material);
}
