//! Streets and buildings: large walls beside very many small parts. 160 metres square, y up, the middle
//! of the central crossing at the origin. Streets run along x and z at every multiple of 40 metres, and
//! houses are taller towards the middle.

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
/// Roof, parapet, stair house, two chimneys, and four awnings over the shops.
const TRIMMINGS: u64 = 2 + 4 * 10 + 10 + 2 * 10 + 4 * 10;
const TREE: u64 = (2 * TREE_SIDES * TREE_RINGS + TREE_SIDES - 2) as u64;
const TREE_SIDES: u32 = 6;
/// Rings of triangle pairs, from the foot of the trunk to the top of the crown.
const TREE_RINGS: u32 = 4;
const DASHES_PER_BLOCK: u32 = 6;

const ASPHALT: u32 = 0;
const PAVEMENT: u32 = 1;
const GLASS: u32 = 2;
const FRAME: u32 = 3;
const STONE: u32 = 4;
const METAL: u32 = 5;
const CARS: [u32; 4] = [6, 7, 8, 9];
const CURTAIN: u32 = 10;
const ROOF: u32 = 11;
const LEAVES: u32 = 12;
const PAINT: u32 = 13;
const AWNINGS: [u32; 3] = [14, 15, 16];
const WALLS: [u32; 8] = [17, 18, 19, 20, 21, 22, 23, 24];

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
        material("yellow car", [0.75, 0.52, 0.06]),
        material("curtain", [0.5, 0.47, 0.4]),
        material("roof", [0.2, 0.18, 0.18]),
        material("leaves", [0.13, 0.3, 0.06]),
        material("paint", [0.75, 0.75, 0.72]),
        material("red awning", [0.6, 0.07, 0.06]),
        material("green awning", [0.05, 0.3, 0.14]),
        material("blue awning", [0.08, 0.2, 0.5]),
        material("brick", [0.46, 0.17, 0.1]),
        material("ochre", [0.68, 0.46, 0.16]),
        material("plaster", [0.76, 0.72, 0.62]),
        material("rose", [0.64, 0.36, 0.31]),
        material("slate", [0.26, 0.33, 0.42]),
        material("sage", [0.4, 0.48, 0.32]),
        material("terracotta", [0.62, 0.28, 0.14]),
        material("sand", [0.62, 0.53, 0.39]),
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
    let trees = (left / 24 / TREE).min(256);
    let dashes = 2 * u64::from(DASHES_PER_BLOCK) * (BLOCKS * (BLOCKS - 1)) as u64;
    let dashes = if left / 40 > 2 * dashes { dashes } else { 0 };
    let trimmings = TRIMMINGS * buildings.len() as u64;
    let trimmings = if left / 5 > trimmings { trimmings } else { 0 };
    if dashes > 0 {
        paint_lines(&mut streets);
    }
    let mut gardener = random.fork(2);
    for i in 0..trees {
        tree(&mut streets, &mut gardener, i, trees);
    }
    let mut furniture = random.fork(1);
    for i in 0..cars {
        park(&mut streets, &mut furniture, i);
    }
    for i in 0..lamps {
        lamp(&mut streets, i, lamps);
    }
    left -= cars * CAR + lamps * LAMP + trees * TREE + 2 * dashes + trimmings;

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
        if trimmings > 0 {
            trim(&mut mesh, building, random.fork(5000 + i as u64));
        }
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
        let inner_block = [x, z].iter().all(|c| (c + (PITCH - STREET) / 2.0).abs() < PITCH);
        let tallest = random.fork(5 + 100 * block as u64).below((per_side * per_side) as u32) as i32;
        for i in 0..per_side * per_side {
            let mut random = random.fork(10 + 100 * block as u64 + i as u64);
            // The middle of a large block is a yard.
            if per_side == 3 && i == 4 {
                continue;
            }
            let gap = random.range(0.0, 0.06) * lot;
            let width = lot - gap;
            // One house in each block stands out, and in the middle of the city it is a tower.
            let floors = match (i == tallest, inner_block) {
                (true, true) => 12 + random.below(3),
                (true, false) => 7 + random.below(3),
                (false, true) => 4 + random.below(5),
                (false, false) => 2 + random.below(4),
            };
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
    let colour = CARS[random.below(4) as usize];
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
    let foot = kerb(index, lamps, 0.6, 0.0);
    let rings: Vec<Vec<Vec3>> =
        [0.0, 4.5].map(|y| ring(foot + Vec3::Y * y, 0.08 * Vec3::X, -0.08 * Vec3::Z, 6)).into();
    mesh.tube(&rings, METAL);
    let plate = |size: f32| (Vec3::new(-size / 2.0, 0.0, -size / 2.0), size * Vec3::X, size * Vec3::Z);
    let (corner, x, z) = plate(0.4);
    mesh.cuboid(foot + corner + Vec3::Y * 4.5, x, 0.5 * Vec3::Y, z, false, FRAME);
    let (corner, x, z) = plate(0.6);
    mesh.cuboid(foot + corner + Vec3::Y * 5.0, x, 0.12 * Vec3::Y, z, false, METAL);
}

