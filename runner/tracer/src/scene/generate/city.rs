//! Streets and buildings: large walls beside very many small parts. 160 metres square, y up, the middle
//! of the central crossing at the origin. Streets run along x and z at every multiple of 40 metres.

use glam::Vec3;
use rayon::prelude::*;

use super::{Mesh, assemble, material, ring};
use crate::scene::Geometry;
use crate::scene::random::Random;

const BLOCKS: i32 = 4;
const PITCH: f32 = 40.0;
const STREET: f32 = 12.0;
/// Triangles of a window at each level of detail.
const WINDOW: [u64; 6] = [0, 2, 12, 52, 132, 372];
const CAR: u64 = 10 + 10 + 4 * 12;
const LAMP: u64 = 2 * 6 + 10 + 10;
const BUILDING: u64 = 10;

const ASPHALT: u32 = 0;
const PAVEMENT: u32 = 1;
const GLASS: u32 = 2;
const FRAME: u32 = 3;
const STONE: u32 = 4;
const METAL: u32 = 5;
const CARS: [u32; 3] = [6, 7, 8];
const WALLS: [u32; 5] = [9, 10, 11, 12, 13];

/// A building: its low corner, its size, and the colour of its walls.
struct Building {
    corner: Vec3,
    size: Vec3,
    wall: u32,
    floors: u32,
    columns: [u32; 2],
}

impl Building {
    fn windows(&self) -> u64 {
        2 * u64::from(self.floors) * u64::from(self.columns[0] + self.columns[1])
    }
}

pub(super) fn generate(triangles: u64, seed: u64) -> Geometry {
    let materials = vec![
        material("asphalt", [0.09, 0.09, 0.1]),
        material("pavement", [0.42, 0.4, 0.38]),
        material("glass", [0.12, 0.18, 0.25]),
        material("frame", [0.85, 0.84, 0.8]),
        material("stone", [0.6, 0.56, 0.5]),
        material("metal", [0.25, 0.27, 0.28]),
        material("red car", [0.6, 0.06, 0.05]),
        material("blue car", [0.08, 0.16, 0.45]),
        material("white car", [0.75, 0.75, 0.75]),
        material("brick", [0.45, 0.2, 0.13]),
        material("ochre", [0.65, 0.48, 0.24]),
        material("plaster", [0.72, 0.68, 0.6]),
        material("rose", [0.62, 0.4, 0.36]),
        material("slate", [0.33, 0.38, 0.44]),
    ];
    let random = Random::new(seed);
    let per_side = if triangles < 6_000 { 2 } else { 3 };
    let buildings = buildings(&random, per_side);

    let mut streets = Mesh::default();
    lay_streets(&mut streets);
    let fixed = streets.triangles.len() as u64 + BUILDING * buildings.len() as u64;
    let mut left = triangles.saturating_sub(fixed);
    let cars = (left / 20 / CAR).min(400);
    let lamps = (left / 20 / LAMP).min(320);
    let mut furniture = random.fork(1);
    for i in 0..cars {
        park(&mut streets, &mut furniture, i);
    }
    for i in 0..lamps {
        lamp(&mut streets, i, lamps);
    }
    left -= cars * CAR + lamps * LAMP;

    // Each window gets one of two neighbouring levels of detail, so that the mean meets the budget.
    let windows: u64 = buildings.iter().map(Building::windows).sum();
    let mean = left as f64 / windows as f64;
    let level = (1..WINDOW.len() - 1).rev().find(|&level| WINDOW[level] as f64 <= mean).unwrap_or(0);
    let share = ((mean - WINDOW[level] as f64) / (WINDOW[level + 1] - WINDOW[level]) as f64) as f32;
    // Past the finest window, bricks of the walls take what is left.
    let beyond = (mean - WINDOW[WINDOW.len() - 1] as f64).max(0.0);
    let bricks = (beyond / 10.0).round() as u32;

    let mut parts = vec![streets];
    parts.par_extend(buildings.par_iter().enumerate().map(|(i, building)| {
        let mut mesh = Mesh::default();
        raise(&mut mesh, building, random.fork(1000 + i as u64), level, share.min(1.0), bricks);
        mesh
    }));
    let mut geometry = assemble(parts, materials);
    drop_unused_materials(&mut geometry);
    geometry
}

/// A small city may have no cars or windows; its materials should not pretend otherwise.
fn drop_unused_materials(geometry: &mut Geometry) {
    let mut used = vec![false; geometry.materials.len()];
    for &id in &geometry.material_ids {
        used[id as usize] = true;
    }
    let mut next = 0;
    let new_ids: Vec<u32> = used
        .iter()
        .map(|&used| {
            let id = next;
            next += u32::from(used);
            id
        })
        .collect();
    for id in &mut geometry.material_ids {
        *id = new_ids[*id as usize];
    }
    let mut keep = used.iter();
    geometry.materials.retain(|_| *keep.next().unwrap_or(&true));
}

