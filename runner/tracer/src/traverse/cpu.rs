//! The traversal kernel's twin: the same tests, one ray at a time, and the brute force that both are held
//! against.

use super::{Counts, Hit, Ray};
use crate::{
    bvh2::Aabb,
    layout::{self, LeafTriangle, NodeLayout, Target},
};

/// The watertight test of `triangle.glsl`: the distance, or `None`.
///
/// `t_max` may be the best distance so far.
pub fn intersect(ray: &Ray, t_max: f32, [v0, v1, v2]: &[[f32; 3]; 3]) -> Option<f32> {
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
        [(-shear[0]).mul_add(p[2], p[0]), (-shear[1]).mul_add(p[2], p[1]), p[2]]
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

/// The distance to a triangle's plane in double precision; not finite for a ray in the plane or a triangle
/// without area.
fn plane_distance(ray: &Ray, triangle: &[[f32; 3]; 3]) -> f64 {
    let [v0, v1, v2] = triangle.map(|v| glam::DVec3::from_array(v.map(f64::from)));
    let origin = glam::DVec3::from_array(ray.origin.map(f64::from));
    let direction = glam::DVec3::from_array(ray.direction.map(f64::from));
    let normal = (v1 - v0).cross(v2 - v0);
    normal.dot(v0 - origin) / normal.dot(direction)
}

/// `Slab` of `slab.glsl`: what the conservative box test needs of a ray.
struct Slab {
    inverse: [f32; 3],
    lower: [f32; 3],
    upper: [f32; 3],
}

impl Slab {
    fn new(ray: &Ray, extent: f32) -> Self {
        let inverse = ray.direction.map(|d| (if d < 0.0 { -1.0 } else { 1.0 }) / d.abs().max(1e-18));
        let pad = ray.origin.map(|o| o.abs().max(extent) * 0.5f32.powi(21));
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
    triangles: &[LeafTriangle],
    extent: f32,
    ray: &Ray,
) -> (Hit, Counts) {
    let slab = Slab::new(ray, extent);
    let mut best = Hit { t: ray.t_max.min(f32::MAX), triangle: Hit::MISS };
    let mut counts = Counts::default();
    let mut stack = vec![Target::Node(0)];
    while let Some(target) = stack.pop() {
        match target {
            Target::Node(index) => {
                counts.nodes += 1;
                let mut hit: Vec<(f32, Target)> = Vec::new();
                for child in layout::children::<L>(&nodes[index as usize]) {
                    counts.boxes += 1;
                    if let Some(t) = slab.enter(&child.bounds, ray.t_min, best.t) {
                        hit.push((t, child.target));
                    }
                }
                hit.sort_by(|a, b| b.0.total_cmp(&a.0));
                stack.extend(hit.into_iter().map(|(_, target)| target));
            }
            Target::Leaf { first, count } => {
                for triangle in &triangles[first as usize..(first + count) as usize] {
                    counts.triangles += 1;
                    if let Some(t) = intersect(ray, best.t, &triangle.corners()) {
                        best = Hit { t, triangle: triangle.primitive };
                    }
                }
            }
        }
    }
    (if best.triangle == Hit::MISS { Hit::NONE } else { best }, counts)
}

/// Tests every triangle.
pub fn brute_force(triangles: &[[[f32; 3]; 3]], ray: &Ray) -> Hit {
    let mut best = Hit { t: ray.t_max, triangle: Hit::MISS };
    for (index, triangle) in triangles.iter().enumerate() {
        if let Some(t) = intersect(ray, best.t, triangle) {
            best = Hit { t, triangle: index as u32 };
        }
    }
    if best.triangle == Hit::MISS { Hit::NONE } else { best }
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
    if (exact - f64::from(t)).abs() <= 1e-3 * reach && exact > f64::from(ray.t_min) {
        exact as f32
    } else {
        t
    }
}
