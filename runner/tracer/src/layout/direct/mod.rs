//! RTRS's direct layout (Lewis 2024, 3.2.1, listing 4): 40 bytes a node, its own box in it, leaves included.
//!
//! ```text
//! byte  0     4     8         20         24        36
//!       fst   snd   minima    item_idx   maxima    item_count
//! ```
//!
//! ```text
//! fst 5   snd 6   item_count 0                   node: its children are nodes 5 and 6
//! fst 0   snd 0   item_idx 42   item_count 4     leaf: triangles 42 to 45
//! ```
//!
//! Node 0 is the root. Siblings lie next to each other: the children of the i-th node of the wide tree are nodes 2i + 1
//! and 2i + 2, so a tree with w of them takes 2w + 1. Kernels keep a node by the number of its first child.
//!
//! The paper has each node of 40 bytes, but a `vec3` of WGSL begins at a multiple of 16 bytes, and the sizes in its
//! figure 8 are multiples of 48: here they are 40. The root's box, which no traversal needs, is stored too.
//!
//! An absent child, which only a scene of a single triangle has, has a point at infinity for a box.

use super::{Child, LayoutParams, Limits, NodeLayout, Stored, Target, absent, around};
use crate::bvh2::{Aabb, MAX_TRIANGLES};
use bytemuck::{Pod, Zeroable};
use std::{mem::offset_of, ops::Range};

/// A node: see the module's text.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct DirectNode {
    /// Its first child; 0 if it is a leaf.
    pub fst: u32,
    /// Its second child; 0 if it is a leaf.
    pub snd: u32,
    /// Least corner of its box.
    pub minima: [f32; 3],
    /// The first of its triangles in leaf order, if it is a leaf.
    pub item_idx: u32,
    /// Greatest corner of its box.
    pub maxima: [f32; 3],
    /// How many triangles; 0 if it is no leaf.
    pub item_count: u32,
}

const _: () = {
    assert!(size_of::<DirectNode>() == 40);
    assert!(offset_of!(DirectNode, snd) == 4 && offset_of!(DirectNode, minima) == 8);
    assert!(offset_of!(DirectNode, item_idx) == 20 && offset_of!(DirectNode, maxima) == 24);
    assert!(offset_of!(DirectNode, item_count) == 36);
};

impl DirectNode {
    fn bounds(&self) -> Aabb {
        Aabb { lo: self.minima, hi: self.maxima }
    }

    /// The children of the wide tree's node `index` for the node that is stored of it.
    fn inner(bounds: &Aabb, index: u32) -> Self {
        let (fst, snd) = (2 * index + 1, 2 * index + 2);
        Self { fst, snd, minima: bounds.lo, maxima: bounds.hi, item_idx: 0, item_count: 0 }
    }
}

/// The layout `Direct`.
#[derive(Clone, Copy, Debug)]
pub struct Direct;

impl NodeLayout for Direct {
    type Node = DirectNode;
    const NAME: &'static str = "Direct";
    const EXACT: bool = true;
    const LIMITS: Limits =
        Limits { children: 2, triangles_per_leaf: 16, triangles_per_node: 32, triangles: MAX_TRIANGLES };

    fn child(nodes: &[DirectNode], index: u32, slot: usize) -> Option<Child> {
        let parent = &nodes[index as usize];
        let index = [parent.fst, parent.snd][slot];
        let node = &nodes[index as usize];
        let target = match node.item_count {
            0 => Target::Node(index),
            count => Target::Leaf { first: node.item_idx, count },
        };
        (node.minima[0] != f32::INFINITY).then_some(Child { bounds: node.bounds(), target })
    }

    fn own_items(nodes: &[DirectNode], index: u32, slot: usize) -> Range<u32> {
        let parent = &nodes[index as usize];
        let index = [parent.fst, parent.snd][slot];
        let node = &nodes[index as usize];
        let is_node = node.item_count == 0 && node.minima[0] != f32::INFINITY;
        index..index + u32::from(!is_node)
    }

    fn encode(nodes: &[Stored<'_>], _params: &LayoutParams) -> Vec<DirectNode> {
        let mut encoded = Vec::with_capacity(2 * nodes.len() + 1);
        encoded.push(DirectNode::inner(&around(nodes[0].children), 0));
        for node in nodes {
            assert!((1..=2).contains(&node.children.len()), "a binary node has one or two children");
            encoded.extend((0..2).map(|slot| match node.children.get(slot).copied().flatten() {
                None => DirectNode { minima: absent().lo, maxima: absent().hi, ..DirectNode::zeroed() },
                Some(Child { bounds, target: Target::Node(index) }) => DirectNode::inner(&bounds, index),
                Some(Child { bounds, target: Target::Leaf { first, count } }) => DirectNode {
                    fst: 0,
                    snd: 0,
                    minima: bounds.lo,
                    item_idx: first,
                    maxima: bounds.hi,
                    item_count: count,
                },
            }));
        }
        encoded
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_decode_to_what_they_were_encoded_from() {
        let bounds = |lo: f32, hi: f32| Aabb { lo: [lo; 3], hi: [hi, hi + 1.0, hi] };
        let leaf = |at: f32, first, count| {
            Some(Child { bounds: bounds(at, at + 1.0), target: Target::Leaf { first, count } })
        };
        let inner = Child { bounds: bounds(-5.0, 3.0), target: Target::Node(1) };
        let (root, below) = ([leaf(1.0, 42, 4), Some(inner)], [leaf(-5.0, 0, 1), leaf(0.0, 1, 16)]);
        let nodes = Direct::encode(
            &[Stored { children: &root, triangles: 21 }, Stored { children: &below, triangles: 17 }],
            &LayoutParams::default(),
        );
        assert_eq!(nodes.len(), 5);
        assert_eq!((nodes[0].fst, nodes[0].snd, nodes[0].bounds()), (1, 2, bounds(-5.0, 3.0)));
        assert_eq!((nodes[1].item_idx, nodes[1].item_count, nodes[1].fst), (42, 4, 0));
        assert_eq!((nodes[2].fst, nodes[2].snd, nodes[2].item_count), (3, 4, 0));
        let child = |index, slot| Direct::child(&nodes, index, slot);
        assert_eq!(child(0, 0), leaf(1.0, 42, 4));
        assert_eq!(child(0, 1), Some(Child { target: Target::Node(2), ..inner }));
        assert_eq!([child(2, 0), child(2, 1)], below);
        let items = |index, slot| Direct::own_items(&nodes, index, slot);
        assert_eq!([items(0, 0), items(0, 1), items(2, 0), items(2, 1)], [1..2, 2..2, 3..4, 4..5]);
    }

    #[test]
    fn a_lone_leaf_has_no_sibling() {
        let leaf = Some(Child {
            bounds: Aabb { lo: [0.0; 3], hi: [1.0, 2.0, 0.0] },
            target: Target::Leaf { first: 0, count: 1 },
        });
        let nodes = Direct::encode(&[Stored { children: &[leaf], triangles: 1 }], &LayoutParams::default());
        assert_eq!(Direct::child(&nodes, 0, 0), leaf);
        assert_eq!(Direct::child(&nodes, 0, 1), None);
        assert_eq!(Direct::own_items(&nodes, 0, 1), 2..3);
    }
}