/// Dashed lines in the middle of the streets between blocks, clear of crossings.
fn paint_lines(mesh: &mut Mesh) {
    let free = PITCH - STREET;
    for street in 1..BLOCKS {
        let across = (street - BLOCKS / 2) as f32 * PITCH;
        for dash in 0..BLOCKS as u32 * DASHES_PER_BLOCK {
            let block = (dash / DASHES_PER_BLOCK) as i32 - BLOCKS / 2;
            let within = ((dash % DASHES_PER_BLOCK) as f32 + 0.25) / DASHES_PER_BLOCK as f32;
            let along = block as f32 * PITCH + STREET / 2.0 + within * free;
            let (long, wide) = (0.5 * free / DASHES_PER_BLOCK as f32, 0.18);
            let flat = |a: f32, b: f32| Vec3::new(a, 0.01, b);
            let (a, b) = (across - wide / 2.0, across + wide / 2.0);
            mesh.quad([flat(along, a), flat(along, b), flat(along + long, b), flat(along + long, a)], PAINT);
            mesh.quad([flat(a, along), flat(a, along + long), flat(b, along + long), flat(b, along)], PAINT);
        }
    }
}

/// Where the `index`th of `count` things stands that are spread along the edges of all pavements, `inset`
/// metres from the kerb.
fn kerb(index: u64, count: u64, inset: f32, shift: f32) -> Vec3 {
    let blocks = (BLOCKS * BLOCKS) as u64;
    let block = block_corners().nth((index % blocks) as usize).unwrap_or_default();
    let place = ((index / blocks) as f32 + shift) / count.div_ceil(blocks) as f32 * 4.0;
    let inner = PITCH - STREET - 2.0 * inset;
    let along = inset + inner * place.fract();
    let (x, z) = match place as u32 {
        0 => (along, inset),
        1 => (inset + inner, along),
        2 => (2.0 * inset + inner - along, inset + inner),
        _ => (inset, 2.0 * inset + inner - along),
    };
    Vec3::new(block.0 + x, 0.15, block.1 + z)
}

