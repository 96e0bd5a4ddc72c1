//! Procedural scenes with a triangle count and a seed, so that a fresh machine has real work to do and
//! cost can be plotted against size.
//!
//! Each generator fills the same space whatever its count: more triangles mean finer or more parts, so
//! the same views fit. The same generator, count and seed always give the same triangles.

mod city;
mod cornell;
mod forest;
mod hairball;
mod sphereflake;

use std::fmt;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::{Geometry, Material};

/// The largest triangle count that may be asked for.
pub(super) const MAX_REQUEST: u64 = 20_000_000;

/// A procedural scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Generator {
    /// A closed room with two blocks and a lamp in the ceiling: nothing but large, evenly cut surfaces.
    Cornell,
    /// A ball with nine smaller balls on it, and so on: detail at every scale.
    Sphereflake,
    /// Many thin curved strands around a core: long triangles whose boxes overlap.
    Hairball,
    /// Streets and facades with windows, sills, cars and lamps: large walls beside many small parts.
    City,
    /// Hilly ground, trunks and clouds of leaf cards: many small unconnected triangles.
    Forest,
}

impl Generator {
    /// Every generator.
    pub const ALL: [Self; 5] = [Self::Cornell, Self::Sphereflake, Self::Hairball, Self::City, Self::Forest];

    /// The name in descriptors, which is also that of the built-in scene.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cornell => "cornell",
            Self::Sphereflake => "sphereflake",
            Self::Hairball => "hairball",
            Self::City => "city",
            Self::Forest => "forest",
        }
    }

    /// The count where none is given: light enough for a driver that runs on the CPU.
    pub fn default_triangles(self) -> u64 {
        match self {
            Self::Cornell => 4_000,
            Self::Sphereflake => 50_000,
            Self::Hairball => 60_000,
            Self::City => 80_000,
            Self::Forest => 80_000,
        }
    }

    /// Makes about `triangles` triangles: within a tenth from one thousand up, coarser below; at most
    /// twenty million. Ten million take a few seconds.
    pub(crate) fn generate(self, triangles: u64, seed: u64) -> Geometry {
        let triangles = triangles.min(MAX_REQUEST);
        match self {
            Self::Cornell => cornell::generate(triangles, seed),
            Self::Sphereflake => sphereflake::generate(triangles, seed),
            Self::Hairball => hairball::generate(triangles, seed),
            Self::City => city::generate(triangles, seed),
            Self::Forest => forest::generate(triangles, seed),
        }
    }
}

impl fmt::Display for Generator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

fn material(name: &str, albedo: [f32; 3]) -> Material {
    Material::diffuse(name, albedo)
}

/// Triangles of one part, before the parts are put together.
#[derive(Default)]
struct Mesh {
    triangles: Vec<[[f32; 3]; 3]>,
    materials: Vec<u32>,
}

impl Mesh {
    fn triangle(&mut self, a: Vec3, b: Vec3, c: Vec3, material: u32) {
        self.triangles.push([a.to_array(), b.to_array(), c.to_array()]);
        self.materials.push(material);
    }

    /// Two triangles; the corners in counter-clockwise order as seen from the front.
    fn quad(&mut self, [a, b, c, d]: [Vec3; 4], material: u32) {
        self.triangle(a, b, c, material);
        self.triangle(a, c, d, material);
    }

    /// A parallelogram cut into `nu` × `nv` cells, two triangles each; its front is where u × v points.
    fn grid(&mut self, origin: Vec3, u: Vec3, v: Vec3, (nu, nv): (u32, u32), material: u32) {
        let at = |i: u32, j: u32| origin + u * (i as f32 / nu as f32) + v * (j as f32 / nv as f32);
        for j in 0..nv {
            for i in 0..nu {
                self.quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], material);
            }
        }
    }

    /// A box with the given edges at a corner, right-handed; `bottom` says whether the face at −`y` is
    /// made. 12 or 10 triangles.
    fn cuboid(&mut self, origin: Vec3, x: Vec3, y: Vec3, z: Vec3, bottom: bool, material: u32) {
        let at = |i: u32| {
            origin
                + if i & 1 > 0 { x } else { Vec3::ZERO }
                + if i & 2 > 0 { y } else { Vec3::ZERO }
                + if i & 4 > 0 { z } else { Vec3::ZERO }
        };
        const FACES: [[u32; 4]; 6] =
            [[4, 5, 7, 6], [1, 0, 2, 3], [5, 1, 3, 7], [0, 4, 6, 2], [6, 7, 3, 2], [0, 1, 5, 4]];
        for face in &FACES[..if bottom { 6 } else { 5 }] {
            self.quad(face.map(at), material);
        }
    }

    /// A tube through `rings` of equally many points each; the rings turn counter-clockwise as seen
    /// against its direction.
    fn tube(&mut self, rings: &[Vec<Vec3>], material: u32) {
        for pair in rings.windows(2) {
            let n = pair[0].len();
            for i in 0..n {
                let j = (i + 1) % n;
                self.quad([pair[0][i], pair[0][j], pair[1][j], pair[1][i]], material);
            }
        }
    }
}

