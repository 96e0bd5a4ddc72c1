//! Acceleration structures and ray tracing pipelines as the driver makes them (`VK_KHR_acceleration_structure`,
//! `VK_KHR_ray_tracing_pipeline`).
//!
//! Only on devices that have [`RAY_TRACING`]. As everywhere here, memory is reached by its address: kernels get that of
//! a structure among their arguments, so there are no descriptors.

use super::{
    Buffer, Error, Gpu, Pass, Shader,
    device::{Inner, PUSH_BYTES},
    error::Context,
};
use ash::{khr, vk};
use bytemuck::{NoUninit, Pod, Zeroable};
use std::{fmt, slice};

/// The optional feature of a device whose driver traces rays, by the name it has in
/// [`DeviceInfo::optional`](super::DeviceInfo::optional).
pub const RAY_TRACING: &str = "rayTracingPipeline";
/// The optional feature by which the device itself says how many rays are launched.
pub const TRACE_INDIRECT: &str = "rayTracingPipelineTraceRaysIndirect";

/// Stages of which a pipeline's arguments are seen: rays are made in the first of them.
const ARGUMENTS: vk::ShaderStageFlags = vk::ShaderStageFlags::RAYGEN_KHR;

/// What a device that traces rays needs to be told, and to be asked.
pub(super) struct RayTracing {
    structures: khr::acceleration_structure::Device,
    pipelines: khr::ray_tracing_pipeline::Device,
    layout: vk::PipelineLayout,
    /// Scratch memory begins at multiples of this.
    scratch_alignment: u64,
    /// Primitives of a structure at most.
    most_primitives: u64,
    /// Bytes that name a shader in a table, and what places in tables are multiples of.
    handle_bytes: u32,
    handle_alignment: u32,
    table_alignment: u32,
    /// Rays of a launch at most.
    most_rays: u32,
}

impl RayTracing {
    /// Extensions that a device with [`RAY_TRACING`] is opened with.
    pub(super) const EXTENSIONS: [&std::ffi::CStr; 3] = [
        khr::acceleration_structure::NAME,
        khr::ray_tracing_pipeline::NAME,
        khr::deferred_host_operations::NAME,
    ];

    /// Of a device that was opened with the extensions and features.
    pub(super) fn new(
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        device: &ash::Device,
    ) -> Result<Self, Error> {
        let mut structure = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
        let mut pipeline = vk::PhysicalDeviceRayTracingPipelinePropertiesKHR::default();
        let mut all =
            vk::PhysicalDeviceProperties2::default().push_next(&mut structure).push_next(&mut pipeline);
        // SAFETY: the device has the extensions that both structs belong to.
        unsafe { instance.get_physical_device_properties2(physical, &mut all) };
        let ranges = [vk::PushConstantRange::default().stage_flags(ARGUMENTS).size(PUSH_BYTES)];
        let info = vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&ranges);
        // SAFETY: the device is alive, and `info` lives until the call returns.
        let layout =
            unsafe { device.create_pipeline_layout(&info, None) }.context("creating a pipeline layout")?;
        Ok(Self {
            structures: khr::acceleration_structure::Device::new(instance, device),
            pipelines: khr::ray_tracing_pipeline::Device::new(instance, device),
            layout,
            scratch_alignment: structure.min_acceleration_structure_scratch_offset_alignment.max(1).into(),
            most_primitives: structure.max_primitive_count,
            handle_bytes: pipeline.shader_group_handle_size,
            handle_alignment: pipeline.shader_group_handle_alignment.max(1),
            table_alignment: pipeline.shader_group_base_alignment.max(1),
            most_rays: pipeline.max_ray_dispatch_invocation_count,
        })
    }

    /// Frees what [`RayTracing::new`] made.
    ///
    /// # Safety
    /// Nothing that was made with it is left, and it is used no more.
    pub(super) unsafe fn destroy(&self, device: &ash::Device) {
        // SAFETY: by the contract above.
        unsafe { device.destroy_pipeline_layout(self.layout, None) };
    }
}

