//! Numbers the nodes of a wide tree, and the triangles of its leaves, depth first (Ylitie et al. 2017, end of 3.3).
//!
//! ```text
//! node 0, whose children a b c are nodes        0   a b c   children of a   those below them   children of b   …
//! ```
//!
//! The children of a node stay together. Behind them come, child by child, their own children and what is below those,
//! so that a subtree is one piece of memory, but for its root. The same holds for triangles: first those of a node's own
//! leaves, then those below its children.
//!
//! Contraction gives out places by counters, level by level and in another order in every build. Here each node counts
//! itself in the subtrees that it is in, and then what comes before it, both on its way to the root: three launches,
//! whatever the depth. Equal trees become equal memory.
//!
//! A pass in which only the last child to arrive goes on to its parent (Karras 2012, section 4) would take fewer atomic
//! additions; Mesa 22.3's CPU driver left its loop after two turns.

use super::{Numbering, Progress, WORKGROUP};
use crate::gpu::{Buffer, Error, Gpu, Kernel, Pass, groups, shaders};
use bytemuck::{Pod, Zeroable};

/// Workgroups that every device can launch; the kernels go on from there by themselves.
const MOST_GROUPS: u32 = 65_535;

/// The kernels.
#[derive(Debug)]
pub(super) struct DepthFirst {
    parents: Kernel,
    sizes: Kernel,
    place: Kernel,
    arity: usize,
}

/// Device memory for it.
#[derive(Debug)]
pub(super) struct Placed {
    subtrees: Buffer,
    /// `WideNodes` in `wide.glsl`, in their new order.
    pub nodes: Buffer,
    /// The nodes of the binary tree that they were made of.
    pub tasks: Buffer,
}

/// What is numbered.
pub(super) struct Made<'a> {
    pub nodes: &'a Buffer,
    pub tasks: &'a Buffer,
    pub progress: &'a Buffer,
    /// Nodes there is room for.
    pub capacity: usize,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    wide: u64,
    tasks: u64,
    progress: u64,
    subtrees: u64,
    placed: u64,
    placed_tasks: u64,
    arity: u32,
    pad: u32,
}

impl DepthFirst {
    /// Compiles the kernels where a numbering takes them.
    pub fn new(gpu: &Gpu, arity: usize, numbering: Numbering) -> Result<Option<Self>, Error> {
        if numbering != Numbering::DepthFirst {
            return Ok(None);
        }
        let size = WORKGROUP.min(gpu.info().max_workgroup_size);
        Ok(Some(Self {
            parents: Kernel::new(gpu, &shaders::CONTRACT_DEPTH_FIRST_PARENTS, size, &[])?,
            sizes: Kernel::new(gpu, &shaders::CONTRACT_DEPTH_FIRST_SIZES, size, &[])?,
            place: Kernel::new(gpu, &shaders::CONTRACT_DEPTH_FIRST_PLACE, size, &[])?,
            arity,
        }))
    }

    /// Allocates for trees of up to `capacity` nodes of so many words.
    pub fn buffers(&self, gpu: &Gpu, capacity: usize, words: usize) -> Result<Placed, Error> {
        let words_each = |name, words| gpu.buffer(name, (4 * words * capacity) as u64);
        Ok(Placed {
            subtrees: words_each("subtrees of the wide tree", 2)?,
            nodes: words_each("wide tree, depth first", words)?,
            tasks: words_each("what it was made of, depth first", 1)?,
        })
    }

    /// Numbers a tree; does nothing while it is not complete.
    pub fn record(&self, pass: &mut Pass, made: &Made<'_>, placed: &Placed) {
        assert!(made.progress.bytes() >= size_of::<Progress>() as u64, "the progress of a contraction");
        let push = Push {
            wide: made.nodes.address(),
            tasks: made.tasks.address(),
            progress: made.progress.address(),
            subtrees: placed.subtrees.address(),
            placed: placed.nodes.address(),
            placed_tasks: placed.tasks.address(),
            arity: self.arity as u32,
            pad: 0,
        };
        let groups = groups(made.capacity, self.parents.workgroup_size()).min(MOST_GROUPS);
        for (name, kernel) in [("parents", &self.parents), ("sizes", &self.sizes), ("place", &self.place)] {
            pass.dispatch(name, kernel, &push, groups);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::interface::{Module, fields};

    #[test]
    fn shaders_see_arguments_as_the_host_does() {
        let push = fields!(Push: wide, tasks, progress, subtrees, placed, placed_tasks, arity);
        for shader in [
            &shaders::CONTRACT_DEPTH_FIRST_PARENTS,
            &shaders::CONTRACT_DEPTH_FIRST_SIZES,
            &shaders::CONTRACT_DEPTH_FIRST_PLACE,
        ] {
            Module::read(shader)
                .assert_push_constants(size_of::<Push>(), &push)
                .assert_items("WideSubtrees", 8, None)
                .assert_items("WideNodes", 4, None);
        }
    }
}
