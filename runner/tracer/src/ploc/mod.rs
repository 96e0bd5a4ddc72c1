//! Parallel locally-ordered clustering, PLOC++ (Benthin, Drabinski, Tessari, Dittebrandt 2022): a binary
//! tree from the bottom up.
//!
//! Every triangle starts as a cluster; clusters lie in a row, in Morton order. An iteration finds each
//! one's neighbour, merges the pairs that choose each other, and closes the gaps:
//!
//! ```text
//! clusters     a    b    c    d    e    f    g
//! neighbour    b    a    b    e    d    g    e        the one within the radius to either side
//!              \----/         \----/                  with the least area of the box around both
//! next         ab   c    de   f    g                  node ab = (a, b), node de = (d, e)
//! ```
//!
//! Two dispatches an iteration: `nearest.comp` finds partners and counts what each block will keep,
//! `merge.comp` adds up the counts of the blocks before its own and writes nodes and clusters. Their
//! workgroup counts come from the GPU, so the host records a number of iterations and reads nothing back.
//! When one workgroup can hold all clusters, `tail.comp` does the rest in shared memory.
//!
//! We leave the paper in three points. There a single kernel makes an iteration by letting workgroups wait
//! for the sums of earlier ones, which Vulkan does not promise to work. Of equally near neighbours the one
//! with the least `own ^ other` is taken, so that rows of identical boxes halve at once. And [`Step`] bounds
//! the number of iterations for any input.

use crate::{
    bvh2::{Bvh2Buffers, MAX_LEVELS},
    gpu::{Buffer, Error, Gpu, Kernel, Pass, groups, shaders},
};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

pub mod cpu;

/// What may be chosen about the clustering.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlocParams {
    /// How far along the row a cluster looks for its neighbour, to either side; 1 to 64.
    ///
    /// The cost of `nearest.comp` grows in proportion. On sponza 4, 8, 16, 32 give an SAH cost of 136.2,
    /// 133.0, 130.6, 128.3; from 8 to 16 it falls by 0.4 to 1.8% on sponza, kitchen and both bistros.
    pub radius: u32,
}

impl Default for PlocParams {
    fn default() -> Self {
        Self { radius: 8 }
    }
}

/// Where the clustering stands, and the rule that bounds its iterations.
///
/// Mutual pairs can be rare: in a nest of boxes each smaller than the next, every one's best neighbour is
/// the next smaller, and only the innermost two agree. So an iteration that removes less than one cluster
/// in 64 is followed by a forced one, in which clusters 2k and 2k + 1 merge whatever their boxes; and after
/// 128 iterations every second one is forced. Ordinary scenes meet neither. They lose a third of their
/// clusters at first and a tenth later, and need 60 to 100 iterations for a few million triangles; when a
/// few hundred clusters are left they may lose less, but bad pairs would cost most there, hence the first
/// rule holds only above 1024. The second bounds the iterations for 2^27 triangles to 128 + 2 * 27, which
/// [`MAX_LEVELS`] can hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Iterations done.
    pub done: u32,
    /// Clusters left.
    pub clusters: usize,
    /// Whether the next iteration merges 2k with 2k + 1.
    pub forced: bool,
}

impl Step {
    const SMALL: usize = 1024;
    const PATIENCE: u32 = 128;

    /// Before the first iteration.
    pub fn first(clusters: usize) -> Self {
        Self { done: 0, clusters, forced: false }
    }

    /// After an iteration that left so many clusters; `step_after` in `ploc.glsl`.
    #[must_use]
    pub fn after(self, clusters: usize) -> Self {
        let done = self.done + 1;
        let stuck = clusters > Self::SMALL && clusters > self.clusters - self.clusters / 64;
        Self { done, clusters, forced: !self.forced && (stuck || done >= Self::PATIENCE) }
    }
}

/// The kernels, compiled.
#[derive(Debug)]
pub struct Ploc {
    leaves: Kernel,
    nearest: Kernel,
    merge: Kernel,
    tail: Kernel,
    radius: u32,
    level_group: u32,
}

/// Memory that the clustering needs besides the tree.
#[derive(Debug)]
pub struct PlocBuffers {
    /// Clusters of even and of odd iterations.
    clusters: [Buffer; 2],
    partners: Buffer,
    block_counts: Buffer,
    /// Zeroed at the start: `State` in `ploc.glsl`, then the superblocks' counts of even and odd steps.
    state: Buffer,
    supers: [u64; 2],
}

