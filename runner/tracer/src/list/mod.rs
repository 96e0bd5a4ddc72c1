//! Triangles without a tree: what a tree is worth, and what all else costs (RTRS's basic and blank intersection handlers,
//! Lewis 2024, 4.1).
//!
//! [`Listing::All`] tests every ray against every triangle, an invocation a ray. [`Listing::None`] is the same kernel with
//! no triangle to test: rays are read, and nothing is hit. Both keep the triangles of the scene, in the order of its file,
//! as leaves of trees do.
//!
//! There is no twin but the brute force that all traversals are held against ([`crate::traverse::cpu::brute_force`]).

use crate::{
    Error,
    bvh2::MAX_TRIANGLES,
    gpu::{Buffer, Gpu, Kernel, Pass, groups, shaders},
    layout::TriangleBuffers,
    traverse::{Buffers, Counting, Params, Structure, Tree, TriangleTest, Wave},
};
use bytemuck::{Pod, Zeroable};

/// Which triangles rays are tested against.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Listing {
    /// Every one.
    All,
    /// None.
    None,
}

/// Most triangles that rays are tested against: with more, a picture takes minutes on any device.
pub const MOST: usize = 1 << 16;

/// Triangles of a launch: few enough for drivers that end long loops silently, even if each lane of their subgroups, 8, met
/// another one that has to be tested exactly, which takes six turns of loops.
const AT_ONCE: u32 = 1024;

const WORKGROUP: u32 = 128;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct StorePush {
    triangles: u64,
    stored: u64,
    indices: u64,
    count: u32,
    unused: u32,
}

/// The kernel that stores triangles, and the memory they are stored in.
#[derive(Debug)]
pub struct Builder {
    gpu: Gpu,
    store: Kernel,
    listing: Listing,
    count: usize,
    triangles: TriangleBuffers,
}

impl Builder {
    /// Allocates for so many triangles, stored for a test.
    ///
    /// # Errors
    /// There are none, or more than [`MOST`] that rays are to be tested against, or too little memory.
    pub fn new(gpu: &Gpu, listing: Listing, test: TriangleTest, count: usize) -> Result<Self, Error> {
        let most = match listing {
            Listing::All => MOST,
            Listing::None => MAX_TRIANGLES,
        };
        if count == 0 || count > most {
            return Err(Error::ListTriangles { triangles: count, most });
        }
        let size = WORKGROUP.min(gpu.info().max_workgroup_size);
        Ok(Self {
            store: Kernel::new(gpu, &shaders::LIST_STORE, size, &[test.format() as u32])?,
            triangles: TriangleBuffers::new(gpu, test, count)?,
            gpu: gpu.clone(),
            listing,
            count,
        })
    }

    /// Stores the first of `triangles` (nine finite floats each), as many as it was made for. The milliseconds that this
    /// took the device.
    ///
    /// # Errors
    /// The device was lost.
    ///
    /// # Panics
    /// There are more than the buffer holds.
    pub fn build(&self, triangles: &Buffer) -> Result<f64, Error> {
        assert!(36 * self.count as u64 <= triangles.bytes(), "{} triangles in {triangles:?}", self.count);
        let push = StorePush {
            triangles: triangles.address(),
            stored: self.triangles.stored.address(),
            indices: self.triangles.indices_address(),
            count: self.count as u32,
            unused: 0,
        };
        let groups = groups(self.count, self.store.workgroup_size()).min(65_535);
        let mut pass = Pass::new(&self.gpu)?;
        pass.scope("build", |pass| pass.dispatch("store", &self.store, &push, groups));
        Ok(pass.submit()?.milliseconds("build"))
    }

    /// What the last build made.
    pub fn finish(self) -> List {
        List { listing: self.listing, count: self.count, triangles: self.triangles }
    }
}

/// Triangles that rays can be tested against.
#[derive(Debug)]
pub struct List {
    listing: Listing,
    count: usize,
    /// In the order of the file.
    pub triangles: TriangleBuffers,
}

