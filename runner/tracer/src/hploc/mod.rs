//! Hierarchical PLOC (Benthin, Meister, Barczak, Mehalwal, Tsakok, Kensler 2024): a binary tree from the bottom up, in a
//! single launch.
//!
//! Where [`crate::ploc`] clusters all of the curve at once, an iteration a launch, this goes up the radix hierarchy of
//! the Morton codes and clusters each of its nodes on its own, as soon as both halves are done:
//!
//! ```text
//! codes      000 001 | 010 011 || 100 | 101 110 …     the higher the bit in which neighbours differ, the later
//!             a   b     c   d      e                   they meet
//!
//!   left half, at most W/2 clusters      right half, at most W/2
//!   [ ab  cd ]                           [ e  fg  h ]
//!        \______________ a window of W ______________/
//!        [ ab  cd  e  fg  h ]     nearest neighbours merge, as in PLOC, until W/2 or fewer are left; one at the root
//! ```
//!
//! An invocation climbs from each leaf. Two meet at each node of the hierarchy: the earlier one leaves a note and ends,
//! the later one goes on. So nobody waits, and no progress of others has to be promised. Ranges of at most W/2 leaves
//! need no clustering; from there on all invocations of the subgroup cluster a range together. What the collapse
//! decides about a node follows from its children, so it is decided when the node is made ([`crate::collapse`]).
//!
//! Which clusters meet follows from the codes alone, not from who comes first. So does where a node is stored: each leaf
//! brings a number along, a node takes the first of those that its window has, and number 0, that of the first leaf, is
//! kept for the root. Hence the tree is the same on every device, whatever the size of its subgroups, down to the
//! places of its nodes; but it has no levels ([`crate::bvh2`]).
//!
//! We leave the paper in four points. There the window is as wide as a subgroup; here it is a parameter, and a lane has
//! several of its clusters where subgroups are smaller. Nodes get their places from a counter there, which half a
//! million small ranges would crowd around. Of neighbours that make boxes of
//! equal area the nearer is taken, and of two equally near ones that of the pair that begins at an even slot, so that
//! rows of identical boxes halve at once. And where a cluster has [`PATIENCE`] levels, the clusters 2k
//! and 2k + 1 of its window merge whatever their boxes, so that no input makes a tree of more than
//! [`crate::bvh2::MAX_LEVELS`].

use crate::{
    bvh2::Bvh2Buffers,
    collapse::{CollapseParams, Costs},
    gpu::{Buffer, Error, Gpu, Kernel, Pass, groups, shaders},
};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

pub mod cpu;

/// What may be chosen about the clustering.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HplocParams {
    /// How far along a window a cluster looks for its neighbour, to either side; 1 to 64.
    ///
    /// On an H100, 4, 8, 16 take 0.67, 0.89, 1.43 ms for bistro_exterior, and Wide8 trees have an SAH cost of 70.8, 69.6,
    /// 69.2.
    pub radius: u32,
    /// Clusters that are looked at together, an even number from 4 to 64. More make a better tree, and take more
    /// iterations; more than a subgroup has lanes take several turns.
    pub window: u32,
}

impl Default for HplocParams {
    fn default() -> Self {
        Self { radius: 8, window: 32 }
    }
}

/// Levels above which a cluster is no longer merged by its box.
///
/// A window adds up to 31 levels, a forced one 1 for each halving, and the radix hierarchy has at most 63 + 27 nodes
/// above each other.
const PATIENCE: u16 = 128;

/// The kernels, compiled.
#[derive(Debug)]
pub struct Hploc {
    leaves: Kernel,
    climb: Kernel,
    costs: Costs,
}

/// Memory that the clustering needs besides the tree.
#[derive(Debug)]
pub struct HplocBuffers {
    /// A word for each boundary between two leaves.
    visits: Buffer,
    /// Two words for each leaf.
    clusters: Buffer,
}

/// Invocations of a workgroup that writes leaves.
const LEAVES_WORKGROUP: u32 = 256;

/// Invocations of a workgroup that climbs. Small, because it ends only when the last one does.
const WORKGROUP: u32 = 64;

