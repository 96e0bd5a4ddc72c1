//! Cutting a reference in two at a plane.

use crate::bvh2::{Aabb, Triangle};
use std::array::from_fn;

/// A triangle and a corner more for each plane it is cut with, six of a box and one more; and some that
/// rounding may add.
const CORNERS: usize = 16;

/// By how much corners move at most while a triangle is cut, as a share of its greatest coordinate: less
/// than a hundred roundings, of at most 2^-53 each. A power of two, 2^-46.
const ERROR: f64 = 1.0 / (1u64 << 46) as f64;

/// A convex polygon, in double precision.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [[f64; 3]; CORNERS],
    count: usize,
}

impl Polygon {
    const EMPTY: Self = Self { corners: [[0.0; 3]; CORNERS], count: 0 };

    /// Adds a corner if there is room.
    fn push(&mut self, corner: [f64; 3]) {
        if let Some(place) = self.corners.get_mut(self.count) {
            *place = corner;
        }
        self.count += 1;
    }

    /// What lies at or below `plane` on an axis, or, with a `sign` of -1, at or above it (Sutherland and
    /// Hodgman).
    fn cut(&self, axis: usize, plane: f64, sign: f64) -> Self {
        let inside = |p: &[f64; 3]| sign * (plane - p[axis]);
        let corners = &self.corners[..self.count];
        if corners.iter().all(|p| inside(p) >= 0.0) {
            return *self;
        }
        let mut cut = Self::EMPTY;
        for (i, a) in corners.iter().enumerate() {
            let b = &corners[(i + 1) % corners.len()];
            let (da, db) = (inside(a), inside(b));
            if da >= 0.0 {
                cut.push(*a);
            }
            if (da > 0.0 && db < 0.0) || (da < 0.0 && db > 0.0) {
                let t = da / (da - db);
                cut.push(from_fn(|k| a[k] + t * (b[k] - a[k])));
            }
        }
        // A polygon that is not cut is larger than it has to be, and so no error.
        if cut.count <= CORNERS { cut } else { *self }
    }
}

/// The greatest float that is not above, for a sign of 1; the least that is not below, for one of -1.
fn round(x: f64, sign: f64) -> f32 {
    let near = x as f32;
    if sign * (f64::from(near) - x) <= 0.0 {
        near + 0.0
    } else if sign > 0.0 {
        near.next_down() + 0.0
    } else {
        near.next_up() + 0.0
    }
}

/// The boxes around what `triangle` has in `bounds` on either side of a plane, the plane included. None
/// where there is certainly nothing.
///
/// Cutting moves corners by rounding errors, so all planes are taken to lie a little further out, by more
/// than these errors can add up to, and so are the sides of the box that comes out. Then it is met with
/// `bounds` and with the plane, which are exact.
pub(super) fn clip(triangle: &Triangle, bounds: &Aabb, axis: usize, plane: f32) -> [Option<Aabb>; 2] {
    let mut whole = Polygon::EMPTY;
    triangle.iter().for_each(|p| whole.push(p.map(f64::from)));
    let greatest = triangle.as_flattened().iter().fold(0.0f32, |m, x| m.max(x.abs()));
    let error = f64::from(greatest) * ERROR;
    for k in 0..3 {
        whole = whole.cut(k, f64::from(bounds.hi[k]) + error, 1.0);
        whole = whole.cut(k, f64::from(bounds.lo[k]) - error, -1.0);
    }
    [1.0, -1.0].map(|sign| {
        let part = whole.cut(axis, f64::from(plane) + sign * error, sign);
        if part.count == 0 {
            return None;
        }
        let (mut lo, mut hi) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in &part.corners[..part.count] {
            lo = from_fn(|k| lo[k].min(p[k]));
            hi = from_fn(|k| hi[k].max(p[k]));
        }
        let mut clipped = Aabb {
            lo: from_fn(|k| round(lo[k] - error, 1.0).max(bounds.lo[k])),
            hi: from_fn(|k| round(hi[k] + error, -1.0).min(bounds.hi[k])),
        };
        if sign > 0.0 {
            clipped.hi[axis] = clipped.hi[axis].min(plane);
        } else {
            clipped.lo[axis] = clipped.lo[axis].max(plane);
        }
        (!clipped.is_empty()).then_some(clipped)
    })
}
