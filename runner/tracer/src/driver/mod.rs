//! The driver's own ray tracing, to hold ours against: `VK_KHR_acceleration_structure` builds the tree and
//! `VK_KHR_ray_tracing_pipeline` traces the rays, in hardware where there is any.
//!
//! ```text
//! triangles in device memory → structure of triangles → compacted → structure of one instance → rays → hits
//!                              \     bottom     /      \ compact /  \         top         /
//! ```
//!
//! It reads the same triangles and the same rays as our kernels, and writes hits of the same form. What its trees are
//! like and what rays meet in them no driver tells.
//!
//! There is no twin on the CPU: hits are held against brute force. Distances are the driver's, which may differ from
//! ours in the last digits, and where a ray passes an edge it may see another triangle, or none at a silhouette. A
//! negative `t_min` counts as 0, since Vulkan has no other.

use crate::{
    Error,
    bvh2::MAX_TRIANGLES,
    gpu::{
        AccelerationStructure, Buffer, CompactedSize, DeviceInfo, Geometry, Gpu, Instance, Kernel, Launch,
        Pass, Prefer, RAY_TRACING, RayPipeline, Recipe, TRACE_INDIRECT, Timings, shaders,
    },
    traverse::{self, Buffers, Tree, TriangleTest},
};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use std::cell::{Cell, RefCell};

/// What can be chosen about it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// What the driver is told to prefer: `fast-trace` or `fast-build`. The latter takes half the time, more or less,
    /// and leads to slower rays.
    pub build: Prefer,
    /// Whether the structure is copied to where it takes no more memory than it needs. Takes a part of the build's
    /// time; rays rarely gain from it.
    pub compact: bool,
    /// Rays in a row of the launch, 0 for all of them in one. Drivers map a launch to subgroups by its shape: where
    /// they take tiles of it, rows as long as a tile is wide keep neighbouring rays together.
    pub row: u32,
}

impl Default for Params {
    fn default() -> Self {
        Self { build: Prefer::FastTrace, compact: true, row: 0 }
    }
}

/// Rows of a launch are at most so many, which every device allows.
const MOST_ROWS: u64 = 1 << 22;

/// Fails where a device's driver does not trace rays.
///
/// # Errors
/// It does not.
pub fn check(info: &DeviceInfo) -> Result<(), Error> {
    if info.has(RAY_TRACING) {
        return Ok(());
    }
    Err(Error::NoRayTracing {
        device: info.name.clone(),
        driver: format!("{} {}", info.driver_name, info.driver_info).trim().to_owned(),
    })
}

/// What a build took on the device, in milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Milliseconds {
    /// Building over the triangles.
    pub bottom: f64,
    /// Asking how small it can be, and copying it there; 0 where that was not wanted.
    pub compact: f64,
    /// Building over the one instance of it.
    pub top: f64,
    /// All of it. The host learns the compacted size on the way; the time that this takes is not the device's, and not
    /// in here.
    pub total: f64,
}

/// Device memory for builds over a scene, so that a build after the first allocates nothing.
#[derive(Debug)]
pub struct Builder {
    gpu: Gpu,
    params: Params,
    triangles: u32,
    bottom: AccelerationStructure,
    /// The last build's, where that was compacted.
    compacted: RefCell<Option<AccelerationStructure>>,
    size: CompactedSize,
    top: AccelerationStructure,
    instances: Buffer,
    scratch: Buffer,
    built: Cell<bool>,
}

impl Builder {
    /// Allocates for builds over the first `count` of `triangles` (nine finite floats each).
    ///
    /// # Errors
    /// The device's driver does not trace rays, or there are no triangles, too many, or too little memory.
    ///
    /// # Panics
    /// There are more triangles than the buffer holds.
    pub fn new(gpu: &Gpu, params: &Params, triangles: &Buffer, count: usize) -> Result<Self, Error> {
        check(gpu.info())?;
        let most = gpu.most_primitives().min(MAX_TRIANGLES as u64);
        if count == 0 || count as u64 > most {
            return Err(Error::DriverTriangles { triangles: count, most });
        }
        assert!(36 * count as u64 <= triangles.bytes(), "{count} triangles in {triangles:?}");
        let count = u32::try_from(count).expect("checked above");
        let instances = gpu.upload("instances", &[Instance::zeroed()])?;
        let (lower, upper) = (bottom(params, triangles, count), top(params, &instances));
        let (of_lower, of_upper) = (gpu.build_sizes(&lower), gpu.build_sizes(&upper));
        let scratch = gpu.buffer("scratch memory of builds", of_lower.scratch.max(of_upper.scratch))?;
        Ok(Self {
            bottom: gpu.acceleration_structure(
                "structure of triangles",
                lower.geometry,
                of_lower.structure,
            )?,
            top: gpu.acceleration_structure("structure of instances", upper.geometry, of_upper.structure)?,
            compacted: RefCell::default(),
            size: CompactedSize::new(gpu)?,
            instances,
            scratch,
            gpu: gpu.clone(),
            params: params.clone(),
            triangles: count,
            built: Cell::new(false),
        })
    }