/// Words of `State` in `ploc.glsl`.
const STATE_WORDS: usize = 1 + 2 * (MAX_LEVELS + 1) + 3 * (MAX_LEVELS + 1);
const ARGUMENTS_WORD: usize = 1 + 2 * (MAX_LEVELS + 1);
const SUPERBLOCK: u32 = 32;

/// Invocations a workgroup wants; `tail.comp` starts when this many clusters are left. Twice as many would
/// not fit 32 KiB of shared memory with a large radius.
const WORKGROUP: u32 = 512;

/// Nodes that a workgroup takes where later stages process a level by a dispatch.
pub(crate) const LEVEL_WORKGROUP: u32 = 256;

/// Invocations of the one workgroup that processes all small levels, which have a few hundred nodes each.
pub(crate) const TAIL_WORKGROUP: u32 = 512;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LeavesPush {
    triangles: u64,
    order: u64,
    nodes: u64,
    state: u64,
    levels: u64,
    count: u32,
    pad: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct NearestPush {
    nodes: u64,
    clusters: u64,
    partners: u64,
    block_counts: u64,
    super_counts: u64,
    next_super_counts: u64,
    state: u64,
    bounds: u64,
    step: u32,
    pad: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct MergePush {
    nodes: u64,
    clusters: u64,
    next_clusters: u64,
    partners: u64,
    block_counts: u64,
    super_counts: u64,
    state: u64,
    levels: u64,
    step: u32,
    level_group: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct TailPush {
    nodes: u64,
    clusters: [u64; 2],
    state: u64,
    levels: u64,
    bounds: u64,
}

impl Ploc {
    /// Compiles the kernels.
    ///
    /// # Errors
    /// The driver's compiler failed.
    ///
    /// # Panics
    /// The radius is not in 1 to 64.
    pub fn new(gpu: &Gpu, params: &PlocParams) -> Result<Self, Error> {
        assert!((1..=64).contains(&params.radius), "the radius is 1 to 64, not {}", params.radius);
        let size = WORKGROUP.min(gpu.info().max_workgroup_size);
        let radius = [params.radius];
        Ok(Self {
            leaves: Kernel::new(gpu, &shaders::PLOC_LEAVES, size, &radius)?,
            nearest: Kernel::new(gpu, &shaders::PLOC_NEAREST, size, &radius)?,
            merge: Kernel::new(gpu, &shaders::PLOC_MERGE, size, &radius)?,
            tail: Kernel::new(gpu, &shaders::PLOC_TAIL, size, &radius)?,
            radius: params.radius,
            level_group: LEVEL_WORKGROUP.min(gpu.info().max_workgroup_size),
        })
    }

    /// Allocates for up to `count` triangles.
    ///
    /// # Errors
    /// Too little memory.
    pub fn buffers(&self, gpu: &Gpu, count: usize) -> Result<PlocBuffers, Error> {
        let blocks = groups(count, self.own());
        let supers = u64::from(blocks.div_ceil(SUPERBLOCK));
        let words = STATE_WORDS as u64 + 2 * supers;
        let state = gpu.buffer("clustering state", 4 * words)?;
        let first_supers = state.address() + 4 * STATE_WORDS as u64;
        let indices = 4 * count as u64;
        Ok(PlocBuffers {
            clusters: [gpu.buffer("even clusters", indices)?, gpu.buffer("odd clusters", indices)?],
            partners: gpu.buffer("partners", indices)?,
            block_counts: gpu.buffer("block counts", 4 * u64::from(blocks))?,
            supers: [first_supers, first_supers + 4 * supers],
            state,
        })
    }

    /// Clusters that a workgroup decides about; `OWN` in `ploc.glsl`.
    fn own(&self) -> u32 {
        self.nearest.workgroup_size() - 2 * self.radius
    }

    /// Clusters that the tail can take over; sizes around it and around [`Ploc::block`] deserve tests.
    pub fn tail(&self) -> usize {
        self.nearest.workgroup_size() as usize
    }

    /// Clusters a block.
    pub fn block(&self) -> usize {
        self.own() as usize
    }

    /// Iterations to record for `count` triangles of which nothing is known: more than most scenes need.
    ///
    /// One that is not needed costs empty dispatches, here and in the stages that go level by level; if
    /// these are too few, the host records more.
    pub fn iterations(&self, count: usize) -> u32 {
        let factor = (count as f64 / self.tail() as f64).max(1.0);
        ((9.0 * factor.ln()).ceil() as u32).min(MAX_LEVELS as u32)
    }

    /// Records the leaves, which start the tree afresh.
    pub fn record_leaves(
        &self,
        pass: &mut Pass,
        triangles: &Buffer,
        count: usize,
        order: &Buffer,
        tree: &Bvh2Buffers,
        buffers: &PlocBuffers,
    ) {
        pass.fill(&buffers.state, 0);
        pass.fill(&tree.levels, 0);
        let push = LeavesPush {
            triangles: triangles.address(),
            order: order.address(),
            nodes: tree.nodes.address(),
            state: buffers.state.address(),
            levels: tree.levels.address(),
            count: u32::try_from(count).expect("at most MAX_TRIANGLES"),
            pad: 0,
        };
        pass.dispatch("leaves", &self.leaves, &push, groups(count, self.leaves.workgroup_size()));
    }

    /// Records the iterations `steps` and the tail. The tree is complete if so many were enough:
    /// then `levels.count` is no longer 0 (or there is one triangle).
    pub fn record(
        &self,
        pass: &mut Pass,
        tree: &Bvh2Buffers,
        bounds: &Buffer,
        buffers: &PlocBuffers,
        steps: std::ops::Range<u32>,
    ) {
        for step in steps {
            let (now, next) = ((step % 2) as usize, ((step + 1) % 2) as usize);
            let arguments = 4 * ARGUMENTS_WORD as u64 + 12 * u64::from(step);
            let push = NearestPush {
                nodes: tree.nodes.address(),
                clusters: buffers.clusters[now].address(),
                partners: buffers.partners.address(),
                block_counts: buffers.block_counts.address(),
                super_counts: buffers.supers[now],
                next_super_counts: buffers.supers[next],
                state: buffers.state.address(),
                bounds: bounds.address(),
                step,
                pad: 0,
            };
            pass.dispatch_indirect("nearest", &self.nearest, &push, &buffers.state, arguments);
            let push = MergePush {
                nodes: tree.nodes.address(),
                clusters: buffers.clusters[now].address(),
                next_clusters: buffers.clusters[next].address(),
                partners: buffers.partners.address(),
                block_counts: buffers.block_counts.address(),
                super_counts: buffers.supers[now],
                state: buffers.state.address(),
                levels: tree.levels.address(),
                step,
                level_group: self.level_group,
            };
            pass.dispatch_indirect("merge", &self.merge, &push, &buffers.state, arguments);
        }
        let push = TailPush {
            nodes: tree.nodes.address(),
            clusters: [buffers.clusters[0].address(), buffers.clusters[1].address()],
            state: buffers.state.address(),
            levels: tree.levels.address(),
            bounds: bounds.address(),
        };
        pass.dispatch("tail", &self.tail, &push, 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bvh2::{Bvh2Node, LevelsHeader},
        gpu::interface::{Field, Module, fields},
    };

    #[test]
    fn shaders_see_arguments_as_the_host_does() {
        let node = size_of::<Bvh2Node>();
        Module::read(&shaders::PLOC_LEAVES)
            .assert_push_constants(
                size_of::<LeavesPush>(),
                &fields!(LeavesPush: triangles, order, nodes, state, levels, count),
            )
            .assert_items("Bvh2Nodes", node, None);
        Module::read(&shaders::PLOC_NEAREST).assert_push_constants(
            size_of::<NearestPush>(),
            &fields!(NearestPush: nodes, clusters, partners, block_counts, super_counts, next_super_counts,
                state, bounds, step),
        );
        let mut levels = fields!(LevelsHeader: count, tail, leaves, iterations, first);
        let end = size_of::<LevelsHeader>();
        levels.push(Field { name: "arguments", offset: end, size: 12 * MAX_LEVELS });
        Module::read(&shaders::PLOC_MERGE)
            .assert_push_constants(
                size_of::<MergePush>(),
                &fields!(MergePush: nodes, clusters, next_clusters, partners, block_counts, super_counts,
                    state, levels, step, level_group),
            )
            .assert_block("Levels", &levels);
        Module::read(&shaders::PLOC_TAIL)
            .assert_push_constants(
                size_of::<TailPush>(),
                &fields!(TailPush: nodes, clusters, state, levels, bounds),
            )
            .assert_items("Bvh2Nodes", node, None);
    }

    #[test]
    fn iterations_stay_below_the_number_of_levels_however_slow_the_clustering() {
        for lost in [0.0, 0.015, 0.016, 0.1] {
            let mut step = Step::first(1 << 27);
            while step.clusters > 1 {
                let left = if step.forced {
                    step.clusters.div_ceil(2)
                } else {
                    // At least one pair is always mutual.
                    (step.clusters - (step.clusters as f64 * lost) as usize).min(step.clusters - 1)
                };
                step = step.after(left);
            }
            assert!((step.done as usize) < MAX_LEVELS, "{} iterations at {lost}", step.done);
        }
    }
}
