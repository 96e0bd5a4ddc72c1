//! RTRS's reduced-footprint layout (Lewis 2024, 3.2.2, listings 5 and 6): items of 16 bytes, tagged, of which a node takes
//! one and a leaf two, with boxes in half precision.
//!
//! ```text
//!                31          16 15           0
//! node, or       x upper        x lower           data
//! the first of   y upper        y lower
//! a leaf's two   z upper        z lower
//!                0 p iiiiiiiiiiiiiiiiiiiiiiiiii   tag of a node: its children are items from i on; the first of them
//!                                                 takes two if p
//!                1 fffffffffffffffffffffffffff    tag of a leaf: its first triangle
//!
//! the second     item 3         item 2            data
//!                item 5         item 4
//!                item 7         item 6
//!                item 1         item 0            tag
//! ```
//!
//! For example, a node over a leaf of three triangles, from triangle 42 on, and another node:
//!
//! ```text
//! item 0   box   tag 0 1 …001          the children are item 1, which takes two, and item 3
//! item 1   box   tag 1 …101010         leaf: triangle 42
//! item 2   items 0 1 2 0 0 0 0 0       and those 1 and 2 after it; zeros after the first are none
//! item 3   box   tag 0 …
//! ```
//!
//! Planes are rounded outward to halves, so boxes contain the exact ones whatever the coordinates ([`half`]). Beyond 65504
//! they are infinite, and between -2^-14 and 2^-14 there is only zero: scenes should measure between these.
//!
//! # Where we leave the paper
//!
//! There, the tag has the numbers of both children and an item the number of a triangle, in 15 bits each: up to 2^15 - 1
//! triangles, and as many items. **That limit is lifted**, without a bit more memory. Siblings are next to each other, so one
//! number of 30 bits is enough for both children, with one bit for how far the second is from the first. Triangles of a
//! leaf are next to each other, too: the 31 bits that the paper leaves empty in a leaf's first item hold the number of
//! the first, and the eight numbers of 16 bits count from there. What remains is the limit of all layouts, 2^27
//! triangles. Besides, the paper's figure has lower planes and even items in the upper halves of words, and its listing in
//! the lower: here it is the listing.
//!
//! Item 0 is the root. A tree with w nodes of the wide tree takes 3w + 2 items. Kernels keep a node by its tag, so
//! they read no item twice, and the root by 0.
//!
//! An absent child, which only a scene of a single triangle has, has a point at infinity for a box.

use super::{Child, LayoutParams, Limits, NodeLayout, Stored, Target, around};
use crate::bvh2::{Aabb, MAX_TRIANGLES};
use bytemuck::{Pod, Zeroable};
use std::{mem::offset_of, ops::Range};

pub mod half;

/// An item: see the module's text.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct ReducedItem {
    /// A box, or items 2 to 7 of a leaf.
    pub data: [u32; 3],
    /// What it is and where it leads, or items 0 and 1 of a leaf.
    pub tag: u32,
}

const _: () = {
    assert!(size_of::<ReducedItem>() == 16 && offset_of!(ReducedItem, tag) == 12);
    // Three items for each node of the wide tree, of which there are fewer than triangles.
    assert!(3 * MAX_TRIANGLES < 1 << 30);
};

/// Set in a leaf's tag.
const LEAF: u32 = 1 << 31;
/// Set in a node's tag whose first child takes two items.
const LEAF_FIRST: u32 = 1 << 30;
/// Both halves infinite.
const AT_INFINITY: u32 = 0x7c00_7c00;

impl ReducedItem {
    fn new(bounds: &Aabb, tag: u32) -> Self {
        let planes = |axis: usize| half::below(bounds.lo[axis]) | half::above(bounds.hi[axis]) << 16;
        Self { data: std::array::from_fn(planes), tag }
    }

    /// The second item of a leaf of so many triangles that follow each other.
    fn items(count: u32) -> Self {
        let item = |k: u32| if k < count { k } else { 0 };
        let pair = |k: u32| item(k) | item(k + 1) << 16;
        Self { data: [pair(2), pair(4), pair(6)], tag: pair(0) }
    }

