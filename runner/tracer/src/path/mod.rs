//! Path tracing in wavefronts (Laine, Karras, Aila 2013; thesis 4.1, figure 10): generate primary rays,
//! then trace and shade, again and again, each stage a kernel of its own over a compact queue of rays.

use crate::{
    Error,
    builder::BuildWorkspace,
    contract::VisitCounter,
    gpu::{Buffer, Gpu, Kernel, Pass, groups, shaders},
    scene::{Light, Material, Phong, Scene, View},
    traverse::{Buffers, Counts, Hit, Queue, Ray, Traversal, Tree, Utilization, Wave},
};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use rayon::prelude::*;

pub mod phong;
mod shading;
mod single;

pub use shading::{Integrator, Shading};
pub use single::SingleKernel;

/// Subgroups a workgroup of the stages that are not measured.
const STAGE_SUBGROUPS: u32 = 8;

/// What a path is.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// Rays a path has at most, the primary one included (thesis 6.4: 8).
    pub depth: u32,
    /// Varies every random number.
    pub seed: u32,
    /// What happens where a ray hits a surface.
    pub shade: Shading,
}

impl Default for Params {
    fn default() -> Self {
        Self { depth: 8, seed: 0, shade: Shading::default() }
    }
}

/// How sample rays are taken for contractions that go by view.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Sampling {
    /// t: visit counts are trusted where they exceed it (thesis 6.4: 8).
    pub threshold: u32,
    /// d: bounces that are sampled; 0 for primary rays alone (thesis 6.5: 4).
    pub depth_limit: u32,
    /// s: rays go through every s-th pixel (thesis 6.6: 64).
    pub subsampling: u32,
}

impl Default for Sampling {
    fn default() -> Self {
        Self { threshold: 8, depth_limit: 4, subsampling: 64 }
    }
}

/// The sample whose random numbers sample rays take: none that is measured.
const SAMPLING_SAMPLE: u32 = u32::MAX;

/// A scene's triangles and materials in device memory.
#[derive(Debug)]
pub struct DeviceScene {
    /// Nine floats a triangle in file order: what builders read.
    pub positions: Buffer,
    /// Triangles.
    pub triangles: usize,
    /// Largest absolute coordinate.
    pub extent: f32,
    info: Buffer,
    _material_ids: Buffer,
    _materials: Buffer,
    _lights: Buffer,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct SceneInfo {
    positions: u64,
    material_ids: u64,
    materials: u64,
    lights: u64,
    zenith: [f32; 3],
    horizon: [f32; 3],
    ground: [f32; 3],
    extent: f32,
    light_count: u32,
    unused: u32,
}

/// `Material` in `scene.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct MaterialInfo {
    albedo: [f32; 3],
    emission: [f32; 3],
    phong: [f32; 4],
}

impl DeviceScene {
    /// Copies a scene to the device.
    ///
    /// # Errors
    /// Too little memory.
    pub fn upload(gpu: &Gpu, scene: &Scene) -> Result<Self, Error> {
        let material = |m: &Material| {
            let Phong { diffuse, specular, reflective, shininess } = m.phong.unwrap_or(phong::MATTE);
            let phong = [diffuse, specular, reflective, shininess];
            MaterialInfo { albedo: m.albedo, emission: m.emission, phong }
        };
        let materials: Vec<MaterialInfo> = scene.materials.iter().map(material).collect();
        // None is none of them; there has to be memory.
        let none = Light { position: [0.0; 3], strength: 0.0 };
        let lights: Vec<[f32; 4]> = (scene.lights.iter().chain(scene.lights.is_empty().then_some(&none)))
            .map(|Light { position: [x, y, z], strength }| [*x, *y, *z, *strength])
            .collect();
        let positions = gpu.upload("the scene's triangles", &scene.positions)?;
        let material_ids = gpu.upload("material indices", &scene.material_ids)?;
        let materials = gpu.upload("materials", &materials)?;
        let lights = gpu.upload("lights", &lights)?;
        let extent = scene.positions.as_flattened().as_flattened().iter().fold(0f32, |m, x| m.max(x.abs()));
        let info = SceneInfo {
            positions: positions.address(),
            material_ids: material_ids.address(),
            materials: materials.address(),
            lights: lights.address(),
            zenith: scene.sky.zenith,
            horizon: scene.sky.horizon,
            ground: scene.sky.ground,
            extent,
            light_count: scene.lights.len() as u32,
            unused: 0,
        };
        let info = gpu.upload("scene description", &[info])?;
        let triangles = scene.positions.len();
        Ok(Self {
            positions,
            triangles,
            extent,
            info,
            _material_ids: material_ids,
            _materials: materials,
            _lights: lights,
        })
    }
}