/// Shared memory of a workgroup, and what a slot of a window takes.
const SHARED_BYTES: u32 = 16 << 10;
const SLOT_BYTES: u32 = 52;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LeavesPush {
    triangles: u64,
    order: u64,
    nodes: u64,
    visits: u64,
    levels: u64,
    count: u32,
    pad: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ClimbPush {
    nodes: u64,
    keys: u64,
    visits: u64,
    clusters: u64,
    subtrees: u64,
    bounds: u64,
    costs: Costs,
    count: u32,
}

impl Hploc {
    /// Compiles the kernels for keys of `words` 32-bit words.
    ///
    /// # Errors
    /// The driver's compiler failed.
    ///
    /// # Panics
    /// A parameter is out of its documented range.
    pub fn new(
        gpu: &Gpu,
        params: &HplocParams,
        collapse: &CollapseParams,
        words: u32,
    ) -> Result<Self, Error> {
        let &HplocParams { radius, window } = params;
        assert!((1..=64).contains(&radius), "the radius is 1 to 64, not {radius}");
        assert!(
            window.is_multiple_of(2) && (4..=64).contains(&window),
            "a window is even, 4 to 64, not {window}"
        );
        let info = gpu.info();
        let (lanes, most) = (info.subgroup_size, info.max_workgroup_size);
        // Mesa's CPU driver makes all subgroups of a workgroup wait where one has a barrier of its own, and lets go of
        // them when one has ended: there a workgroup has one.
        let wanted = if info.hands_work_over() { WORKGROUP.min(most) / lanes } else { 1 };
        let subgroups = wanted.min(SHARED_BYTES / (SLOT_BYTES * window)).max(1);
        let constants = [radius, window, words, lanes, subgroups];
        Ok(Self {
            leaves: Kernel::new(gpu, &shaders::HPLOC_LEAVES, LEAVES_WORKGROUP.min(most), &[])?,
            climb: Kernel::new(gpu, &shaders::HPLOC_CLIMB, lanes * subgroups, &constants)?,
            costs: collapse.into(),
        })
    }

    /// Allocates for up to `count` triangles.
    ///
    /// # Errors
    /// Too little memory.
    pub fn buffers(gpu: &Gpu, count: usize) -> Result<HplocBuffers, Error> {
        let count = count as u64;
        Ok(HplocBuffers {
            visits: gpu.buffer("visits of the climb", 4 * count)?,
            clusters: gpu.buffer("clusters", 8 * count)?,
        })
    }

    /// Records the tree and its collapse: `keys` and `order` are those of the `count` triangles along the curve.
    #[expect(clippy::too_many_arguments, reason = "what a tree is made of, and what it becomes")]
    pub fn record(
        &self,
        pass: &mut Pass,
        triangles: &Buffer,
        count: usize,
        (keys, order): (&Buffer, &Buffer),
        bounds: &Buffer,
        tree: &Bvh2Buffers,
        subtrees: &Buffer,
        buffers: &HplocBuffers,
    ) {
        let all = u32::try_from(count).expect("at most MAX_TRIANGLES");
        let push = LeavesPush {
            triangles: triangles.address(),
            order: order.address(),
            nodes: tree.nodes.address(),
            visits: buffers.visits.address(),
            levels: tree.levels.address(),
            count: all,
            pad: 0,
        };
        pass.dispatch("leaves", &self.leaves, &push, groups(count, self.leaves.workgroup_size()));
        // A lone triangle has nobody to meet.
        if count > 1 {
            let push = ClimbPush {
                nodes: tree.nodes.address(),
                keys: keys.address(),
                visits: buffers.visits.address(),
                clusters: buffers.clusters.address(),
                subtrees: subtrees.address(),
                bounds: bounds.address(),
                costs: self.costs,
                count: all,
            };
            pass.dispatch("climb", &self.climb, &push, groups(count, self.climb.workgroup_size()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bvh2::Bvh2Node,
        collapse::Subtree,
        gpu::interface::{Module, fields},
    };

    #[test]
    fn shaders_see_arguments_as_the_host_does() {
        let node = size_of::<Bvh2Node>();
        Module::read(&shaders::HPLOC_LEAVES)
            .assert_push_constants(
                size_of::<LeavesPush>(),
                &fields!(LeavesPush: triangles, order, nodes, visits, levels, count),
            )
            .assert_items("Bvh2Nodes", node, None);
        Module::read(&shaders::HPLOC_CLIMB)
            .assert_push_constants(
                size_of::<ClimbPush>(),
                &fields!(ClimbPush: nodes, keys, visits, clusters, subtrees, bounds, costs, count),
            )
            .assert_items("Nodes", node, None)
            .assert_items("Clusters", 8, None)
            .assert_items("Subtrees", size_of::<Subtree>(), None);
    }
}
