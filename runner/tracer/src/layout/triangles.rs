//! Triangles in leaf order, as a ray-triangle test wants them stored: the plain twin of `triangles.comp`.

use super::LeafTriangle;
use crate::{
    bvh2::Triangle,
    traverse::{Ray, TriangleFormat, TriangleTest, cpu},
};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use std::mem::offset_of;

/// The affine map that takes a triangle to the one with corners (0,0,0), (1,0,0) and (0,1,0): `row · (point, 1)`
/// for each of its rows (Woop 2004). 48 bytes, three 16-byte loads.
///
/// For the triangle (2,0,5), (2,3,5), (6,0,5):
///
/// ```text
///         x      y      z      w
/// z       0      0     -0.75   3.75     0 in the plane z = 5
/// u       0      0.333  0      0        0 at (2,0,5) and (6,0,5), 1 at (2,3,5)
/// v       0.25   0      0     -0.5      0 at (2,0,5) and (2,3,5), 1 at (6,0,5)
/// ```
///
/// Only where `z` is zero matters, not how fast it grows: it is the triangle's normal, of edges that were brought to a
/// length between 1 and 2 by a power of two. Which corner the map takes to the origin is free; it is the one
/// opposite to the longest edge, because there the two edges are farthest from parallel, which the map is the less
/// sure of the closer they are.
///
/// The map is computed to about twice single precision and rounded once. A triangle whose edges are closer to parallel
/// than 2^-22 at that corner, degenerate ones among them, has none: its rows are all (0,0,0,1), and no ray hits it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct UnitTriangle {
    /// Distance from the plane, in no unit.
    pub z: [f32; 4],
    /// First barycentric coordinate.
    pub u: [f32; 4],
    /// Second barycentric coordinate.
    pub v: [f32; 4],
}

const _: () = assert!(size_of::<UnitTriangle>() == 48 && size_of::<LeafTriangle>() == 48);

/// A triangle by a corner, the edges from there, and what of the normal `e1 × e2` there is room for (Kensler and Shirley
/// 2006). 48 bytes, three 16-byte loads.
///
/// The triangle (2,0,5), (2,3,5), (6,0,5), the 7th of its scene:
///
/// ```text
///   2    0    5    7      the first corner, and the number in file order
///   0    3    0    0      e1, to the second corner; x of the normal
///   4    0    0    0      e2, to the third; y of the normal, whose z is -12
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct EdgeTriangle {
    /// First corner.
    pub corner: [f32; 3],
    /// Its number in file order.
    pub primitive: u32,
    /// To the second corner.
    pub e1: [f32; 3],
    /// Of the normal.
    pub normal_x: f32,
    /// To the third corner.
    pub e2: [f32; 3],
    /// Of the normal.
    pub normal_y: f32,
}

const _: () = {
    assert!(size_of::<EdgeTriangle>() == 48 && offset_of!(EdgeTriangle, primitive) == 12);
    assert!(offset_of!(EdgeTriangle, e1) == 16 && offset_of!(EdgeTriangle, e2) == 32);
};

impl EdgeTriangle {
    /// Triangle `primitive` of the scene.
    pub fn new(&[a, b, c]: &Triangle, primitive: u32) -> Self {
        let edge = |to: [f32; 3]| -> [f32; 3] { std::array::from_fn(|k| to[k] - a[k]) };
        let (e1, e2) = (edge(b), edge(c));
        let (normal_x, normal_y) = (e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2]);
        Self { corner: a, primitive, e1, normal_x, e2, normal_y }
    }

    /// What is wrong with this for a triangle; nothing where it is right: as the CPU has it, but for numbers so small that
    /// devices may take them for zero.
    pub fn fault(&self, triangle: &Triangle) -> Option<String> {
        let right = Self::new(triangle, self.primitive);
        // An edge too long for a float leaves the others to be compared.
        let longest = right.e1.iter().chain(&right.e2).fold(1.0, |m: f32, x| m.max(x.abs())).min(f32::MAX);
        let tolerance = 4.0 * f32::MIN_POSITIVE * longest;
        let numbers = |t: &Self| {
            let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = [t.corner, t.e1, t.e2];
            [ax, ay, az, bx, by, bz, t.normal_x, cx, cy, cz, t.normal_y]
        };
        let same =
            |(a, b): (f32, f32)| a == b || (a - b).abs() <= tolerance || !a.is_finite() && !b.is_finite();
        let wrong = numbers(self).into_iter().zip(numbers(&right)).find(|pair| !same(*pair));
        wrong.map(|(found, want)| format!("there is {found} and not {want} in {self:?}"))
    }
}