    fn is_absent(&self) -> bool {
        self.data[0] == AT_INFINITY
    }

    /// Its box, with the largest float for what is infinite.
    fn bounds(&self) -> Aabb {
        let plane = |half: u32| half::value(half).clamp(-f32::MAX, f32::MAX);
        Aabb { lo: self.data.map(|x| plane(x & 0xffff)), hi: self.data.map(|x| plane(x >> 16)) }
    }

    /// Triangles of the leaf whose second item this is.
    fn count(&self) -> u32 {
        let [x, y, z] = self.data;
        // The first is there, whatever its number.
        1 + [self.tag >> 16, x, x >> 16, y, y >> 16, z, z >> 16]
            .iter()
            .map(|item| u32::from(item & 0xffff != 0))
            .sum::<u32>()
    }
}

/// The first item of a child of the node with that tag.
fn item_of(tag: u32, slot: usize) -> u32 {
    (tag & (LEAF_FIRST - 1)) + if slot == 0 { 0 } else { 1 + u32::from(tag & LEAF_FIRST != 0) }
}

/// The layout `Reduced`.
#[derive(Clone, Copy, Debug)]
pub struct Reduced;

impl NodeLayout for Reduced {
    type Node = ReducedItem;
    const NAME: &'static str = "Reduced";
    const EXACT: bool = false;
    const LIMITS: Limits =
        Limits { children: 2, triangles_per_leaf: 8, triangles_per_node: 16, triangles: MAX_TRIANGLES };

    fn child(nodes: &[ReducedItem], index: u32, slot: usize) -> Option<Child> {
        let at = item_of(nodes[index as usize].tag, slot);
        let item = &nodes[at as usize];
        let target = match item.tag & LEAF {
            0 => Target::Node(at),
            _ => Target::Leaf { first: item.tag & !LEAF, count: nodes[at as usize + 1].count() },
        };
        (!item.is_absent()).then_some(Child { bounds: item.bounds(), target })
    }

    fn own_items(nodes: &[ReducedItem], index: u32, slot: usize) -> Range<u32> {
        let at = item_of(nodes[index as usize].tag, slot);
        let takes = if nodes[at as usize].tag & LEAF == 0 { 0 } else { 2 };
        at..at + takes
    }

