//! Trees as traversal kernels read them.
//!
//! A layout decides how a node is stored, not which boxes share it. Whatever the layout, node 0 is the
//! root, a node holds its children's boxes, and a leaf is a run of triangles in a buffer of their own, which are
//! stored as the ray-triangle test wants them: [`LeafTriangles`]. [`NodeLayout`] decodes that much, and the validator, the statistics and traversal on the CPU are
//! written once over it.

use crate::{
    bvh2::{Aabb, Bvh2Buffers, Triangle},
    contract::WideBuffers,
    gpu::{self, Buffer, Error, Gpu, Kernel, Pass, shaders},
    traverse::{TriangleFormat, TriangleTest},
};
use bytemuck::{Pod, Zeroable};
use compressed::Assignment;
use serde::{Deserialize, Serialize};
use std::{mem::offset_of, ops::Range};

pub mod binary;
pub mod compressed;
pub mod cpu;
pub mod direct;
mod grid;
pub mod quantized;
pub mod reduced;
mod triangles;
pub mod wide;

pub use crate::permutations::Layout;
pub use triangles::{EdgeTriangle, LeafTriangles, UnitTriangle};

/// Runs an expression with `$L` standing for the [`NodeLayout`] of a [`Layout`].
#[macro_export]
macro_rules! with_layout {
    ($layout:expr, $L:ident => $body:expr) => {
        match $layout {
            $crate::layout::Layout::Binary => {
                type $L = $crate::layout::binary::Binary;
                $body
            }
            $crate::layout::Layout::Wide4 => {
                type $L = $crate::layout::wide::Wide4;
                $body
            }
            $crate::layout::Layout::Wide6 => {
                type $L = $crate::layout::wide::Wide6;
                $body
            }
            $crate::layout::Layout::Wide8 => {
                type $L = $crate::layout::wide::Wide8;
                $body
            }
            $crate::layout::Layout::Quantized4 => {
                type $L = $crate::layout::quantized::Quantized4;
                $body
            }
            $crate::layout::Layout::Quantized6 => {
                type $L = $crate::layout::quantized::Quantized6;
                $body
            }
            $crate::layout::Layout::Quantized8 => {
                type $L = $crate::layout::quantized::Quantized8;
                $body
            }
            $crate::layout::Layout::Compressed8 => {
                type $L = $crate::layout::compressed::Compressed8;
                $body
            }
            $crate::layout::Layout::Direct => {
                type $L = $crate::layout::direct::Direct;
                $body
            }
            $crate::layout::Layout::Reduced => {
                type $L = $crate::layout::reduced::Reduced;
                $body
            }
        }
    };
}

impl Layout {
    /// Whether it is one of the thesis's quantized ones.
    pub fn is_quantized(self) -> bool {
        matches!(self, Self::Quantized4 | Self::Quantized6 | Self::Quantized8)
    }

    /// Bits of a plane under `params`.
    pub fn bits(self, params: &LayoutParams) -> u32 {
        match self {
            Self::Binary | Self::Wide4 | Self::Wide6 | Self::Wide8 | Self::Direct => 32,
            Self::Reduced => 16,
            Self::Quantized4 | Self::Quantized6 | Self::Quantized8 => 8,
            Self::Compressed8 => params.bits,
        }
    }

    /// Whether it is the compressed one, whose slots have an order of their own.
    pub fn is_compressed(self) -> bool {
        self == Self::Compressed8
    }

    /// Whether boxes are in the nodes that they are of, leaves included, and not in those above. Kernels then know nodes by
    /// other numbers than their own, and do not count visits to each.
    pub fn has_own_boxes(self) -> bool {
        matches!(self, Self::Direct | Self::Reduced)
    }

    /// Items that the nodes of a wide tree with so many take: as many, or where leaves are no part of their parents, more.
    pub fn items(self, nodes: usize) -> usize {
        match self {
            Self::Direct => 2 * nodes + 1,
            Self::Reduced => 3 * nodes + 2,
            _ => nodes,
        }
    }

