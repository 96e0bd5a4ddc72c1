//! Trees as traversal kernels read them.
//!
//! A layout decides how a node is stored, not which boxes share it. Whatever the layout, node 0 is the
//! root, a node holds its children's boxes, and a leaf is a run of [`LeafTriangle`]s in a buffer of their
//! own. [`NodeLayout`] decodes that much, and the validator, the statistics and traversal on the CPU are
//! written once over it.

use crate::bvh2::{Aabb, Bvh2Buffers, Triangle};
use crate::gpu::{Buffer, Error, Gpu, Kernel, Pass, groups, shaders};
use bytemuck::{Pod, Zeroable};
use std::mem::offset_of;

pub mod binary;

/// A triangle where its leaf expects it: 48 bytes, three 16-byte loads.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct LeafTriangle {
    /// First corner.
    pub a: [f32; 3],
    /// Its number in file order.
    pub primitive: u32,
    /// Second corner.
    pub b: [f32; 3],
    /// Zero.
    pub pad_b: u32,
    /// Third corner.
    pub c: [f32; 3],
    /// Zero.
    pub pad_c: u32,
}

const _: () = {
    assert!(size_of::<LeafTriangle>() == 48 && offset_of!(LeafTriangle, primitive) == 12);
    assert!(offset_of!(LeafTriangle, b) == 16 && offset_of!(LeafTriangle, c) == 32);
};

impl LeafTriangle {
    /// Triangle `primitive` of the scene.
    pub fn new(triangle: &Triangle, primitive: u32) -> Self {
        let [a, b, c] = *triangle;
        Self { a, primitive, b, pad_b: 0, c, pad_c: 0 }
    }

    /// Its corners.
    pub fn corners(&self) -> Triangle {
        [self.a, self.b, self.c]
    }
}

/// What a layout can express.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Children a node.
    pub children: usize,
    /// Triangles a leaf.
    pub triangles_per_leaf: usize,
    /// Triangles in all leaves of one node together.
    pub triangles_per_node: usize,
    /// Triangles a tree.
    pub triangles: usize,
}

/// Where a child leads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Another node.
    Node(u32),
    /// Triangles `first` to `first + count - 1` in leaf order.
    Leaf {
        /// Index of the first.
        first: u32,
        /// At least 1.
        count: u32,
    },
}

/// A child as its parent describes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Child {
    /// Its box; in a layout with rounding, as decoded, so it contains the exact one.
    pub bounds: Aabb,
    /// What it is.
    pub target: Target,
}

/// How nodes are stored.
pub trait NodeLayout {
    /// One node's bytes.
    type Node: Pod;
    /// As it appears in variants' names.
    const NAME: &'static str;
    /// What it can express.
    const LIMITS: Limits;

    /// The child in a slot, `slot < LIMITS.children`; `None` where the slot is empty.
    fn child(node: &Self::Node, slot: usize) -> Option<Child>;

    /// A node of these children, in slot order.
    ///
    /// # Panics
    /// There are more children than the layout can hold, or none.
    fn encode(children: &[Child]) -> Self::Node;
}

/// The children of a node, empty slots left out.
pub fn children<L: NodeLayout>(node: &L::Node) -> impl Iterator<Item = Child> + '_ {
    (0..L::LIMITS.children).filter_map(|slot| L::child(node, slot))
}

/// The kernel that brings triangles into leaf order, compiled.
#[derive(Debug)]
pub struct LeafOrder {
    kernel: Kernel,
}

const WORKGROUP: u32 = 256;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct TrianglesPush {
    nodes: u64,
    levels: u64,
    positions: u64,
    triangles: u64,
    leaf_triangles: u64,
    count: u32,
    pad: u32,
}

impl LeafOrder {
    /// Compiles the kernel.
    ///
    /// # Errors
    /// The driver's compiler failed.
    pub fn new(gpu: &Gpu) -> Result<Self, Error> {
        Ok(Self { kernel: Kernel::new(gpu, &shaders::LAYOUT_TRIANGLES, WORKGROUP, &[])? })
    }

    /// Writes the triangle of leaf i of `tree` to `leaf_triangles` at `positions[i]`.
    pub fn record(
        &self,
        pass: &mut Pass,
        tree: &Bvh2Buffers,
        positions: &Buffer,
        triangles: &Buffer,
        leaf_triangles: &Buffer,
        count: usize,
    ) {
        let push = TrianglesPush {
            nodes: tree.nodes.address(),
            levels: tree.levels.address(),
            positions: positions.address(),
            triangles: triangles.address(),
            leaf_triangles: leaf_triangles.address(),
            count: u32::try_from(count).expect("at most MAX_TRIANGLES"),
            pad: 0,
        };
        pass.dispatch("triangles", &self.kernel, &push, groups(count, WORKGROUP));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::interface::{Module, fields};

    #[test]
    fn the_shader_sees_arguments_as_the_host_does() {
        Module::read(&shaders::LAYOUT_TRIANGLES)
            .assert_push_constants(
                size_of::<TrianglesPush>(),
                &fields!(TrianglesPush: nodes, levels, positions, triangles, leaf_triangles, count),
            )
            .assert_items("Triangles", size_of::<Triangle>(), None);
    }
}
