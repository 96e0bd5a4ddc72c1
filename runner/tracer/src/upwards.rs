//! Passes up the binary tree: a kernel that visits every inner node, children before their parents.
//!
//! Large levels have a dispatch each, whose size the tree's own header says; the small ones above them are done by
//! one workgroup that waits for itself after each (`upwards.glsl`).

use crate::{
    bvh2::Bvh2Buffers,
    gpu::{Error, Gpu, Kernel, Pass, Shader},
    ploc::{LEVEL_WORKGROUP, TAIL_WORKGROUP},
};
use bytemuck::Pod;

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

    /// Visits every node; the first `large_levels` of the tree may need more than one workgroup. `push` makes the
    /// push constants for a value of `level`.
    pub fn record<P: Pod>(
        &self,
        pass: &mut Pass,
        tree: &Bvh2Buffers,
        large_levels: u32,
        push: impl Fn(u32) -> P,
    ) {
        for level in 0..large_levels {
            let arguments = Bvh2Buffers::arguments(level);
            pass.dispatch_indirect("level", &self.level, &push(level), &tree.levels, arguments);
        }
        pass.dispatch("tail", &self.tail, &push(TAIL), 1);
    }
}
