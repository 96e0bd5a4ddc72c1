//! The thesis's quantized layout (4.3.2, listing 4, figures 13 to 15): 52, 64 and 76 bytes for up to 4, 6
//! and 8 children.
//!
//! ```text
//! byte  0            12          16           20               24           28        28 + 4k
//!       origin.xyz   exponents,  first_node   first_triangle   leaf_sizes   xy[k]     z[k / 2]
//!                    counts
//! ```
//!
//! Planes lie on a grid that starts at the least corner of all children, `origin`, with steps of a power of
//! two an axis. A plane is the number of its grid line, 8 bits:
//!
//! ```text
//! exponents, counts   0100 0010  0111 1100  0111 1101  0111 1010
//!                     '--' '--'  '-------'  '-------'  '-------'
//!                      |    |     step z     step y     step x: 2^(122 - 127) = 1/32
//!                      |    2 of them leaves
//!                      4 children
//!
//! xy of a child       1111 1111  0010 0000  0000 0011  0000 0001
//!                      upper y    lower y    upper x    lower x      x from origin + 1/32 to origin + 3/32
//!
//! z of two children   upper z    lower z    upper z    lower z
//!                     '---- child 1 ----'   '---- child 0 ----'
//! ```
//!
//! Leaves come before nodes. The first node and the first triangle are stored, the others follow; a leaf's
//! triangles less one are a nibble of `leaf_sizes`, the first leaf's the lowest.
//!
//! Decoded boxes contain the exact ones, even before the sum `origin + line * step` is rounded: the
//! difference of a plane and the origin is rounded outward with its exact error (Knuth's TwoSum), scaled by
//! a power of two, which is exact, and rounded outward to a line. Where even the difference leaves the range
//! of a float, it is taken of halves. Steps are never below 2^-126, so no exponent is zero.

use super::{Child, Limits, NodeLayout, Target};
use crate::bvh2::{Aabb, MAX_TRIANGLES};
use bytemuck::{Pod, Zeroable};
use std::mem::offset_of;

/// The grid of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Grid {
    origin: f32,
    /// Biased exponent of the step.
    exponent: u32,
    /// Differences are taken of halves, the exponent for them being one less.
    halved: bool,
}

/// `difference` in `encode.glsl`.
fn difference(x: f32, y: f32, up: bool, halved: bool) -> f32 {
    let (x, y) = if halved { (0.5 * x, 0.5 * y) } else { (x, y) };
    let d = x - y;
    let v = d - x;
    let error = (x - (d - v)) - (y + v);
    let off = if up { error > 0.0 } else { error < 0.0 } || halved;
    match off && d > 0.0 {
        true if up => f32::from_bits(d.to_bits() + 1).min(f32::MAX),
        true => f32::from_bits(d.to_bits() - 1),
        false => d,
    }
}

impl Grid {
    /// The finest one on which 255 steps lead from `lo` to `hi`.
    fn new(lo: f32, hi: f32) -> Self {
        let extent = difference(hi, lo, true, false);
        let halved = extent.is_infinite();
        let extent = if halved { difference(hi, lo, true, true) } else { extent };
        let bits = extent.to_bits();
        let exponent = (bits >> 23) + u32::from(bits & 0x7f_ffff > 0x7f_0000);
        Self { origin: lo, exponent: exponent.max(8) - 7 + u32::from(halved), halved }
    }

    fn inverse(self) -> f32 {
        f32::from_bits((254 + u32::from(self.halved) - self.exponent) << 23)
    }

    fn line_below(self, plane: f32) -> u32 {
        (difference(plane, self.origin, false, self.halved) * self.inverse()).floor() as u32
    }

    fn line_above(self, plane: f32) -> u32 {
        let above = difference(plane, self.origin, true, self.halved);
        // A step may be so much longer that the product is nothing.
        ((above * self.inverse()).ceil() as u32).max(u32::from(above > 0.0))
    }
}

/// The plane of a grid line, rounded to the nearest float.
fn plane(origin: f32, exponent: u32, line: u32) -> f32 {
    (line as f32).mul_add(f32::from_bits(exponent << 23), origin)
}