/// What is all the same to kernels and not to the driver: whether it takes its time over a structure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Prefer {
    /// Rays are fast (`PREFER_FAST_TRACE`).
    #[default]
    FastTrace,
    /// The build is fast (`PREFER_FAST_BUILD`).
    FastBuild,
}

/// What a structure is built over.
#[derive(Clone, Copy, Debug)]
pub enum Geometry<'a> {
    /// So many opaque triangles, nine floats each.
    Triangles(&'a Buffer, u32),
    /// So many [`Instance`]s.
    Instances(&'a Buffer, u32),
}

impl Geometry<'_> {
    fn count(self) -> u32 {
        let (Self::Triangles(_, count) | Self::Instances(_, count)) = self;
        count
    }

    fn kind(self) -> vk::AccelerationStructureTypeKHR {
        match self {
            Self::Triangles(..) => vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL,
            Self::Instances(..) => vk::AccelerationStructureTypeKHR::TOP_LEVEL,
        }
    }

    fn described(self) -> vk::AccelerationStructureGeometryKHR<'static> {
        let at = |buffer: &Buffer| vk::DeviceOrHostAddressConstKHR { device_address: buffer.address() };
        let geometry = vk::AccelerationStructureGeometryKHR::default().flags(vk::GeometryFlagsKHR::OPAQUE);
        match self {
            Self::Triangles(corners, count) => {
                let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
                    .vertex_format(vk::Format::R32G32B32_SFLOAT)
                    .vertex_data(at(corners))
                    .vertex_stride(12)
                    .max_vertex((3 * count).saturating_sub(1))
                    .index_type(vk::IndexType::NONE_KHR);
                geometry
                    .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
                    .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
            }
            Self::Instances(all, _) => {
                let instances = vk::AccelerationStructureGeometryInstancesDataKHR::default().data(at(all));
                geometry
                    .geometry_type(vk::GeometryTypeKHR::INSTANCES)
                    .geometry(vk::AccelerationStructureGeometryDataKHR { instances })
            }
        }
    }
}

/// How a structure is built.
#[derive(Clone, Copy, Debug)]
pub struct Recipe<'a> {
    /// Over what.
    pub geometry: Geometry<'a>,
    /// For what.
    pub prefer: Prefer,
    /// Whether it can be compacted afterwards.
    pub compactable: bool,
}

impl Recipe<'_> {
    /// Calls `with` with what Vulkan wants to know about a build.
    fn described<R>(&self, with: impl FnOnce(vk::AccelerationStructureBuildGeometryInfoKHR<'_>) -> R) -> R {
        let geometry = self.geometry.described();
        let mut flags = match self.prefer {
            Prefer::FastTrace => vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE,
            Prefer::FastBuild => vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_BUILD,
        };
        if self.compactable {
            flags |= vk::BuildAccelerationStructureFlagsKHR::ALLOW_COMPACTION;
        }
        with(
            vk::AccelerationStructureBuildGeometryInfoKHR::default()
                .ty(self.geometry.kind())
                .flags(flags)
                .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
                .geometries(slice::from_ref(&geometry)),
        )
    }
}

/// An instance of a structure of triangles: where it stands, unmoved, and that it is seen from all sides
/// (`VkAccelerationStructureInstanceKHR`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Instance {
    transform: [[f32; 4]; 3],
    /// A number in 24 bits, and in 8 which rays see it.
    index_and_mask: u32,
    /// Where its shaders are in the table, in 24 bits, and flags in 8.
    shaders_and_flags: u32,
    structure: u64,
}

const _: () = assert!(size_of::<Instance>() == size_of::<vk::AccelerationStructureInstanceKHR>());

