//! The one binary tree type, made by every builder, on the GPU and on the CPU.
//!
//! ```text
//! nodes   [ leaf 0 … leaf n-1 | level 0 | level 1 | … | root ]          2n - 1 of 32 bytes
//!           in Morton order     inner nodes, in the order they were made
//! ```
//!
//! A tree of [`crate::sbvh`] has a leaf for each reference, of which a triangle can have several, and its
//! leaves and the nodes of a level are in depth-first order.
//!
//! Children lie in front of their parents, whole levels in front of whole levels: the children of a node
//! in level k are leaves or lie in levels before k. So a pass upwards is one dispatch a level, in order,
//! and a pass downwards the same in reverse, without atomics, without waiting, with one possible result.
//! For PLOC a level is one iteration, for SBVH the nodes of one height.
//!
//! A tree of [`crate::hploc`] has no levels: its root is the last, and the other inner nodes lie in any order.
//! [`Bvh2::upwards`] finds one in which children come first.

use crate::{
    gpu::{Buffer, Error, Gpu},
    ploc::LEVEL_WORKGROUP,
};
use bytemuck::{Pod, Zeroable};
use std::{mem::offset_of, ops::Range};

/// Most levels a tree can have; `MAX_LEVELS` in `levels.glsl`.
pub const MAX_LEVELS: usize = 256;

/// Most triangles a tree can have: child indices of leaves have 27 bits for the first triangle.
pub const MAX_TRIANGLES: usize = 1 << 27;

/// A triangle's three corners.
pub type Triangle = [[f32; 3]; 3];

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Least corner.
    pub lo: [f32; 3],
    /// Greatest corner.
    pub hi: [f32; 3],
}

impl Aabb {
    /// Contains nothing; the neutral element of `union`.
    pub const EMPTY: Self = Self { lo: [f32::INFINITY; 3], hi: [f32::NEG_INFINITY; 3] };

    /// The box of one triangle.
    pub fn of(triangle: &Triangle) -> Self {
        triangle.iter().fold(Self::EMPTY, |b, &p| b.union(&Self { lo: p, hi: p }))
    }

    /// The least box around both.
    pub fn union(&self, other: &Self) -> Self {
        Self {
            lo: std::array::from_fn(|i| self.lo[i].min(other.lo[i])),
            hi: std::array::from_fn(|i| self.hi[i].max(other.hi[i])),
        }
    }

    /// Whether there is no point in it.
    pub fn is_empty(&self) -> bool {
        (0..3).any(|i| self.lo[i] > self.hi[i])
    }

    /// Whether all of `other` lies in it.
    pub fn contains(&self, other: &Self) -> bool {
        other.is_empty() || (0..3).all(|i| self.lo[i] <= other.lo[i] && other.hi[i] <= self.hi[i])
    }

    /// Its middle; the halves are taken first because the sum of two coordinates may not fit a float.
    pub fn center(&self) -> [f32; 3] {
        std::array::from_fn(|i| 0.5 * self.lo[i] + 0.5 * self.hi[i])
    }

    /// Half its surface area, its edges first multiplied by `scale`; `box_half_area` in `box.glsl`.
    pub fn half_area(&self, scale: f32) -> f32 {
        let e: [f32; 3] = std::array::from_fn(|i| (self.hi[i] - self.lo[i]) * scale);
        e[0] * e[1] + e[1] * e[2] + e[2] * e[0]
    }
}

/// A node of a [`Bvh2`], the same on CPU and GPU.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Bvh2Node {
    /// Least corner of its box.
    pub lo: [f32; 3],
    /// Index of the left child, or the triangle's number in file order if this is a leaf.
    pub left: u32,
    /// Greatest corner of its box.
    pub hi: [f32; 3],
    /// Index of the right child, or [`LEAF`].
    pub right: u32,
}

/// What a leaf has instead of a right child.
pub const LEAF: u32 = u32::MAX;

const _: () = {
    assert!(size_of::<Bvh2Node>() == 32);
    assert!(offset_of!(Bvh2Node, left) == 12 && offset_of!(Bvh2Node, hi) == 16);
    assert!(offset_of!(Bvh2Node, right) == 28);
};

impl Bvh2Node {
    /// A node with this box.
    pub fn new(bounds: Aabb, left: u32, right: u32) -> Self {
        Self { lo: bounds.lo, left, hi: bounds.hi, right }
    }

    /// Its box.
    pub fn bounds(&self) -> Aabb {
        Aabb { lo: self.lo, hi: self.hi }
    }
}

/// A binary tree with one triangle, or one reference to a triangle, a leaf, in host memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh2 {
    /// Leaves, then inner nodes; the root is the last. `2 * leaves - 1` nodes.
    pub nodes: Vec<Bvh2Node>,
    /// How many triangles or references; at least one.
    pub leaves: usize,
    /// Consecutive ranges of inner nodes: see the module's text. One may be empty. None where the nodes are in
    /// no order.
    pub levels: Vec<Range<u32>>,
}

impl Bvh2 {
    /// Copies a tree from the device.
    ///
    /// # Errors
    /// A transfer failed.
    pub fn read(from: &Bvh2Buffers, leaves: usize) -> Result<Self, Error> {
        let header = from.header()?;
        let first = &header.first[..=header.levels() as usize];
        Ok(Self {
            nodes: from.nodes.read(0, 2 * leaves - 1)?,
            leaves,
            levels: first.windows(2).map(|w| w[0]..w[1]).collect(),
        })
    }