    /// What it can express.
    pub fn limits(self) -> Limits {
        with_layout!(self, L => <L as NodeLayout>::LIMITS)
    }

    /// Bytes of a node.
    pub fn node_bytes(self) -> usize {
        with_layout!(self, L => size_of::<<L as NodeLayout>::Node>())
    }

    /// Bytes from one node to the next under `params`.
    pub fn stride(self, params: &LayoutParams) -> usize {
        self.node_bytes().next_multiple_of(params.align as usize)
    }
}

/// What may be chosen about how nodes are stored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LayoutParams {
    /// Bytes that the distance between two nodes is a multiple of: 4, which leaves nodes as the thesis has
    /// them, 8 or 16. With more, kernels load up to so many bytes at a time, and more memory is needed.
    pub align: u32,
    /// Bits of a plane in the compressed layout, 4 to 8 (Ylitie et al. 2017, table 1). Its nodes are as large with
    /// fewer: boxes are only rounded more.
    pub bits: u32,
    /// Which slots children have in the compressed layout.
    #[serde(skip)]
    pub assignment: Assignment,
}

impl Default for LayoutParams {
    fn default() -> Self {
        Self { align: 4, bits: 8, assignment: Assignment::Auction }
    }
}

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

/// A node of a wide tree that is to be stored: the one whose number is its place among others.
#[derive(Clone, Copy, Debug)]
pub struct Stored<'a> {
    /// The children in their slots. Nodes, and triangles of leaves, follow each other; where the order of slots means
    /// nothing, leaves come before nodes, and no slot between them is empty.
    pub children: &'a [Option<Child>],
    /// Triangles in the whole subtree.
    pub triangles: u32,
}

/// How nodes are stored.
pub trait NodeLayout {
    /// One node's bytes; where leaves are no part of their parents, those of an item that nodes and leaves are made of.
    type Node: Pod + Send + Sync;
    /// As it appears in messages.
    const NAME: &'static str;
    /// Whether boxes are stored as they are; otherwise what is decoded contains the exact ones.
    const EXACT: bool;
    /// What it can express.
    const LIMITS: Limits;

    /// The child in a slot of a node, `slot < LIMITS.children`; `None` where the slot is empty.
    fn child(nodes: &[Self::Node], index: u32, slot: usize) -> Option<Child>;

    /// The items that only the child in this slot takes, which is a leaf or missing. None where leaves are in their
    /// parents.
    fn own_items(_nodes: &[Self::Node], _index: u32, _slot: usize) -> Range<u32> {
        0..0
    }

    /// The slot of each child, leaves before nodes; `seed` tells nodes apart where slots are random. Theirs in turn,
    /// where the order of slots means nothing.
    fn slots(children: &[Child], _seed: u32, _params: &LayoutParams) -> Vec<usize> {
        (0..children.len()).collect()
    }