impl Instance {
    /// Of a structure, where it is.
    pub fn of(structure: &AccelerationStructure) -> Self {
        let flags = vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE.as_raw();
        Self {
            transform: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
            index_and_mask: 0xFF << 24,
            shaders_and_flags: flags << 24,
            structure: structure.address,
        }
    }
}

/// Bytes that a structure takes at most, and a build of it besides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuildSizes {
    /// Of the structure, before it is compacted.
    pub structure: u64,
    /// Of the memory that the build works in, with room for its alignment.
    pub scratch: u64,
}

/// Memory for a structure, and what a build has put into it.
pub struct AccelerationStructure {
    gpu: Gpu,
    handle: vk::AccelerationStructureKHR,
    address: u64,
    buffer: Buffer,
}

impl fmt::Debug for AccelerationStructure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "AccelerationStructure({:?})", self.buffer)
    }
}

impl AccelerationStructure {
    /// What kernels reach it by.
    pub fn address(&self) -> u64 {
        self.address
    }

    /// Bytes it takes.
    pub fn bytes(&self) -> u64 {
        self.buffer.bytes()
    }
}

impl Drop for AccelerationStructure {
    fn drop(&mut self) {
        // SAFETY: every submission is waited for before `submit` returns, so nothing uses the structure.
        unsafe { self.gpu.ray_tracing().structures.destroy_acceleration_structure(self.handle, None) };
    }
}

impl Gpu {
    /// # Panics
    /// The device lacks [`RAY_TRACING`].
    fn ray_tracing(&self) -> &RayTracing {
        self.inner.ray_tracing.as_ref().expect("only on devices whose driver traces rays")
    }

    /// Primitives that a structure can be built over.
    ///
    /// # Panics
    /// The device lacks [`RAY_TRACING`].
    pub fn most_primitives(&self) -> u64 {
        self.ray_tracing().most_primitives
    }

    /// What a build takes.
    ///
    /// # Panics
    /// The device lacks [`RAY_TRACING`], or there are more primitives than [`Gpu::most_primitives`].
    pub fn build_sizes(&self, recipe: &Recipe<'_>) -> BuildSizes {
        let count = recipe.geometry.count();
        let own = self.ray_tracing();
        assert!(u64::from(count) <= own.most_primitives, "{count} primitives in a structure");
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        recipe.described(|info| {
            // SAFETY: the extension is enabled, and there is one count for the one geometry.
            unsafe {
                own.structures.get_acceleration_structure_build_sizes(
                    vk::AccelerationStructureBuildTypeKHR::DEVICE,
                    &info,
                    &[count],
                    &mut sizes,
                );
            }
        });
        BuildSizes {
            structure: sizes.acceleration_structure_size,
            scratch: sizes.build_scratch_size + own.scratch_alignment,
        }
    }

    /// Allocates `bytes` for a structure over such a geometry.
    ///
    /// # Errors
    /// Too little memory.
    ///
    /// # Panics
    /// The device lacks [`RAY_TRACING`].
    pub fn acceleration_structure(
        &self,
        name: &str,
        geometry: Geometry<'_>,
        bytes: u64,
    ) -> Result<AccelerationStructure, Error> {
        let structures = &self.ray_tracing().structures;
        // One begins at a multiple of 256 in its buffer; a buffer each is simplest.
        let buffer =
            self.buffer_for(name, bytes, vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR)?;
        let info = vk::AccelerationStructureCreateInfoKHR::default()
            .buffer(buffer.handle)
            .size(bytes)
            .ty(geometry.kind());
        // SAFETY: the buffer was made for it, is large enough, and lives as long.
        let handle = unsafe { structures.create_acceleration_structure(&info, None) }
            .context("creating a structure")?;
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(handle);
        // SAFETY: it was made above.
        let address = unsafe { structures.get_acceleration_structure_device_address(&info) };
        Ok(AccelerationStructure { gpu: self.clone(), handle, address, buffer })
    }
}

/// A place for the size that a structure has when it is compacted.
pub struct CompactedSize {
    gpu: Gpu,
    pool: vk::QueryPool,
}

