//! A ball with nine balls a third its size on it, each with nine on it, and so on, over a floor.
//! The large ball has radius 1 and stands at the origin.

use glam::{Quat, Vec3};
use rayon::prelude::*;

use super::{Mesh, assemble, material};
use crate::scene::Geometry;
use crate::scene::random::Random;

const CHILDREN: u64 = 9;
/// Fewest triangles of a ball before another level of balls is added.
const FEWEST: u64 = 90;
const MAX_LEVEL: u32 = 6;
const FLOOR_CELLS: u32 = 8;

struct Ball {
    centre: Vec3,
    radius: f32,
    /// Turns +y to the direction away from the parent.
    turn: Quat,
    level: u32,
}

pub(super) fn generate(triangles: u64, seed: u64) -> Geometry {
    let mut materials = vec![material("floor", [0.55, 0.55, 0.58])];
    let colours = [
        [0.85, 0.62, 0.2],
        [0.75, 0.2, 0.15],
        [0.2, 0.45, 0.7],
        [0.3, 0.6, 0.25],
        [0.6, 0.3, 0.6],
        [0.8, 0.8, 0.75],
        [0.2, 0.6, 0.6],
    ];

    let budget = triangles.saturating_sub(2 * u64::from(FLOOR_CELLS * FLOOR_CELLS)).max(1);
    let total = |level: u32| (CHILDREN.pow(level + 1) - 1) / (CHILDREN - 1);
    let level = (0..=MAX_LEVEL).rev().find(|&level| total(level) * FEWEST <= budget).unwrap_or(0);
    let (slices, stacks) = division(budget / total(level));
    for (i, colour) in colours.iter().enumerate().take(level as usize + 1) {
        materials.push(material(&format!("level {i}"), *colour));
    }

    let random = Random::new(seed);
    let mut balls = vec![Ball { centre: Vec3::ZERO, radius: 1.0, turn: Quat::IDENTITY, level: 0 }];
    let mut from = 0;
    for depth in 0..level {
        let to = balls.len();
        for parent in from..to {
            let mut random = random.fork(parent as u64);
            let twist = random.range(0.0, std::f32::consts::TAU);
            for child in 0..CHILDREN {
                let ball = child_of(&balls[parent], child, twist, depth + 1);
                balls.push(ball);
            }
        }
        from = to;
    }
    let mut parts: Vec<Mesh> = balls
        .par_chunks(256)
        .map(|chunk| {
            let mut mesh = Mesh::default();
            for ball in chunk {
                tessellate(&mut mesh, ball, slices, stacks);
            }
            mesh
        })
        .collect();
    let mut floor = Mesh::default();
    let corner = Vec3::new(-4.0, -1.0, -4.0);
    floor.grid(corner, 8.0 * Vec3::Z, 8.0 * Vec3::X, (FLOOR_CELLS, FLOOR_CELLS), 0);
    parts.push(floor);
    assemble(parts, materials)
}

/// Six balls around the equator and three higher up, away from the grandparent.
fn child_of(parent: &Ball, child: u64, twist: f32, level: u32) -> Ball {
    let (turn, height) =
        if child < 6 { (child as f32 / 6.0, 0.08f32) } else { (child as f32 / 3.0 + 1.0 / 12.0, 0.95) };
    let (sin, cos) = (twist + turn * std::f32::consts::TAU).sin_cos();
    let flat = height.cos();
    let direction = parent.turn * Vec3::new(cos * flat, height.sin(), sin * flat);
    let radius = parent.radius / 3.0;
    Ball {
        centre: parent.centre + direction * (parent.radius + radius),
        radius,
        turn: Quat::from_rotation_arc(Vec3::Y, direction.normalize()),
        level,
    }
}

/// Slices and stacks whose 2 · slices · (stacks − 1) triangles come nearest to `triangles`.
fn division(triangles: u64) -> (u32, u32) {
    let mut best = (3, 2);
    let mut error = u64::MAX;
    for stacks in 2..2300u32 {
        let slices = (triangles as f64 / (2.0 * f64::from(stacks - 1))).round().max(3.0) as u32;
        // Round balls: about twice as many slices as stacks.
        if slices < stacks + stacks / 2 || slices > 2 * stacks + 4 {
            continue;
        }
        let off = (2 * u64::from(slices) * u64::from(stacks - 1)).abs_diff(triangles);
        if off < error {
            (best, error) = ((slices, stacks), off);
        }
    }
    best
}

fn tessellate(mesh: &mut Mesh, ball: &Ball, slices: u32, stacks: u32) {
    let at = |i: u32, j: u32| {
        let (sin, cos) = (std::f32::consts::TAU * (i % slices) as f32 / slices as f32).sin_cos();
        let (y, r) = match j {
            0 => (-1.0, 0.0),
            j if j == stacks => (1.0, 0.0),
            j => {
                let angle = std::f32::consts::PI * (j as f32 / stacks as f32 - 0.5);
                (angle.sin(), angle.cos())
            }
        };
        ball.centre + ball.turn * Vec3::new(r * cos, y, -r * sin) * ball.radius
    };
    let material = 1 + ball.level;
    for j in 0..stacks {
        for i in 0..slices {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            if j > 0 {
                mesh.triangle(a, b, if j + 1 < stacks { c } else { d }, material);
            }
            if j + 1 < stacks {
                mesh.triangle(if j > 0 { a } else { b }, c, d, material);
            }
        }
    }
}
