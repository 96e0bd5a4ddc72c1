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
//! Decoded boxes contain the exact ones: see [`grid`](super::grid).

use super::{
    Child, LayoutParams, Limits, NodeByNode, Target,
    grid::{Grid, plane},
    in_turn,
};
use crate::bvh2::{Aabb, MAX_TRIANGLES};
use bytemuck::{Pod, Zeroable};
use std::mem::offset_of;

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

        impl NodeByNode for $layout {
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

            fn encode(slots: &[Option<Child>], _triangles: u32, _params: &LayoutParams) -> $node {
                let children = in_turn(slots);
                assert!((1..=$arity).contains(&children.len()), "a node has 1 to {} children", $arity);
                let all = children.iter().fold(Aabb::EMPTY, |b, c| b.union(&c.bounds));
                let grid: [Grid; 3] = std::array::from_fn(|k| Grid::new(all.lo[k], all.hi[k], 8));
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
    use crate::layout::grid::tests::{boxes, extremes};
    use proptest::prelude::*;

    fn check<L: NodeByNode>(boxes: &[Aabb], leaves: usize) {
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
        let node = L::encode(
            &children.iter().copied().map(Some).collect::<Vec<_>>(),
            1000,
            &LayoutParams::default(),
        );
        for (slot, child) in children.iter().enumerate() {
            let decoded = L::child(&node, slot).expect("a child");
            assert_eq!(decoded.target, child.target, "{}: slot {slot}", L::NAME);
            assert!(decoded.bounds.contains(&child.bounds), "{}: {decoded:?} of {child:?}", L::NAME);
        }
        assert!((children.len()..L::LIMITS.children).all(|slot| L::child(&node, slot).is_none()));
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

    proptest! {
        #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..Default::default() })]

        #[test]
        fn decoded_boxes_contain_exact_ones(boxes in boxes()) {
            check_all(&boxes);
        }
    }

    #[test]
    fn the_largest_and_the_smallest_boxes_are_contained() {
        extremes(check_all);
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
        let node = Quantized4::encode(&children.map(Some), 99, &LayoutParams::default());
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