impl fmt::Debug for CompactedSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("CompactedSize")
    }
}

impl CompactedSize {
    /// An empty one.
    ///
    /// # Errors
    /// The driver has no memory for it.
    pub fn new(gpu: &Gpu) -> Result<Self, Error> {
        let info = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR)
            .query_count(1);
        // SAFETY: the device is alive; devices that trace rays have queries of this type.
        let pool =
            unsafe { gpu.inner.device.create_query_pool(&info, None) }.context("creating a query pool")?;
        Ok(Self { gpu: gpu.clone(), pool })
    }

    /// Bytes, after a pass that asked has ended.
    ///
    /// # Errors
    /// The device was lost.
    pub fn read(&self) -> Result<u64, Error> {
        let mut bytes = [0u64];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the pool has one query, which a pass that was waited for has written.
        unsafe { self.gpu.inner.device.get_query_pool_results(self.pool, 0, &mut bytes, flags) }
            .context("reading a compacted size")?;
        Ok(bytes[0])
    }
}

impl Drop for CompactedSize {
    fn drop(&mut self) {
        // SAFETY: every submission was waited for.
        unsafe { self.gpu.inner.device.destroy_query_pool(self.pool, None) };
    }
}

impl Pass {
    /// Builds a structure.
    ///
    /// # Panics
    /// The scratch memory is smaller than [`Gpu::build_sizes`] says.
    pub fn build_structure(
        &mut self,
        name: &str,
        recipe: &Recipe<'_>,
        into: &AccelerationStructure,
        scratch: &Buffer,
    ) {
        let sizes = into.gpu.build_sizes(recipe);
        assert!(scratch.bytes() >= sizes.scratch, "{name}: {scratch:?} for {sizes:?}");
        assert!(into.bytes() >= sizes.structure, "{name}: {into:?} for {sizes:?}");
        let count = recipe.geometry.count();
        self.traces_rays();
        self.timed(name, |inner, commands| {
            let own = inner.ray_tracing.as_ref().expect("it has made the structure");
            let begin = scratch.address().next_multiple_of(own.scratch_alignment);
            let range = vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(count);
            recipe.described(|info| {
                let info = info
                    .dst_acceleration_structure(into.handle)
                    .scratch_data(vk::DeviceOrHostAddressKHR { device_address: begin });
                // SAFETY: the command buffer is recording; structure and scratch are as large as was asked for, and the
                // geometry's buffers hold what is read.
                unsafe {
                    own.structures.cmd_build_acceleration_structures(
                        commands,
                        &[info],
                        &[slice::from_ref(&range)],
                    );
                }
            });
        });
    }

    /// Asks how large a structure is when it is compacted.
    pub fn ask_compacted_size(&mut self, name: &str, of: &AccelerationStructure, size: &CompactedSize) {
        self.traces_rays();
        self.timed(name, |inner, commands| {
            let own = inner.ray_tracing.as_ref().expect("it has made the structure");
            // SAFETY: the command buffer is recording; the pool has one query, which is reset before it is written.
            unsafe {
                inner.device.cmd_reset_query_pool(commands, size.pool, 0, 1);
                own.structures.cmd_write_acceleration_structures_properties(
                    commands,
                    &[of.handle],
                    vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR,
                    size.pool,
                    0,
                );
            }
        });
    }

    /// Copies a structure to where it takes no more than it needs.
    pub fn compact_structure(
        &mut self,
        name: &str,
        from: &AccelerationStructure,
        to: &AccelerationStructure,
    ) {
        let info = vk::CopyAccelerationStructureInfoKHR::default()
            .src(from.handle)
            .dst(to.handle)
            .mode(vk::CopyAccelerationStructureModeKHR::COMPACT);
        self.traces_rays();
        self.timed(name, |inner, commands| {
            let own = inner.ray_tracing.as_ref().expect("it has made the structures");
            // SAFETY: the command buffer is recording; `from` was built to be compacted, and `to` has the size that the
            // driver named.
            unsafe { own.structures.cmd_copy_acceleration_structure(commands, &info) };
        });
    }

