//! The traversal kernel's twin: the same tests, one ray at a time, and the brute force that both are held
//! against.

use super::{Counts, Hit, Ray, TriangleTest};
use crate::{
    bvh2::Aabb,
    layout::{self, EdgeTriangle, LeafTriangles, NodeLayout, Target, UnitTriangle},
};

/// A test of a ray against a triangle: the distance, or `None`. `t_max` may be the best distance so far.
///
/// The twins round as their formulas stand. Kernels may fuse multiplications and additions where the watertight test
/// does not forbid it, so their distances differ in the last places, and of the other tests the decision about a
/// ray that passes an edge (see [`passes_edge`]).
pub fn intersect(test: TriangleTest, ray: &Ray, t_max: f32, triangle: &[[f32; 3]; 3]) -> Option<f32> {
    match test {
        TriangleTest::Watertight => watertight(ray, t_max, triangle),
        TriangleTest::MoellerTrumbore => moeller_trumbore(ray, t_max, triangle),
        TriangleTest::KenslerShirley => kensler_shirley(ray, t_max, &EdgeTriangle::new(triangle, 0)),
        TriangleTest::Woop => woop(ray, t_max, &UnitTriangle::new(triangle)),
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `moeller_trumbore.glsl`.
fn moeller_trumbore(ray: &Ray, t_max: f32, [v0, v1, v2]: &[[f32; 3]; 3]) -> Option<f32> {
    let from_v0 = |p: &[f32; 3]| -> [f32; 3] { std::array::from_fn(|k| p[k] - v0[k]) };
    let (e1, e2, s) = (from_v0(v1), from_v0(v2), from_v0(&ray.origin));
    let p = cross(ray.direction, e2);
    let inverse = 1.0 / dot(e1, p);
    let u = dot(s, p) * inverse;
    if !(0.0..=1.0).contains(&u) {
        return None;
    }
    let q = cross(s, e1);
    let v = dot(ray.direction, q) * inverse;
    let t = dot(e2, q) * inverse;
    (v >= 0.0 && u + v <= 1.0 && t > ray.t_min && t < t_max).then_some(t)
}

/// `kensler_shirley.glsl`, by the edges of a triangle.
pub fn kensler_shirley(ray: &Ray, t_max: f32, triangle: &EdgeTriangle) -> Option<f32> {
    let EdgeTriangle { corner, e1, e2, normal_x, normal_y, .. } = *triangle;
    let normal = [normal_x, normal_y, e1[0] * e2[1] - e1[1] * e2[0]];
    let inverse = 1.0 / dot(normal, ray.direction);
    let offset: [f32; 3] = std::array::from_fn(|k| corner[k] - ray.origin[k]);
    let moment = cross(ray.direction, offset);
    let u = -dot(e2, moment) * inverse;
    let v = dot(e1, moment) * inverse;
    let t = dot(normal, offset) * inverse;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > ray.t_min && t < t_max).then_some(t)
}

/// `woop.glsl`: Woop's test, by the map of a triangle.
pub fn woop(ray: &Ray, t_max: f32, map: &UnitTriangle) -> Option<f32> {
    let at = |row: [f32; 4]| {
        let normal = [row[0], row[1], row[2]];
        (dot(normal, ray.origin) + row[3], dot(normal, ray.direction))
    };
    let (above, along) = at(map.z);
    let t = -above / along;
    // A quotient that is no number fails here.
    let within = t > ray.t_min && t < t_max;
    if !within {
        return None;
    }
    let [u, v] = [map.u, map.v].map(|row| {
        let (origin, direction) = at(row);
        origin + t * direction
    });
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then_some(t)
}

/// `triangle.glsl`: the watertight test.
fn watertight(ray: &Ray, t_max: f32, [v0, v1, v2]: &[[f32; 3]; 3]) -> Option<f32> {
    let d = ray.direction;
    let magnitude = d.map(f32::abs);
    let axis = if magnitude[0] > magnitude[1] {
        if magnitude[0] > magnitude[2] { 0 } else { 2 }
    } else if magnitude[1] > magnitude[2] {
        1
    } else {
        2
    };
    let permute = |v: [f32; 3]| [v[(axis + 1) % 3], v[(axis + 2) % 3], v[axis]];
    let d = permute(d);
    let shear = [d[0] / d[2], d[1] / d[2], 1.0 / d[2]];
    let project = |v: &[f32; 3]| {
        let p = permute([v[0] - ray.origin[0], v[1] - ray.origin[1], v[2] - ray.origin[2]]);
        [p[0] - shear[0] * p[2], p[1] - shear[1] * p[2], p[2]]
    };
    let (a, b, c) = (project(v0), project(v1), project(v2));
    let e = [c[0] * b[1] - c[1] * b[0], a[0] * c[1] - a[1] * c[0], b[0] * a[1] - b[1] * a[0]];
    let (least, greatest) = (e[0].min(e[1]).min(e[2]), e[0].max(e[1]).max(e[2]));
    if least < 0.0 && greatest > 0.0 {
        return None;
    }
    let inverse = shear[2] / (e[0] + e[1] + e[2]);
    let t = (e[0] * a[2] + e[1] * b[2] + e[2] * c[2]) * inverse;
    if t.is_nan() || t >= t_max {
        return None;
    }
    let across = [a, b, c].iter().fold(0f32, |m, p| m.max(p[0].abs()).max(p[1].abs()));
    let depth = a[2].abs().max(b[2].abs()).max(c[2].abs());
    let error = depth * (12.0 * across * (across + depth) * inverse.abs() + 4.0 * shear[2].abs());
    let uncertain = (t - ray.t_min).abs() < error * f32::EPSILON;
    let t = if uncertain { plane_distance(ray, &[*v0, *v1, *v2]) as f32 } else { t };
    (t > ray.t_min && t < t_max).then_some(t)
}

/// The distance to a triangle's plane in double precision, 0 for a ray that starts on it as far as the
/// kernel can tell; not finite for a ray in the plane or a triangle without area.
fn plane_distance(ray: &Ray, triangle: &[[f32; 3]; 3]) -> f64 {
    let [v0, v1, v2] = triangle.map(|v| glam::DVec3::from_array(v.map(f64::from)));
    let origin = glam::DVec3::from_array(ray.origin.map(f64::from));
    let direction = glam::DVec3::from_array(ray.direction.map(f64::from));
    let (e1, e2, offset) = (v1 - v0, v2 - v0, v0 - origin);
    let normal = e1.cross(e2);
    let above = normal.dot(offset);
    let products = (0..3).map(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        (e1[i] * e2[j]).abs().max((e1[j] * e2[i]).abs()) * offset[k].abs()
    });
    if above.abs() <= products.fold(0.0, f64::max) * 0.5f64.powi(40) {
        0.0
    } else {
        above / normal.dot(direction)
    }
}