macro_rules! layout {
    ($layout:ident, $node:ident, $arity:literal, $bytes:literal) => {
        #[doc = concat!("A node of up to ", $arity, " children, ", $bytes, " bytes: see the module's text.")]
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
        pub struct $node {
            /// Where the grid starts.
            pub origin: [f32; 3],
            /// Three exponents of 8 bits, then the number of leaves and that of children, 4 bits each.
            pub exponents_counts: u32,
            /// Index of the first child that is a node.
            pub first_node: u32,
            /// First triangle of the first child that is a leaf.
            pub first_triangle: u32,
            /// Triangles less one of each leaf, 4 bits each.
            pub leaf_sizes: u32,
            /// Grid lines of each child in x and y: lower x, upper x, lower y, upper y, 8 bits each.
            pub xy: [u32; $arity],
            /// Grid lines of each two children in z: lower and upper of one, lower and upper of the other.
            pub z: [u32; $arity / 2],
        }

        const _: () = {
            assert!(size_of::<$node>() == $bytes);
            assert!(offset_of!($node, exponents_counts) == 12 && offset_of!($node, first_node) == 16);
            assert!(offset_of!($node, first_triangle) == 20 && offset_of!($node, leaf_sizes) == 24);
            assert!(offset_of!($node, xy) == 28 && offset_of!($node, z) == 28 + 4 * $arity);
        };

        #[doc = concat!("The quantized layout of up to ", $arity, " children.")]
        #[derive(Clone, Copy, Debug)]
        pub struct $layout;

        impl NodeLayout for $layout {
            type Node = $node;
            const NAME: &'static str = stringify!($layout);
            const EXACT: bool = false;
            const LIMITS: Limits = Limits {
                children: $arity,
                triangles_per_leaf: 16,
                triangles_per_node: 16 * $arity,
                triangles: MAX_TRIANGLES,
            };

            fn child(node: &$node, slot: usize) -> Option<Child> {
                let (leaves, children) = (node.exponents_counts >> 24 & 15, node.exponents_counts >> 28);
                let slot = slot as u32;
                if slot >= children {
                    return None;
                }
                let size = |leaf: u32| (node.leaf_sizes >> (4 * leaf) & 15) + 1;
                let target = if slot < leaves {
                    let first = node.first_triangle + (0..slot).map(size).sum::<u32>();
                    Target::Leaf { first, count: size(slot) }
                } else {
                    Target::Node(node.first_node + slot - leaves)
                };
                let xy = node.xy[slot as usize];
                let z = node.z[slot as usize / 2] >> (16 * (slot % 2));
                let lines = [xy, xy >> 16, z];
                let at = |axis: usize, line: u32| {
                    plane(node.origin[axis], node.exponents_counts >> (8 * axis) & 255, line & 255)
                };
                let bounds = Aabb {
                    lo: std::array::from_fn(|k| at(k, lines[k])),
                    hi: std::array::from_fn(|k| at(k, lines[k] >> 8)),
                };
                Some(Child { bounds, target })
            }

            fn encode(children: &[Child], _triangles: u32) -> $node {
                assert!((1..=$arity).contains(&children.len()), "a node has 1 to {} children", $arity);
                let all = children.iter().fold(Aabb::EMPTY, |b, c| b.union(&c.bounds));
                let grid: [Grid; 3] = std::array::from_fn(|k| Grid::new(all.lo[k], all.hi[k]));
                let mut node = $node {
                    origin: all.lo,
                    exponents_counts: grid[0].exponent
                        | grid[1].exponent << 8
                        | grid[2].exponent << 16
                        | (children.len() as u32) << 28,
                    ..Zeroable::zeroed()
                };
                let (mut leaves, mut next_node, mut next_triangle) = (0, None, None);
                for (slot, child) in children.iter().enumerate() {
                    match child.target {
                        Target::Leaf { first, count } => {
                            assert!(next_node.is_none(), "leaves come before nodes");
                            assert!((1..=16).contains(&count));
                            let expected = *next_triangle.get_or_insert(first);
                            assert_eq!(first, expected, "triangles follow each other");
                            if slot == 0 {
                                node.first_triangle = first;
                            }
                            next_triangle = Some(first + count);
                            node.leaf_sizes |= (count - 1) << (4 * slot);
                            leaves += 1;
                        }
                        Target::Node(index) => {
                            let expected = *next_node.get_or_insert(index);
                            assert_eq!(index, expected, "nodes follow each other");
                            if slot == leaves {
                                node.first_node = index;
                            }
                            next_node = Some(index + 1);
                        }
                    }
                    let b = &child.bounds;
                    let lines = |k: usize| grid[k].line_below(b.lo[k]) | grid[k].line_above(b.hi[k]) << 8;
                    node.xy[slot] = lines(0) | lines(1) << 16;
                    node.z[slot / 2] |= lines(2) << (16 * (slot % 2));
                }
                node.exponents_counts |= (leaves as u32) << 24;
                node
            }
        }
    };
}