    /// Launches rays in a pipeline.
    pub fn trace_rays<P: NoUninit>(
        &mut self,
        name: &str,
        pipeline: &RayPipeline,
        push: &P,
        launch: Launch<'_>,
    ) {
        let push = bytemuck::bytes_of(push);
        assert!(push.len() <= PUSH_BYTES as usize, "{name}: arguments fit the push constants");
        self.traces_rays();
        self.timed(name, |inner, commands| {
            let own = inner.ray_tracing.as_ref().expect("it has made the pipeline");
            let [rays, miss, hit, callable] = &pipeline.regions;
            // SAFETY: the command buffer is recording; the pipeline was made with this layout, and the regions lie in
            // its table. Callers' launches are within limits, which `RayPipeline::most_rays` tells; the three numbers
            // of an indirect one lie in a buffer made for that.
            unsafe {
                inner.device.cmd_bind_pipeline(
                    commands,
                    vk::PipelineBindPoint::RAY_TRACING_KHR,
                    pipeline.pipeline,
                );
                inner.device.cmd_push_constants(commands, own.layout, ARGUMENTS, 0, push);
                match launch {
                    Launch::Size([width, height]) => {
                        own.pipelines.cmd_trace_rays(commands, rays, miss, hit, callable, width, height, 1);
                    }
                    Launch::Indirect(buffer) => {
                        let address = buffer.address();
                        own.pipelines.cmd_trace_rays_indirect(commands, rays, miss, hit, callable, address);
                    }
                }
            }
        });
    }
}

/// How many rays are launched.
#[derive(Clone, Copy, Debug)]
pub enum Launch<'a> {
    /// So many in a row, and so many rows.
    Size([u32; 2]),
    /// What three u32 at the beginning of a buffer say. The device must have [`TRACE_INDIRECT`].
    Indirect(&'a Buffer),
}

/// A ray tracing pipeline of three shaders, and the table in which the driver finds them.
///
/// As kernels are, it is compiled once for each device and lives as long as that.
pub struct RayPipeline {
    pipeline: vk::Pipeline,
    /// Of the shaders that make rays, that are called where one hits nothing or something, and of none.
    regions: [vk::StridedDeviceAddressRegionKHR; 4],
    most_rays: u32,
    _table: Buffer,
}

impl fmt::Debug for RayPipeline {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "RayPipeline({:?})", self._table)
    }
}

impl RayPipeline {
    /// Compiles the shaders that make rays, and that are called where one hits nothing or a triangle.
    ///
    /// # Errors
    /// The driver's compiler failed, or there is no memory for the table.
    ///
    /// # Panics
    /// The device lacks [`RAY_TRACING`].
    pub fn new(gpu: &Gpu, rays: &Shader, miss: &Shader, hit: &Shader) -> Result<Self, Error> {
        let own = gpu.ray_tracing();
        let key = (rays.name, false, Vec::new());
        let pipeline = {
            let mut pipelines =
                gpu.inner.pipelines.lock().expect("nobody panics while holding the pipelines");
            match pipelines.get(&key) {
                Some(&pipeline) => pipeline,
                None => {
                    let pipeline = compile(&gpu.inner, own, [rays, miss, hit])?;
                    pipelines.insert(key, pipeline);
                    pipeline
                }
            }
        };
        // Each shader has a region of its own, and a region begins at a multiple of the table's alignment.
        let stride = own.handle_bytes.next_multiple_of(own.handle_alignment);
        let region = stride.next_multiple_of(own.table_alignment);
        // SAFETY: the pipeline has three groups.
        let handles = unsafe {
            let bytes = 3 * own.handle_bytes as usize;
            own.pipelines.get_ray_tracing_shader_group_handles(pipeline, 0, 3, bytes)
        }
        .context("reading the shaders' handles")?;
        let alignment = u64::from(own.table_alignment);
        let usage = vk::BufferUsageFlags::SHADER_BINDING_TABLE_KHR;
        let table = gpu.buffer_for("shader table", u64::from(3 * region) + alignment, usage)?;
        let begin = table.address().next_multiple_of(alignment);
        let mut bytes = vec![0u8; table.bytes() as usize];
        for (group, handle) in handles.chunks_exact(own.handle_bytes as usize).enumerate() {
            let at = (begin - table.address()) as usize + group * region as usize;
            bytes[at..at + handle.len()].copy_from_slice(handle);
        }
        table.write(&bytes)?;
        let of = |group: u64| {
            vk::StridedDeviceAddressRegionKHR::default()
                .device_address(begin + group * u64::from(region))
                .stride(stride.into())
                .size(stride.into())
        };
        let regions = [of(0), of(1), of(2), vk::StridedDeviceAddressRegionKHR::default()];
        Ok(Self { pipeline, regions, most_rays: own.most_rays, _table: table })
    }

