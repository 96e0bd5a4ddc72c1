//! The thesis's binary layout (4.1, figures 9 and 12): 56 bytes a node, both children's boxes in it.
//!
//! ```text
//! byte  0         12        24        36        48       52
//!       lo0.xyz   hi0.xyz   lo1.xyz   hi1.xyz   child0   child1
//! ```
//!
//! A child index names a node, or with its top bit set a leaf:
//!
//! ```text
//! 0 0000 000000000000000000010000101    node 133
//! 1 0011 000000000000000000000101010    leaf: 3 + 1 triangles, from triangle 42 on
//! | |    '-- first triangle, 27 bits
//! | '------- triangles less one, 4 bits
//! '--------- leaf
//! ```
//!
//! An absent child, which only a scene of a single triangle has, has a box without inside, from the
//! largest number to the least: a slab test that knows from the signs of a ray which plane is met
//! first misses it, whichever way the ray goes. (A point at infinity, which wide nodes have, would
//! be multiplied by zero.)

use super::{Child, LayoutParams, Limits, NodeByNode, Target, in_turn};
use crate::bvh2::{Aabb, MAX_TRIANGLES};
use bytemuck::{Pod, Zeroable};
use std::mem::offset_of;

/// A node: see the module's text.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct BinaryNode {
    /// Least corner of the first child's box.
    pub lo0: [f32; 3],
    /// Greatest corner of the first child's box.
    pub hi0: [f32; 3],
    /// Least corner of the second child's box.
    pub lo1: [f32; 3],
    /// Greatest corner of the second child's box.
    pub hi1: [f32; 3],
    /// Encoded index of the first child.
    pub child0: u32,
    /// Encoded index of the second child.
    pub child1: u32,
}

const _: () = {
    assert!(size_of::<BinaryNode>() == 56);
    assert!(offset_of!(BinaryNode, hi0) == 12 && offset_of!(BinaryNode, lo1) == 24);
    assert!(offset_of!(BinaryNode, hi1) == 36);
    assert!(offset_of!(BinaryNode, child0) == 48 && offset_of!(BinaryNode, child1) == 52);
};

/// Set in a child index that means a leaf.
pub const LEAF_BIT: u32 = 1 << 31;
/// From this bit on, triangles less one.
pub const COUNT_SHIFT: u32 = 27;
const FIRST_MASK: u32 = (1 << COUNT_SHIFT) - 1;

/// Two absent children.
pub const EMPTY_NODE: BinaryNode = BinaryNode {
    lo0: [f32::MAX; 3],
    hi0: [-f32::MAX; 3],
    lo1: [f32::MAX; 3],
    hi1: [-f32::MAX; 3],
    child0: LEAF_BIT,
    child1: LEAF_BIT,
};

/// What a child index means.
pub fn target(index: u32) -> Target {
    if index & LEAF_BIT == 0 {
        Target::Node(index)
    } else {
        Target::Leaf { first: index & FIRST_MASK, count: (index >> COUNT_SHIFT & 15) + 1 }
    }
}

/// The child index that means it.
///
/// # Panics
/// It cannot be expressed.
pub fn code(target: Target) -> u32 {
    match target {
        Target::Node(index) => {
            assert!(index & LEAF_BIT == 0, "node {index}");
            index
        }
        Target::Leaf { first, count } => {
            assert!((1..=16).contains(&count) && first <= FIRST_MASK, "{count} triangles from {first} on");
            LEAF_BIT | (count - 1) << COUNT_SHIFT | first
        }
    }
}

/// The layout `Binary`.
#[derive(Clone, Copy, Debug)]
pub struct Binary;

impl NodeByNode for Binary {
    type Node = BinaryNode;
    const NAME: &'static str = "Binary";
    const EXACT: bool = true;
    const LIMITS: Limits =
        Limits { children: 2, triangles_per_leaf: 16, triangles_per_node: 32, triangles: MAX_TRIANGLES };

    fn child(node: &BinaryNode, slot: usize) -> Option<Child> {
        let (lo, hi, index) = match slot {
            0 => (node.lo0, node.hi0, node.child0),
            _ => (node.lo1, node.hi1, node.child1),
        };
        (lo[0] <= hi[0]).then_some(Child { bounds: Aabb { lo, hi }, target: target(index) })
    }

    fn encode(slots: &[Option<Child>], _triangles: u32, _params: &LayoutParams) -> BinaryNode {
        let children = in_turn(slots);
        assert!((1..=2).contains(&children.len()), "a binary node has one or two children");
        let first = &children[0];
        let mut node = BinaryNode {
            lo0: first.bounds.lo,
            hi0: first.bounds.hi,
            child0: code(first.target),
            ..EMPTY_NODE
        };
        if let Some(second) = children.get(1) {
            node.lo1 = second.bounds.lo;
            node.hi1 = second.bounds.hi;
            node.child1 = code(second.target);
        }
        node
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_decodes_to_what_it_was_encoded_from() {
        let leaf = Child {
            bounds: Aabb { lo: [0.0; 3], hi: [1.0, 2.0, 0.0] },
            target: Target::Leaf { first: 42, count: 4 },
        };
        let inner = Child { bounds: Aabb { lo: [-1.0; 3], hi: [5.0; 3] }, target: Target::Node(133) };
        let node = Binary::encode(&[leaf, inner].map(Some), 9, &LayoutParams::default());
        assert_eq!(node.child0, 0b1001_1000_0000_0000_0000_0000_0010_1010);
        assert_eq!(node.child1, 0b0000_0000_0000_0000_0000_0000_1000_0101);
        assert_eq!(Binary::child(&node, 0), Some(leaf));
        assert_eq!(Binary::child(&node, 1), Some(inner));
        assert_eq!(Binary::child(&Binary::encode(&[Some(leaf)], 4, &LayoutParams::default()), 1), None);
    }
}
