//! How often a ray-triangle test is wrong, and by how much.

use super::{
    exact::{self, LARGEST, Truth},
    inputs::Case,
};
use tracer::{
    bvh2::Aabb,
    traverse::{TriangleTest, cpu},
};

/// What became of many rays under one test.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Rays through the inside of a triangle, and those of them that the test lets pass.
    pub inside: u64,
    pub false_misses: u64,
    /// Rays that miss a triangle, and those of them that the test says hit.
    pub outside: u64,
    pub false_hits: u64,
    /// Rays that meet at least one of the triangles they are aimed at, and those of them that meet none under the test.
    pub met: u64,
    pub slips: u64,
    /// Hits of the test, and those of them by rays that miss the box around the triangle: false ones, and true ones.
    pub hits: u64,
    pub false_outside: u64,
    pub true_outside: u64,
    /// Of each true hit that the test finds, how far its distance is off, in parts of the distance.
    pub errors: Vec<f32>,
}

impl Tally {
    /// Adds one case.
    pub fn add(&mut self, test: TriangleTest, case: &Case) {
        let (mut met, mut found_any) = (false, false);
        for triangle in &case.triangles {
            let truth = exact::meet(&case.ray, triangle);
            let found = cpu::intersect(test, &case.ray, f32::INFINITY, triangle);
            met |= truth.distance().is_some();
            found_any |= found.is_some();
            match truth {
                Truth::Inside(_) => {
                    self.inside += 1;
                    self.false_misses += u64::from(found.is_none());
                }
                Truth::Miss => {
                    self.outside += 1;
                    self.false_hits += u64::from(found.is_some());
                }
                // Either answer is right for one of the two triangles there.
                Truth::Edge(_) => {}
            }
            if let Some(t) = found {
                self.hits += 1;
                let outside = u64::from(!cpu::enters(&case.ray, &Aabb::of(triangle), LARGEST as f32));
                if let Some(exact) = truth.distance() {
                    self.true_outside += outside;
                    self.errors.push(((f64::from(t) - exact).abs() / exact) as f32);
                } else {
                    self.false_outside += outside;
                }
            }
        }
        self.met += u64::from(met);
        self.slips += u64::from(met && !found_any);
    }

    /// Adds what another has seen.
    pub fn merge(mut self, other: Self) -> Self {
        self.inside += other.inside;
        self.false_misses += other.false_misses;
        self.outside += other.outside;
        self.false_hits += other.false_hits;
        self.met += other.met;
        self.slips += other.slips;
        self.hits += other.hits;
        self.false_outside += other.false_outside;
        self.true_outside += other.true_outside;
        self.errors.extend(other.errors);
        self
    }

    /// Median and largest relative error of the distance.
    pub fn error(&mut self) -> Option<(f32, f32)> {
        let largest = self.errors.iter().copied().reduce(f32::max)?;
        let middle = self.errors.len() / 2;
        let (_, median, _) = self.errors.select_nth_unstable_by(middle, f32::total_cmp);
        Some((*median, largest))
    }
}