/// `Slab` of `slab.glsl`: what the conservative box test needs of a ray.
pub(super) struct Slab {
    pub inverse: [f32; 3],
    pub lower: [f32; 3],
    pub upper: [f32; 3],
}

impl Slab {
    /// `EXACT_PAD` in `slab.glsl`.
    pub const EXACT_PAD: f32 = 1.0 / 2_097_152.0;

    pub fn new(ray: &Ray, extent: f32, pad: f32) -> Self {
        let inverse = ray.direction.map(|d| (if d < 0.0 { -1.0 } else { 1.0 }) / d.abs().max(1e-18));
        let pad = ray.origin.map(|o| o.abs().max(extent) * pad);
        let (o, p, i) = (ray.origin, pad, inverse);
        Self {
            inverse,
            lower: std::array::from_fn(|k| -(o[k] + p[k]) * i[k]),
            upper: std::array::from_fn(|k| -(o[k] - p[k]) * i[k]),
        }
    }

    fn enter(&self, bounds: &Aabb, t_min: f32, t_max: f32) -> Option<f32> {
        let (mut enters, mut leaves) = (t_min, t_max);
        for k in 0..3 {
            let a = bounds.lo[k].mul_add(self.inverse[k], self.lower[k]);
            let b = bounds.hi[k].mul_add(self.inverse[k], self.upper[k]);
            enters = enters.max(a.min(b));
            leaves = leaves.min(a.max(b));
        }
        (enters <= leaves).then_some(enters)
    }
}