fn block_corners() -> impl Iterator<Item = (f32, f32)> {
    (0..BLOCKS * BLOCKS).map(|i| {
        let at = |k: i32| (k - BLOCKS / 2) as f32 * PITCH + STREET / 2.0;
        (at(i % BLOCKS), at(i / BLOCKS))
    })
}

fn buildings(random: &Random, per_side: i32) -> Vec<Building> {
    let inner = PITCH - STREET - 4.0;
    let lot = inner / per_side as f32;
    let mut all = Vec::new();
    for (block, (x, z)) in block_corners().enumerate() {
        for i in 0..per_side * per_side {
            let mut random = random.fork(10 + 100 * block as u64 + i as u64);
            // The middle of a large block is a yard.
            if per_side == 3 && i == 4 {
                continue;
            }
            let gap = random.range(0.0, 0.06) * lot;
            let width = lot - gap;
            let floors = 3 + random.below(6);
            let size = Vec3::new(width, floors as f32 * 3.2 + 1.0, width);
            let corner =
                Vec3::new(x + 2.0 + (i % per_side) as f32 * lot, 0.15, z + 2.0 + (i / per_side) as f32 * lot);
            let columns = [(width / 2.2) as u32, (width / 2.2) as u32];
            let wall = WALLS[random.below(WALLS.len() as u32) as usize];
            all.push(Building { corner, size, wall, floors, columns });
        }
    }
    all
}

fn lay_streets(mesh: &mut Mesh) {
    let half = BLOCKS as f32 * PITCH / 2.0;
    let cells = (8, 8);
    mesh.grid(Vec3::new(-half, 0.0, -half), 2.0 * half * Vec3::Z, 2.0 * half * Vec3::X, cells, ASPHALT);
    let inner = PITCH - STREET;
    for (x, z) in block_corners() {
        mesh.cuboid(Vec3::new(x, 0.0, z), inner * Vec3::X, 0.15 * Vec3::Y, inner * Vec3::Z, false, PAVEMENT);
    }
}

/// A car beside the pavement of some street, clear of crossings.
fn park(mesh: &mut Mesh, random: &mut Random, index: u64) {
    let street = (random.below(BLOCKS as u32 - 1) as i32 + 1 - BLOCKS / 2) as f32 * PITCH;
    let block = (random.below(BLOCKS as u32) as i32 - BLOCKS / 2) as f32 * PITCH;
    let along = block + STREET / 2.0 + random.range(3.0, PITCH - STREET - 3.0);
    let side = if random.below(2) == 0 { -4.6 } else { 4.6 };
    let flip = index.is_multiple_of(2);
    let place = |forward: f32, across: f32, height: f32| {
        if flip {
            Vec3::new(along + forward, height, street + side - across)
        } else {
            Vec3::new(street + side + across, height, along + forward)
        }
    };
    let (ahead, across) =
        (place(1.0, 0.0, 0.0) - place(0.0, 0.0, 0.0), place(0.0, 1.0, 0.0) - place(0.0, 0.0, 0.0));
    let colour = CARS[random.below(3) as usize];
    let mut part = |from: [f32; 3], size: [f32; 3], bottom: bool, material: u32| {
        let origin = place(from[0], from[1], from[2]);
        // across × up = ahead, whichever way the car stands.
        mesh.cuboid(origin, across * size[1], Vec3::Y * size[2], ahead * size[0], bottom, material);
    };
    part([-2.1, -0.85, 0.3], [4.2, 1.7, 0.6], false, colour);
    part([-1.2, -0.75, 0.9], [2.2, 1.5, 0.5], false, GLASS);
    for (forward, across) in [(-1.5, -0.9), (-1.5, 0.7), (1.0, -0.9), (1.0, 0.7)] {
        part([forward, across, 0.0], [0.6, 0.2, 0.6], true, METAL);
    }
}

/// A lamp post on the edge of a pavement.
fn lamp(mesh: &mut Mesh, index: u64, lamps: u64) {
    let corners: Vec<(f32, f32)> = block_corners().collect();
    let block = corners[(index % corners.len() as u64) as usize];
    let per_block = lamps.div_ceil(corners.len() as u64);
    let place = (index / corners.len() as u64) as f32 / per_block as f32;
    let inner = PITCH - STREET - 1.2;
    let edge = (place * 4.0) as u32;
    let along = 0.6 + inner * (place * 4.0).fract();
    let (x, z) = match edge {
        0 => (along, 0.6),
        1 => (0.6 + inner, along),
        2 => (0.6 + inner - along, 0.6 + inner),
        _ => (0.6, 0.6 + inner - along),
    };
    let foot = Vec3::new(block.0 + x, 0.15, block.1 + z);
    let rings: Vec<Vec<Vec3>> =
        [0.0, 4.5].map(|y| ring(foot + Vec3::Y * y, 0.08 * Vec3::X, -0.08 * Vec3::Z, 6)).into();
    mesh.tube(&rings, METAL);
    let plate = |size: f32| (Vec3::new(-size / 2.0, 0.0, -size / 2.0), size * Vec3::X, size * Vec3::Z);
    let (corner, x, z) = plate(0.4);
    mesh.cuboid(foot + corner + Vec3::Y * 4.5, x, 0.5 * Vec3::Y, z, false, FRAME);
    let (corner, x, z) = plate(0.6);
    mesh.cuboid(foot + corner + Vec3::Y * 5.0, x, 0.12 * Vec3::Y, z, false, METAL);
}

