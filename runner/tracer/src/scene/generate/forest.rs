//! Hilly ground, trees with trunks, branches and leaf cards, and grass: very many small triangles that
//! share no edges. 60 metres square, y up. A path two metres wide along x (|z| < 2) stays clear.

use glam::Vec3;
use rayon::prelude::*;

use super::{Mesh, assemble, material, ring};
use crate::scene::Geometry;
use crate::scene::random::Random;

const HALF: f32 = 30.0;
const PATH: f32 = 2.0;

const GROUND: u32 = 0;
const BARK: u32 = 1;
const LEAVES: [u32; 3] = [2, 3, 4];
const GRASS: u32 = 5;

pub(super) fn generate(triangles: u64, seed: u64) -> Geometry {
    let materials = vec![
        material("ground", [0.24, 0.17, 0.1]),
        material("bark", [0.2, 0.13, 0.08]),
        material("dark leaf", [0.06, 0.2, 0.04]),
        material("light leaf", [0.22, 0.42, 0.08]),
        material("autumn leaf", [0.5, 0.24, 0.05]),
        material("grass", [0.16, 0.34, 0.07]),
    ];
    let random = Random::new(seed);
    let cells = ((triangles as f64 * 0.03 / 2.0).sqrt() as u32).clamp(4, 512);
    let mut left = triangles.saturating_sub(2 * u64::from(cells) * u64::from(cells));
    let grass = left / 6;
    left -= grass;
    let trees = ((14.0 * (triangles as f64 / 1000.0).powf(0.42)) as u64).clamp(8, 600);

    let mut parts = vec![ground(cells)];
    let tree_parts = plant(&random, trees).into_par_iter().enumerate().map(|(i, foot)| {
        // Spread the remainder so that the sum is exact.
        let budget = left * (i as u64 + 1) / trees - left * i as u64 / trees;
        tree(random.fork(i as u64), foot, budget)
    });
    parts.par_extend(tree_parts);
    let chunks: Vec<u64> = (0..grass).step_by(1 << 14).collect();
    parts.par_extend(chunks.into_par_iter().map(|first| {
        let mut mesh = Mesh::default();
        let mut random = random.fork(0x6_0000_0000 + first);
        let height = (2.2 / (grass as f32).powf(0.15)).clamp(0.2, 0.7);
        for _ in first..(first + (1 << 14)).min(grass) {
            blade(&mut mesh, &mut random, height);
        }
        mesh
    }));
    assemble(parts, materials)
}

/// Height of the ground; almost level on the path.
fn height(x: f32, z: f32) -> f32 {
    let hills = (0.13 * x).sin() * (0.11 * z + 0.5).cos() + 0.4 * (0.31 * x + 1.0).sin() * (0.27 * z).sin();
    let off_path = (z.abs() / 8.0).min(1.0);
    1.1 * hills * (0.15 + 0.85 * off_path)
}

fn on_ground(x: f32, z: f32) -> Vec3 {
    Vec3::new(x, height(x, z), z)
}

fn ground(cells: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let corner = Vec3::new(-HALF, 0.0, -HALF);
    mesh.grid(corner, 2.0 * HALF * Vec3::Z, 2.0 * HALF * Vec3::X, (cells, cells), GROUND);
    for corner in mesh.triangles.iter_mut().flatten() {
        corner[1] = height(corner[0], corner[2]);
    }
    mesh
}

/// A shaken grid of trees that leaves the path free.
fn plant(random: &Random, trees: u64) -> Vec<Vec3> {
    let mut random = random.fork(0x7_0000_0000);
    let columns = (trees as f32).sqrt().ceil() as u64;
    let rows = trees.div_ceil(columns);
    (0..trees)
        .map(|i| {
            let shaken =
                |k: u64, n: u64, r: &mut Random| ((k as f32 + r.range(0.15, 0.85)) / n as f32) * 2.0 - 1.0;
            let x = shaken(i % columns, columns, &mut random) * (HALF - 1.0);
            let mut z = shaken(i / columns, rows, &mut random) * (HALF - 1.0);
            if z.abs() < PATH + 0.8 {
                z = z.signum() * (PATH + 0.8 + z.abs() / 2.0);
            }
            on_ground(x, z)
        })
        .collect()
}

