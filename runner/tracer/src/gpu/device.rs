use super::{
    Error,
    error::Context,
    pass::Timing,
    present,
    ray_tracing::{RAY_TRACING, RayTracing, TRACE_INDIRECT},
};
use ash::{ext, khr, vk};
use raw_window_handle::{HandleError, HasDisplayHandle, RawDisplayHandle};
use std::{
    collections::HashMap,
    ffi::{CStr, CString, c_void},
    fmt,
    str::FromStr,
    sync::{Arc, Mutex},
};

/// Kernels take their arguments in at most this many bytes, which every Vulkan device offers.
pub(super) const PUSH_BYTES: u32 = 128;

/// Numbers of the vendors whose drivers' words are known here.
pub(super) const NVIDIA: u32 = 0x10DE;
pub(super) const AMD: u32 = 0x1002;
pub(super) const INTEL: u32 = 0x8086;

/// The optional feature by which lanes that part in a branch go on together behind it.
pub(super) const RECONVERGENCE: &str = "shaderMaximalReconvergence";

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

/// How a device presents itself, ordered by which one we would rather measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DeviceKind {
    /// A GPU with its own memory.
    Discrete,
    /// A GPU that shares the processor's memory.
    Integrated,
    /// A GPU seen through a hypervisor.
    Virtual,
    /// A driver that runs kernels on the processor, such as Mesa's lavapipe.
    Cpu,
    /// Anything else.
    Other,
}

/// What matters here about a Vulkan device.
#[derive(Clone, Debug, serde::Serialize)]
pub struct DeviceInfo {
    /// Position in the loader's list; what `--device N` means.
    pub index: usize,
    /// As the driver names it.
    pub name: String,
    /// Discrete, integrated, CPU.
    pub kind: DeviceKind,
    /// PCI vendor, or a Khronos vendor id.
    pub vendor_id: u32,
    /// The vendor's device id.
    pub device_id: u32,
    /// Thirty-two hexadecimal digits with hyphens.
    pub uuid: String,
    /// `major.minor.patch`.
    pub api_version: String,
    /// The driver's name.
    pub driver_name: String,
    /// The driver's own version text.
    pub driver_info: String,
    /// Vendor-encoded driver version.
    pub driver_version: u32,
    /// Invocations a subgroup.
    pub subgroup_size: u32,
    /// Least and greatest subgroup size a kernel can ask for.
    pub subgroup_size_range: [u32; 2],
    /// Bytes of shared memory a workgroup can use.
    pub shared_memory_bytes: u32,
    /// Invocations in the largest workgroup.
    pub max_workgroup_size: u32,
    /// Invocations along each axis of the largest workgroup.
    pub max_workgroup_axes: [u32; 3],
    /// Workgroups along each axis of the largest dispatch.
    pub max_workgroups: [u32; 3],
    /// Bytes of the largest storage buffer that a descriptor can name.
    pub storage_buffer_bytes: u64,
    /// Bytes of each memory heap, and whether it is the device's own.
    pub heaps: Vec<(u64, bool)>,
    /// Nanoseconds a timestamp tick; 0 where the queue has no timestamps.
    pub timestamp_period_ns: f32,
    /// Bits of a timestamp that count.
    pub timestamp_bits: u32,
    /// Bytes of the largest device-local heap.
    pub memory_bytes: u64,
    /// Bytes of the largest single allocation.
    pub max_allocation_bytes: u64,
    /// Multiprocessors (NVIDIA) or compute units (AMD) where the driver tells, else 0.
    pub multiprocessors: u32,
    /// Subgroups one multiprocessor can hold where the driver tells, else 0.
    pub subgroups_per_multiprocessor: u32,
    /// PCI domain, bus, device and function, for matching with the vendor's management library.
    pub pci: Option<String>,
    /// Optional features that are used where present.
    pub optional: Vec<String>,
    /// Required features that are absent; empty for a device that works here.
    pub missing: Vec<String>,
}