/// A pinhole camera for pictures of one shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    eye: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
}

impl Camera {
    /// The camera of a view for pictures of `width` × `height`.
    pub fn new(view: &View, width: u32, height: u32) -> Self {
        let eye = Vec3::from_array(view.eye);
        let forward = (Vec3::from_array(view.target) - eye).normalize_or(Vec3::NEG_Z);
        // Looking straight up or down leaves `up` without meaning; any sideways direction will do.
        let right = forward.cross(Vec3::from_array(view.up)).try_normalize();
        let right = right.unwrap_or_else(|| forward.any_orthonormal_vector());
        let tangent = (0.5 * view.vfov_degrees).to_radians().tan();
        let aspect = width as f32 / height as f32;
        Self { eye, right: right * tangent * aspect, up: right.cross(forward) * tangent, forward }
    }
}

/// `Camera` in `generate.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct CameraArguments {
    order: u64,
    eye: [f32; 3],
    right: [f32; 3],
    up: [f32; 3],
    forward: [f32; 3],
    width: u32,
    height: u32,
    sample: u32,
    seed: u32,
    every: u32,
    unused: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct GenerateArguments {
    rays: u64,
    paths: u64,
    queue: u64,
    camera: CameraArguments,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ShadeArguments {
    rays: u64,
    hits: u64,
    paths: u64,
    queue: u64,
    next_rays: u64,
    next_paths: u64,
    next_queue: u64,
    scene: u64,
    image: u64,
    sample: u32,
    depth: u32,
    seed: u32,
    last: u32,
    shading: shading::Arguments,
    unused: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct SumArguments {
    counts: u64,
    sums: u64,
    rays: u32,
    invocations: u32,
}

/// Rays whose costs one invocation adds up. Each may cost 2²⁷ before 32 bits overflow.
const RAYS_A_SUM: usize = 32;

/// `Path` in `scene.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct PathState {
    pixel: u32,
    throughput: [f32; 3],
}

/// One wavefront as it was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaveTime {
    /// Rays traced.
    pub rays: u64,
    /// Of the traversal kernel alone.
    pub milliseconds: f64,
}

/// One path a pixel, measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// By depth, primary rays first; wavefronts without rays are left out.
    pub waves: Vec<WaveTime>,
    /// All kernels of the sample from first to last, shading included.
    pub milliseconds: f64,
}

/// What the rays of one wavefront cost together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaveCounts {
    /// Rays traced.
    pub rays: u64,
    /// Inner nodes visited.
    pub nodes: u64,
    /// Boxes tested.
    pub boxes: u64,
    /// Triangles tested.
    pub triangles: u64,
    /// How well the subgroups were used that traced them.
    pub utilization: Utilization,
}

/// Everything about one wavefront, read back from the device.
#[derive(Clone, Debug)]
pub struct Wavefront {
    /// Depth of the rays, 0 for primary.
    pub depth: usize,
    /// In the order in which they were traced.
    pub rays: Vec<Ray>,
    /// One a ray.
    pub hits: Vec<Hit>,
    /// One a ray.
    pub pixels: Vec<u32>,
    /// One a ray where the traversal counts, else empty.
    pub counts: Vec<Counts>,
}

