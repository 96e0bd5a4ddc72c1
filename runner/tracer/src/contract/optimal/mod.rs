//! The contraction of least SAH cost (Ylitie et al. 2017, 3.4): which boxes share a node and which triangles a leaf,
//! decided together.
//!
//! The cost of a wide tree is that of its nodes and of the triangles in its leaves (equation 4), each times the area
//! of its box. Bottom up, each node n of the binary tree learns the least cost C(n, i) of its whole subtree as a forest
//! of at most i wide trees (equations 5 to 8):
//!
//! ```text
//! C(n, 1) = min( A(n) P(n) c_prim  if P(n) <= P_max,  D(n, arity) + A(n) c_node )      a leaf, or a wide node
//! C(n, i) = min( D(n, i), C(n, i - 1) )                                               two trees or more, or fewer
//! D(n, j) = min over 0 < k < j of C(left, k) + C(right, j - k)
//! ```
//!
//! Costs and decisions are the node's plan, `arity` words:
//!
//! ```text
//! C(n, 1) … C(n, arity - 1)   decisions   1…011 010 001 000 001 001 000
//!                                         |  '-'                 '-'
//!                                         |   |                   k of D(n, 2), 0 where C(n, 1) is as good
//!                                         |   k of D(n, 8): three of a wide node's eight children at most
//!                                         |   lie below the left child
//!                                         as a single tree it is a leaf
//! ```
//!
//! Going down from the root by these decisions, `contract.glsl` finds each wide node's children. The collapse has no
//! say; only its numbers of triangles are used.

use super::Input;
use crate::{
    gpu::{Buffer, Error, Gpu, Pass, shaders},
    upwards::{ByHeight, Heights, Upwards},
};
use bytemuck::{Pod, Zeroable};

pub mod cpu;

/// What visits and tests cost: `c_node`, `c_prim` and P_max of the paper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// Of visiting a node.
    pub node: f32,
    /// Of testing one triangle.
    pub triangle: f32,
    /// Most triangles a leaf.
    pub max_leaf: u32,
}

/// The kernel that plans, compiled for one arity.
#[derive(Debug)]
pub(super) struct Planner {
    kernel: Upwards,
    heights: Heights,
    arity: usize,
    costs: Costs,
}

/// What is planned, in device memory.
#[derive(Debug)]
pub(super) struct Plans {
    pub plans: Buffer,
    /// Of trees without levels.
    by_height: ByHeight,
    leaves: usize,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    nodes: u64,
    levels: u64,
    subtrees: u64,
    bounds: u64,
    plans: u64,
    order: u64,
    node_cost: f32,
    triangle_cost: f32,
    max_leaf: u32,
    level: u32,
}

impl Planner {
    pub fn new(gpu: &Gpu, arity: usize, costs: Costs) -> Result<Self, Error> {
        let kernel = Upwards::new(gpu, shaders::contract_optimal_costs(arity), &[])?;
        Ok(Self { kernel, heights: Heights::new(gpu)?, arity, costs })
    }

    /// Allocates plans for trees of up to `leaves` leaves.
    pub fn buffers(&self, gpu: &Gpu, leaves: usize) -> Result<Plans, Error> {
        let plans = gpu.buffer("plans of a contraction", 4 * (self.arity * (leaves - 1)) as u64)?;
        Ok(Plans { plans, by_height: Heights::buffers(gpu, leaves)?, leaves })
    }

    /// Plans for every inner node.
    pub fn record(&self, pass: &mut Pass, input: &Input<'_>, to: &Plans) {
        let Costs { node, triangle, max_leaf } = self.costs;
        let Plans { plans, by_height, leaves } = to;
        let (levels, order, large) = match input.large_levels {
            Some(large) => (&input.tree.levels, 0, large),
            None => {
                self.heights.record(pass, input.tree, input.subtrees, *leaves, by_height);
                (&by_height.levels, by_height.order.address(), Heights::LARGE_LEVELS)
            }
        };
        self.kernel.record(pass, levels, large, |level| Push {
            nodes: input.tree.nodes.address(),
            levels: levels.address(),
            order,
            subtrees: input.subtrees.address(),
            bounds: input.bounds.address(),
            plans: plans.address(),
            node_cost: node,
            triangle_cost: triangle,
            max_leaf,
            level,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::interface::{Module, fields};

    #[test]
    fn shaders_see_arguments_as_the_host_does() {
        let push = fields!(Push: nodes, levels, subtrees, bounds, plans, order, node_cost, triangle_cost, max_leaf, level);
        for &arity in crate::permutations::ARITIES {
            Module::read(shaders::contract_optimal_costs(arity))
                .assert_push_constants(size_of::<Push>(), &push)
                .assert_items("Plans", 4, None);
        }
    }
}
