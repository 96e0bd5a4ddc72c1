//! The compressed layout of Ylitie, Karras and Laine 2017 (3.1 to 3.3, figure 4): 80 bytes for up to 8 children.
//!
//! ```text
//! byte  0            12           15      16           20               24        32       40 …     56 …
//!       origin.xyz   exponents    imask   first_node   first_triangle   meta[8]   lo.x[8]  lo.y, z  hi.x, y, z
//! ```
//!
//! Planes lie on a grid of 8 bits (see [`grid`](super::grid)), one byte each, eight of a kind together. What a child
//! is, and where, is a byte of `meta`:
//!
//! ```text
//! slot                0           1           2           3           4           5          6          7
//!                  node        leaf        node     nothing        leaf        leaf       node    nothing
//!                           3 triangles                         1           2
//! meta          001 11000   111 00000   001 11010   000 00000   001 00011   011 00100  001 11110  000 00000
//!               '-' '---'   '-' '---'                           of the triangles that all leaves have together
//!                |    |      |    first triangle at 0           0 to 2 are slot 1's, 3 is slot 4's, 4 and 5 slot 5's
//!                |    slot + 24   three triangles, in unary
//!                a node
//! imask         0100 0101    slots 0, 2 and 6 are nodes: first_node + 0, + 1 and + 2
//! ```
//!
//! The order of slots means something: a ray whose direction has the signs of the bits of s (1 for negative, x in
//! bit 0) goes to slot s first, and to slot i XOR s as its i-th (3.2). So a child belongs into the slot whose rays
//! meet it first: see [`assign`].
//!
//! Children of a node follow each other in memory, nodes in the order of their slots. A contraction gives them their
//! places before anybody knows slots, so siblings change places among each other: `arrange.comp` says how.

use super::{
    Child, LayoutParams, Limits, NodeByNode, Target,
    grid::{Grid, plane},
};
use crate::bvh2::{Aabb, MAX_TRIANGLES};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use std::mem::offset_of;

pub mod assign;

/// How children are assigned to slots (Ylitie et al. 2017, 3.4 and table 8).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Assignment {
    /// At the least cost in all, by an auction (Bertsekas 1992).
    #[default]
    Auction,
    /// The cheapest child in the cheapest slot first.
    Greedy,
    /// By a random permutation that depends on nothing but the node.
    Random,
}

impl Assignment {
    /// Every assignment.
    pub const ALL: &[Self] = &[Self::Auction, Self::Greedy, Self::Random];
}

/// A node of up to 8 children, 80 bytes: see the module's text.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct CompressedNode {
    /// Where the grid starts, as bits.
    pub origin: [u32; 3],
    /// Biased exponent of the step of each axis.
    pub exponents: [u8; 3],
    /// Which slots hold nodes.
    pub imask: u8,
    /// Index of the node in the lowest of those slots; the others follow.
    pub first_node: u32,
    /// First triangle of all leaves.
    pub first_triangle: u32,
    /// What each slot holds.
    pub meta: [u8; 8],
    /// Grid lines of the lower planes, by axis and slot.
    pub lo: [[u8; 8]; 3],
    /// Of the upper planes.
    pub hi: [[u8; 8]; 3],
}

const _: () = {
    assert!(size_of::<CompressedNode>() == 80 && offset_of!(CompressedNode, exponents) == 12);
    assert!(offset_of!(CompressedNode, imask) == 15 && offset_of!(CompressedNode, first_node) == 16);
    assert!(offset_of!(CompressedNode, first_triangle) == 20 && offset_of!(CompressedNode, meta) == 24);
    assert!(offset_of!(CompressedNode, lo) == 32 && offset_of!(CompressedNode, hi) == 56);
};

/// The compressed layout.
#[derive(Clone, Copy, Debug)]
pub struct Compressed8;

impl NodeByNode for Compressed8 {
    type Node = CompressedNode;
    const NAME: &'static str = "Compressed8";
    const EXACT: bool = false;
    const LIMITS: Limits =
        Limits { children: 8, triangles_per_leaf: 3, triangles_per_node: 24, triangles: MAX_TRIANGLES };