/// Below this, the square of the sine of the angle between two edges is none.
const SINGULAR: f64 = 1.0 / (1u64 << 44) as f64;

/// A triangle's corners, that opposite to its longest edge first, and the power of two that brings the largest
/// coordinate of an edge to between 1 and 2.
fn prepared(&[a, b, c]: &Triangle) -> (Triangle, f32) {
    let edge = |p: [f32; 3], q: [f32; 3]| -> [f32; 3] { std::array::from_fn(|k| q[k] - p[k]) };
    let edges = [edge(a, b), edge(b, c), edge(c, a)];
    let largest = edges.as_flattened().iter().fold(0f32, |m, x| m.max(x.abs()));
    let scale = if largest < 2f32.powi(127) {
        f32::from_bits((254 << 23) - (largest.to_bits() & 0x7F80_0000))
    } else {
        0.0
    };
    let [ab, bc, ca] = edges.map(|e| {
        let [x, y, z] = e.map(|x| x * scale);
        x * x + y * y + z * z
    });
    let corners = if ca > ab && ca >= bc {
        [b, c, a]
    } else if ab >= bc && ab >= ca {
        [c, a, b]
    } else {
        [a, b, c]
    };
    (corners, scale)
}

impl UnitTriangle {
    /// Of a triangle without a map.
    pub const NOWHERE: Self =
        Self { z: [0.0, 0.0, 0.0, 1.0], u: [0.0, 0.0, 0.0, 1.0], v: [0.0, 0.0, 0.0, 1.0] };

    /// The map of a triangle.
    pub fn new(triangle: &Triangle) -> Self {
        let (corners, scale) = prepared(triangle);
        let scale = f64::from(scale);
        let [v0, v1, v2] = corners.map(|v| DVec3::from_array(v.map(f64::from)));
        let (e1, e2) = ((v1 - v0) * scale, (v2 - v0) * scale);
        let normal = e1.cross(e2);
        let squared = normal.length_squared();
        // What is no number is singular too.
        let regular = squared > e1.length_squared() * e2.length_squared() * SINGULAR;
        if !regular {
            return Self::NOWHERE;
        }
        // The offset goes with the row as it was rounded, so that the row is zero at that corner.
        let row = |exact: DVec3| {
            let [x, y, z] = exact.to_array().map(|x| x as f32);
            let offset = -DVec3::new(f64::from(x), f64::from(y), f64::from(z)).dot(v0);
            [x, y, z, offset as f32]
        };
        Self {
            z: row(normal),
            u: row(e2.cross(normal) / squared * scale),
            v: row(normal.cross(e1) / squared * scale),
        }
    }

