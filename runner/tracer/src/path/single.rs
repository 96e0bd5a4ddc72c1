//! The whole wavefront as one launch (thesis 4.4, 5.1.1, table 3).

use super::{Camera, CameraArguments, PathTracer, Sample, WaveTime, shading};
use crate::{
    Error,
    gpu::{Buffer, Gpu, Kernel, Pass, shaders},
    traverse::{Counting, Language, Params, Queue, Tree, Wave, check_finished, constants},
};
use bytemuck::{Pod, Zeroable};

/// Rays of a path that the kernel has room to time; `MAX_DEPTH` in `single.comp`.
const MAX_DEPTH: usize = 64;

/// `Grid` in `single.comp`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Grid {
    joined: u32,
    participants: u32,
    arrived: u32,
    unused: u32,
    began: [u32; 2],
    ended: [u32; 2],
    clock: [[u32; 2]; 2 * MAX_DEPTH],
}

/// `Arguments` in `single.comp`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Arguments {
    camera: CameraArguments,
    depths: u32,
    unused: u32,
    rays: [u64; 2],
    paths: [u64; 2],
    hits: u64,
    queues: u64,
    scene: u64,
    image: u64,
    nodes: u64,
    triangles: u64,
    indices: u64,
    grid: u64,
    extent: f32,
    shading: shading::Arguments,
}

/// All stages of a path in one persistent kernel with a software scheduler, for one layout.
///
/// Workgroups wait for each other, which needs a device that lets those go on that have started
/// ([`crate::gpu::DeviceInfo::hands_work_over`]); on any other a single workgroup is launched, which waits
/// for nobody, and only small pictures are of use.
#[derive(Debug)]
pub struct SingleKernel {
    gpu: Gpu,
    kernel: Kernel,
    stack: u32,
    grid: Buffer,
    arguments: Buffer,
    groups: u32,
}

impl SingleKernel {
    /// Compiles the kernel for a tree. Primary and secondary rays share it: its workgroups and its schedule
    /// are those meant for secondary ones.
    ///
    /// # Errors
    /// The device has no clock that kernels can read, or cannot run workgroups of that size.
    pub fn new(gpu: &Gpu, params: &Params, tree: &Tree) -> Result<Self, Error> {
        let info = gpu.info();
        if !info.has(CLOCK) {
            return Err(Error::NoClock { device: info.name.clone() });
        }
        if params.language != Language::Glsl || params.technique.barrier {
            return Err(Error::NoSingleKernel);
        }
        let layout = tree.structure.layout().ok_or(Error::SeparateKernels)?;
        let (constants, stack) = constants(gpu, params, tree, layout, Counting::Nothing, Wave::Secondary)?;
        let size = params.workgroup_size(gpu, Wave::Secondary);
        let kernel = Kernel::new(gpu, shaders::path_single(layout), size, &constants)?;
        // As many as run at once; where that is not known, one a multiprocessor surely does. Should fewer run,
        // the others find the list of participants closed and leave.
        let groups = match (info.hands_work_over(), kernel.resources().occupancy) {
            (false, _) => 1,
            (true, Some(occupancy)) => info.multiprocessors * occupancy.workgroups,
            (true, None) => info.multiprocessors.max(1),
        };
        Ok(Self {
            kernel,
            stack,
            grid: gpu.buffer("grid of the single kernel", size_of::<Grid>() as u64)?,
            arguments: gpu.buffer("arguments of the single kernel", size_of::<Arguments>() as u64)?,
            groups,
            gpu: gpu.clone(),
        })
    }

    /// The kernel.
    pub fn kernel(&self) -> &Kernel {
        &self.kernel
    }

    /// Entries of the traversal stack it was compiled with.
    pub fn stack(&self) -> u32 {
        self.stack
    }
}

/// The optional feature without which stages of one launch cannot be told apart in time.
const CLOCK: &str = "shaderDeviceClock";

impl PathTracer<'_> {
    /// Traces one path a pixel in a single launch and adds its light to the picture.
    ///
    /// Wavefronts are timed by the device's clock as one invocation reads it between stages, barriers
    /// included; its unit is found from the time that the whole launch took.
    ///
    /// # Errors
    /// The device was lost, or its driver ended a loop.
    ///
    /// # Panics
    /// Paths are longer than 64 rays.
    pub fn sample_in_one(
        &self,
        single: &SingleKernel,
        tree: &Tree,
        camera: &Camera,
        sample: u32,
    ) -> Result<Sample, Error> {
        let depths = self.params.depth as usize;
        assert!(depths <= MAX_DEPTH, "{depths} rays a path");
        let address = |buffers: &[Buffer; 2]| [buffers[0].address(), buffers[1].address()];
        single.arguments.write(&[Arguments {
            camera: self.camera(camera, sample, 1),
            depths: self.params.depth,
            unused: 0,
            rays: address(&self.rays),
            paths: address(&self.paths),
            hits: self.hits.address(),
            queues: self.queue(0),
            scene: self.scene.info.address(),
            image: self.image.address(),
            nodes: tree.nodes,
            triangles: tree.triangles,
            indices: tree.indices,
            grid: single.grid.address(),
            extent: tree.extent,
            shading: self.params.shade.arguments(camera.eye.to_array()),
        }])?;
        let mut pass = Pass::new(&self.gpu)?;
        pass.fill(&self.queues, 0);
        pass.fill(&single.grid, 0);
        pass.dispatch("single", &single.kernel, &single.arguments.address(), single.groups);
        let milliseconds = pass.submit()?.milliseconds("single");

        let grid: Grid = single.grid.read(0, 1)?[0];
        let queues: Vec<Queue> = self.queues.read(0, depths)?;
        let elapsed = |from: [u32; 2], to: [u32; 2]| {
            let ticks = |t: [u32; 2]| u64::from(t[0]) | u64::from(t[1]) << 32;
            ticks(to).wrapping_sub(ticks(from)) as f64
        };
        let tick = milliseconds / elapsed(grid.began, grid.ended).max(1.0);
        let mut waves = Vec::new();
        for (depth, queue) in queues.iter().enumerate() {
            check_finished(&single.gpu, depth, queue)?;
            if queue.count > 0 {
                let [before, after] = [grid.clock[2 * depth], grid.clock[2 * depth + 1]];
                let milliseconds = elapsed(before, after) * tick;
                waves.push(WaveTime { rays: u64::from(queue.count), milliseconds });
            }
        }
        Ok(Sample { waves, milliseconds })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        gpu::interface::{Module, fields},
        layout::Layout,
    };

    #[test]
    fn the_shaders_see_memory_as_the_host_does() {
        for &layout in Layout::ALL {
            Module::read(shaders::path_single(layout))
                .assert_block(
                    "Arguments",
                    &fields!(Arguments: camera, depths, rays, paths, hits, queues, scene, image, nodes,
                        triangles, indices, grid, extent, shading),
                )
                .assert_block(
                    "Grid",
                    &fields!(Grid: joined, participants, arrived, unused, began, ended, clock),
                );
        }
    }
}