    /// The inner nodes, children in front of their parents.
    pub fn upwards(&self) -> Vec<u32> {
        let inner = self.leaves as u32..self.nodes.len() as u32;
        if !self.levels.is_empty() {
            return inner.collect();
        }
        // From the root down, then turned around.
        let mut order: Vec<u32> = inner.last().into_iter().collect();
        let mut next = 0;
        while let Some(&index) = order.get(next) {
            let node = self.nodes[index as usize];
            order.extend([node.left, node.right].into_iter().filter(|&c| c as usize >= self.leaves));
            next += 1;
        }
        order.reverse();
        order
    }

    /// The same tree with its inner nodes in levels, by their height, where they were in no order.
    pub fn in_levels(self) -> Self {
        if !self.levels.is_empty() || self.leaves == 1 {
            return self;
        }
        let leaves = self.leaves;
        let mut order = self.upwards();
        let mut heights = vec![0u32; self.nodes.len()];
        for &index in &order {
            let Bvh2Node { left, right, .. } = self.nodes[index as usize];
            heights[index as usize] = 1 + heights[left as usize].max(heights[right as usize]);
        }
        // The root is higher than all others, and so remains the last.
        order.sort_by_key(|&index| (heights[index as usize], index));
        let mut numbers: Vec<u32> = (0..self.nodes.len() as u32).collect();
        order.iter().zip(leaves as u32..).for_each(|(&from, to)| numbers[from as usize] = to);
        let mut nodes = self.nodes[..leaves].to_vec();
        nodes.extend(order.iter().map(|&index| {
            let node = self.nodes[index as usize];
            let [left, right] = [node.left, node.right].map(|child| numbers[child as usize]);
            Bvh2Node { left, right, ..node }
        }));
        let mut levels = Vec::new();
        let mut next = leaves as u32;
        for level in order.chunk_by(|a, b| heights[*a as usize] == heights[*b as usize]) {
            levels.push(next..next + level.len() as u32);
            next += level.len() as u32;
        }
        Self { nodes, leaves, levels }
    }
}

/// `Levels` in `levels.glsl`, without the dispatch arguments at its end.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct LevelsHeader {
    /// Zero while the tree is incomplete; [`UNORDERED`] where there are none.
    pub count: u32,
    pub tail: u32,
    pub leaves: u32,
    pub iterations: u32,
    pub first: [u32; MAX_LEVELS + 1],
}

/// Instead of a number of levels: the nodes are in no order; `UNORDERED` in `levels.glsl`.
const UNORDERED: u32 = u32::MAX;

impl LevelsHeader {
    /// How many levels there are.
    pub fn levels(&self) -> u32 {
        if self.count == UNORDERED { 0 } else { self.count }
    }
}

/// Levels of no more nodes than this, and with none larger above them, are left to one workgroup. `FEW` of PLOC is
/// more; but trees from elsewhere have many small levels on top.
const TAIL_NODES: usize = 1024;

const LEVELS_BYTES: u64 = (size_of::<LevelsHeader>() + 12 * MAX_LEVELS) as u64;

/// A binary tree in device memory, and which of its nodes can be processed together.
#[derive(Debug)]
pub struct Bvh2Buffers {
    /// Of [`Bvh2Node`].
    pub nodes: Buffer,
    /// `Levels` in `levels.glsl`.
    pub levels: Buffer,
}

impl Bvh2Buffers {
    /// Room for a tree of `leaves` leaves.
    ///
    /// # Errors
    /// Too little memory.
    pub fn new(gpu: &Gpu, leaves: usize) -> Result<Self, Error> {
        Ok(Self {
            nodes: gpu.buffer("binary tree", 32 * (2 * leaves as u64 - 1))?,
            levels: Self::levels(gpu, "levels of the binary tree")?,
        })
    }

    /// Room for `Levels` in `levels.glsl`.
    pub(crate) fn levels(gpu: &Gpu, name: &str) -> Result<Buffer, Error> {
        gpu.buffer(name, LEVELS_BYTES)
    }

    /// Copies a tree here. Returns how many of its levels may need more than one workgroup.
    pub(crate) fn write(&self, gpu: &Gpu, tree: &Bvh2) -> Result<u32, Error> {
        let sizes = || tree.levels.iter().map(|level| level.len());
        // Larger ones may lie above smaller ones.
        let tail = sizes().rposition(|size| size > TAIL_NODES).map_or(0, |last| last + 1);
        let mut first = [tree.nodes.len() as u32; MAX_LEVELS + 1];
        first.iter_mut().zip(&tree.levels).for_each(|(first, level)| *first = level.start);
        let header = LevelsHeader {
            count: tree.levels.len() as u32,
            tail: tail as u32,
            leaves: tree.leaves as u32,
            iterations: 0,
            first,
        };
        let size = LEVEL_WORKGROUP.min(gpu.info().max_workgroup_size) as usize;
        let mut words: Vec<u32> = bytemuck::cast_slice(&[header]).to_vec();
        words.extend(sizes().take(tail).flat_map(|nodes| [nodes.div_ceil(size) as u32, 1, 1]));
        words.resize(LEVELS_BYTES as usize / 4, 0);
        self.nodes.write(&tree.nodes)?;
        self.levels.write(&words)?;
        Ok(tail as u32)
    }

    /// Which levels there are.
    pub(crate) fn header(&self) -> Result<LevelsHeader, Error> {
        Ok(self.levels.read(0, 1)?[0])
    }

    /// Byte offset in `levels` of the dispatch arguments of a level.
    pub(crate) fn arguments(level: u32) -> u64 {
        size_of::<LevelsHeader>() as u64 + 12 * u64::from(level)
    }
}