    /// What is wrong with this map for a triangle; nothing where it is right.
    ///
    /// It takes the triangle's corners to those of the unit triangle, to 8 units in the last place of what its rows
    /// are summed from, or the triangle is degenerate as far as a map can tell.
    pub fn fault(&self, triangle: &Triangle) -> Option<String> {
        let (corners, _) = prepared(triangle);
        let exact = corners.map(|v| DVec3::from_array(v.map(f64::from)));
        if *self == Self::NOWHERE {
            let (e1, e2) = (exact[1] - exact[0], exact[2] - exact[0]);
            let (squared, lengths) =
                (e1.cross(e2).length_squared(), e1.length_squared() * e2.length_squared());
            // Twice, because it was decided in another arithmetic.
            let thin = squared <= 2.0 * lengths * SINGULAR;
            let far = e1.abs().max(e2.abs()).max_element() >= f64::from(f32::MAX);
            return (!thin && !far).then(|| "there is no map, but the triangle has an area".into());
        }
        let rows = [("z", self.z, [0.0; 3]), ("u", self.u, [0.0, 1.0, 0.0]), ("v", self.v, [0.0, 0.0, 1.0])];
        let reach = exact.iter().fold(0.0, |m: f64, v| m.max(v.length()));
        for (name, row, want) in rows {
            let [x, y, z, w] = row.map(f64::from);
            let normal = DVec3::new(x, y, z);
            let own = if name == "z" { 0.0 } else { 1.0 };
            let tolerance = 8.0 * 0.5f64.powi(24) * (normal.length() * reach + w.abs() + own);
            for (corner, want) in exact.iter().zip(want) {
                let found = normal.dot(*corner) + w;
                // What is no number is wrong.
                let right = (found - want).abs() <= tolerance;
                if !right {
                    return Some(format!("{name} is {found} and not {want} at {corner}, beyond {tolerance}"));
                }
            }
        }
        None
    }
}

/// Triangles in the order of a tree's leaves, in the format of a test.
#[derive(Clone, Debug, PartialEq)]
pub enum LeafTriangles {
    /// With their indices inside.
    Corners {
        /// One of those that take corners.
        test: TriangleTest,
        /// As many as the scene has.
        triangles: Vec<LeafTriangle>,
    },
    /// For [`TriangleTest::KenslerShirley`], with their indices inside.
    Edges(Vec<EdgeTriangle>),
    /// For [`TriangleTest::Woop`].
    Maps {
        /// As many as the scene has triangles.
        maps: Vec<UnitTriangle>,
        /// Of each, the triangle's index in file order.
        indices: Vec<u32>,
    },
}

impl LeafTriangles {
    /// Stores triangles for a test.
    pub fn new(test: TriangleTest, triangles: Vec<LeafTriangle>) -> Self {
        match test.format() {
            TriangleFormat::Corners => Self::Corners { test, triangles },
            TriangleFormat::Edges => {
                Self::Edges(triangles.iter().map(|t| EdgeTriangle::new(&t.corners(), t.primitive)).collect())
            }
            TriangleFormat::Maps => Self::Maps {
                maps: triangles.iter().map(|t| UnitTriangle::new(&t.corners())).collect(),
                indices: triangles.iter().map(|t| t.primitive).collect(),
            },
        }
    }

    /// The same of a scene's triangles as they are in its file.
    pub fn in_file_order(test: TriangleTest, triangles: &[Triangle]) -> Self {
        Self::new(test, triangles.iter().zip(0..).map(|(t, i)| LeafTriangle::new(t, i)).collect())
    }

    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Self::Corners { triangles, .. } => triangles.len(),
            Self::Edges(triangles) => triangles.len(),
            Self::Maps { indices, .. } => indices.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The index in file order of the triangle at a place.
    pub fn index(&self, place: usize) -> u32 {
        match self {
            Self::Corners { triangles, .. } => triangles[place].primitive,
            Self::Edges(triangles) => triangles[place].primitive,
            Self::Maps { indices, .. } => indices[place],
        }
    }

    /// The distance at which a ray meets the triangle at a place, nearer than `t_max`.
    pub fn intersect(&self, place: usize, ray: &Ray, t_max: f32) -> Option<f32> {
        match self {
            Self::Corners { test, triangles } => {
                cpu::intersect(*test, ray, t_max, &triangles[place].corners())
            }
            Self::Edges(triangles) => cpu::kensler_shirley(ray, t_max, &triangles[place]),
            Self::Maps { maps, .. } => cpu::woop(ray, t_max, &maps[place]),
        }
    }