    /// All nodes of a tree; the first is the root.
    ///
    /// # Panics
    /// There are more children than the layout can hold, or none, or they are in another order.
    fn encode(nodes: &[Stored<'_>], params: &LayoutParams) -> Vec<Self::Node>;
}

/// A layout in which a node says everything of its children, and each can be read and written by itself.
pub trait NodeByNode {
    /// [`NodeLayout::Node`].
    type Node: Pod + Send + Sync;
    /// [`NodeLayout::NAME`].
    const NAME: &'static str;
    /// [`NodeLayout::EXACT`].
    const EXACT: bool;
    /// [`NodeLayout::LIMITS`].
    const LIMITS: Limits;

    /// The child in a slot, `slot < LIMITS.children`; `None` where the slot is empty.
    fn child(node: &Self::Node, slot: usize) -> Option<Child>;

    /// [`NodeLayout::slots`].
    fn slots(children: &[Child], _seed: u32, _params: &LayoutParams) -> Vec<usize> {
        (0..children.len()).collect()
    }

    /// A node of the children in these slots, with so many triangles in its whole subtree: see [`Stored`].
    ///
    /// # Panics
    /// There are more children than the layout can hold, or none, or they are in another order.
    fn encode(children: &[Option<Child>], triangles: u32, params: &LayoutParams) -> Self::Node;
}

impl<L: NodeByNode> NodeLayout for L {
    type Node = L::Node;
    const NAME: &'static str = L::NAME;
    const EXACT: bool = L::EXACT;
    const LIMITS: Limits = L::LIMITS;

    fn child(nodes: &[L::Node], index: u32, slot: usize) -> Option<Child> {
        L::child(&nodes[index as usize], slot)
    }

    fn slots(children: &[Child], seed: u32, params: &LayoutParams) -> Vec<usize> {
        L::slots(children, seed, params)
    }

    fn encode(nodes: &[Stored<'_>], params: &LayoutParams) -> Vec<L::Node> {
        nodes.iter().map(|node| L::encode(node.children, node.triangles, params)).collect()
    }
}

/// The children of slots of which none is empty.
///
/// # Panics
/// One is.
fn in_turn(slots: &[Option<Child>]) -> Vec<Child> {
    slots.iter().map(|child| child.expect("no slot is empty")).collect()
}

/// The children of a node, empty slots left out.
pub fn children<L: NodeLayout>(nodes: &[L::Node], index: u32) -> impl Iterator<Item = Child> + '_ {
    (0..L::LIMITS.children).filter_map(move |slot| L::child(nodes, index, slot))
}

/// The box around all children of a node.
fn around(slots: &[Option<Child>]) -> Aabb {
    slots.iter().flatten().fold(Aabb::EMPTY, |b, child| b.union(&child.bounds))
}

/// What stands in an absent slot whose box is stored as it is; `absent` in `encode.comp`.
fn absent() -> Aabb {
    Aabb { lo: [f32::INFINITY; 3], hi: [f32::INFINITY; 3] }
}

/// The kernels that write a wide tree's nodes and triangles, compiled for one layout.
#[derive(Debug)]
pub struct Encode {
    /// What comes before, where a node's place is not its number.
    arrange: Option<Kernel>,
    nodes: Kernel,
    triangles: Kernel,
    layout: Layout,
    stride: usize,
    test: TriangleTest,
}

const WORKGROUP: u32 = 128;

/// Fewer, where nodes are put together in shared memory: 232 bytes each at most.
const ENCODING_WORKGROUP: u32 = 64;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ArrangePush {
    nodes: u64,
    wide: u64,
    progress: u64,
    arranged: u64,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ArrangeItemsPush {
    wide: u64,
    progress: u64,
    arranged: u64,
    first: u32,
    most: u32,
}

/// Nodes that one launch of `layout/reduced/arrange.comp` goes over: as many as leave drivers that end long loops far from
/// doing so.
const ARRANGED_AT_ONCE: u32 = 1 << 16;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct EncodePush {
    nodes: u64,
    wide: u64,
    progress: u64,
    nodes_out: u64,
    arranged: u64,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct TrianglesPush {
    nodes: u64,
    wide: u64,
    progress: u64,
    triangles: u64,
    leaf_triangles: u64,
    indices: u64,
    leaves: u32,
    arity: u32,
}

impl Encode {
    /// Compiles the kernels, which store triangles for a test.
    ///
    /// # Errors
    /// The driver's compiler failed.
    ///
    /// # Panics
    /// `align` is not 4, 8 or 16, or `bits` not 4 to 8.
    pub fn new(gpu: &Gpu, layout: Layout, params: &LayoutParams, test: TriangleTest) -> Result<Self, Error> {
        assert!([4, 8, 16].contains(&params.align), "nodes are aligned to 4, 8 or 16 bytes");
        assert!((4..=8).contains(&params.bits), "planes have 4 to 8 bits");
        let size = WORKGROUP.min(gpu.info().max_workgroup_size);
        let encoding = ENCODING_WORKGROUP.min(size);
        let stride = layout.stride(params);
        let arrange = match layout {
            Layout::Compressed8 => Some(Kernel::new(
                gpu,
                &shaders::LAYOUT_COMPRESSED_ARRANGE,
                size,
                &[params.assignment as u32],
            )?),
            Layout::Reduced => {
                let size = 512.min(gpu.info().max_workgroup_size);
                Some(Kernel::new(gpu, &shaders::LAYOUT_REDUCED_ARRANGE, size, &[])?)
            }
            _ => None,
        };
        Ok(Self {
            arrange,
            nodes: Kernel::new(gpu, shaders::layout_encode(layout), encoding, &[stride as u32, params.bits])?,
            triangles: Kernel::new(gpu, &shaders::LAYOUT_TRIANGLES, size, &[test.format() as u32])?,
            layout,
            stride,
            test,
        })
    }

    /// The layout.
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// Bytes from one node to the next.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Allocates the memory for a tree of up to `nodes` nodes and `triangles` triangles.
    ///
    /// # Errors
    /// Too little memory.
    pub fn buffers(&self, gpu: &Gpu, nodes: usize, triangles: usize) -> Result<LayoutBuffers, Error> {
        let arranged = || gpu.buffer("slots and places of nodes", 8 * nodes as u64);
        Ok(LayoutBuffers {
            arranged: self.arrange.as_ref().map(|_| arranged()).transpose()?,
            nodes: gpu.buffer("nodes", (self.stride * self.layout.items(nodes)) as u64)?,
            triangles: TriangleBuffers::new(gpu, self.test, triangles)?,
        })
    }

    /// Writes nodes, and triangles in the order of their leaves.
    pub fn record(&self, pass: &mut Pass, input: &Input<'_>, to: &LayoutBuffers) {
        let Input { tree, wide, triangles, count } = *input;
        // Most of these workgroups find nothing to do, which costs less than another indirect dispatch.
        let groups = |kernel: &Kernel| gpu::groups(wide.capacity(), kernel.workgroup_size()).min(MOST_GROUPS);
        let arranged = to.arranged.as_ref().map_or(0, Buffer::address);
        if let (Layout::Reduced, Some(arrange)) = (self.layout, &self.arrange) {
            for first in (0..wide.capacity() as u32).step_by(ARRANGED_AT_ONCE as usize) {
                let (wide, progress) = (wide.nodes().address(), wide.progress.address());
                let push = ArrangeItemsPush { wide, progress, arranged, first, most: ARRANGED_AT_ONCE };
                pass.dispatch("arrange", arrange, &push, 1);
            }
        } else if let Some(arrange) = &self.arrange {
            let push = ArrangePush {
                nodes: tree.nodes.address(),
                wide: wide.nodes().address(),
                progress: wide.progress.address(),
                arranged,
            };
            pass.dispatch("arrange", arrange, &push, groups(arrange));
        }
        let push = EncodePush {
            nodes: tree.nodes.address(),
            wide: wide.nodes().address(),
            progress: wide.progress.address(),
            nodes_out: to.nodes.address(),
            arranged,
        };
        pass.dispatch("nodes", &self.nodes, &push, groups(&self.nodes));
        let push = TrianglesPush {
            nodes: tree.nodes.address(),
            wide: wide.nodes().address(),
            progress: wide.progress.address(),
            triangles: triangles.address(),
            leaf_triangles: to.triangles.stored.address(),
            indices: to.triangles.indices_address(),
            leaves: u32::try_from(count).expect("at most MAX_TRIANGLES"),
            arity: self.layout.arity() as u32,
        };
        let leaves = self.layout.arity() * wide.capacity();
        let groups = gpu::groups(leaves, self.triangles.workgroup_size()).min(MOST_GROUPS);
        pass.dispatch("triangles", &self.triangles, &push, groups);
    }
}

/// A tree as kernels traverse it, in device memory.
#[derive(Debug)]
pub struct LayoutBuffers {
    /// `Arrangement` in `arranged.glsl`, of a layout in which a node's place is not its number.
    arranged: Option<Buffer>,
    /// Nodes, a stride apart.
    pub nodes: Buffer,
    /// In the order of leaves.
    pub triangles: TriangleBuffers,
}

/// Device memory of [`LeafTriangles`].
#[derive(Debug)]
pub struct TriangleBuffers {
    /// Of [`LeafTriangle`], [`EdgeTriangle`] or [`UnitTriangle`]: which, the test says.
    pub stored: Buffer,
    /// With maps, u32.
    indices: Option<Buffer>,
    test: TriangleTest,
}

impl TriangleBuffers {
    /// Allocates for so many, stored for a test.
    pub(crate) fn new(gpu: &Gpu, test: TriangleTest, count: usize) -> Result<Self, Error> {
        let indices = || gpu.buffer("indices in leaf order", (size_of::<u32>() * count) as u64);
        Ok(Self {
            stored: gpu.buffer("triangles in leaf order", (size_of::<LeafTriangle>() * count) as u64)?,
            indices: (test.format() == TriangleFormat::Maps).then(indices).transpose()?,
            test,
        })
    }

    /// What they are stored for.
    pub fn test(&self) -> TriangleTest {
        self.test
    }

    /// Address of the indices, 0 where they are stored with the triangles.
    pub fn indices_address(&self) -> u64 {
        self.indices.as_ref().map_or(0, Buffer::address)
    }

    /// Copies the first `count` triangles to the host.
    ///
    /// # Errors
    /// A transfer failed.
    pub fn read(&self, count: usize) -> Result<LeafTriangles, Error> {
        Ok(match &self.indices {
            Some(indices) => {
                LeafTriangles::Maps { maps: self.stored.read(0, count)?, indices: indices.read(0, count)? }
            }
            None if self.test.format() == TriangleFormat::Edges => {
                LeafTriangles::Edges(self.stored.read(0, count)?)
            }
            None => LeafTriangles::Corners { test: self.test, triangles: self.stored.read(0, count)? },
        })
    }
}

/// What is stored.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// The binary tree, which has the boxes.
    pub tree: &'a Bvh2Buffers,
    /// Which of them share a node.
    pub wide: &'a WideBuffers,
    /// Nine floats a triangle, in file order.
    pub triangles: &'a Buffer,
    /// How many triangles.
    pub count: usize,
}

/// Workgroups that every device can launch; the kernels go on from there by themselves.
const MOST_GROUPS: u32 = 65_535;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bvh2::Bvh2Node,
        gpu::interface::{Module, fields},
    };

    #[test]
    fn shaders_see_arguments_as_the_host_does() {
        Module::read(&shaders::LAYOUT_TRIANGLES)
            .assert_push_constants(
                size_of::<TrianglesPush>(),
                &fields!(TrianglesPush: nodes, wide, progress, triangles, leaf_triangles, indices, leaves, arity),
            )
            .assert_items("Triangles", size_of::<Triangle>(), None)
            .assert_items("WideNodes", 4, None)
            .assert_items("LeafTriangles", 16, None)
            .assert_items("Indices", 4, None)
            .assert_specialization(1, "FORMAT");
        Module::read(&shaders::LAYOUT_COMPRESSED_ARRANGE)
            .assert_push_constants(
                size_of::<ArrangePush>(),
                &fields!(ArrangePush: nodes, wide, progress, arranged),
            )
            .assert_items("Arrangement", 8, None)
            .assert_specialization(1, "ASSIGNMENT");
        Module::read(&shaders::LAYOUT_REDUCED_ARRANGE)
            .assert_push_constants(
                size_of::<ArrangeItemsPush>(),
                &fields!(ArrangeItemsPush: wide, progress, arranged, first, most),
            )
            .assert_items("Arrangement", 8, None);

        for &layout in Layout::ALL {
            Module::read(shaders::layout_encode(layout))
                .assert_push_constants(
                    size_of::<EncodePush>(),
                    &fields!(EncodePush: nodes, wide, progress, nodes_out, arranged),
                )
                .assert_items("Bvh2Nodes", size_of::<Bvh2Node>(), None)
                .assert_items("WideNodes", 4, None)
                .assert_items("Words", 4, None)
                .assert_specialization(1, "STRIDE");
        }
    }
}
