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
//! Nodes are numbered depth first, so node 0 is the root and a left child that is a node follows its
//! parent. An absent child, which only a scene of a single triangle has, has a point at infinity for a
//! box: every slab test misses it, whichever way the ray goes, while one with lo > hi would be hit by
//! those that sort the two planes.

use super::{Child, Limits, NodeLayout, Target};
use crate::{
    bvh2::{Aabb, Bvh2Buffers, MAX_TRIANGLES},
    collapse::TAIL,
    gpu::{Buffer, Error, Gpu, Kernel, Pass, shaders},
    ploc::{LEVEL_WORKGROUP, TAIL_WORKGROUP},
};
use bytemuck::{Pod, Zeroable};
use std::mem::offset_of;

pub mod cpu;

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
    lo0: [f32::INFINITY; 3],
    hi0: [f32::INFINITY; 3],
    lo1: [f32::INFINITY; 3],
    hi1: [f32::INFINITY; 3],
    child0: LEAF_BIT,
    child1: LEAF_BIT,
};

/// The layout `Binary`.
#[derive(Clone, Copy, Debug)]
pub struct Binary;

impl NodeLayout for Binary {
    type Node = BinaryNode;
    const NAME: &'static str = "Binary";
    const LIMITS: Limits =
        Limits { children: 2, triangles_per_leaf: 16, triangles_per_node: 32, triangles: MAX_TRIANGLES };

    fn child(node: &BinaryNode, slot: usize) -> Option<Child> {
        let (lo, hi, index) = match slot {
            0 => (node.lo0, node.hi0, node.child0),
            _ => (node.lo1, node.hi1, node.child1),
        };
        let bounds = Aabb { lo, hi };
        let target = if index & LEAF_BIT == 0 {
            Target::Node(index)
        } else {
            Target::Leaf { first: index & FIRST_MASK, count: (index >> COUNT_SHIFT & 15) + 1 }
        };
        (lo[0] != f32::INFINITY).then_some(Child { bounds, target })
    }

    fn encode(children: &[Child]) -> BinaryNode {
        assert!((1..=2).contains(&children.len()), "a binary node has one or two children");
        let code = |child: &Child| match child.target {
            Target::Node(index) => {
                assert!(index & LEAF_BIT == 0);
                index
            }
            Target::Leaf { first, count } => {
                assert!((1..=16).contains(&count) && first <= FIRST_MASK);
                LEAF_BIT | (count - 1) << COUNT_SHIFT | first
            }
        };
        let first = &children[0];
        let mut node =
            BinaryNode { lo0: first.bounds.lo, hi0: first.bounds.hi, child0: code(first), ..EMPTY_NODE };
        if let Some(second) = children.get(1) {
            node.lo1 = second.bounds.lo;
            node.hi1 = second.bounds.hi;
            node.child1 = code(second);
        }
        node
    }
}

/// What a build leaves for the host to read.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Summary {
    /// Nodes in the layout.
    pub nodes: u32,
    /// Nodes on the longest way from the root to a leaf, the root included. A traversal that pushes the
    /// farther of two children needs a stack of at most `depth` entries.
    pub depth: u32,
    /// Levels of the binary tree, that is iterations of the clustering; 0 if it is not complete.
    pub levels: u32,
    /// Those that were processed by a dispatch each, before one workgroup took over.
    pub large_levels: u32,
    /// The same of the clustering itself, which needs all of a workgroup's shared memory.
    pub iterations: u32,
}

/// The kernel, compiled.
#[derive(Debug)]
pub struct Rearrange {
    level: Kernel,
    tail: Kernel,
}

/// Memory that the rearrangement needs.
#[derive(Debug)]
pub struct RearrangeBuffers {
    places: Buffer,
    /// Of each leaf of the binary tree, where its triangle goes.
    pub positions: Buffer,
    /// One [`Summary`].
    pub summary: Buffer,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    nodes: u64,
    levels: u64,
    subtrees: u64,
    places: u64,
    positions: u64,
    nodes_out: u64,
    summary: u64,
    level: u32,
    pad: u32,
}

impl Rearrange {
    /// Compiles the kernel.
    ///
    /// # Errors
    /// The driver's compiler failed.
    pub fn new(gpu: &Gpu) -> Result<Self, Error> {
        let kernel = |size| Kernel::new(gpu, &shaders::LAYOUT_BINARY_REARRANGE, size, &[]);
        let most = gpu.info().max_workgroup_size;
        Ok(Self { level: kernel(LEVEL_WORKGROUP.min(most))?, tail: kernel(TAIL_WORKGROUP.min(most))? })
    }

    /// Allocates for a tree of up to `leaves` leaves.
    ///
    /// # Errors
    /// Too little memory.
    pub fn buffers(gpu: &Gpu, leaves: usize) -> Result<RearrangeBuffers, Error> {
        Ok(RearrangeBuffers {
            places: gpu.buffer("places of nodes", 8 * (leaves as u64 - 1))?,
            positions: gpu.buffer("positions of triangles", 4 * leaves as u64)?,
            summary: gpu.buffer("summary of a build", size_of::<Summary>() as u64)?,
        })
    }

    /// Writes the nodes, the triangles' positions and the summary; `nodes_out` has room for
    /// `max(leaves - 1, 1)` nodes.
    pub fn record(
        &self,
        pass: &mut Pass,
        tree: &Bvh2Buffers,
        subtrees: &Buffer,
        nodes_out: &Buffer,
        buffers: &RearrangeBuffers,
        large_levels: u32,
    ) {
        let push = |level| Push {
            nodes: tree.nodes.address(),
            levels: tree.levels.address(),
            subtrees: subtrees.address(),
            places: buffers.places.address(),
            positions: buffers.positions.address(),
            nodes_out: nodes_out.address(),
            summary: buffers.summary.address(),
            level,
            pad: 0,
        };
        pass.dispatch("tail", &self.tail, &push(TAIL), 1);
        for level in (0..large_levels).rev() {
            pass.dispatch_indirect(
                "level",
                &self.level,
                &push(level),
                &tree.levels,
                Bvh2Buffers::arguments(level),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bvh2::Bvh2Node,
        gpu::interface::{Module, fields},
    };

    #[test]
    fn the_shader_sees_memory_as_the_host_does() {
        Module::read(&shaders::LAYOUT_BINARY_REARRANGE)
            .assert_push_constants(
                size_of::<Push>(),
                &fields!(Push: nodes, levels, subtrees, places, positions, nodes_out, summary, level),
            )
            .assert_items("Bvh2Nodes", size_of::<Bvh2Node>(), None)
            .assert_block("Summary", &fields!(Summary: nodes, depth, levels, large_levels, iterations));
    }

    #[test]
    fn a_node_decodes_to_what_it_was_encoded_from() {
        let leaf = Child {
            bounds: Aabb { lo: [0.0; 3], hi: [1.0, 2.0, 0.0] },
            target: Target::Leaf { first: 42, count: 4 },
        };
        let inner = Child { bounds: Aabb { lo: [-1.0; 3], hi: [5.0; 3] }, target: Target::Node(133) };
        let node = Binary::encode(&[leaf, inner]);
        assert_eq!(node.child0, 0b1001_1000_0000_0000_0000_0000_0010_1010);
        assert_eq!(node.child1, 0b0000_0000_0000_0000_0000_0000_1000_0101);
        assert_eq!(Binary::child(&node, 0), Some(leaf));
        assert_eq!(Binary::child(&node, 1), Some(inner));
        assert_eq!(Binary::child(&Binary::encode(&[leaf]), 1), None);
    }
}