    /// Whether these are `twin`, as the CPU writes them: corners to the bit, of others the indices. What else there is
    /// [`EdgeTriangle::fault`] and [`UnitTriangle::fault`] hold against the corners.
    pub fn agree(&self, twin: &[LeafTriangle]) -> bool {
        match self {
            Self::Corners { triangles, .. } => triangles == twin,
            Self::Edges(triangles) => {
                triangles.iter().map(|t| t.primitive).eq(twin.iter().map(|t| t.primitive))
            }
            Self::Maps { indices, .. } => indices.iter().copied().eq(twin.iter().map(|t| t.primitive)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_is_the_one_that_is_documented() {
        let map = UnitTriangle::new(&[[2.0, 0.0, 5.0], [2.0, 3.0, 5.0], [6.0, 0.0, 5.0]]);
        let third = 1.0 / 3.0;
        let want =
            UnitTriangle { z: [0.0, 0.0, -0.75, 3.75], u: [0.0, third, 0.0, 0.0], v: [0.25, 0.0, 0.0, -0.5] };
        assert_eq!(map, want);
    }

    #[test]
    fn edges_are_those_that_are_documented_and_wrong_ones_are_found() {
        let triangle = [[2.0, 0.0, 5.0], [2.0, 3.0, 5.0], [6.0, 0.0, 5.0]];
        let edges = EdgeTriangle::new(&triangle, 7);
        let rows = [[2.0, 0.0, 5.0, f32::from_bits(7)], [0.0, 3.0, 0.0, 0.0], [4.0, 0.0, 0.0, 0.0]];
        assert_eq!(bytemuck::cast::<_, [[f32; 4]; 3]>(edges), rows);
        assert_eq!(edges.fault(&triangle), None);
        for place in (0..12).filter(|place| *place != 3) {
            let mut numbers: [f32; 12] = bytemuck::cast(edges);
            numbers[place] += 1e-6;
            assert!(bytemuck::cast::<_, EdgeTriangle>(numbers).fault(&triangle).is_some(), "{place}");
        }
        // Of edges beyond floats, too.
        let endless = [[-3e38; 3], [3e38, 0.0, 0.0], [0.0; 3]];
        let mut edges = EdgeTriangle::new(&endless, 7);
        assert_eq!(edges.fault(&endless), None);
        edges.corner[0] = 3e38;
        assert!(edges.fault(&endless).is_some());
    }

    #[test]
    fn the_corner_between_the_short_edges_is_the_origin() {
        let (tip, a, b) = ([100.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        for triangle in [[tip, a, b], [a, b, tip], [b, tip, a], [tip, b, a]] {
            let ([first, ..], scale) = prepared(&triangle);
            assert!(first == a || first == b, "{triangle:?}");
            assert_eq!(scale, 1.0 / 64.0);
        }
    }

    #[test]
    fn maps_of_all_sizes_are_right_and_a_wrong_one_is_found() {
        let shape = [[1.0f32, 2.0, 3.0], [4.0, 2.5, 3.0], [1.0, 7.0, 3.5]];
        for scale in [1e-18, 1e-6, 1.0, 1e6, 1e18] {
            for shift in [0.0, 10.0, 1000.0] {
                let triangle = shape.map(|p| p.map(|x| (x + shift) * scale));
                let map = UnitTriangle::new(&triangle);
                assert_ne!(map, UnitTriangle::NOWHERE, "{triangle:?}");
                assert_eq!(map.fault(&triangle), None, "{triangle:?}");
                let moved = triangle.map(|p| [p[0] * 1.001, p[1], p[2]]);
                assert!(map.fault(&moved).is_some(), "{moved:?}");
                assert!(UnitTriangle::NOWHERE.fault(&triangle).is_some());
            }
        }
        let needle = |width: f32| [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0 + width]];
        assert_eq!(UnitTriangle::new(&needle(1e-6)).fault(&needle(1e-6)), None);
    }

    #[test]
    fn a_degenerate_triangle_has_no_map() {
        let triangles = [
            [[5.0; 3]; 3],
            [[0.0; 3], [1.0, 2.0, 3.0], [2.0, 4.0, 6.0]],
            [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            [[-3e38; 3], [3e38; 3], [0.0, 1.0, 0.0]],
        ];
        for triangle in triangles {
            assert_eq!(UnitTriangle::new(&triangle), UnitTriangle::NOWHERE, "{triangle:?}");
            assert_eq!(UnitTriangle::NOWHERE.fault(&triangle), None, "{triangle:?}");
        }
    }
}
