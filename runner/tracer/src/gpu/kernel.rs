use super::{Error, Gpu, Resources, Shader, device::RECONVERGENCE, error::Context};
use ash::vk;
use std::fmt;

/// A compute pipeline: one shader with its specialization constants filled in.
///
/// Specialization constant 0 is the workgroup size in every shader. A pipeline is compiled once for each device and
/// lives as long as that: a sweep comes back to the same kernels again and again.
pub struct Kernel {
    gpu: Gpu,
    name: &'static str,
    workgroup_size: u32,
    pub(super) pipeline: vk::Pipeline,
}

/// One figure that the driver's compiler tells of a kernel, such as its register count.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Statistic {
    /// The driver's own name for it.
    pub name: String,
    /// Its value; booleans are 0 and 1.
    pub value: f64,
}

impl fmt::Debug for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Kernel({}, {} invocations)", self.name, self.workgroup_size)
    }
}

/// A module whose entry point reconverges maximally. Neither GLSL's compiler in distributions nor Slang has a word
/// for it, so the instructions are put where they belong: the extension before the memory model, and the mode behind
/// the entry point.
fn reconverging(words: &[u32]) -> Vec<u32> {
    const IMPORT: u32 = 11;
    const MEMORY_MODEL: u32 = 14;
    const ENTRY_POINT: u32 = 15;
    const EXECUTION_MODE: u32 = 16;
    const EXTENSION: u32 = 10;
    const MAXIMALLY_RECONVERGES: u32 = 6023;
    let name = b"SPV_KHR_maximal_reconvergence\0\0\0";
    let (head, mut rest) = words.split_at(5);
    let mut made = head.to_vec();
    let (mut entry, mut extended) = (None, false);
    while let [first, ..] = rest {
        let (instruction, next) = rest.split_at((first >> 16).max(1) as usize);
        let operation = first & 0xFFFF;
        // Extensions stand before imports and the memory model.
        if !extended && matches!(operation, IMPORT | MEMORY_MODEL) {
            extended = true;
            made.push((1 + name.len() as u32 / 4) << 16 | EXTENSION);
            made.extend(name.chunks_exact(4).map(|c| u32::from_le_bytes([c[0], c[1], c[2], c[3]])));
        }
        if let Some(entry) = entry.take_if(|_| operation != ENTRY_POINT) {
            made.extend([3 << 16 | EXECUTION_MODE, entry, MAXIMALLY_RECONVERGES]);
        }
        if operation == ENTRY_POINT {
            entry = Some(instruction[2]);
        }
        made.extend(instruction);
        rest = next;
    }
    made
}

impl Kernel {
    /// Compiles `shader` with `workgroup_size` as constant 0 and `constants` as 1, 2, ….
    ///
    /// # Errors
    /// The device cannot run workgroups of that size, or its compiler failed.
    pub fn new(gpu: &Gpu, shader: &Shader, workgroup_size: u32, constants: &[u32]) -> Result<Self, Error> {
        Self::with_reconvergence(gpu, shader, workgroup_size, constants, false)
    }

    /// The same; `reconverge` if lanes are to reconverge maximally (`SPV_KHR_maximal_reconvergence`).
    ///
    /// # Errors
    /// As [`Kernel::new`], or the device has no such thing.
    pub fn with_reconvergence(
        gpu: &Gpu,
        shader: &Shader,
        workgroup_size: u32,
        constants: &[u32],
        reconverge: bool,
    ) -> Result<Self, Error> {
        let info = gpu.info();
        if workgroup_size == 0
            || workgroup_size > info.max_workgroup_size
            || !workgroup_size.is_multiple_of(info.subgroup_size)
        {
            return Err(Error::WorkgroupSize {
                kernel: shader.name,
                size: workgroup_size,
                subgroup: info.subgroup_size,
                limit: info.max_workgroup_size,
            });
        }
        let values: Vec<u32> = std::iter::once(workgroup_size).chain(constants.iter().copied()).collect();
        let mut pipelines = gpu.inner.pipelines.lock().expect("nobody panics while holding the pipelines");
        let kernel = |pipeline| Self { gpu: gpu.clone(), name: shader.name, workgroup_size, pipeline };
        if let Some(&pipeline) = pipelines.get(&(shader.name, reconverge, values.clone())) {
            return Ok(kernel(pipeline));
        }
        let device = &gpu.inner.device;
        let mut words = ash::util::read_spv(&mut std::io::Cursor::new(shader.spirv))
            .expect("the build made valid SPIR-V");
        if reconverge {
            if !info.has(RECONVERGENCE) {
                return Err(Error::NoReconvergence { device: info.name.clone() });
            }
            words = reconverging(&words);
        }
        // SAFETY: the words are a SPIR-V module that the compiler accepted.
        let module =
            unsafe { device.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None) }
                .context(shader.name)?;

