//! Rays and triangles of many kinds, with whole coordinates.

use super::exact::LARGEST;
use rand_xoshiro::{
    SplitMix64,
    rand_core::{Rng, SeedableRng},
};
use std::collections::HashMap;
use tracer::{bvh2::Triangle, traverse::Ray};

/// A ray, and the triangles that it is aimed at or past.
#[derive(Clone, Debug)]
pub struct Case {
    pub ray: Ray,
    pub triangles: Vec<Triangle>,
}

/// What rays and triangles are like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Triangles of any shape, an eighth of the scene large, and rays aimed at points in and around them.
    Ordinary,
    /// The same, and rays aimed at their edges.
    Edges,
    /// Triangles with one edge 2,000 to 32,000 times as short as the other two.
    Needles,
    /// Triangles with one corner almost on the opposite edge, as thin as needles.
    Slivers,
    /// Rays that leave slivers, as the bounces of a path do: they start a little above one.
    Leaving,
    /// Triangles of 256 units, 65,000 times as far from the origin, and rays that start near them.
    Far,
    /// Rays from inside a closed mesh as large as the scene, aimed at an edge that two triangles share. All
    /// triangles at both ends of it are looked at: rounding may take a ray to any of them.
    MeshEdges,
    /// The same, aimed at a corner.
    MeshCorners,
    /// The first in a mesh that is 2,000 times as far from the origin as it is large.
    FarMeshEdges,
}

impl Kind {
    /// All, in the order of the table.
    pub const ALL: [Self; 9] = [
        Self::Ordinary,
        Self::Edges,
        Self::Needles,
        Self::Slivers,
        Self::Leaving,
        Self::Far,
        Self::MeshEdges,
        Self::MeshCorners,
        Self::FarMeshEdges,
    ];

    /// As the table calls it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ordinary => "ordinary triangles",
            Self::Edges => "ordinary triangles, at their edges",
            Self::Needles => "needles",
            Self::Slivers => "slivers",
            Self::Leaving => "leaving slivers",
            Self::Far => "small, far from the origin",
            Self::MeshEdges => "closed mesh, shared edges",
            Self::MeshCorners => "closed mesh, corners",
            Self::FarMeshEdges => "closed mesh far away, shared edges",
        }
    }
}

type Point = [i64; 3];

fn float(p: Point) -> [f32; 3] {
    p.map(|x| x as f32)
}

fn add(a: Point, b: Point) -> Point {
    std::array::from_fn(|k| a[k] + b[k])
}

fn towards(origin: Point, target: Point) -> Ray {
    let direction = std::array::from_fn(|k| (target[k] - origin[k]) as f32);
    Ray { origin: float(origin), t_min: 0.0, direction, t_max: f32::INFINITY }
}

/// `(1 - u - v) * a + u * b + v * c`, rounded to whole coordinates that floats hold.
fn point_of([a, b, c]: [Point; 3], u: f64, v: f64) -> Point {
    std::array::from_fn(|k| {
        let [a, b, c] = [a[k], b[k], c[k]].map(|x| x as f64);
        ((1.0 - u - v) * a + u * b + v * c).round().clamp(-LARGEST as f64, LARGEST as f64) as i64
    })
}

/// A closed mesh: an octahedron's faces, each cut into squares of [`Mesh::CUTS`] triangles, blown up to a sphere with
/// hills. Corners are where several triangles are told the same coordinates.
struct Mesh {
    faces: Vec<[Point; 3]>,
    around: HashMap<Point, Vec<usize>>,
    centre: Point,
    radius: i64,
}

impl Mesh {
    const CUTS: i64 = 16;

    fn new(centre: Point, radius: i64) -> Self {
        let n = Self::CUTS;
        let mut faces = Vec::new();
        for signs in 0..8 {
            let corner = |i: i64, j: i64| -> Point {
                let p = [i, j, n - i - j].map(|x| x as f64);
                let length = p.iter().map(|x| x * x).sum::<f64>().sqrt();
                let hills = 0.9 + 0.05 * (0.9 * p[0] + 1.7 * p[1]).sin();
                std::array::from_fn(|k| {
                    let side = if signs >> k & 1 == 1 { -1.0 } else { 1.0 };
                    centre[k] + (side * p[k] / length * hills * radius as f64).round() as i64
                })
            };
            for i in 0..n {
                for j in 0..n - i {
                    faces.push([corner(i, j), corner(i + 1, j), corner(i, j + 1)]);
                    if i + j < n - 1 {
                        faces.push([corner(i + 1, j + 1), corner(i, j + 1), corner(i + 1, j)]);
                    }
                }
            }
        }
        let mut around: HashMap<Point, Vec<usize>> = HashMap::new();
        for (index, face) in faces.iter().enumerate() {
            face.iter().for_each(|corner| around.entry(*corner).or_default().push(index));
        }
        Self { faces, around, centre, radius }
    }

    /// The triangles that have any of these corners, each once.
    fn around(&self, corners: &[Point]) -> Vec<Triangle> {
        let mut indices: Vec<usize> =
            corners.iter().flat_map(|corner| &self.around[corner]).copied().collect();
        indices.sort_unstable();
        indices.dedup();
        indices.into_iter().map(|i| self.faces[i].map(float)).collect()
    }
}

/// Makes cases, the same ones from the same seed.
pub struct Inputs {
    random: SplitMix64,
    mesh: Mesh,
    far_mesh: Mesh,
}

impl Inputs {
    /// A stream of cases of its own for each seed.
    pub fn new(seed: u64) -> Self {
        let far = LARGEST - (1 << 14);
        Self {
            random: SplitMix64::seed_from_u64(seed),
            mesh: Mesh::new([0; 3], LARGEST),
            far_mesh: Mesh::new([far, -far, far], 1 << 13),
        }
    }