    /// Rays of a launch at most.
    pub fn most_rays(&self) -> u32 {
        self.most_rays
    }
}

/// A pipeline with three groups of one shader each.
fn compile(inner: &Inner, own: &RayTracing, shaders: [&Shader; 3]) -> Result<vk::Pipeline, Error> {
    let device = &inner.device;
    let mut modules = Vec::new();
    let compiled = (|| {
        for shader in shaders {
            let words = ash::util::read_spv(&mut std::io::Cursor::new(shader.spirv))
                .expect("the build made valid SPIR-V");
            let info = vk::ShaderModuleCreateInfo::default().code(&words);
            // SAFETY: the words are a SPIR-V module that the compiler accepted.
            modules.push(unsafe { device.create_shader_module(&info, None) }.context(shader.name)?);
        }
        let kinds = [
            vk::ShaderStageFlags::RAYGEN_KHR,
            vk::ShaderStageFlags::MISS_KHR,
            vk::ShaderStageFlags::CLOSEST_HIT_KHR,
        ];
        let stages: Vec<_> = kinds
            .iter()
            .zip(&modules)
            .map(|(&stage, &module)| {
                vk::PipelineShaderStageCreateInfo::default().stage(stage).module(module).name(c"main")
            })
            .collect();
        let group = || {
            vk::RayTracingShaderGroupCreateInfoKHR::default()
                .ty(vk::RayTracingShaderGroupTypeKHR::GENERAL)
                .general_shader(vk::SHADER_UNUSED_KHR)
                .closest_hit_shader(vk::SHADER_UNUSED_KHR)
                .any_hit_shader(vk::SHADER_UNUSED_KHR)
                .intersection_shader(vk::SHADER_UNUSED_KHR)
        };
        let groups = [
            group().general_shader(0),
            group().general_shader(1),
            group().ty(vk::RayTracingShaderGroupTypeKHR::TRIANGLES_HIT_GROUP).closest_hit_shader(2),
        ];
        let info = vk::RayTracingPipelineCreateInfoKHR::default()
            .stages(&stages)
            .groups(&groups)
            .max_pipeline_ray_recursion_depth(1)
            .layout(own.layout);
        // SAFETY: the modules and the layout are alive, and the groups name stages that are there.
        let made = unsafe {
            own.pipelines.create_ray_tracing_pipelines(
                vk::DeferredOperationKHR::null(),
                vk::PipelineCache::null(),
                &[info],
                None,
            )
        };
        match made {
            Ok(pipelines) => Ok(pipelines[0]),
            Err((_, result)) => Err(Error::from_vk(shaders[0].name, result)),
        }
    })();
    for module in modules {
        // SAFETY: the pipeline has what it needs of them.
        unsafe { device.destroy_shader_module(module, None) };
    }
    compiled
}