impl DeviceInfo {
    /// Whether the device has an optional feature, by the name it has in `optional`.
    pub fn has(&self, feature: &str) -> bool {
        self.optional.iter().any(|o| o == feature)
    }

    /// Whether the driver tells what its compiler made of a kernel.
    pub fn tells_statistics(&self) -> bool {
        self.has("pipelineExecutableInfo")
    }

    /// Whether the driver is Mesa's lavapipe of a release that silently ends a loop after 65,535
    /// iterations of a subgroup (all before 23.1).
    pub fn ends_long_loops(&self) -> bool {
        if self.driver_name != "llvmpipe" {
            return false;
        }
        let version = self.driver_info.strip_prefix("Mesa ").unwrap_or("");
        let mut parts = version.split(|c: char| !c.is_ascii_digit()).map(|p| p.parse().unwrap_or(0));
        let (major, minor): (u32, u32) = (parts.next().unwrap_or(0), parts.next().unwrap_or(0));
        // Seen in 22.3, gone in 25.0: anything older than the latter is taken to have it.
        (major, minor) < (25, 0)
    }

    /// Whether a workgroup that has started goes on while others wait for it ("occupancy-bound execution",
    /// Sorensen et al., OOPSLA 2016), so that work may be handed from one to another in a single launch.
    ///
    /// Vulkan promises it nowhere. NVIDIA's driver is known to do it, and the thesis relies on it there;
    /// CPU drivers are known not to; others have not been tried.
    pub fn hands_work_over(&self) -> bool {
        self.driver_name == "NVIDIA"
    }
}

impl fmt::Display for DeviceInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} ({} {})", self.index, self.name, self.driver_name, self.driver_info)
    }
}

/// Which device to open.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Selector {
    /// A discrete GPU before an integrated one before a CPU driver.
    #[default]
    Best,
    /// Position in the loader's list.
    Index(usize),
    /// Part of a name, in any case, or a UUID.
    Name(String),
}

impl FromStr for Selector {
    type Err = std::convert::Infallible;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(text.parse().map_or_else(|_| Self::Name(text.into()), Self::Index))
    }
}

/// How to open a device.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Which one.
    pub device: Selector,
    /// Turn on the validation layer with synchronization checks.
    pub validate: bool,
}

/// An open device with one compute queue. Cheap to clone; the last clone closes it.
#[derive(Clone)]
pub struct Gpu {
    pub(super) inner: Arc<Inner>,
}

/// What tells pipelines apart: the shader's name, whether it reconverges, and its specialization constants.
pub(super) type Compiled = (&'static str, bool, Vec<u32>);

pub(super) struct Inner {
    pub device: ash::Device,
    /// Submitting needs the queue to ourselves.
    pub queue: Mutex<vk::Queue>,
    pub family: u32,
    pub info: DeviceInfo,
    pub layout: vk::PipelineLayout,
    pub memory: vk::PhysicalDeviceMemoryProperties,
    pub executable: Option<khr::pipeline_executable_properties::Device>,
    pub ray_tracing: Option<RayTracing>,
    /// Whether swapchains can be made.
    pub presents: bool,
    pub physical: vk::PhysicalDevice,
    pub full_subgroups: bool,
    pub tick: Timing,
    /// What has been compiled.
    pub pipelines: Mutex<HashMap<Compiled, vk::Pipeline>>,
    messages: Arc<Mutex<Vec<String>>>,
    instance: Instance,
}

impl fmt::Debug for Gpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Gpu({})", self.inner.info)
    }
}

/// The loader, the instance, and the messenger that collects validation messages.
struct Instance {
    instance: ash::Instance,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    /// Reached by the messenger's callback through a raw pointer, so it must outlive it.
    _messages: Arc<Mutex<Vec<String>>>,
    entry: ash::Entry,
}

impl Inner {
    /// What surfaces are made of; neither outlives `self`.
    pub(super) fn vulkan(&self) -> (&ash::Entry, &ash::Instance) {
        (&self.instance.entry, &self.instance.instance)
    }
}