    fn encode(nodes: &[Stored<'_>], _params: &LayoutParams) -> Vec<ReducedItem> {
        // Of each node, the tag that says where its children are.
        let mut next = 1;
        let tags: Vec<u32> = nodes
            .iter()
            .map(|node| {
                let leaf = |slot: usize| {
                    !matches!(node.children.get(slot), Some(Some(Child { target: Target::Node(_), .. })))
                };
                let tag = next | if leaf(0) { LEAF_FIRST } else { 0 };
                next += (0..2).map(|slot| 1 + u32::from(leaf(slot))).sum::<u32>();
                tag
            })
            .collect();
        let mut encoded = Vec::with_capacity(next as usize);
        encoded.push(ReducedItem::new(&around(nodes[0].children), tags[0]));
        for node in nodes {
            assert!((1..=2).contains(&node.children.len()), "a binary node has one or two children");
            for slot in 0..2 {
                match node.children.get(slot).copied().flatten() {
                    None => encoded
                        .extend([ReducedItem { data: [AT_INFINITY; 3], tag: LEAF }, ReducedItem::zeroed()]),
                    Some(Child { bounds, target: Target::Node(index) }) => {
                        encoded.push(ReducedItem::new(&bounds, tags[index as usize]));
                    }
                    Some(Child { bounds, target: Target::Leaf { first, count } }) => {
                        assert!((1..=8).contains(&count), "a leaf has 1 to 8 triangles, not {count}");
                        encoded.extend([ReducedItem::new(&bounds, LEAF | first), ReducedItem::items(count)]);
                    }
                }
            }
        }
        encoded
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::grid::tests::{boxes, extremes};
    use proptest::prelude::*;

    fn leaf(bounds: Aabb, first: u32, count: u32) -> Option<Child> {
        Some(Child { bounds, target: Target::Leaf { first, count } })
    }

    fn encode(nodes: &[[Option<Child>; 2]]) -> Vec<ReducedItem> {
        let nodes: Vec<_> = nodes.iter().map(|children| Stored { children, triangles: 0 }).collect();
        Reduced::encode(&nodes, &LayoutParams::default())
    }

    /// The example of the module's text.
    #[test]
    fn items_are_what_is_drawn() {
        let unit = Aabb { lo: [0.0; 3], hi: [1.0, 2.0, -0.0] };
        let node = Some(Child { bounds: unit, target: Target::Node(1) });
        let items = encode(&[[leaf(unit, 42, 3), node], [leaf(unit, 0, 1), leaf(unit, 1, 8)]]);
        assert_eq!(items.len(), 8);
        assert_eq!(items[0].tag, 0b0100_0000_0000_0000_0000_0000_0000_0001);
        assert_eq!(items[0].data, [0x3c00_0000, 0x4000_0000, 0x8000_0000]);
        assert_eq!(items[1].tag, 0b1000_0000_0000_0000_0000_0000_0010_1010);
        assert_eq!((items[2].tag, items[2].data), (0x0001_0000, [2, 0, 0]));
        assert_eq!(items[3].tag, LEAF_FIRST | 4);
        assert_eq!((items[7].tag, items[7].data), (0x0001_0000, [0x0003_0002, 0x0005_0004, 0x0007_0006]));
        let child = |index, slot| Reduced::child(&items, index, slot).unwrap().target;
        assert_eq!(child(0, 0), Target::Leaf { first: 42, count: 3 });
        assert_eq!(child(0, 1), Target::Node(3));
        assert_eq!(child(3, 0), Target::Leaf { first: 0, count: 1 });
        assert_eq!(child(3, 1), Target::Leaf { first: 1, count: 8 });
        let own = |index, slot| Reduced::own_items(&items, index, slot);
        assert_eq!([own(0, 0), own(0, 1), own(3, 0), own(3, 1)], [1..3, 3..3, 4..6, 6..8]);
    }

    #[test]
    fn a_lone_leaf_has_no_sibling() {
        let unit = Aabb { lo: [0.0; 3], hi: [1.0; 3] };
        let child = leaf(unit, 0, 1);
        let items = Reduced::encode(&[Stored { children: &[child], triangles: 1 }], &LayoutParams::default());
        assert_eq!((items.len(), Reduced::child(&items, 0, 0)), (5, child));
        assert_eq!((Reduced::child(&items, 0, 1), Reduced::own_items(&items, 0, 1)), (None, 3..5));
    }

    /// The largest numbers that a tree of 2^27 triangles needs.
    #[test]
    fn numbers_beyond_fifteen_bits_are_kept() {
        let unit = Aabb { lo: [0.0; 3], hi: [1.0; 3] };
        for first in [(1 << 15) - 1, 1 << 15, (1 << 27) - 8] {
            let items = encode(&[[leaf(unit, first, 8), leaf(unit, 0, 1)]]);
            let target = Reduced::child(&items, 0, 0).unwrap().target;
            assert_eq!(target, Target::Leaf { first, count: 8 });
        }
        let tag = LEAF_FIRST | (3 << 27);
        assert_eq!([item_of(tag, 0), item_of(tag, 1)], [3 << 27, (3 << 27) + 2]);
    }

    fn check(boxes: &[Aabb]) {
        for pair in boxes.windows(2) {
            let children = [leaf(pair[0], 0, 8), leaf(pair[1], 8, 5)];
            let items = encode(&[children]);
            for (slot, child) in children.iter().enumerate() {
                let (found, child) = (Reduced::child(&items, 0, slot).unwrap(), child.unwrap());
                assert_eq!(found.target, child.target);
                assert!(found.bounds.contains(&child.bounds), "{found:?} of {child:?}");
                assert!(items[0].bounds().contains(&child.bounds), "the root has {:?}", items[0].bounds());
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..Default::default() })]

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