/// The buffers and kernels that trace paths through one scene at one picture size.
#[derive(Debug)]
pub struct PathTracer<'s> {
    gpu: Gpu,
    scene: &'s DeviceScene,
    width: u32,
    height: u32,
    params: Params,
    generate: Kernel,
    shade: Kernel,
    /// Place of each pixel along the Z-order curve, by pixel.
    places: Vec<u32>,
    order: Buffer,
    rays: [Buffer; 2],
    paths: [Buffer; 2],
    hits: Buffer,
    counting: Option<Counting>,
    queues: Buffer,
    image: Buffer,
}

/// Room for what each ray costs, for the sums over some of them, and for what subgroups count together.
#[derive(Debug)]
struct Counting {
    counts: Buffer,
    sums: Buffer,
    sum: Kernel,
    utilization: Buffer,
}

impl Counting {
    fn new(gpu: &Gpu, pixels: u64) -> Result<Self, Error> {
        let size = size_of::<Counts>() as u64;
        let kernel = Kernel::new(gpu, &shaders::PATH_SUM, STAGE_SUBGROUPS * gpu.info().subgroup_size, &[])?;
        Ok(Self {
            counts: gpu.buffer("ray counters", pixels * size)?,
            sums: gpu.buffer("sums of ray counters", pixels.div_ceil(RAYS_A_SUM as u64) * size)?,
            sum: kernel,
            utilization: gpu.buffer("SIMD utilization", size_of::<Utilization>() as u64)?,
        })
    }

    /// Costs of the first `rays` rays, each item over some of them.
    fn sums(&self, gpu: &Gpu, rays: usize) -> Result<Vec<Counts>, Error> {
        let invocations = rays.div_ceil(RAYS_A_SUM);
        let arguments = SumArguments {
            counts: self.counts.address(),
            sums: self.sums.address(),
            rays: rays as u32,
            invocations: invocations as u32,
        };
        let mut pass = Pass::new(gpu)?;
        pass.dispatch("sum", &self.sum, &arguments, groups(invocations, self.sum.workgroup_size()));
        pass.submit()?;
        Ok(self.sums.read(0, invocations)?)
    }
}

/// Pixels along the Z-order curve, row-major indices.
fn z_order(width: u32, height: u32) -> Vec<u32> {
    let spread = |v: u32| (0..16).fold(0u64, |code, bit| code | (u64::from(v >> bit & 1) << (2 * bit)));
    let (xs, ys): (Vec<_>, Vec<_>) = ((0..width).map(spread).collect(), (0..height).map(spread).collect());
    let mut order: Vec<u32> = (0..width * height).collect();
    order.par_sort_unstable_by_key(|p| xs[(p % width) as usize] | (ys[(p / width) as usize] << 1));
    order
}

impl<'s> PathTracer<'s> {
    /// Allocates for pictures of `width` × `height`. `counting` adds room for [`Counts`].
    ///
    /// # Errors
    /// Too little memory.
    pub fn new(
        gpu: &Gpu,
        scene: &'s DeviceScene,
        (width, height): (u32, u32),
        params: &Params,
        counting: bool,
    ) -> Result<Self, Error> {
        let size = STAGE_SUBGROUPS * gpu.info().subgroup_size;
        let pixels = u64::from(width) * u64::from(height);
        let order = z_order(width, height);
        let mut places = vec![0; order.len()];
        for (place, &pixel) in order.iter().enumerate() {
            places[pixel as usize] = place as u32;
        }
        let rays = || gpu.buffer("rays", pixels * size_of::<Ray>() as u64);
        let paths = || gpu.buffer("paths", pixels * size_of::<PathState>() as u64);
        Ok(Self {
            generate: Kernel::new(gpu, &shaders::PATH_GENERATE, size, &[])?,
            shade: Kernel::new(gpu, &shaders::PATH_SHADE, size, &[])?,
            order: gpu.upload("pixel order", &order)?,
            places,
            rays: [rays()?, rays()?],
            paths: [paths()?, paths()?],
            hits: gpu.buffer("hits", pixels * size_of::<Hit>() as u64)?,
            counting: if counting { Some(Counting::new(gpu, pixels)?) } else { None },
            queues: gpu.buffer("queues", u64::from(params.depth + 1) * size_of::<Queue>() as u64)?,
            image: gpu.buffer("the picture", pixels * 16)?,
            gpu: gpu.clone(),
            scene,
            width,
            height,
            params: params.clone(),
        })
    }

    fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    fn queue(&self, depth: usize) -> u64 {
        self.queues.address() + (depth * size_of::<Queue>()) as u64
    }

    fn camera(&self, camera: &Camera, sample: u32, every: u32) -> CameraArguments {
        CameraArguments {
            order: self.order.address(),
            eye: camera.eye.to_array(),
            right: camera.right.to_array(),
            up: camera.up.to_array(),
            forward: camera.forward.to_array(),
            width: self.width,
            height: self.height,
            sample,
            seed: self.params.seed,
            every,
            unused: 0,
        }
    }

    fn record_generate(&self, pass: &mut Pass, camera: &Camera, sample: u32, every: u32) {
        pass.fill(&self.queues, 0);
        let arguments = GenerateArguments {
            rays: self.rays[0].address(),
            paths: self.paths[0].address(),
            queue: self.queue(0),
            camera: self.camera(camera, sample, every),
        };
        let rays = self.pixels().div_ceil(every as usize);
        let count = groups(rays, self.generate.workgroup_size());
        pass.dispatch("generate", &self.generate, &arguments, count);
    }

    fn record_trace(
        &self,
        pass: &mut Pass,
        traversal: &Traversal,
        tree: &Tree,
        depth: usize,
        visits: Option<&Buffer>,
    ) {
        let buffers = Buffers {
            rays: self.rays[depth % 2].address(),
            hits: self.hits.address(),
            queue: self.queue(depth),
            counts: self.counting.as_ref().map_or(0, |counting| counting.counts.address()),
            visits: visits.map_or(0, Buffer::address),
            utilization: self.counting.as_ref().map_or(0, |counting| counting.utilization.address()),
        };
        traversal.record(pass, &format!("trace {depth}"), Wave::at(depth), tree, &buffers, self.pixels());
    }

    fn record_shade(&self, pass: &mut Pass, camera: &Camera, sample: u32, depth: usize) {
        let (now, next) = (depth % 2, (depth + 1) % 2);
        let arguments = ShadeArguments {
            rays: self.rays[now].address(),
            hits: self.hits.address(),
            paths: self.paths[now].address(),
            queue: self.queue(depth),
            next_rays: self.rays[next].address(),
            next_paths: self.paths[next].address(),
            next_queue: self.queue(depth + 1),
            scene: self.scene.info.address(),
            image: self.image.address(),
            sample,
            depth: depth as u32,
            seed: self.params.seed,
            last: u32::from(depth + 1 == self.params.depth as usize),
            shading: self.params.shade.arguments(camera.eye.to_array()),
            unused: 0,
        };
        let count = groups(self.pixels(), self.shade.workgroup_size());
        pass.dispatch(&format!("shade {depth}"), &self.shade, &arguments, count);
    }

    /// Rays of each depth, once all are known to have been finished.
    fn rays_by_depth(&self, traversal: &Traversal, depths: usize) -> Result<Vec<u64>, Error> {
        let queues: Vec<Queue> = self.queues.read(0, depths)?;
        for (depth, queue) in queues.iter().enumerate() {
            traversal.check(depth, queue)?;
        }
        Ok(queues.iter().map(|q| u64::from(q.count)).collect())
    }

    /// Traces one path a pixel in one submission, adds its light to the picture, and says how long each
    /// traversal took.
    ///
    /// # Errors
    /// The device was lost, or its driver ended a loop.
    pub fn sample(
        &self,
        traversal: &Traversal,
        tree: &Tree,
        camera: &Camera,
        sample: u32,
    ) -> Result<Sample, Error> {
        let depths = self.params.depth as usize;
        let mut pass = Pass::new(&self.gpu)?;
        pass.scope("sample", |pass| {
            self.record_generate(pass, camera, sample, 1);
            for depth in 0..depths {
                self.record_trace(pass, traversal, tree, depth, None);
                self.record_shade(pass, camera, sample, depth);
            }
        });
        let timings = pass.submit()?;
        let rays = self.rays_by_depth(traversal, depths)?;
        let waves = rays.iter().enumerate().filter(|(_, rays)| **rays > 0).map(|(depth, &rays)| WaveTime {
            rays,
            milliseconds: timings.milliseconds(&format!("sample/trace {depth}")),
        });
        Ok(Sample { waves: waves.collect(), milliseconds: timings.milliseconds("sample") })
    }