impl Instance {
    /// For windows of a display, if one is given.
    fn new(validate: bool, display: Option<RawDisplayHandle>) -> Result<Self, Error> {
        // SAFETY: loading the system's Vulkan loader runs its initializers, which are sound by the
        // loader's contract; the library stays loaded as long as `entry`.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| Error::NoLoader(e.to_string()))?;
        let messages: Arc<Mutex<Vec<String>>> = Arc::default();
        let app =
            vk::ApplicationInfo::default().application_name(c"broadleaf").api_version(vk::API_VERSION_1_3);
        let mut layers = Vec::new();
        let mut extensions = Vec::new();
        if let Some(display) = display {
            extensions.extend(present::instance_extensions(&entry, display)?.into_iter().map(CStr::as_ptr));
        }
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        let mut messenger_info = messenger_info(&messages);
        if validate {
            // SAFETY: `entry` is loaded.
            let known = unsafe { entry.enumerate_instance_layer_properties() }.context("listing layers")?;
            if !known.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION)) {
                return Err(Error::NoValidation);
            }
            layers.push(VALIDATION.as_ptr());
            extensions.push(ext::debug_utils::NAME.as_ptr());
            extensions.push(ext::validation_features::NAME.as_ptr());
        }
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&app)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&extensions);
        if validate {
            info = info.push_next(&mut features).push_next(&mut messenger_info);
        }
        // SAFETY: every pointer in `info` lives until the call returns.
        let instance = match unsafe { entry.create_instance(&info, None) } {
            Err(vk::Result::ERROR_INCOMPATIBLE_DRIVER) => return Err(Error::NoDevice),
            other => other.context("creating the instance")?,
        };
        let messenger = if validate {
            let utils = ext::debug_utils::Instance::new(&entry, &instance);
            // SAFETY: the extension is enabled; `messages` outlives the messenger (see `Drop`).
            let made = unsafe { utils.create_debug_utils_messenger(&self::messenger_info(&messages), None) };
            Some((utils, made.context("creating the debug messenger")?))
        } else {
            None
        };
        Ok(Self { instance, messenger, _messages: messages, entry })
    }

    fn physical(&self) -> Result<Vec<vk::PhysicalDevice>, Error> {
        // SAFETY: the instance is alive.
        unsafe { self.instance.enumerate_physical_devices() }.context("listing devices")
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: nothing made from the instance is left: `Inner` drops its device first.
        unsafe {
            if let Some((utils, messenger)) = &self.messenger {
                utils.destroy_debug_utils_messenger(*messenger, None);
            }
            self.instance.destroy_instance(None);
        }
    }
}

fn messenger_info(messages: &Arc<Mutex<Vec<String>>>) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    use vk::{DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Type};
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(Severity::WARNING | Severity::ERROR)
        .message_type(Type::GENERAL | Type::VALIDATION | Type::PERFORMANCE)
        .pfn_user_callback(Some(on_message))
        .user_data(Arc::as_ptr(messages).cast_mut().cast())
}

unsafe extern "system" fn on_message(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: Vulkan hands us valid data, and `user` is the message list that `Instance` keeps alive.
    let (text, messages) = unsafe {
        let text = (*data).message_as_c_str().map_or_else(String::new, |t| t.to_string_lossy().into_owned());
        (text, &*user.cast::<Mutex<Vec<String>>>())
    };
    // The loader's own remarks about other installed drivers are not about us, and neither is that a layer is older than
    // the driver and has not heard of its extensions.
    let not_about_us = [
        "loader_",
        "terminator_CreateInstance",
        "is not supported by this layer",
        "includes a structure with unknown VkStructureType",
    ];
    if !not_about_us.iter().any(|remark| text.contains(remark)) {
        eprintln!("validation: {text}");
        if let Ok(mut list) = messages.lock() {
            list.push(text);
        }
    }
    vk::FALSE
}