/// The nearest hit through a tree in any layout: children nearest first, leaves when they are reached.
/// `extent` is the scene's largest absolute coordinate.
///
/// The kernel visits no fewer nodes: while some lane of its subgroup looks for a leaf, others go on with a
/// leaf postponed, not knowing yet what it would have cut off.
pub fn closest_hit<L: NodeLayout>(
    nodes: &[L::Node],
    triangles: &LeafTriangles,
    extent: f32,
    ray: &Ray,
) -> (Hit, Counts) {
    let slab = Slab::new(ray, extent, Slab::EXACT_PAD);
    let mut best = Hit { t: ray.t_max.min(f32::MAX), triangle: Hit::MISS };
    let mut counts = Counts::default();
    let mut stack = vec![Target::Node(0)];
    while let Some(target) = stack.pop() {
        match target {
            Target::Node(index) => {
                counts.nodes += 1;
                let mut hit: Vec<(f32, Target)> = Vec::new();
                for child in layout::children::<L>(nodes, index) {
                    counts.boxes += 1;
                    if let Some(t) = slab.enter(&child.bounds, ray.t_min, best.t) {
                        hit.push((t, child.target));
                    }
                }
                hit.sort_by(|a, b| b.0.total_cmp(&a.0));
                stack.extend(hit.into_iter().map(|(_, target)| target));
            }
            Target::Leaf { first, count } => {
                for place in first as usize..(first + count) as usize {
                    counts.triangles += 1;
                    if let Some(t) = triangles.intersect(place, ray, best.t) {
                        best = Hit { t, triangle: triangles.index(place) };
                    }
                }
            }
        }
    }
    (if best.triangle == Hit::MISS { Hit::NONE } else { best }, counts)
}

/// Tests every triangle.
pub fn brute_force(triangles: &LeafTriangles, ray: &Ray) -> Hit {
    let mut best = Hit { t: ray.t_max, triangle: Hit::MISS };
    for place in 0..triangles.len() {
        if let Some(t) = triangles.intersect(place, ray, best.t) {
            best = Hit { t, triangle: triangles.index(place) };
        }
    }
    if best.triangle == Hit::MISS { Hit::NONE } else { best }
}

/// Whether a ray passes a line through two corners of a triangle within 2^-19 of the larger of `extent` and its origin's
/// coordinates, or runs in the triangle's plane to 1 in 10,000.
///
/// There the tests that are not watertight decide by rounding, each device by its own. What they say of a ray that
/// passes outside may besides be lost in a tree: boxes are wider than what is in them by 2^-21, which is more than
/// rounding moves a ray across an edge, but at an acute corner less than it moves it beyond.
pub fn passes_edge(ray: &Ray, triangle: &[[f32; 3]; 3], extent: f32) -> bool {
    let corners = triangle.map(|v| glam::DVec3::from_array(v.map(f64::from)));
    let origin = glam::DVec3::from_array(ray.origin.map(f64::from));
    let direction = glam::DVec3::from_array(ray.direction.map(f64::from)).normalize();
    let [v0, v1, v2] = corners;
    let normal = (v1 - v0).cross(v2 - v0);
    let tolerance = origin.abs().max_element().max(f64::from(extent)) * 0.5f64.powi(19);
    normal.dot(direction).abs() <= 1e-4 * normal.length()
        || (0..3).any(|k| {
            let (from, to) = (corners[k], corners[(k + 1) % 3]);
            let across = direction.cross(to - from);
            let offset = from - origin;
            // Lines that are all but parallel are as far apart as one is from a point of the other.
            if across.length() > 1e-9 * (to - from).length() {
                offset.dot(across).abs() <= tolerance * across.length()
            } else {
                offset.cross(direction).length() <= tolerance
            }
        })
}

/// Whether a ray enters a box, which is taken to be as much wider as kernels take it. `extent` is the scene's largest
/// absolute coordinate.
pub fn enters(ray: &Ray, bounds: &Aabb, extent: f32) -> bool {
    Slab::new(ray, extent, Slab::EXACT_PAD).enter(bounds, ray.t_min, ray.t_max.min(f32::MAX)).is_some()
}

/// The distance to the plane of the triangle that was hit, evaluated in double precision: what a hit file
/// holds, so that its distances are limited by the file's format and not by single-precision arithmetic
/// over long triangles. Which triangle is hit stays the traversal's decision.
pub fn refine(ray: &Ray, triangle: &[[f32; 3]; 3], t: f32) -> f32 {
    let exact = plane_distance(ray, triangle);
    // A ray almost in the triangle's plane may cross it far outside the triangle: then the distance stays.
    let length = |v: [f32; 3]| v.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
    let reach = triangle.iter().map(|v| length(std::array::from_fn(|k| v[k] - ray.origin[k])));
    let reach = reach.fold(0.0, f64::max) / length(ray.direction);
    if (exact - f64::from(t)).abs() <= 1e-3 * reach.max(exact) && exact > f64::from(ray.t_min) {
        exact as f32
    } else {
        t
    }
}