impl List {
    /// Bytes of all triangles.
    pub fn triangle_bytes(&self) -> u64 {
        (self.count * self.triangles.test().triangle_bytes()) as u64
    }

    /// What a [`Traversal`](crate::traverse::Traversal) reaches them by.
    pub fn tree(&self, extent: f32) -> Tree {
        Tree {
            nodes: 0,
            triangles: self.triangles.stored.address(),
            indices: self.triangles.indices_address(),
            test: self.triangles.test(),
            structure: Structure::List(self.listing),
            listed: match self.listing {
                Listing::All => self.count as u32,
                Listing::None => 0,
            },
            stride: 0,
            stack: 0,
            extent,
        }
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Arguments {
    rays: u64,
    hits: u64,
    triangles: u64,
    indices: u64,
    queue: u64,
    counts: u64,
    utilization: u64,
    begin: u32,
    end: u32,
    last: u32,
    unused: u32,
}

/// The kernels that test rays against a list, for both kinds of wavefronts.
#[derive(Debug)]
pub(crate) struct Rays {
    primary: Kernel,
    secondary: Kernel,
}

impl Rays {
    /// Compiles them for triangles that are stored for a test.
    pub fn new(gpu: &Gpu, params: &Params, test: TriangleTest, counting: Counting) -> Result<Self, Error> {
        let kernel = |wave| {
            // Of what `traverse/tree.glsl` is specialized by, only these matter here.
            let (counting, hoist, test) = (counting as u32, u32::from(params.technique.hoist), test as u32);
            let constants = [1, 1, 0, counting, 0, 4, 0, 0, hoist, test];
            Kernel::new(gpu, &shaders::LIST_CLOSEST_HIT, params.workgroup_size(gpu, wave), &constants)
        };
        Ok(Self { primary: kernel(Wave::Primary)?, secondary: kernel(Wave::Secondary)? })
    }

    /// That of a kind of wavefront.
    pub fn kernel(&self, wave: Wave) -> &Kernel {
        match wave {
            Wave::Primary => &self.primary,
            Wave::Secondary => &self.secondary,
        }
    }

    /// Records the traversal of a queue of at most `rays` rays as one span called `name`.
    pub fn record(
        &self,
        pass: &mut Pass,
        name: &str,
        wave: Wave,
        tree: &Tree,
        buffers: &Buffers,
        rays: usize,
    ) {
        let kernel = self.kernel(wave);
        let groups = groups(rays, kernel.workgroup_size());
        let launch = |pass: &mut Pass, name: &str, begin: u32| {
            let end = tree.listed.min(begin + AT_ONCE);
            let arguments = Arguments {
                rays: buffers.rays,
                hits: buffers.hits,
                triangles: tree.triangles,
                indices: tree.indices,
                queue: buffers.queue,
                counts: buffers.counts,
                utilization: buffers.utilization,
                begin,
                end,
                last: u32::from(end == tree.listed),
                unused: 0,
            };
            pass.dispatch(name, kernel, &arguments, groups);
        };
        if tree.listed <= AT_ONCE {
            launch(pass, name, 0);
        } else {
            pass.scope(name, |pass| {
                (0..tree.listed).step_by(AT_ONCE as usize).for_each(|begin| launch(pass, "launch", begin));
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::interface::{Module, fields};

    #[test]
    fn shaders_see_arguments_as_the_host_does() {
        Module::read(&shaders::LIST_STORE)
            .assert_push_constants(
                size_of::<StorePush>(),
                &fields!(StorePush: triangles, stored, indices, count),
            )
            .assert_items("LeafTriangles", 16, None)
            .assert_specialization(1, "FORMAT");
        Module::read(&shaders::LIST_CLOSEST_HIT)
            .assert_push_constants(
                size_of::<Arguments>(),
                &fields!(Arguments: rays, hits, triangles, indices, queue, counts, utilization, begin, end, last),
            )
            .assert_specialization(4, "COUNT")
            .assert_specialization(9, "HOIST")
            .assert_specialization(10, "TRIANGLE_TEST");
    }
}