/// Every device that the loader offers, in its order, also those that cannot run our kernels.
///
/// # Errors
/// No loader, or no driver.
pub fn devices() -> Result<Vec<DeviceInfo>, Error> {
    let instance = Instance::new(false, None)?;
    let all = instance.physical()?;
    Ok(all.iter().enumerate().map(|(i, &p)| described(&instance.instance, p, i)).collect())
}

/// The device that would be opened, without opening it.
///
/// # Errors
/// No loader, no driver, or no device of that name.
pub fn describe(wanted: &Selector) -> Result<DeviceInfo, Error> {
    let mut infos = devices()?;
    let index = select(&infos, wanted)?;
    Ok(infos.swap_remove(index))
}

/// The compute queue family we use: the first that can compute.
fn compute_family(families: &[vk::QueueFamilyProperties]) -> Option<usize> {
    families.iter().position(|f| f.queue_flags.contains(vk::QueueFlags::COMPUTE))
}

fn text(chars: &[std::ffi::c_char]) -> String {
    let bytes: Vec<u8> = chars.iter().take_while(|c| **c != 0).map(|c| c.cast_unsigned()).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

fn described(instance: &ash::Instance, physical: vk::PhysicalDevice, index: usize) -> DeviceInfo {
    // SAFETY: `physical` came from this instance, which is alive.
    let (extensions, families, basic) = unsafe {
        (
            instance.enumerate_device_extension_properties(physical).unwrap_or_default(),
            instance.get_physical_device_queue_family_properties(physical),
            instance.get_physical_device_properties(physical),
        )
    };
    let has = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
    let mut p11 = vk::PhysicalDeviceVulkan11Properties::default();
    let mut p12 = vk::PhysicalDeviceVulkan12Properties::default();
    let mut p13 = vk::PhysicalDeviceVulkan13Properties::default();
    let mut pci = vk::PhysicalDevicePCIBusInfoPropertiesEXT::default();
    let mut sm = vk::PhysicalDeviceShaderSMBuiltinsPropertiesNV::default();
    let mut f12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut f13 = vk::PhysicalDeviceVulkan13Features::default();
    let mut executable = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
    let mut clock = vk::PhysicalDeviceShaderClockFeaturesKHR::default();
    let mut reconvergence = vk::PhysicalDeviceShaderMaximalReconvergenceFeaturesKHR::default();
    let mut structures = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default();
    let mut ray_pipelines = vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default();
    let mut p2 = vk::PhysicalDeviceProperties2::default();
    let mut f2 = vk::PhysicalDeviceFeatures2::default();
    let modern = basic.api_version >= vk::API_VERSION_1_3;
    if modern {
        p2 = p2.push_next(&mut p11).push_next(&mut p12).push_next(&mut p13);
        f2 = f2.push_next(&mut f12).push_next(&mut f13);
    }
    if has(ext::pci_bus_info::NAME) {
        p2 = p2.push_next(&mut pci);
    }
    if has(ash::nv::shader_sm_builtins::NAME) {
        p2 = p2.push_next(&mut sm);
    }
    if has(khr::pipeline_executable_properties::NAME) {
        f2 = f2.push_next(&mut executable);
    }
    if has(khr::shader_clock::NAME) {
        f2 = f2.push_next(&mut clock);
    }
    if has(khr::shader_maximal_reconvergence::NAME) {
        f2 = f2.push_next(&mut reconvergence);
    }
    let traces_rays = RayTracing::EXTENSIONS.into_iter().all(has);
    if traces_rays {
        f2 = f2.push_next(&mut structures).push_next(&mut ray_pipelines);
    }
    // SAFETY: as above; the chains hold only structs of extensions or versions the device has.
    let memory = unsafe {
        instance.get_physical_device_properties2(physical, &mut p2);
        instance.get_physical_device_features2(physical, &mut f2);
        instance.get_physical_device_memory_properties(physical)
    };
    let core = f2.features;
    let family = compute_family(&families);
    let timestamp_bits = family.map_or(0, |f| families[f].timestamp_valid_bits);

    let mut missing = Vec::new();
    let mut need = |there: bool, what: &str| {
        if !there {
            missing.push(what.to_owned());
        }
    };
    need(modern, "Vulkan 1.3");
    need(family.is_some(), "a compute queue");
    need(timestamp_bits > 0, "timestamps");
    need(core.shader_int64 != 0, "shaderInt64");
    need(f12.buffer_device_address != 0, "bufferDeviceAddress");
    need(f12.scalar_block_layout != 0, "scalarBlockLayout");
    need(f13.synchronization2 != 0, "synchronization2");
    let operations = vk::SubgroupFeatureFlags::BASIC
        | vk::SubgroupFeatureFlags::VOTE
        | vk::SubgroupFeatureFlags::ARITHMETIC
        | vk::SubgroupFeatureFlags::BALLOT
        | vk::SubgroupFeatureFlags::SHUFFLE;
    need(
        p11.subgroup_supported_operations.contains(operations),
        "subgroup vote, arithmetic, ballot and shuffle",
    );

    let mut optional = Vec::new();
    let mut may = |there: bool, what: &str| {
        if there {
            optional.push(what.to_owned());
        }
    };
    may(f13.subgroup_size_control != 0 && f13.compute_full_subgroups != 0, "subgroupSizeControl");
    may(executable.pipeline_executable_info != 0, "pipelineExecutableInfo");
    may(sm.shader_sm_count > 0, "shaderSMBuiltins");
    may(clock.shader_device_clock != 0, "shaderDeviceClock");
    may(reconvergence.shader_maximal_reconvergence != 0, RECONVERGENCE);
    let traces_rays = structures.acceleration_structure != 0 && ray_pipelines.ray_tracing_pipeline != 0;
    may(traces_rays, RAY_TRACING);
    may(traces_rays && ray_pipelines.ray_tracing_pipeline_trace_rays_indirect != 0, TRACE_INDIRECT);

    let [d0, d1, d2, d3, d4, d5, d6, d7, d8, d9, d10, d11, d12, d13, d14, d15] = p11.device_uuid;
    let hex = |bytes: &[u8]| bytes.iter().map(|b| format!("{b:02x}")).collect::<String>();
    let uuid = [
        hex(&[d0, d1, d2, d3]),
        hex(&[d4, d5]),
        hex(&[d6, d7]),
        hex(&[d8, d9]),
        hex(&[d10, d11, d12, d13, d14, d15]),
    ]
    .join("-");
    let version = basic.api_version;
    let heaps = &memory.memory_heaps[..memory.memory_heap_count as usize];
    let local = heaps.iter().filter(|h| h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL));
    DeviceInfo {
        index,
        name: text(&basic.device_name),
        kind: match basic.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
            vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
            vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
            vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
            _ => DeviceKind::Other,
        },
        vendor_id: basic.vendor_id,
        device_id: basic.device_id,
        uuid,
        api_version: format!(
            "{}.{}.{}",
            vk::api_version_major(version),
            vk::api_version_minor(version),
            vk::api_version_patch(version)
        ),
        driver_name: text(&p12.driver_name),
        driver_info: text(&p12.driver_info),
        driver_version: basic.driver_version,
        subgroup_size: p11.subgroup_size.max(1),
        subgroup_size_range: [p13.min_subgroup_size, p13.max_subgroup_size],
        shared_memory_bytes: basic.limits.max_compute_shared_memory_size,
        // The last limit holds where a kernel fixes its subgroup size, as ours do.
        max_workgroup_size: basic
            .limits
            .max_compute_work_group_invocations
            .min(basic.limits.max_compute_work_group_size[0])
            .min(p13.max_compute_workgroup_subgroups.max(1) * p11.subgroup_size.max(1)),
        max_workgroup_axes: basic.limits.max_compute_work_group_size,
        max_workgroups: basic.limits.max_compute_work_group_count,
        storage_buffer_bytes: u64::from(basic.limits.max_storage_buffer_range),
        heaps: heaps.iter().map(|h| (h.size, h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))).collect(),
        timestamp_period_ns: if timestamp_bits > 0 { basic.limits.timestamp_period } else { 0.0 },
        timestamp_bits,
        memory_bytes: local.map(|h| h.size).max().unwrap_or(0),
        max_allocation_bytes: p11.max_memory_allocation_size,
        multiprocessors: sm.shader_sm_count,
        subgroups_per_multiprocessor: sm.shader_warps_per_sm,
        pci: has(ext::pci_bus_info::NAME).then(|| {
            format!(
                "{:08x}:{:02x}:{:02x}.{:x}",
                pci.pci_domain, pci.pci_bus, pci.pci_device, pci.pci_function
            )
        }),
        optional,
        missing,
    }
}