        let entries: Vec<_> = (0..values.len() as u32)
            .map(|i| vk::SpecializationMapEntry::default().constant_id(i).offset(4 * i).size(4))
            .collect();
        let special =
            vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(&values));
        let mut required = vk::PipelineShaderStageRequiredSubgroupSizeCreateInfo::default()
            .required_subgroup_size(info.subgroup_size);
        let mut stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(c"main")
            .specialization_info(&special);
        if gpu.inner.full_subgroups {
            stage = stage
                .flags(vk::PipelineShaderStageCreateFlags::REQUIRE_FULL_SUBGROUPS)
                .push_next(&mut required);
        }
        let mut create = vk::ComputePipelineCreateInfo::default().stage(stage).layout(gpu.inner.layout);
        if gpu.inner.executable.is_some() {
            create = create.flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR);
        }
        // SAFETY: module and layout belong to this device; all pointers live until the call returns,
        // after which the module is no longer needed.
        let made = unsafe {
            let made = device.create_compute_pipelines(vk::PipelineCache::null(), &[create], None);
            device.destroy_shader_module(module, None);
            made
        };
        let pipeline = made.map_err(|(_, result)| result).context(shader.name)?[0];
        pipelines.insert((shader.name, reconverge, values), pipeline);
        Ok(kernel(pipeline))
    }

    /// Invocations a workgroup.
    pub fn workgroup_size(&self) -> u32 {
        self.workgroup_size
    }

    /// The shader's name.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// What the kernel takes from a multiprocessor. Where the driver tells nothing of it (it lacks
    /// `VK_KHR_pipeline_executable_properties`), that is its two sizes and nothing else.
    pub fn resources(&self) -> Resources {
        Resources::new(self.gpu.info(), self.workgroup_size, self.told_subgroup_size(), &self.statistics())
    }

    /// Everything that the driver's compiler tells of the kernel, under its own names; empty where it does not.
    pub fn statistics(&self) -> Vec<Statistic> {
        let Some(executable) = &self.gpu.inner.executable else { return Vec::new() };
        if self.told_subgroup_size().is_none() {
            return Vec::new();
        }
        let info = vk::PipelineExecutableInfoKHR::default().pipeline(self.pipeline);
        // SAFETY: the pipeline belongs to this device and was made with CAPTURE_STATISTICS, and it has an
        // executable 0, whose subgroup size we have just seen.
        let all = unsafe { executable.get_pipeline_executable_statistics(&info) }.unwrap_or_default();
        all.iter()
            .map(|s| {
                // SAFETY: `format` says which member of the union is set.
                let value = unsafe {
                    match s.format {
                        vk::PipelineExecutableStatisticFormatKHR::BOOL32 => f64::from(s.value.b32),
                        vk::PipelineExecutableStatisticFormatKHR::INT64 => s.value.i64 as f64,
                        vk::PipelineExecutableStatisticFormatKHR::UINT64 => s.value.u64 as f64,
                        _ => s.value.f64,
                    }
                };
                let name =
                    s.name_as_c_str().map_or_else(|_| String::new(), |n| n.to_string_lossy().into_owned());
                Statistic { name, value }
            })
            .collect()
    }

    /// The subgroup size of the pipeline's first executable; a compute pipeline has one, or none that is told.
    fn told_subgroup_size(&self) -> Option<u32> {
        let info = vk::PipelineInfoKHR::default().pipeline(self.pipeline);
        // SAFETY: the pipeline belongs to this device, which has the extension's feature enabled.
        let all = unsafe { self.gpu.inner.executable.as_ref()?.get_pipeline_executable_properties(&info) };
        Some(all.ok()?.first()?.subgroup_size)
    }
}
