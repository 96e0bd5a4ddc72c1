//! Where a ray meets a triangle, by whole numbers: there is no rounding, and nothing is uncertain.

use tracer::{bvh2::Triangle, traverse::Ray};

/// What is true of a ray that starts at its origin, and a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Truth {
    /// It passes through the inside, at this distance.
    Inside(f64),
    /// It passes through an edge or a corner, at this distance.
    Edge(f64),
    /// It misses the triangle, has it behind or at its origin, or runs in its plane.
    Miss,
}

impl Truth {
    /// The distance at which the triangle is met.
    pub fn distance(self) -> Option<f64> {
        match self {
            Self::Inside(t) | Self::Edge(t) => Some(t),
            Self::Miss => None,
        }
    }
}

/// Largest coordinate of a corner or an origin: floats hold whole numbers up to it exactly.
pub const LARGEST: i64 = 1 << 24;

fn whole(p: [f32; 3]) -> [i128; 3] {
    p.map(|x| {
        // Of a direction, too, which is the difference of two points.
        assert!(x.fract() == 0.0 && x.abs() <= 4.0 * LARGEST as f32, "{x} is no whole number, or too large");
        x as i128
    })
}

fn dot(a: [i128; 3], b: [i128; 3]) -> i128 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [i128; 3], b: [i128; 3]) -> [i128; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// What is true of a ray, whose limits are not looked at, and a triangle. Determinants stay below 2^83.
///
/// # Panics
/// A coordinate is no whole number, or larger than four times [`LARGEST`].
pub fn meet(ray: &Ray, triangle: &Triangle) -> Truth {
    let (origin, direction) = (whole(ray.origin), whole(ray.direction));
    let [a, b, c] = triangle.map(|corner| {
        let corner = whole(corner);
        std::array::from_fn(|k| corner[k] - origin[k])
    });
    // Six times the volumes that the direction spans with the edges, as seen from the origin.
    let edges = [(b, c), (c, a), (a, b)].map(|(from, to)| dot(direction, cross(from, to)));
    let along: i128 = edges.iter().sum();
    let above = dot(a, cross(b, c));
    let beside = edges.iter().any(|e| *e > 0) && edges.iter().any(|e| *e < 0);
    if along == 0 || beside || above == 0 || (above < 0) != (along < 0) {
        return Truth::Miss;
    }
    let t = above as f64 / along as f64;
    if edges.contains(&0) { Truth::Edge(t) } else { Truth::Inside(t) }
}