fn select(infos: &[DeviceInfo], wanted: &Selector) -> Result<usize, Error> {
    let no_such = |wanted: &str| Error::NoSuchDevice {
        wanted: wanted.into(),
        there: infos.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "),
    };
    match wanted {
        Selector::Best => infos
            .iter()
            .filter(|i| i.missing.is_empty())
            .min_by_key(|i| (i.kind, i.index))
            .or(infos.first())
            .map(|i| i.index)
            .ok_or(Error::NoDevice),
        Selector::Index(n) => infos.get(*n).map(|i| i.index).ok_or_else(|| no_such(&n.to_string())),
        Selector::Name(name) => {
            let lower = name.to_lowercase();
            let plain = lower.replace('-', "");
            infos
                .iter()
                .find(|i| i.uuid.replace('-', "") == plain || i.name.to_lowercase().contains(&lower))
                .map(|i| i.index)
                .ok_or_else(|| no_such(name))
        }
    }
}

impl Gpu {
    /// Opens a device.
    ///
    /// # Errors
    /// No loader, no driver, no device of that name, or one that lacks what the kernels need.
    pub fn open(options: &Options) -> Result<Self, Error> {
        Self::open_with(options, None)
    }

    /// Opens a device that can show pictures in windows of a display ([`super::Presenter`]).
    ///
    /// # Errors
    /// As of [`Gpu::open`]; or the device cannot.
    pub fn open_for_display(options: &Options, display: impl HasDisplayHandle) -> Result<Self, Error> {
        let no = |e: HandleError| Error::NoPresentation { device: "Vulkan".into(), reason: e.to_string() };
        Self::open_with(options, Some(display.display_handle().map_err(no)?.as_raw()))
    }