    /// Builds over `triangles`, the buffer that it was made for. What was built before is lost.
    ///
    /// # Errors
    /// The device was lost, or has no memory for the compacted structure.
    pub fn build(&self, triangles: &Buffer) -> Result<Milliseconds, Error> {
        let (gpu, compact) = (&self.gpu, self.params.compact);
        let lower = bottom(&self.params, triangles, self.triangles);
        let mut timings = Timings::default();
        if compact {
            let mut pass = Pass::new(gpu)?;
            pass.scope("build", |pass| {
                pass.build_structure("bottom", &lower, &self.bottom, &self.scratch);
                pass.ask_compacted_size("compact", &self.bottom, &self.size);
            });
            timings.spans.extend(pass.submit()?.spans);
            let bytes = self.size.read()?;
            let mut compacted = self.compacted.borrow_mut();
            // Triangles that are the same make a structure that is the same, or nearly.
            if compacted.as_ref().is_none_or(|there| there.bytes() != bytes.next_multiple_of(16)) {
                *compacted = None;
                let made = gpu.acceleration_structure("compacted structure", lower.geometry, bytes)?;
                self.instances.write(&[Instance::of(&made)])?;
                *compacted = Some(made);
            }
        } else if !self.built.get() {
            self.instances.write(&[Instance::of(&self.bottom)])?;
        }
        let mut pass = Pass::new(gpu)?;
        pass.scope("build", |pass| {
            match self.compacted.borrow().as_ref() {
                Some(compacted) => pass.compact_structure("compact", &self.bottom, compacted),
                None => pass.build_structure("bottom", &lower, &self.bottom, &self.scratch),
            }
            pass.build_structure("top", &top(&self.params, &self.instances), &self.top, &self.scratch);
        });
        timings.spans.extend(pass.submit()?.spans);
        self.built.set(true);
        Ok(Milliseconds {
            bottom: timings.milliseconds("build/bottom"),
            compact: timings.milliseconds("build/compact"),
            top: timings.milliseconds("build/top"),
            total: timings.milliseconds("build"),
        })
    }

    /// What the last build made; the memory that only builds need is freed.
    ///
    /// # Panics
    /// Nothing was built.
    pub fn finish(self) -> Structure {
        assert!(self.built.get(), "something was built");
        let triangles = self.compacted.into_inner().unwrap_or(self.bottom);
        Structure { triangles, top: self.top }
    }
}

fn bottom<'a>(params: &Params, triangles: &'a Buffer, count: u32) -> Recipe<'a> {
    let geometry = Geometry::Triangles(triangles, count);
    Recipe { geometry, prefer: params.build, compactable: params.compact }
}

fn top<'a>(params: &Params, instances: &'a Buffer) -> Recipe<'a> {
    Recipe { geometry: Geometry::Instances(instances, 1), prefer: params.build, compactable: false }
}

/// A tree that the driver has built and can trace.
#[derive(Debug)]
pub struct Structure {
    /// Reached by way of the instance only.
    triangles: AccelerationStructure,
    top: AccelerationStructure,
}

impl Structure {
    /// Bytes of nodes and triangles.
    pub fn bytes(&self) -> u64 {
        self.triangles.bytes() + self.top.bytes()
    }