    /// Traces sample rays with a traversal that counts visits, and leaves in `visits` how many of them met
    /// each inner node of the binary tree in `workspace`, whose own wide tree `tree` is (thesis 4.2.2).
    /// Returns the milliseconds that it took, from clearing the counts on.
    ///
    /// Rays go through every s-th pixel along the Z-order curve, so that they are spread over the picture.
    /// Their light is added to the picture.
    ///
    /// # Errors
    /// The device was lost, or its driver ended a loop.
    pub fn sample_visits(
        &self,
        traversal: &Traversal,
        tree: &Tree,
        camera: &Camera,
        sampling: &Sampling,
        workspace: &BuildWorkspace,
        visits: &VisitCounter,
    ) -> Result<f64, Error> {
        let depths = self.params.depth.min(sampling.depth_limit + 1) as usize;
        let mut pass = Pass::new(&self.gpu)?;
        pass.scope("sampling", |pass| {
            visits.clear(pass);
            self.record_generate(pass, camera, SAMPLING_SAMPLE, sampling.subsampling);
            for depth in 0..depths {
                self.record_trace(pass, traversal, tree, depth, Some(&visits.by_node));
                if depth + 1 < depths {
                    self.record_shade(pass, camera, SAMPLING_SAMPLE, depth);
                }
            }
            workspace.record_visits(pass, visits);
        });
        let timings = pass.submit()?;
        self.rays_by_depth(traversal, depths)?;
        Ok(timings.milliseconds("sampling"))
    }

    /// Traces one path a pixel, a submission a depth, and hands each wavefront to `look` with all that is
    /// known of it, until `look` returns false.
    ///
    /// Its rays are put in the order of their pixels along the Z-order curve, because the order in which
    /// kernels append them differs from run to run.
    ///
    /// # Errors
    /// The device was lost, or its driver ended a loop.
    pub fn wavefronts(
        &self,
        traversal: &Traversal,
        tree: &Tree,
        camera: &Camera,
        sample: u32,
        mut look: impl FnMut(Wavefront) -> bool,
    ) -> Result<(), Error> {
        self.each_depth(traversal, tree, camera, sample, |depth, count| {
            let now = depth % 2;
            let paths: Vec<PathState> = self.paths[now].read(0, count)?;
            let mut sorted: Vec<usize> = (0..count).collect();
            sorted.par_sort_unstable_by_key(|&i| self.places[paths[i].pixel as usize]);
            let rays: Vec<Ray> = self.rays[now].read(0, count)?;
            let hits: Vec<Hit> = self.hits.read(0, count)?;
            let counts: Vec<Counts> = match &self.counting {
                Some(counting) => counting.counts.read(0, count)?,
                None => Vec::new(),
            };
            Ok(look(Wavefront {
                depth,
                rays: sorted.iter().map(|&i| rays[i]).collect(),
                hits: sorted.iter().map(|&i| hits[i]).collect(),
                pixels: sorted.iter().map(|&i| paths[i].pixel).collect(),
                counts: if counts.is_empty() { counts } else { sorted.iter().map(|&i| counts[i]).collect() },
            }))
        })
    }