    fn open_with(options: &Options, display: Option<RawDisplayHandle>) -> Result<Self, Error> {
        let instance = Instance::new(options.validate, display)?;
        let physical = instance.physical()?;
        let infos: Vec<_> =
            physical.iter().enumerate().map(|(i, &p)| described(&instance.instance, p, i)).collect();
        let index = select(&infos, &options.device)?;
        let info = infos[index].clone();
        let physical = physical[index];
        if !info.missing.is_empty() {
            return Err(Error::Unsupported { device: info.name, missing: info.missing.join(", ") });
        }
        let full_subgroups = info.has("subgroupSizeControl")
            && (info.subgroup_size_range[0]..=info.subgroup_size_range[1]).contains(&info.subgroup_size);

        // SAFETY: `physical` belongs to this live instance.
        let families = unsafe { instance.instance.get_physical_device_queue_family_properties(physical) };
        let family = u32::try_from(compute_family(&families).expect("checked above")).expect("few families");
        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
        let mut extensions: Vec<CString> = Vec::new();
        let mut f12 = vk::PhysicalDeviceVulkan12Features::default()
            .buffer_device_address(true)
            .scalar_block_layout(true);
        let mut f13 = vk::PhysicalDeviceVulkan13Features::default()
            .synchronization2(true)
            // Part of Vulkan 1.3: workgroups that are sized as kernels in Slang want it.
            .maintenance4(true)
            .subgroup_size_control(full_subgroups)
            .compute_full_subgroups(full_subgroups);
        let mut executable = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default()
            .pipeline_executable_info(true);
        let mut info2 = vk::PhysicalDeviceFeatures2::default()
            .features(vk::PhysicalDeviceFeatures::default().shader_int64(true))
            .push_next(&mut f12)
            .push_next(&mut f13);
        let mut clock = vk::PhysicalDeviceShaderClockFeaturesKHR::default().shader_device_clock(true);
        if info.has("shaderDeviceClock") {
            extensions.push(khr::shader_clock::NAME.into());
            info2 = info2.push_next(&mut clock);
        }
        let mut reconvergence = vk::PhysicalDeviceShaderMaximalReconvergenceFeaturesKHR::default()
            .shader_maximal_reconvergence(true);
        if info.has(RECONVERGENCE) {
            extensions.push(khr::shader_maximal_reconvergence::NAME.into());
            info2 = info2.push_next(&mut reconvergence);
        }
        if info.tells_statistics() {
            extensions.push(khr::pipeline_executable_properties::NAME.into());
            info2 = info2.push_next(&mut executable);
        }
        let traces_rays = info.has(RAY_TRACING);
        let mut structures =
            vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
        let mut ray_pipelines = vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default()
            .ray_tracing_pipeline(true)
            .ray_tracing_pipeline_trace_rays_indirect(info.has(TRACE_INDIRECT));
        if traces_rays {
            extensions.extend(RayTracing::EXTENSIONS.map(Into::into));
            info2 = info2.push_next(&mut structures).push_next(&mut ray_pipelines);
        }
        if display.is_some() {
            // SAFETY: `physical` belongs to this live instance.
            let there = unsafe { instance.instance.enumerate_device_extension_properties(physical) }
                .context("listing the device's extensions")?;
            if !there.iter().any(|e| e.extension_name_as_c_str() == Ok(khr::swapchain::NAME)) {
                return Err(Error::NoPresentation {
                    device: info.name,
                    reason: "it has no VK_KHR_swapchain".into(),
                });
            }
            extensions.push(khr::swapchain::NAME.into());
        }
        let names: Vec<_> = extensions.iter().map(|e| e.as_ptr()).collect();
        let create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&names)
            .push_next(&mut info2);
        // SAFETY: every feature and extension asked for was reported by `described`.
        let device = unsafe { instance.instance.create_device(physical, &create, None) }
            .context("opening the device")?;
        let executable = info
            .tells_statistics()
            .then(|| khr::pipeline_executable_properties::Device::new(&instance.instance, &device));