    /// What a [`Traversal`](crate::traverse::Traversal) reaches it by.
    pub fn tree(&self, extent: f32) -> Tree {
        Tree {
            nodes: self.top.address(),
            triangles: 0,
            indices: 0,
            test: TriangleTest::default(),
            structure: traverse::Structure::Driver,
            listed: 0,
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
    queue: u64,
    structure: u64,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct SizeArguments {
    queue: u64,
    launch: u64,
    row: u32,
    unused: u32,
}

/// The driver's closest hits of a queue of rays.
#[derive(Debug)]
pub(crate) struct Rays {
    pipeline: RayPipeline,
    /// Where the device says how many rays are launched: who writes that, and where to.
    indirect: Option<(Kernel, Buffer)>,
    row: u32,
}

impl Rays {
    pub fn new(gpu: &Gpu, params: &Params) -> Result<Self, Error> {
        Self::launched(gpu, params, gpu.info().has(TRACE_INDIRECT))
    }

    /// The same; `indirect` if the device is to say how many rays are launched.
    fn launched(gpu: &Gpu, params: &Params, indirect: bool) -> Result<Self, Error> {
        check(gpu.info())?;
        let pipeline =
            RayPipeline::new(gpu, &shaders::DRIVER_TRACE, &shaders::DRIVER_MISS, &shaders::DRIVER_HIT)?;
        let size = || {
            let kernel = Kernel::new(gpu, &shaders::DRIVER_SIZE, gpu.info().subgroup_size, &[])?;
            Ok::<_, Error>((kernel, gpu.buffer("size of a launch", 12)?))
        };
        Ok(Self { pipeline, indirect: indirect.then(size).transpose()?, row: params.row })
    }

    /// Records the traversal of a queue of at most `rays` rays as one span called `name`. Where the device can say how
    /// many there are, a small kernel does, before the span; elsewhere so many are launched, and those end at once for
    /// which there is no ray.
    pub fn record(&self, pass: &mut Pass, name: &str, tree: &Tree, buffers: &Buffers, rays: usize) {
        // Wavefronts are pictures of at most 2^30 pixels, and so is what every device launches.
        let rays = (rays as u64).clamp(1, self.pipeline.most_rays().into()) as u32;
        let row = match self.row {
            0 => 0,
            row => row.max(u64::from(rays).div_ceil(MOST_ROWS) as u32),
        };
        let arguments =
            Arguments { rays: buffers.rays, hits: buffers.hits, queue: buffers.queue, structure: tree.nodes };
        let launch = match &self.indirect {
            Some((kernel, buffer)) => {
                let size = SizeArguments { queue: buffers.queue, launch: buffer.address(), row, unused: 0 };
                pass.dispatch(&format!("size of {name}"), kernel, &size, 1);
                Launch::Indirect(buffer)
            }
            None if row == 0 => Launch::Size([rays, 1]),
            None => Launch::Size([row, rays.div_ceil(row)]),
        };
        pass.trace_rays(name, &self.pipeline, &arguments, launch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        gpu::{
            Options,
            interface::{Module, fields},
        },
        traverse::{Hit, Queue, Ray},
    };

    /// Whoever says how many rays there are, the host or the device: the hits are the same.
    #[test]
    fn both_ways_of_launching_trace_the_same_rays() {
        let gpu = Gpu::open(&Options { validate: true, ..Options::default() }).unwrap();
        if check(gpu.info()).is_err() {
            eprintln!("skipped: {} does not trace rays", gpu.info());
            return;
        }
        let corners =
            gpu.upload("triangles", &[[[0f32, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]]).unwrap();
        for row in [0, 1, 8, 1000] {
            let params = Params { row, ..Params::default() };
            let builder = Builder::new(&gpu, &params, &corners, 1).unwrap();
            builder.build(&corners).unwrap();
            let structure = builder.finish();
            let ray = |at: usize| Ray {
                origin: [at as f32 / 64.0, 0.25, 0.0],
                t_min: 0.0,
                direction: [0.0, 0.0, 1.0],
                t_max: f32::INFINITY,
            };
            let rays: Vec<Ray> = (0..100).map(ray).collect();
            // Three quarters of the way along is the triangle's edge; the last rays are not queued.
            let expected = |at: usize| match at {
                97.. => Hit { t: -1.0, triangle: 7 },
                49.. => Hit::NONE,
                _ => Hit { t: 1.0, triangle: 0 },
            };
            for indirect in [true, false] {
                if indirect && !gpu.info().has(TRACE_INDIRECT) {
                    continue;
                }
                let there = gpu.upload("rays", &rays).unwrap();
                let hits = gpu.upload("hits", &[Hit { t: -1.0, triangle: 7 }; 100]).unwrap();
                let queue = gpu.upload("queue", &[Queue { count: 97, ..Queue::default() }]).unwrap();
                let buffers = Buffers {
                    rays: there.address(),
                    hits: hits.address(),
                    queue: queue.address(),
                    counts: 0,
                    visits: 0,
                    utilization: 0,
                };
                let traced = Rays::launched(&gpu, &params, indirect).unwrap();
                let mut pass = Pass::new(&gpu).unwrap();
                traced.record(&mut pass, "trace", &structure.tree(1.0), &buffers, 100);
                pass.submit().unwrap();
                let found: Vec<Hit> = hits.read(0, 100).unwrap();
                for (at, hit) in found.iter().enumerate().filter(|(at, _)| *at != 48) {
                    assert_eq!(*hit, expected(at), "ray {at}, rows of {row}, indirect: {indirect}");
                }
            }
        }
        assert_eq!(gpu.validation_messages(), Vec::<String>::new());
    }

    #[test]
    fn shaders_see_memory_as_the_host_does() {
        let queue = fields!(Queue: next, count, finished, unused);
        Module::read(&shaders::DRIVER_TRACE)
            .assert_push_constants(size_of::<Arguments>(), &fields!(Arguments: rays, hits, queue, structure))
            .assert_items("Rays", size_of::<Ray>(), Some(&fields!(Ray: origin, t_min, direction, t_max)))
            .assert_items("Hits", size_of::<Hit>(), Some(&fields!(Hit: t, triangle)))
            .assert_block("Queue", &queue);
        Module::read(&shaders::DRIVER_SIZE)
            .assert_push_constants(
                size_of::<SizeArguments>(),
                &fields!(SizeArguments: queue, launch, row, unused),
            )
            .assert_block("Queue", &queue);
    }
}