/// Points around `centre` in the plane spanned by `u` and `v`.
fn ring(centre: Vec3, u: Vec3, v: Vec3, sides: u32) -> Vec<Vec3> {
    (0..sides)
        .map(|i| {
            let (sin, cos) = (std::f32::consts::TAU * i as f32 / sides as f32).sin_cos();
            centre + u * cos + v * sin
        })
        .collect()
}

/// Puts parts together, in their order.
fn assemble(parts: Vec<Mesh>, materials: Vec<Material>) -> Geometry {
    let count = parts.iter().map(|part| part.triangles.len()).sum();
    let mut geometry =
        Geometry { positions: Vec::with_capacity(count), material_ids: Vec::with_capacity(count), materials };
    for part in parts {
        geometry.positions.extend_from_slice(&part.triangles);
        geometry.material_ids.extend_from_slice(&part.materials);
    }
    geometry
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_count_is_close_to_what_was_asked_for() {
        for generator in Generator::ALL {
            for asked in [1_000, 3_000, 10_000, 30_000, 100_000, 1_000_000] {
                let made = generator.generate(asked, 1).positions.len() as f64;
                let ratio = made / asked as f64;
                assert!((0.85..=1.15).contains(&ratio), "{generator}: asked for {asked}, made {made}");
            }
        }
    }

    #[test]
    fn tiny_requests_give_something() {
        for generator in Generator::ALL {
            for asked in [1, 2, 10, 100] {
                let made = generator.generate(asked, 1).positions.len();
                assert!((1..1200).contains(&made), "{generator}: asked for {asked}, made {made}");
            }
        }
    }

    #[test]
    fn triangles_are_finite_and_have_area_and_materials() {
        for generator in Generator::ALL {
            let made = generator.generate(20_000, 3);
            assert_eq!(made.positions.len(), made.material_ids.len());
            assert!(made.positions.iter().flatten().flatten().all(|x| x.is_finite()), "{generator}");
            let mut used = vec![false; made.materials.len()];
            for (&[a, b, c], &id) in made.positions.iter().zip(&made.material_ids) {
                let [a, b, c] = [a, b, c].map(Vec3::from_array);
                assert!((b - a).cross(c - a).length() > 0.0, "{generator}: {a} {b} {c}");
                used[id as usize] = true;
            }
            assert!(used.iter().all(|&used| used), "{generator}: {used:?}");
            assert!(made.materials.iter().flat_map(|m| m.albedo).all(|x| (0.0..=1.0).contains(&x)));
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_scene_and_another_seed_another() {
        for generator in Generator::ALL {
            let (a, b, c) =
                (generator.generate(9_000, 7), generator.generate(9_000, 7), generator.generate(9_000, 8));
            assert!(a.positions == b.positions && a.material_ids == b.material_ids, "{generator}");
            assert!(a.positions != c.positions, "{generator}");
        }
    }

    #[test]
    fn every_size_fills_the_same_space() {
        for generator in Generator::ALL {
            let size = |n| {
                let (low, high) = super::super::bounds(&generator.generate(n, 1).positions);
                Vec3::from_array(high) - Vec3::from_array(low)
            };
            let (small, large) = (size(2_000), size(300_000));
            assert!(
                (small / large).min_element() > 0.7 && (small / large).max_element() < 1.4,
                "{generator}: {small} {large}"
            );
        }
    }

    #[test]
    fn cuboids_and_tubes_face_outwards() {
        let mut mesh = Mesh::default();
        mesh.cuboid(Vec3::splat(-1.0), 2.0 * Vec3::X, 2.0 * Vec3::Y, 2.0 * Vec3::Z, true, 0);
        let ends = [-1.0, 1.0].map(|y| ring(Vec3::Y * y, Vec3::X, -Vec3::Z, 5));
        mesh.tube(&ends, 0);
        assert_eq!(mesh.triangles.len(), 12 + 10);
        for corners in mesh.triangles {
            let [a, b, c] = corners.map(Vec3::from_array);
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0, "{a} {b} {c}");
        }
    }
}
