//! Passes up the binary tree: a kernel that visits every inner node, children before their parents.
//!
//! Large levels have a dispatch each, whose size the tree's own header says; the small ones above them are done by
//! one workgroup that waits for itself after each (`upwards.glsl`).
//!
//! A tree without levels gets some first, [`Heights`]: its nodes are listed by their heights, which the collapse knows.

use crate::{
    bvh2::{Bvh2Buffers, MAX_LEVELS},
    gpu::{Buffer, Error, Gpu, Kernel, Pass, Shader, groups, shaders},
    ploc::{LEVEL_WORKGROUP, TAIL_WORKGROUP},
};
use bytemuck::{Pod, Zeroable};

/// Instead of a level: all small levels in one workgroup; `TAIL` in `levels.glsl`.
const TAIL: u32 = u32::MAX;

/// A kernel that goes up, compiled for both sizes of workgroup.
#[derive(Debug)]
pub(crate) struct Upwards {
    level: Kernel,
    tail: Kernel,
}

impl Upwards {
    /// Compiles it.
    ///
    /// # Errors
    /// The driver's compiler failed.
    pub fn new(gpu: &Gpu, shader: &'static Shader, constants: &[u32]) -> Result<Self, Error> {
        let most = gpu.info().max_workgroup_size;
        let kernel = |size: u32| Kernel::new(gpu, shader, size.min(most), constants);
        Ok(Self { level: kernel(LEVEL_WORKGROUP)?, tail: kernel(TAIL_WORKGROUP)? })
    }

    /// Visits every node; the first `large_levels` of `levels` may need more than one workgroup. `push` makes the push
    /// constants for a value of `level`.
    pub fn record<P: Pod>(
        &self,
        pass: &mut Pass,
        levels: &Buffer,
        large_levels: u32,
        push: impl Fn(u32) -> P,
    ) {
        for level in 0..large_levels {
            let arguments = Bvh2Buffers::arguments(level);
            pass.dispatch_indirect("level", &self.level, &push(level), levels, arguments);
        }
        pass.dispatch("tail", &self.tail, &push(TAIL), 1);
    }
}

/// Lists the nodes of a tree without levels by their heights.
#[derive(Debug)]
pub(crate) struct Heights {
    count: Kernel,
    scan: Kernel,
    place: Kernel,
    level_group: u32,
}

/// A tree's nodes by their heights.
#[derive(Debug)]
pub(crate) struct ByHeight {
    /// `Levels` in `levels.glsl`, of places in `order` as if the leaves were in front of it.
    pub levels: Buffer,
    /// The inner nodes.
    pub order: Buffer,
    cursors: Buffer,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct HeightsPush {
    tree: u64,
    subtrees: u64,
    levels: u64,
    order: u64,
    cursors: u64,
    level_group: u32,
    most_large: u32,
}

impl Heights {
    /// Levels that get a dispatch each, if they are large; the tail does the rest, however large.
    pub const LARGE_LEVELS: u32 = 48;

    const WORKGROUP: u32 = 256;
    const COUNTING_GROUPS: u32 = 1024;

    /// Compiles the kernels.
    ///
    /// # Errors
    /// The driver's compiler failed.
    pub fn new(gpu: &Gpu) -> Result<Self, Error> {
        let most = gpu.info().max_workgroup_size;
        let kernel = |shader| Kernel::new(gpu, shader, Self::WORKGROUP.min(most), &[]);
        Ok(Self {
            count: kernel(&shaders::UPWARDS_COUNT)?,
            scan: kernel(&shaders::UPWARDS_SCAN)?,
            place: kernel(&shaders::UPWARDS_PLACE)?,
            level_group: LEVEL_WORKGROUP.min(most),
        })
    }

    /// Allocates for trees of up to `leaves` leaves.
    ///
    /// # Errors
    /// Too little memory.
    pub fn buffers(gpu: &Gpu, leaves: usize) -> Result<ByHeight, Error> {
        Ok(ByHeight {
            levels: Bvh2Buffers::levels(gpu, "levels by height")?,
            order: gpu.buffer("nodes by height", 4 * (leaves as u64 - 1))?,
            cursors: gpu.buffer("nodes of each height", 4 * MAX_LEVELS as u64)?,
        })
    }

    /// Lists the nodes of a tree of up to `leaves` leaves.
    pub fn record(
        &self,
        pass: &mut Pass,
        tree: &Bvh2Buffers,
        subtrees: &Buffer,
        leaves: usize,
        to: &ByHeight,
    ) {
        pass.fill(&to.cursors, 0);
        let push = HeightsPush {
            tree: tree.levels.address(),
            subtrees: subtrees.address(),
            levels: to.levels.address(),
            order: to.order.address(),
            cursors: to.cursors.address(),
            level_group: self.level_group,
            most_large: Self::LARGE_LEVELS,
        };
        let all = groups(leaves, self.place.workgroup_size());
        pass.dispatch("count", &self.count, &push, all.min(Self::COUNTING_GROUPS));
        pass.dispatch("scan", &self.scan, &push, 1);
        pass.dispatch("place", &self.place, &push, all);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::interface::{Module, fields};

    #[test]
    fn shaders_see_arguments_as_the_host_does() {
        let push = fields!(HeightsPush: tree, subtrees, levels, order, cursors, level_group, most_large);
        for shader in [&shaders::UPWARDS_COUNT, &shaders::UPWARDS_SCAN, &shaders::UPWARDS_PLACE] {
            Module::read(shader).assert_push_constants(size_of::<HeightsPush>(), &push);
        }
    }
}