fn raise(mesh: &mut Mesh, b: &Building, mut random: Random, level: usize, share: f32, bricks: u32) {
    let (x, y, z) = (b.size.x * Vec3::X, b.size.y * Vec3::Y, b.size.z * Vec3::Z);
    mesh.cuboid(b.corner, x, y, z, false, b.wall);
    // Each facade: its low corner, and the direction to the right as seen from the street.
    let facades = [
        (b.corner + z, Vec3::X, b.size.x, b.columns[0]),
        (b.corner + x + z, -Vec3::Z, b.size.z, b.columns[1]),
        (b.corner + x, -Vec3::X, b.size.x, b.columns[0]),
        (b.corner, Vec3::Z, b.size.z, b.columns[1]),
    ];
    for (low, right, width, columns) in facades {
        let out = right.cross(Vec3::Y);
        let pitch = width / columns as f32;
        for floor in 0..b.floors {
            for column in 0..columns {
                let finer = usize::from(random.unit() < share);
                let corner = low
                    + right * ((column as f32 + 0.5) * pitch - 0.55)
                    + Vec3::Y * (floor as f32 * 3.2 + 1.0);
                window(mesh, corner, right, out, level + finer);
                for brick in 0..bricks {
                    lay_brick(mesh, corner, right, out, pitch - 1.2, brick, bricks);
                }
            }
        }
    }
}

/// A window of 1.1 by 1.6 metres whose pane lies just before the wall.
fn window(mesh: &mut Mesh, corner: Vec3, right: Vec3, out: Vec3, level: usize) {
    let (width, height) = (1.1, 1.6);
    let mut bar = |from: [f32; 2], size: [f32; 2], depth: f32, material: u32| {
        let origin = corner + right * from[0] + Vec3::Y * from[1];
        // The face against the wall is not made.
        mesh.cuboid(origin, right * size[0], out * depth, -Vec3::Y * -size[1], false, material);
    };
    if level >= 2 {
        bar([-0.15, -0.12], [width + 0.3, 0.12], 0.25, STONE);
    }
    if level >= 3 {
        bar([-0.08, 0.0], [0.08, height], 0.08, FRAME);
        bar([width, 0.0], [0.08, height], 0.08, FRAME);
        bar([-0.08, height], [width + 0.16, 0.1], 0.1, FRAME);
        bar([width / 2.0 - 0.03, 0.0], [0.06, height], 0.06, FRAME);
    }
    if level >= 4 {
        for k in 1..=3 {
            bar([0.0, height * k as f32 / 4.0 - 0.015], [width / 2.0 - 0.03, 0.03], 0.05, FRAME);
            bar(
                [width / 2.0 + 0.03, height * k as f32 / 4.0 - 0.015],
                [width / 2.0 - 0.03, 0.03],
                0.05,
                FRAME,
            );
        }
        bar([-0.1, height + 0.1], [width + 0.2, 0.08], 0.18, STONE);
        bar([-0.1, height + 0.18], [width + 0.2, 0.04], 0.22, STONE);
    }
    if level >= 5 {
        // A railing: posts and two rails before the lower half.
        for k in 0..22 {
            let x = width * k as f32 / 21.0;
            let origin = corner + right * (x - 0.01) + out * 0.18;
            mesh.cuboid(origin, right * 0.02, out * 0.02, Vec3::Y * 0.7, false, METAL);
        }
        for y in [0.08, 0.7] {
            let origin = corner + Vec3::Y * y + out * 0.17;
            mesh.cuboid(origin, right * width, out * 0.04, Vec3::Y * 0.03, false, METAL);
        }
    }
    if level >= 1 {
        let low = corner + out * 0.02;
        let (u, v) = (right * width, Vec3::Y * height);
        mesh.quad([low, low + u, low + u + v, low + v], GLASS);
    }
}

/// One of `count` raised bricks between two windows.
fn lay_brick(mesh: &mut Mesh, corner: Vec3, right: Vec3, out: Vec3, width: f32, index: u32, count: u32) {
    let columns = ((count as f32 / 4.0).sqrt().ceil() as u32).max(1);
    let rows = count.div_ceil(columns);
    let (w, h) = (width / columns as f32, 3.0 / rows as f32);
    let at = corner
        + right * (1.15 + w * (index % columns) as f32)
        + Vec3::Y * (h * (index / columns) as f32 - 0.8);
    mesh.cuboid(at, right * (0.85 * w), out * 0.015, Vec3::Y * (0.85 * h), false, STONE);
}