    /// The next case of a kind.
    pub fn case(&mut self, kind: Kind) -> Case {
        match kind {
            Kind::Ordinary => {
                let triangle = self.triangle();
                let (u, v) = (2.0 * self.unit() - 0.5, 2.0 * self.unit() - 0.5);
                self.aimed(triangle, u, v)
            }
            Kind::Edges => {
                let triangle = self.triangle();
                let along = self.unit();
                let (u, v) = [(along, 0.0), (0.0, along), (along, 1.0 - along)][self.below(3)];
                self.aimed(triangle, u, v)
            }
            Kind::Needles => {
                let triangle = self.needle();
                // As far beside it as it is wide.
                let (u, across) = (self.unit(), 3.0 * self.unit() - 1.0);
                self.aimed(triangle, u * (1.0 - across), u * across)
            }
            Kind::Slivers => {
                let triangle = self.sliver();
                let (u, v) = (self.unit(), 3.0 * self.unit() - 1.0);
                self.aimed(triangle, u, v)
            }
            Kind::Leaving => self.leaving(),
            Kind::Far => {
                let far = LARGEST - (1 << 14);
                let centre = [0; 3].map(|x: i64| x + if self.below(2) == 0 { far } else { -far });
                let triangle = [0; 3].map(|_: i64| add(centre, self.point(1 << 8)));
                let origin = add(centre, self.point(1 << 13));
                let (u, v) = (2.0 * self.unit() - 0.5, 2.0 * self.unit() - 0.5);
                let ray = towards(origin, point_of(triangle, u, v));
                self.of(ray, triangle)
            }
            Kind::MeshEdges => self.at_mesh(false, false),
            Kind::MeshCorners => self.at_mesh(false, true),
            Kind::FarMeshEdges => self.at_mesh(true, false),
        }
    }

    fn of(&mut self, ray: Ray, triangle: [Point; 3]) -> Case {
        if ray.direction == [0.0; 3] {
            let up = Ray { direction: [0.0, 0.0, 1.0], ..ray };
            return Case { ray: up, triangles: vec![triangle.map(float)] };
        }
        // Corners in any order: tests treat the first differently.
        let turn = self.below(3);
        let triangle = [0, 1, 2].map(|i| float(triangle[(i + turn) % 3]));
        Case { ray, triangles: vec![triangle] }
    }

    fn aimed(&mut self, triangle: [Point; 3], u: f64, v: f64) -> Case {
        let origin = self.point(LARGEST);
        let ray = towards(origin, point_of(triangle, u, v));
        self.of(ray, triangle)
    }

    fn leaving(&mut self) -> Case {
        let triangle = self.sliver();
        let (u, v) = (self.unit(), self.unit());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let [a, b, c] = triangle.map(|p| p.map(|x| x as f64));
        let [p, q]: [[f64; 3]; 2] = [b, c].map(|to| std::array::from_fn(|k| to[k] - a[k]));
        let normal = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
        let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
        // As far above it as path tracing starts its rays: 2^-18 of the scene's extent.
        let above = normal.map(|x| (x / length * (LARGEST >> 18) as f64).round() as i64);
        let mut direction = self.point(LARGEST);
        if (0..3).map(|k| direction[k] as f64 * normal[k]).sum::<f64>() < 0.0 {
            direction = direction.map(|x| -x);
        }
        let origin = add(point_of(triangle, u, v), above).map(|x| x.clamp(-LARGEST, LARGEST));
        let ray =
            Ray { origin: float(origin), t_min: 0.0, direction: float(direction), t_max: f32::INFINITY };
        self.of(ray, triangle)
    }

    fn at_mesh(&mut self, far: bool, at_corner: bool) -> Case {
        let mesh = if far { &self.far_mesh } else { &self.mesh };
        let (centre, radius, faces) = (mesh.centre, mesh.radius, mesh.faces.len());
        let origin = add(centre, self.point(radius / 3));
        let (face, side, along) = (self.below(faces), self.below(3), self.unit());
        let mesh = if far { &self.far_mesh } else { &self.mesh };
        let (a, b) = (mesh.faces[face][side], mesh.faces[face][(side + 1) % 3]);
        if at_corner {
            return Case { ray: towards(origin, a), triangles: mesh.around(&[a]) };
        }
        Case { ray: towards(origin, point_of([a, b, a], along, 0.0)), triangles: mesh.around(&[a, b]) }
    }

    /// Any triangle of an eighth of the scene's size.
    fn triangle(&mut self) -> [Point; 3] {
        let size = LARGEST / 8;
        let centre = self.point(LARGEST - size);
        [0; 3].map(|_: i64| add(centre, self.point(size)))
    }

    /// A triangle of which two corners are close together.
    fn needle(&mut self) -> [Point; 3] {
        let [a, b, _] = self.triangle();
        let width = 1 << (7 + self.below(4));
        [a, b, add(b, self.point(width)).map(|x| x.clamp(-LARGEST, LARGEST))]
    }

    /// A triangle of which one corner is close to the middle of the opposite edge.
    fn sliver(&mut self) -> [Point; 3] {
        let [a, b, _] = self.triangle();
        let width = 1 << (7 + self.below(4));
        let middle = point_of([a, b, a], 0.25 + 0.5 * self.unit(), 0.0);
        [a, b, add(middle, self.point(width)).map(|x| x.clamp(-LARGEST, LARGEST))]
    }

    /// Each coordinate at most `most` from zero.
    fn point(&mut self, most: i64) -> Point {
        [0; 3].map(|_: i64| (self.random.next_u64() % (2 * most as u64 + 1)) as i64 - most)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.random.next_u64() % n as u64) as usize
    }

    /// In 0 to 1.
    fn unit(&mut self) -> f64 {
        (self.random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }
}