        let ray_tracing =
            traces_rays.then(|| RayTracing::new(&instance.instance, physical, &device)).transpose()?;

        let ranges =
            [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(PUSH_BYTES)];
        // SAFETY: the device is alive, and the create infos live until each call returns.
        let (queue, layout, memory) = unsafe {
            let layout = device
                .create_pipeline_layout(
                    &vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&ranges),
                    None,
                )
                .context("creating the pipeline layout")?;
            let memory = instance.instance.get_physical_device_memory_properties(physical);
            (device.get_device_queue(family, 0), layout, memory)
        };
        let messages = Arc::clone(&instance._messages);
        let tick = Timing { period_ns: f64::from(info.timestamp_period_ns), bits: info.timestamp_bits };
        Ok(Self {
            inner: Arc::new(Inner {
                device,
                queue: Mutex::new(queue),
                family,
                info,
                layout,
                memory,
                executable,
                ray_tracing,
                presents: display.is_some(),
                physical,
                full_subgroups,
                tick,
                pipelines: Mutex::default(),
                messages,
                instance,
            }),
        })
    }

    /// What this device is.
    pub fn info(&self) -> &DeviceInfo {
        &self.inner.info
    }

    /// What the validation layer has said so far; empty when all is well or it is off.
    pub fn validation_messages(&self) -> Vec<String> {
        self.inner.messages.lock().map(|m| m.clone()).unwrap_or_default()
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        // SAFETY: buffers, kernels and passes hold a `Gpu`, so none is left; the queue is idle because
        // every submission waits for its fence, and we wait once more in case one failed.
        unsafe {
            let _ = self.device.device_wait_idle();
            for &pipeline in self.pipelines.lock().iter().flat_map(|all| all.values()) {
                self.device.destroy_pipeline(pipeline, None);
            }
            self.device.destroy_pipeline_layout(self.layout, None);
            if let Some(ray_tracing) = &self.ray_tracing {
                ray_tracing.destroy(&self.device);
            }
            self.device.destroy_device(None);
        }
        let _ = &self.instance;
    }
}