    fn child(node: &CompressedNode, slot: usize) -> Option<Child> {
        let meta = u32::from(node.meta[slot]);
        let target = if node.imask >> slot & 1 == 1 {
            Target::Node(node.first_node + (node.imask & ((1 << slot) - 1)).count_ones())
        } else if meta != 0 {
            Target::Leaf { first: node.first_triangle + (meta & 31), count: (meta >> 5).count_ones() }
        } else {
            return None;
        };
        let at = |axis: usize, lines: &[[u8; 8]; 3]| {
            let origin = f32::from_bits(node.origin[axis]);
            plane(origin, u32::from(node.exponents[axis]), u32::from(lines[axis][slot]))
        };
        let bounds = Aabb {
            lo: std::array::from_fn(|axis| at(axis, &node.lo)),
            hi: std::array::from_fn(|axis| at(axis, &node.hi)),
        };
        Some(Child { bounds, target })
    }

    fn slots(children: &[Child], seed: u32, params: &LayoutParams) -> Vec<usize> {
        let bounds: Vec<Aabb> = children.iter().map(|child| child.bounds).collect();
        assign::slots(&bounds, seed, params.assignment)
    }

    fn encode(children: &[Option<Child>], _triangles: u32, params: &LayoutParams) -> CompressedNode {
        let there = || children.iter().enumerate().filter_map(|(slot, child)| Some((slot, (*child)?)));
        assert!(children.len() <= 8 && there().next().is_some(), "a node has 1 to 8 children");
        let all = there().fold(Aabb::EMPTY, |all, (_, child)| all.union(&child.bounds));
        let grid: [Grid; 3] = std::array::from_fn(|k| Grid::new(all.lo[k], all.hi[k], params.bits));
        let firsts =
            |of: fn(&Target) -> Option<u32>| there().filter_map(move |(_, child)| of(&child.target)).min();
        let mut node = CompressedNode {
            origin: all.lo.map(f32::to_bits),
            exponents: grid.map(|grid| grid.exponent as u8),
            first_node: firsts(|target| match *target {
                Target::Node(index) => Some(index),
                Target::Leaf { .. } => None,
            })
            .unwrap_or_default(),
            first_triangle: firsts(|target| match *target {
                Target::Node(_) => None,
                Target::Leaf { first, .. } => Some(first),
            })
            .unwrap_or_default(),
            // Inverted, so that a ray hardly ever meets it. If it does, `meta` says that there is nothing.
            lo: [[255; 8]; 3],
            ..Zeroable::zeroed()
        };
        let mut next_node = node.first_node;
        for (slot, Child { bounds, target }) in there() {
            node.meta[slot] = match target {
                Target::Node(index) => {
                    assert_eq!(index, next_node, "nodes follow each other in the order of their slots");
                    next_node += 1;
                    node.imask |= 1 << slot;
                    0b001_00000 | (24 + slot as u8)
                }
                Target::Leaf { first, count } => {
                    let offset = first - node.first_triangle;
                    assert!(
                        (1..=3).contains(&count) && offset + count <= 24,
                        "{count} triangles at {offset}"
                    );
                    ((1 << count) - 1) << 5 | offset as u8
                }
            };
            for (axis, grid) in grid.iter().enumerate() {
                node.lo[axis][slot] = grid.line_below(bounds.lo[axis]) as u8;
                node.hi[axis][slot] = grid.line_above(bounds.hi[axis]) as u8;
            }
        }
        node
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::grid::tests::{boxes, extremes};
    use proptest::prelude::*;

    fn node(index: u32) -> Target {
        Target::Node(index)
    }

    fn leaf(first: u32, count: u32) -> Target {
        Target::Leaf { first, count }
    }

    /// The example that the module draws.
    #[test]
    fn meta_and_imask_are_what_is_drawn() {
        let targets = [
            Some(node(70)),
            Some(leaf(500, 3)),
            Some(node(71)),
            None,
            Some(leaf(503, 1)),
            Some(leaf(504, 2)),
            Some(node(72)),
            None,
        ];
        let bounds = Aabb { lo: [0.0; 3], hi: [1.0; 3] };
        let children = targets.map(|target| target.map(|target| Child { bounds, target }));
        let made = Compressed8::encode(&children, 10, &LayoutParams::default());
        let meta = [0b001_11000, 0b111_00000, 0b001_11010, 0, 0b001_00011, 0b011_00100, 0b001_11110, 0];
        assert_eq!((made.meta, made.imask), (meta, 0b0100_0101));
        assert_eq!((made.first_node, made.first_triangle), (70, 500));
        for (slot, child) in children.iter().enumerate() {
            assert_eq!(Compressed8::child(&made, slot).map(|c| c.target), child.map(|c| c.target));
        }
    }

    #[test]
    fn planes_are_bytes_in_rows_of_one_kind() {
        // Steps of 1/32, 1/4 and 1/8, because the children reach from the origin that many steps.
        let (origin, step) = ([10.0, -20.0, 4.0], [1.0 / 32.0, 0.25, 0.125]);
        let child = |lo: [u8; 3], hi: [u8; 3], target| {
            let at = |lines: [u8; 3]| std::array::from_fn(|k| origin[k] + f32::from(lines[k]) * step[k]);
            Some(Child { bounds: Aabb { lo: at(lo), hi: at(hi) }, target })
        };
        let children =
            [child([0, 32, 0], [3, 255, 7], node(1)), None, child([1, 0, 9], [255, 40, 255], leaf(7, 1))];
        let made = Compressed8::encode(&children, 10, &LayoutParams::default());
        let bytes: [u8; 80] = bytemuck::cast(made);
        assert_eq!(bytes[..12], *bytemuck::bytes_of(&origin));
        assert_eq!(bytes[12..16], [127 - 5, 127 - 2, 127 - 3, 0b001]);
        assert_eq!((bytes[32], bytes[34], bytes[40], bytes[42], bytes[48], bytes[50]), (0, 1, 32, 0, 0, 9));
        assert_eq!(
            (bytes[56], bytes[58], bytes[64], bytes[66], bytes[72], bytes[74]),
            (3, 255, 255, 40, 7, 255)
        );
        // On the grid, nothing is lost.
        assert!((0..3).all(|slot| Compressed8::child(&made, slot) == children[slot]));
    }

    fn check(boxes: &[Aabb]) {
        for bits in 4..=8 {
            let params = LayoutParams { bits, ..Default::default() };
            for leaves in [0, boxes.len() / 2, boxes.len()] {
                let target = |i: usize| {
                    if i < leaves { leaf(90 + 3 * i as u32, 3) } else { node((i - leaves) as u32) }
                };
                let children: Vec<_> = boxes
                    .iter()
                    .enumerate()
                    .map(|(i, &bounds)| Some(Child { bounds, target: target(i) }))
                    .collect();
                let made = Compressed8::encode(&children, 10, &params);
                for (slot, child) in children.iter().enumerate() {
                    let (decoded, child) =
                        (Compressed8::child(&made, slot).expect("a child"), child.expect("one"));
                    assert_eq!(decoded.target, child.target);
                    assert!(decoded.bounds.contains(&child.bounds), "{decoded:?} of {child:?}");
                    let most = ((1u32 << bits) - 1) as u8;
                    assert!(made.hi.iter().chain(&made.lo).all(|lines| lines[slot] <= most));
                }
                assert!((children.len()..8).all(|slot| Compressed8::child(&made, slot).is_none()));
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..Default::default() })]

        #[test]
        fn decoded_boxes_contain_exact_ones(boxes in boxes()) {
            check(&boxes);
        }
    }

    #[test]
    fn the_largest_and_the_smallest_boxes_are_contained() {
        extremes(check);
    }
}
