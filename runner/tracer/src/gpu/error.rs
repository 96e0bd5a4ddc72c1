use ash::vk;

/// What can go wrong between us and the driver. Each message names the cause and a way out.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The Vulkan loader could not be opened.
    #[error(
        "the Vulkan loader (libvulkan.so.1) cannot be opened: {0}; run scripts/setup, or install libvulkan1 and a driver"
    )]
    NoLoader(String),
    /// The loader works but no driver offers a device.
    #[error(
        "no Vulkan device: the loader found no driver that works; install your GPU's driver, or Mesa's CPU driver (mesa-vulkan-drivers), and check VK_DRIVER_FILES"
    )]
    NoDevice,
    /// `--device` names nothing that is there.
    #[error("no device matches {wanted:?}; there are: {there}")]
    NoSuchDevice {
        /// As the user wrote it.
        wanted: String,
        /// Index and name of each device.
        there: String,
    },
    /// A contraction in a single launch was ended before its tree was complete.
    #[error(
        "the driver of {device} ended a contraction before its tree was complete: it ends long loops, or does \
         not let workgroups wait for each other; use contract.form=levels"
    )]
    EndedEarly {
        /// The device's name.
        device: String,
    },
    /// The device cannot run these kernels.
    #[error(
        "{device} lacks {missing}, which every kernel here needs; choose another with --device, or update its driver"
    )]
    Unsupported {
        /// The device's name.
        device: String,
        /// What it lacks, in Vulkan's terms.
        missing: String,
    },
    /// There is no way from the device to a window.
    #[error(
        "{device} cannot show pictures in this window: {reason}; choose another with --device, or leave the window out: runner render"
    )]
    NoPresentation {
        /// The device's name.
        device: String,
        /// What is in the way.
        reason: String,
    },
    /// The validation layer was asked for and is not installed.
    #[error(
        "the validation layer VK_LAYER_KHRONOS_validation is not installed; run scripts/setup, install vulkan-validationlayers, or leave out --validate"
    )]
    NoValidation,
    /// An allocation failed or cannot succeed.
    #[error("{what} needs {} MiB, but the largest memory heap of {device} has {} MiB{}; use a smaller scene or picture, or another --device", bytes >> 20, heap >> 20, if *free_hint { " and not all of it is free" } else { "" })]
    OutOfMemory {
        /// The buffer's name.
        what: String,
        /// Its size.
        bytes: u64,
        /// The device's name.
        device: String,
        /// Size of the heap.
        heap: u64,
        /// The driver refused although the size alone would fit.
        free_hint: bool,
    },
    /// The device is gone: a crash, a reset, or the operating system's watchdog.
    #[error(
        "the device was lost during {0}: the driver crashed, was reset, or ended a kernel that ran too long; look in the kernel log, try a smaller --size or scene, and run with --validate"
    )]
    DeviceLost(String),
    /// More work was recorded than a pass can time.
    #[error("a pass holds more than {0} timed spans; record it in several passes")]
    TooManySpans(u32),
    /// A kernel's grid exceeds the device.
    #[error("{name} needs {groups} workgroups, the device allows {limit}; use a smaller scene or picture")]
    TooManyGroups {
        /// The dispatch.
        name: String,
        /// Asked for.
        groups: u32,
        /// `maxComputeWorkGroupCount[0]`.
        limit: u32,
    },
    /// The device does not reconverge maximally.
    #[error(
        "{device} lacks VK_KHR_shader_maximal_reconvergence: leave out glsl.reconverge and slang.reconverge"
    )]
    NoReconvergence {
        /// The device's name.
        device: String,
    },
    /// A workgroup size that the device cannot run.
    #[error(
        "{kernel}: a workgroup of {size} invocations is not possible on this device: it must be a multiple of the subgroup size {subgroup} and at most {limit}"
    )]
    WorkgroupSize {
        /// The kernel.
        kernel: &'static str,
        /// Asked for.
        size: u32,
        /// The device's subgroup size.
        subgroup: u32,
        /// The device's limit.
        limit: u32,
    },
    /// Anything else the driver reported.
    #[error("{call}: the driver answered {result:?}")]
    Vulkan {
        /// What we asked for.
        call: String,
        /// Vulkan's result code.
        result: vk::Result,
    },
}

impl Error {
    /// Wraps a result code, keeping device loss apart from the rest.
    pub(super) fn from_vk(call: &str, result: vk::Result) -> Self {
        match result {
            vk::Result::ERROR_DEVICE_LOST => Self::DeviceLost(call.into()),
            _ => Self::Vulkan { call: call.into(), result },
        }
    }
}

/// Shortens `.map_err(...)` on Vulkan calls.
pub(super) trait Context<T> {
    fn context(self, call: &str) -> Result<T, Error>;
}

impl<T> Context<T> for Result<T, vk::Result> {
    fn context(self, call: &str) -> Result<T, Error> {
        self.map_err(|result| Error::from_vk(call, result))
    }
}
