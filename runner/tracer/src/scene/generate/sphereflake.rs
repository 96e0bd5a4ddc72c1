//! A ball with nine balls a third its size on it, each with nine on it, and so on, over a floor.
//! The large ball has radius 1 and stands at the origin. Large balls are cut finer than small ones.

use glam::{Quat, Vec3};
use rayon::prelude::*;

use super::{Mesh, assemble, material};
use crate::scene::Geometry;
use crate::scene::random::Random;

const CHILDREN: u64 = 9;
/// Fewest triangles that the smallest balls may have when another level of balls is added.
const FEWEST: f64 = 30.0;
const MAX_LEVEL: u32 = 6;
const FLOOR_CELLS: u32 = 8;
const FLOOR_HALF: f32 = 12.0;

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
    let level = (0..=MAX_LEVEL)
        .rev()
        .find(|&level| budget as f64 * share(level) / total_share(level) >= FEWEST)
        .unwrap_or(0);
    let divisions = divisions(budget, level);
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
                tessellate(&mut mesh, ball, divisions[ball.level as usize]);
            }
            mesh
        })
        .collect();
    let mut floor = Mesh::default();
    let corner = Vec3::new(-FLOOR_HALF, -1.0, -FLOOR_HALF);
    let (u, v) = (2.0 * FLOOR_HALF * Vec3::Z, 2.0 * FLOOR_HALF * Vec3::X);
    floor.grid(corner, u, v, (FLOOR_CELLS, FLOOR_CELLS), 0);
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

/// What a ball of a level gets of the triangles, where the large ball gets 1: its radius to the power 1.5.
/// In proportion to the radius large balls would look angular, to its square small ones.
fn share(level: u32) -> f64 {
    3f64.powf(-1.5 * f64::from(level))
}

/// The shares of all balls down to `level` together.
fn total_share(level: u32) -> f64 {
    (0..=level).map(|l| CHILDREN.pow(l) as f64 * share(l)).sum()
}

/// Slices and stacks of the balls of each level. The smallest, of which there are most, choose first, so
/// that the few large ones, which can be cut finely, make up for their rounding.
fn divisions(budget: u64, level: u32) -> Vec<(u32, u32)> {
    let mut left = budget;
    let mut all: Vec<_> = (0..=level)
        .rev()
        .map(|level| {
            let (slices, stacks) = division((left as f64 * share(level) / total_share(level)) as u64);
            let each = 2 * u64::from(slices) * u64::from(stacks - 1);
            left = left.saturating_sub(CHILDREN.pow(level) * each);
            (slices, stacks)
        })
        .collect();
    all.reverse();
    all
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

fn tessellate(mesh: &mut Mesh, ball: &Ball, (slices, stacks): (u32, u32)) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_balls_are_rounder_than_small_ones() {
        for triangles in [1_000, 50_000, 1_000_000] {
            let made = generate(triangles, 1);
            let of = |level: u32| made.material_ids.iter().filter(|&&id| id == 1 + level).count();
            let levels = made.materials.len() as u32 - 1;
            for level in 1..levels {
                let (here, above) = (
                    of(level) / CHILDREN.pow(level) as usize,
                    of(level - 1) / CHILDREN.pow(level - 1) as usize,
                );
                assert!(here >= 20 && above > 2 * here, "{triangles}: {above} then {here}");
            }
        }
        assert!(generate(50_000, 1).material_ids.iter().filter(|&&id| id == 1).count() > 3_000);
    }
}