layout!(Quantized4, Quantized4Node, 4, 52);
layout!(Quantized6, Quantized6Node, 6, 64);
layout!(Quantized8, Quantized8Node, 8, 76);

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::cmp::Ordering;

    /// How `line` steps compare with `to - from`, exactly.
    fn compare(line: u32, exponent: u32, from: f32, to: f32) -> Ordering {
        // Exact: 8 bits times a power of two.
        let steps = f64::from(line) * 2f64.powi(exponent as i32 - 127);
        // The sum of two floats and its error; doubles have room for both.
        let (x, y) = (f64::from(to), f64::from(from));
        let d = x - y;
        let v = d - x;
        let error = (x - (d - v)) - (y + v);
        // The error is less than the distance to the next double, so it counts only among equals.
        steps
            .partial_cmp(&d)
            .and_then(|order| Some(order.then(0.0f64.partial_cmp(&error)?)))
            .expect("numbers")
    }

    /// Encodes boxes of one axis and holds their lines against the exact planes.
    fn check_axis(planes: &[(f32, f32)]) {
        let lo = planes.iter().fold(f32::INFINITY, |m, p| m.min(p.0));
        let hi = planes.iter().fold(f32::NEG_INFINITY, |m, p| m.max(p.1));
        let grid = Grid::new(lo, hi);
        let exponent = grid.exponent;
        assert!((1..=254).contains(&exponent), "{grid:?}");
        // With steps half as long, 255 would not do. Where differences are taken of halves they count as
        // rounded even if they are not.
        let half = compare(255, exponent.saturating_sub(1), lo, hi);
        assert!(
            exponent == 1 || half.is_lt() || grid.halved && half.is_eq(),
            "{grid:?} is too coarse for {hi}"
        );
        for &(a, b) in planes {
            let (below, above) = (grid.line_below(a), grid.line_above(b));
            assert!(below <= 255 && above <= 255, "{grid:?}: lines {below} and {above} of {a} and {b}");
            assert!(compare(below, exponent, lo, a).is_le(), "{grid:?}: line {below} lies above {a}");
            assert!(compare(above, exponent, lo, b).is_ge(), "{grid:?}: line {above} lies below {b}");
            // No line nearer would have done; where differences are taken of halves, none but the next.
            let nearer = 1 + u32::from(grid.halved);
            let below_is_tight = compare(below + nearer, exponent, lo, a).is_gt();
            let above_is_tight =
                above.checked_sub(nearer).is_none_or(|line| compare(line, exponent, lo, b).is_lt());
            assert!(below_is_tight, "{grid:?}: line {below} is not the nearest below {a}");
            assert!(above_is_tight, "{grid:?}: line {above} is not the nearest above {b}");
        }
    }

    fn check<L: NodeLayout>(boxes: &[Aabb], leaves: usize) {
        let mut first = 40;
        let children: Vec<Child> = boxes
            .iter()
            .enumerate()
            .map(|(slot, &bounds)| {
                let count = 1 + (7 * slot as u32 + leaves as u32) % 16;
                let target = match slot.checked_sub(leaves) {
                    None => Target::Leaf { first, count },
                    Some(i) => Target::Node(77 + i as u32),
                };
                first += count;
                Child { bounds, target }
            })
            .collect();
        let node = L::encode(&children, 1000);
        for (slot, child) in children.iter().enumerate() {
            let decoded = L::child(&node, slot).expect("a child");
            assert_eq!(decoded.target, child.target, "{}: slot {slot}", L::NAME);
            assert!(decoded.bounds.contains(&child.bounds), "{}: {decoded:?} of {child:?}", L::NAME);
        }
        assert!((children.len()..L::LIMITS.children).all(|slot| L::child(&node, slot).is_none()));
        for axis in 0..3 {
            check_axis(&boxes.iter().map(|b| (b.lo[axis], b.hi[axis])).collect::<Vec<_>>());
        }
    }

    fn check_all(boxes: &[Aabb]) {
        for leaves in [0, boxes.len() / 2, boxes.len()] {
            check::<Quantized8>(boxes, leaves);
            if boxes.len() <= 6 {
                check::<Quantized6>(boxes, leaves);
            }
            if boxes.len() <= 4 {
                check::<Quantized4>(boxes, leaves);
            }
        }
    }

    /// Coordinates of every size and sign; `kind` chooses what is next to each other in one node.
    fn coordinate(kind: u8) -> BoxedStrategy<f32> {
        let finite = any::<f32>().prop_filter("coordinates are finite", |x| x.is_finite());
        match kind {
            0 => (-100.0f32..100.0).boxed(),
            1 => finite.boxed(),
            2 => prop_oneof![Just(f32::MAX), Just(-f32::MAX), Just(0.0), -f32::MAX..f32::MAX, finite].boxed(),
            // Denormals and what is next to them.
            3 => (any::<bool>(), 0u32..1 << 25)
                .prop_map(|(sign, bits)| f32::from_bits(bits | u32::from(sign) << 31))
                .boxed(),
            // Few, so that boxes are flat and planes coincide.
            4 => (-3i8..4).prop_map(|x| f32::from(x) * 0.1).boxed(),
            // Far from the origin, where floats are far apart.
            5 => (0u32..4000).prop_map(|ulps| f32::from_bits(1e4f32.to_bits() + ulps)).boxed(),
            6 => (0u32..300).prop_map(|ulps| -f32::from_bits(1e18f32.to_bits() + ulps)).boxed(),
            // Whole steps, and just beside them.
            _ => (0u32..256, -1i32..=1)
                .prop_map(|(line, off)| {
                    f32::from_bits((line as f32 + 256.0).to_bits().wrapping_add_signed(off))
                })
                .boxed(),
        }
    }

    fn boxes() -> impl Strategy<Value = Vec<Aabb>> {
        (0u8..8, 0u8..8, 0u8..8, 1usize..=8).prop_flat_map(|(x, y, z, n)| {
            let pair = |kind| (coordinate(kind), coordinate(kind));
            proptest::collection::vec((pair(x), pair(y), pair(z)), n..=n).prop_map(|all| {
                let sorted = all.into_iter().map(|(x, y, z)| Aabb {
                    lo: [x, y, z].map(|(a, b)| a.min(b)),
                    hi: [x, y, z].map(|(a, b)| a.max(b)),
                });
                sorted.collect()
            })
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..Default::default() })]

        #[test]
        fn decoded_boxes_contain_exact_ones_as_tightly_as_the_grid_allows(boxes in boxes()) {
            check_all(&boxes);
        }
    }

    #[test]
    fn the_largest_and_the_smallest_boxes_are_contained() {
        let (most, least) = (f32::MAX, f32::from_bits(1));
        for (lo, hi) in [
            (-most, most),
            (0.0, most),
            (-most, 0.0),
            (-most, -most),
            (most, most),
            (-most, least),
            (-least, least),
            (0.0, least),
            (-0.0, 0.0),
            (0.0, f32::MIN_POSITIVE),
            (1.0, 1.0),
            (1.0, 1.0f32.next_up()),
            (0.0, 255.0),
            (0.0, 255.0f32.next_up()),
            (-255.0 * 2f32.powi(120), 0.0),
            (1e4, 1e4f32.next_up()),
        ] {
            let whole = Aabb { lo: [lo; 3], hi: [hi; 3] };
            let (at_lo, at_hi) = (Aabb { lo: [lo; 3], hi: [lo; 3] }, Aabb { lo: [hi; 3], hi: [hi; 3] });
            check_all(&[whole]);
            check_all(&[whole, at_lo, at_hi]);
            check_all(&[at_lo, at_hi]);
        }
    }

    #[test]
    fn the_bits_are_those_that_are_drawn() {
        // Steps of 1/32, 1/4 and 1/8, because the children reach from the origin that many steps.
        let origin = [10.0, -20.0, 4.0];
        let step = [1.0 / 32.0, 0.25, 0.125];
        let child = |lo: [u8; 3], hi: [u8; 3], target| {
            let at = |lines: [u8; 3]| std::array::from_fn(|k| origin[k] + f32::from(lines[k]) * step[k]);
            Child { bounds: Aabb { lo: at(lo), hi: at(hi) }, target }
        };
        let children = [
            child([1, 32, 0], [3, 255, 7], Target::Leaf { first: 42, count: 4 }),
            child([0, 0, 9], [255, 40, 255], Target::Leaf { first: 46, count: 16 }),
            child([200, 1, 2], [201, 2, 3], Target::Node(133)),
            child([0, 0, 0], [1, 1, 1], Target::Node(134)),
        ];
        let node = Quantized4::encode(&children, 99);
        assert_eq!(node.origin, origin);
        assert_eq!(node.exponents_counts, 0b0100_0010_0111_1100_0111_1101_0111_1010);
        assert_eq!((node.first_node, node.first_triangle), (133, 42));
        assert_eq!(node.leaf_sizes, 0b1111_0011);
        assert_eq!(node.xy[0], 0b1111_1111_0010_0000_0000_0011_0000_0001);
        assert_eq!(node.z, [0xff09_0700, 0x0100_0302]);
        // On the grid, nothing is lost.
        assert!((0..4).all(|slot| Quantized4::child(&node, slot) == Some(children[slot])));
    }
}