/// A tree on the pavement: its lowest rings are the trunk, the rest is a ragged crown.
fn tree(mesh: &mut Mesh, random: &mut Random, index: u64, count: u64) {
    let foot = kerb(index, count, 1.1, 0.5);
    let tall = random.range(4.5, 7.5);
    let wide = tall * random.range(0.17, 0.24);
    let sides = TREE_SIDES;
    // Height, radius: a trunk, then the crown.
    let profile: [(f32, f32); TREE_RINGS as usize + 1] =
        [(0.0, 0.05), (0.34, 0.04), (0.42, 0.8), (0.68, 1.0), (0.9, 0.55)];
    let rings: Vec<Vec<Vec3>> = profile
        .iter()
        .enumerate()
        .map(|(k, &(up, r))| {
            let centre = foot + Vec3::Y * (up * tall);
            let mut points = ring(centre, r * wide * Vec3::X, -r * wide * Vec3::Z, sides);
            if k >= 2 {
                for point in &mut points {
                    *point = centre
                        + (*point - centre) * random.range(0.75, 1.2)
                        + Vec3::Y * (tall * random.range(-0.05, 0.05));
                }
            }
            points
        })
        .collect();
    mesh.tube(&rings[..2], ROOF);
    mesh.tube(&rings[1..], LEAVES);
    let top = &rings[TREE_RINGS as usize];
    for i in 1..sides as usize - 1 {
        mesh.triangle(top[0], top[i], top[i + 1], LEAVES);
    }
}

/// What makes a block a house: a roof behind a parapet, a stair house, chimneys, and awnings.
fn trim(mesh: &mut Mesh, b: &Building, mut random: Random) {
    let top = b.corner + b.size.y * Vec3::Y;
    let (w, d) = (b.size.x, b.size.z);
    let flat = |x: f32, z: f32| top + Vec3::new(x, 0.02, z);
    mesh.quad([flat(0.0, 0.0), flat(0.0, d), flat(w, d), flat(w, 0.0)], ROOF);
    let (thick, high) = (0.25, random.range(0.4, 1.0));
    let mut block = |x: f32, y: f32, z: f32, size: [f32; 3], material: u32| {
        let origin = top + Vec3::new(x, y, z);
        mesh.cuboid(origin, size[0] * Vec3::X, size[1] * Vec3::Y, size[2] * Vec3::Z, false, material);
    };
    let coping = if random.below(2) == 0 { STONE } else { b.wall };
    block(0.0, 0.0, 0.0, [w, high, thick], coping);
    block(0.0, 0.0, d - thick, [w, high, thick], coping);
    block(0.0, 0.0, thick, [thick, high, d - 2.0 * thick], coping);
    block(w - thick, 0.0, thick, [thick, high, d - 2.0 * thick], coping);
    let (x, z) = (random.range(0.15, 0.5) * w, random.range(0.15, 0.5) * d);
    block(x, 0.0, z, [0.32 * w, random.range(2.0, 3.2), 0.3 * d], b.wall);
    for _ in 0..2 {
        let (x, z) = (random.range(0.1, 0.85) * w, random.range(0.1, 0.85) * d);
        block(x, 0.0, z, [0.6, random.range(1.2, 2.6), 0.6], WALLS[0]);
    }
    // Awnings slope down over the ground floor's windows.
    let colour = AWNINGS[random.below(3) as usize];
    let (x, z) = (w * Vec3::X, d * Vec3::Z);
    for (low, right, width) in [
        (b.corner + z, Vec3::X, w),
        (b.corner + x + z, -Vec3::Z, d),
        (b.corner + x, -Vec3::X, w),
        (b.corner, Vec3::Z, d),
    ] {
        let out = right.cross(Vec3::Y);
        let slope = out * 1.1 - Vec3::Y * 0.45;
        let origin = low + right * (0.06 * width) + Vec3::Y * 3.25 - Vec3::Y * 0.06;
        mesh.cuboid(origin, right * (0.88 * width), Vec3::Y * 0.06, slope, false, colour);
    }
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
                let pane = if random.below(4) == 0 { CURTAIN } else { GLASS };
                window(mesh, corner, right, out, level + finer, pane);
                for brick in 0..bricks {
                    lay_brick(mesh, corner, right, out, pitch - 1.2, brick, bricks);
                }
            }
        }
    }
}

/// A window of 1.1 by 1.6 metres whose pane lies just before the wall.
fn window(mesh: &mut Mesh, corner: Vec3, right: Vec3, out: Vec3, level: usize, pane: u32) {
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
        mesh.quad([low, low + u, low + u + v, low + v], pane);
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