    /// Traces one primary ray a pixel with a counting traversal, and says what the ray of each pixel cost, row by row from
    /// the top.
    ///
    /// # Errors
    /// The device was lost, or its driver ended a loop.
    ///
    /// # Panics
    /// The tracer was made without counters.
    pub fn primary_costs(
        &self,
        traversal: &Traversal,
        tree: &Tree,
        camera: &Camera,
        sample: u32,
    ) -> Result<Vec<Counts>, Error> {
        let counting = self.counting.as_ref().expect("the tracer was made for counting");
        let mut costs = vec![Counts::zeroed(); self.pixels()];
        self.each_depth(traversal, tree, camera, sample, |_, rays| {
            let paths: Vec<PathState> = self.paths[0].read(0, rays)?;
            let counts: Vec<Counts> = counting.counts.read(0, rays)?;
            for (path, counts) in paths.iter().zip(counts) {
                costs[path.pixel as usize] = counts;
            }
            Ok(false)
        })?;
        Ok(costs)
    }

    /// Traces one path a pixel, a submission a depth, and calls `look` with the depth and its number of
    /// rays while their buffers hold them, until it returns false or no rays are left.
    fn each_depth(
        &self,
        traversal: &Traversal,
        tree: &Tree,
        camera: &Camera,
        sample: u32,
        mut look: impl FnMut(usize, usize) -> Result<bool, Error>,
    ) -> Result<(), Error> {
        for depth in 0..self.params.depth as usize {
            let mut pass = Pass::new(&self.gpu)?;
            if depth == 0 {
                self.record_generate(&mut pass, camera, sample, 1);
            }
            if let Some(counting) = &self.counting {
                pass.fill(&counting.utilization, 0);
            }
            self.record_trace(&mut pass, traversal, tree, depth, None);
            pass.submit()?;
            let count =
                *self.rays_by_depth(traversal, depth + 1)?.last().expect("depth + 1 is not 0") as usize;
            if !look(depth, count)? || count == 0 {
                break;
            }
            let mut pass = Pass::new(&self.gpu)?;
            self.record_shade(&mut pass, camera, sample, depth);
            pass.submit()?;
        }
        Ok(())
    }

    /// Traces one path a pixel with a counting traversal and adds up what the rays of each depth cost, and
    /// how well subgroups were used; depths without rays are left out.
    ///
    /// # Errors
    /// The device was lost, or its driver ended a loop.
    ///
    /// # Panics
    /// The tracer was made without counters.
    pub fn count(
        &self,
        traversal: &Traversal,
        tree: &Tree,
        camera: &Camera,
        sample: u32,
    ) -> Result<Vec<WaveCounts>, Error> {
        let counting = self.counting.as_ref().expect("the tracer was made for counting");
        let mut waves = Vec::new();
        self.each_depth(traversal, tree, camera, sample, |depth, rays| {
            if rays > 0 {
                let counts = counting.sums(&self.gpu, rays)?;
                let sum = |of: fn(&Counts) -> u32| counts.iter().map(|c| u64::from(of(c))).sum();
                debug_assert_eq!(waves.len(), depth);
                waves.push(WaveCounts {
                    rays: rays as u64,
                    nodes: sum(|c| c.nodes),
                    boxes: sum(|c| c.boxes),
                    triangles: sum(|c| c.triangles),
                    utilization: counting.utilization.read(0, 1)?[0],
                });
            }
            Ok(true)
        })?;
        Ok(waves)
    }

    /// Sets the picture to black.
    ///
    /// # Errors
    /// The device was lost.
    pub fn clear(&self) -> Result<(), Error> {
        let mut pass = Pass::new(&self.gpu)?;
        pass.fill(&self.image, 0);
        pass.submit()?;
        Ok(())
    }