/// One tree of exactly `budget` triangles where that is enough for a trunk and a leaf.
fn tree(mut random: Random, foot: Vec3, budget: u64) -> Mesh {
    let mut mesh = Mesh::default();
    let tall = random.range(6.0, 10.0);
    let thick = 0.022 * tall * random.range(0.8, 1.3);
    let lean = Vec3::new(random.range(-0.08, 0.08), 1.0, random.range(-0.08, 0.08)).normalize();
    let sides = if budget < 400 { 3 } else { (4 + budget / 1000).min(10) as u32 };
    let steps = if budget < 400 { 1 } else { (2 + budget / 600).min(12) as u32 };
    let trunk: Vec<Vec<Vec3>> = (0..=steps)
        .map(|k| {
            let s = k as f32 / steps as f32;
            let centre = foot - Vec3::Y * 0.2 + lean * (s * tall * 0.85);
            let r = thick * (1.0 - 0.8 * s);
            ring(centre, r * Vec3::X, -r * Vec3::Z, sides)
        })
        .collect();
    mesh.tube(&trunk, BARK);

    // Branches take a sixth of what is left, each three-sided and once bent.
    let after_trunk = budget.saturating_sub(mesh.triangles.len() as u64);
    let branches = (after_trunk / 6 / 12).min(160);
    let mut twigs = vec![(foot + lean * (0.75 * tall), 0.3 * tall)];
    for _ in 0..branches {
        let s = random.range(0.35, 0.85);
        let start = foot + lean * (s * tall);
        let mut out = random.direction();
        out.y = out.y.abs() * 0.6 + 0.1;
        let out = out.normalize();
        let length = tall * 0.34 * (1.25 - s) * random.range(0.7, 1.2);
        let r = 0.35 * thick * (1.1 - s);
        let (u, v) = out.any_orthonormal_pair();
        let middle = start + out * (0.5 * length);
        let end = start + out * length + Vec3::Y * (0.15 * length);
        let rings =
            [(start, 1.0), (middle, 0.7), (end, 0.25)].map(|(p, k)| ring(p, u * (r * k), v * (r * k), 3));
        mesh.tube(&rings, BARK);
        twigs.push((end, 0.28 * length + 0.25));
        twigs.push((middle, 0.22 * length + 0.2));
    }

    let leaves = (budget.saturating_sub(mesh.triangles.len() as u64) / 2).max(1);
    let size = (9.0 / (leaves as f32).sqrt()).clamp(0.03, 0.9);
    let colour = LEAVES[if random.below(6) == 0 { 2 } else { random.below(2) as usize }];
    for _ in 0..leaves {
        let (centre, spread) = twigs[random.below(twigs.len() as u32) as usize];
        let at = centre + random.direction() * spread * random.unit().cbrt();
        let (u, v) = random.direction().any_orthonormal_pair();
        let (u, v) = (u * size * random.range(0.6, 1.0), v * size * 0.55);
        let colour = if random.below(4) == 0 { LEAVES[random.below(2) as usize] } else { colour };
        mesh.quad([at - u, at - v, at + u, at + v], colour);
    }
    mesh
}

fn blade(mesh: &mut Mesh, random: &mut Random, tall: f32) {
    let (x, mut z) = (random.range(-HALF, HALF), random.range(-HALF, HALF));
    // Sparse on the path.
    if z.abs() < PATH && random.below(8) > 0 {
        z = z.signum() * (PATH + z.abs() * 2.0);
    }
    let foot = on_ground(x, z);
    let turn = random.range(0.0, std::f32::consts::TAU);
    let tall = tall * random.range(0.5, 1.2);
    let side = Vec3::new(turn.cos(), 0.0, turn.sin()) * (0.1 * tall + 0.006);
    let tip = foot + Vec3::new(random.range(-0.3, 0.3), 1.0, random.range(-0.3, 0.3)) * tall;
    mesh.triangle(foot - side, foot + side, tip, GRASS);
}