/// A device that tells nothing, for tests to fill in.
#[cfg(test)]
pub(super) fn unknown() -> DeviceInfo {
    DeviceInfo {
        index: 0,
        name: String::new(),
        kind: DeviceKind::Other,
        vendor_id: 0,
        device_id: 0,
        uuid: String::new(),
        api_version: String::new(),
        driver_name: String::new(),
        driver_info: String::new(),
        driver_version: 0,
        subgroup_size: 32,
        subgroup_size_range: [32, 32],
        shared_memory_bytes: 0,
        max_workgroup_size: 1024,
        max_workgroup_axes: [1024; 3],
        max_workgroups: [65535; 3],
        storage_buffer_bytes: 0,
        heaps: vec![],
        timestamp_period_ns: 1.0,
        timestamp_bits: 64,
        memory_bytes: 0,
        max_allocation_bytes: 0,
        multiprocessors: 0,
        subgroups_per_multiprocessor: 0,
        pci: None,
        optional: vec![],
        missing: vec![],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(index: usize, kind: DeviceKind, name: &str) -> DeviceInfo {
        let uuid = format!("0000000{index}-0000-0000-0000-000000000000");
        DeviceInfo { index, name: name.into(), kind, uuid, ..unknown() }
    }

    #[test]
    fn a_discrete_gpu_comes_before_an_integrated_one_before_a_cpu_driver() {
        let mut all = vec![
            device(0, DeviceKind::Cpu, "llvmpipe"),
            device(1, DeviceKind::Integrated, "Graphics 770"),
            device(2, DeviceKind::Discrete, "GeForce"),
        ];
        assert_eq!(select(&all, &Selector::Best).unwrap(), 2);
        all[2].missing.push("shaderInt64".into());
        assert_eq!(select(&all, &Selector::Best).unwrap(), 1);
        all.truncate(1);
        assert_eq!(select(&all, &Selector::Best).unwrap(), 0);
    }

    #[test]
    fn a_device_is_found_by_number_part_of_its_name_and_uuid() {
        let all = [device(0, DeviceKind::Cpu, "llvmpipe"), device(1, DeviceKind::Discrete, "GeForce RTX")];
        let pick = |text: &str| select(&all, &text.parse().unwrap());
        assert_eq!(pick("1").unwrap(), 1);
        assert_eq!(pick("geforce").unwrap(), 1);
        assert_eq!(pick("00000001-0000-0000-0000-000000000000").unwrap(), 1);
        let error = pick("radeon").unwrap_err().to_string();
        assert!(error.contains("GeForce RTX") && error.contains("radeon"), "{error}");
        assert!(pick("2").is_err());
    }

    #[test]
    fn only_old_lavapipe_ends_long_loops() {
        let mut info = device(0, DeviceKind::Cpu, "llvmpipe (LLVM 15)");
        info.driver_name = "llvmpipe".into();
        info.driver_info = "Mesa 22.3.6 (LLVM 15.0.6)".into();
        assert!(info.ends_long_loops());
        info.driver_info = "Mesa 25.0.7-2 (LLVM 19)".into();
        assert!(!info.ends_long_loops());
        info.driver_name = "NVIDIA".into();
        info.driver_info = "580.159".into();
        assert!(!info.ends_long_loops());
    }
}
