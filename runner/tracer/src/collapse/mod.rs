//! Merges leaves where that lowers the expected cost: one triangle a leaf → up to sixteen.
//!
//! Bottom up, each inner node N of the binary tree chooses the cheaper of staying inner and becoming a leaf
//! of all its n triangles (Meister and Bittner 2018; thesis 1.2.2, 4.1):
//!
//! ```text
//! C(N) = min( c_t SA(N) + C(left) + C(right),   c_i SA(N) n   if n <= max_leaf )
//! ```
//!
//! The binary tree itself stays as it is; what was decided, and what the layouts need to know of a subtree
//! before they place it, is one [`Subtree`] for each inner node. The root always stays inner, because every
//! layout keeps a child's box in its parent.

use crate::{
    bvh2::{Bvh2Buffers, MAX_TRIANGLES},
    gpu::{Buffer, Error, Gpu, Pass, shaders},
    upwards::Upwards,
};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use std::mem::offset_of;

pub mod cpu;

/// The costs that decide what is merged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CollapseParams {
    /// c_t: what visiting an inner node costs. Larger than `intersection_cost`: larger leaves.
    #[serde(rename = "c_t")]
    pub traversal_cost: f32,
    /// c_i: what testing one triangle costs.
    #[serde(rename = "c_i")]
    pub intersection_cost: f32,
    /// Most triangles a leaf; 1 keeps every leaf apart, 16 is what the layouts can express.
    pub max_leaf: u32,
    /// Whether every subtree of up to `max_leaf` triangles becomes a leaf, whatever that costs (Lewis 2024, 3.1). No
    /// parameter: it belongs to [`crate::midpoint`].
    #[serde(skip)]
    pub by_size: bool,
}

impl Default for CollapseParams {
    fn default() -> Self {
        Self { traversal_cost: 2.0, intersection_cost: 2.0, max_leaf: 16, by_size: false }
    }
}

/// What the collapse knows about an inner node of the binary tree; `Subtree` in `collapse.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Subtree {
    /// Expected cost, in units of the scaled half area: divide by the root's for a cost a ray.
    pub cost: f32,
    /// Triangles below it.
    pub triangles: u32,
    /// Inner nodes below it and itself, after the collapse; 0 if it became a leaf.
    pub inner: u32,
    /// Inner nodes on the longest way down, itself included; 0 if it became a leaf.
    pub height: u16,
    /// The same before the collapse: a leaf of one triangle has 0, its parent 1 or more.
    pub levels: u16,
}

const _: () = {
    assert!(size_of::<Subtree>() == 16 && offset_of!(Subtree, triangles) == 4);
    assert!(offset_of!(Subtree, inner) == 8 && offset_of!(Subtree, height) == 12);
    assert!(offset_of!(Subtree, levels) == 14);
    assert!(MAX_TRIANGLES <= 1 << 27);
};

/// The kernel, compiled.
#[derive(Debug)]
pub struct Collapse {
    kernel: Upwards,
    costs: Costs,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    nodes: u64,
    levels: u64,
    subtrees: u64,
    bounds: u64,
    costs: Costs,
    level: u32,
}

/// The same as the parameters but for `by_size`, as `Costs` in `collapse.glsl` has them.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Costs {
    pub traversal: f32,
    pub intersection: f32,
    pub max_leaf: u32,
}

impl From<&CollapseParams> for Costs {
    fn from(params: &CollapseParams) -> Self {
        let &CollapseParams { traversal_cost, intersection_cost, max_leaf, by_size: _ } = params;
        assert!((1..=16).contains(&max_leaf), "a leaf has 1 to 16 triangles, not {max_leaf}");
        Self { traversal: traversal_cost, intersection: intersection_cost, max_leaf }
    }
}

impl Collapse {
    /// Compiles the kernel.
    ///
    /// # Errors
    /// The driver's compiler failed.
    ///
    /// # Panics
    /// `max_leaf` is not in 1 to 16.
    pub fn new(gpu: &Gpu, params: &CollapseParams) -> Result<Self, Error> {
        let kernel = Upwards::new(gpu, &shaders::COLLAPSE_COLLAPSE, &[params.by_size.into()])?;
        Ok(Self { kernel, costs: params.into() })
    }

    /// Allocates the subtrees of a tree of `leaves` leaves.
    ///
    /// # Errors
    /// Too little memory.
    pub fn buffer(gpu: &Gpu, leaves: usize) -> Result<Buffer, Error> {
        gpu.buffer("subtrees", 16 * (leaves as u64 - 1))
    }

    /// Decides about every node; `large_levels` of the tree may need more than one workgroup.
    pub fn record(
        &self,
        pass: &mut Pass,
        tree: &Bvh2Buffers,
        bounds: &Buffer,
        subtrees: &Buffer,
        large_levels: u32,
    ) {
        self.kernel.record(pass, &tree.levels, large_levels, |level| Push {
            nodes: tree.nodes.address(),
            levels: tree.levels.address(),
            subtrees: subtrees.address(),
            bounds: bounds.address(),
            costs: self.costs,
            level,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::interface::{Module, fields};

    #[test]
    fn the_shader_sees_arguments_as_the_host_does() {
        Module::read(&shaders::COLLAPSE_COLLAPSE)
            .assert_push_constants(
                size_of::<Push>(),
                &fields!(Push: nodes, levels, subtrees, bounds, costs, level),
            )
            .assert_items("Subtrees", size_of::<Subtree>(), None)
            .assert_specialization(1, "BY_SIZE");
    }
}