    /// Sums of radiance since [`PathTracer::clear`], linear RGB and nothing, row by row from the top.
    ///
    /// # Errors
    /// The device was lost.
    pub fn picture(&self) -> Result<Vec<[f32; 4]>, Error> {
        Ok(self.image.read(0, self.pixels())?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::interface::{Module, fields};

    #[test]
    fn shaders_see_memory_as_the_host_does() {
        let ray = fields!(Ray: origin, t_min, direction, t_max);
        let path = fields!(PathState: pixel, throughput);
        let queue = fields!(Queue: next, count, finished, unused);
        let generate = fields!(GenerateArguments: rays, paths, queue, camera);
        Module::read(&shaders::PATH_GENERATE)
            .assert_push_constants(size_of::<GenerateArguments>(), &generate)
            .assert_items("Rays", size_of::<Ray>(), Some(&ray))
            .assert_items("Paths", size_of::<PathState>(), Some(&path))
            .assert_block("Queue", &queue);
        let shade = fields!(ShadeArguments: rays, hits, paths, queue, next_rays, next_paths, next_queue,
            scene, image, sample, depth, seed, last, shading);
        let sum = fields!(SumArguments: counts, sums, rays, invocations);
        Module::read(&shaders::PATH_SUM).assert_push_constants(size_of::<SumArguments>(), &sum).assert_items(
            "Sums",
            size_of::<Counts>(),
            None,
        );
        let scene = fields!(SceneInfo: positions, material_ids, materials, lights, zenith, horizon, ground,
            extent, light_count);
        let material = fields!(MaterialInfo: albedo, emission, phong);
        Module::read(&shaders::PATH_SHADE)
            .assert_push_constants(size_of::<ShadeArguments>(), &shade)
            .assert_block("Scene", &scene)
            .assert_block("Queue", &queue)
            .assert_items("Rays", size_of::<Ray>(), Some(&ray))
            .assert_items("Hits", size_of::<Hit>(), Some(&fields!(Hit: t, triangle)))
            .assert_items("Paths", size_of::<PathState>(), Some(&path))
            .assert_items("Materials", size_of::<MaterialInfo>(), Some(&material))
            .assert_items("Lights", 16, None)
            .assert_items("Positions", 12, None)
            .assert_items("Image", 16, None);
    }

    /// The kernel that adds up what rays cost, held against its twin: a plain sum.
    #[test]
    fn what_rays_cost_is_added_up_to_the_last_ray() {
        let gpu = Gpu::open(&crate::gpu::Options::default()).unwrap();
        // One ray, as many as an invocation adds up, one fewer and one more, and many; costs up to the largest.
        for rays in [1usize, 31, 32, 33, 1000, 70_001] {
            let counting = Counting::new(&gpu, rays as u64).unwrap();
            let mut random = 1u32;
            let mut next = || {
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (random >> 5) % (1 << 27)
            };
            let costs: Vec<Counts> = (0..rays)
                .map(|_| Counts { nodes: next(), boxes: next(), triangles: next(), unused: 0 })
                .collect();
            counting.counts.write(&costs).unwrap();
            // What is behind the last ray does not count.
            for traced in [rays, rays.div_ceil(2)] {
                let sums = counting.sums(&gpu, traced).unwrap();
                assert_eq!(sums.len(), traced.div_ceil(RAYS_A_SUM));
                for of in [|c: &Counts| c.nodes, |c: &Counts| c.boxes, |c: &Counts| c.triangles] {
                    let sum = |all: &[Counts]| all.iter().map(|c| u64::from(of(c))).sum::<u64>();
                    assert_eq!(sum(&sums), sum(&costs[..traced]), "{traced} of {rays}");
                }
            }
        }
    }

    #[test]
    fn the_z_order_visits_every_pixel_once_and_quads_together() {
        let order = z_order(5, 3);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..15).collect::<Vec<_>>());
        assert_eq!(order[..4], [0, 1, 5, 6]);
    }

    #[test]
    fn a_camera_looks_from_its_eye_to_its_target() {
        let view = View {
            name: String::new(),
            eye: [1.0, 2.0, 3.0],
            target: [1.0, 2.0, -7.0],
            up: [0.0, 1.0, 0.0],
            vfov_degrees: 90.0,
        };
        let camera = Camera::new(&view, 200, 100);
        assert!((camera.forward - Vec3::NEG_Z).length() < 1e-6);
        assert!((camera.right - Vec3::X * 2.0).length() < 1e-6);
        assert!((camera.up - Vec3::Y).length() < 1e-6);
        let down = Camera::new(&View { target: [1.0, -5.0, 3.0], ..view }, 200, 100);
        assert!(down.right.is_finite() && down.up.length() > 0.9);
    }
}
