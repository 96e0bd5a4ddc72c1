//! Vulkan: a device, its buffers, compute kernels, the driver's own ray tracing, passes with timestamps, and where
//! somebody looks on, pictures in a window.
//!
//! Knows nothing of BVHs. Every buffer is reached by its device address, handed to kernels in push
//! constants, so there are no descriptor sets; a kernel's arguments are one plain struct.

mod buffer;
mod device;
mod error;
#[cfg(test)]
pub(crate) mod interface;
mod kernel;
mod occupancy;
mod pass;
mod present;
mod ray_tracing;
mod resources;

pub use buffer::Buffer;
pub use device::{DeviceInfo, DeviceKind, Gpu, Options, Selector, describe, devices};
pub use error::Error;
pub use kernel::{Kernel, Statistic};
pub use occupancy::{Limit, MultiprocessorLimits, Occupancy, UnknownLimits};
pub use pass::{Pass, Span, Timings};
pub use present::Presenter;
pub use ray_tracing::{
    AccelerationStructure, BuildSizes, CompactedSize, Geometry, Instance, Launch, Prefer, RAY_TRACING,
    RayPipeline, Recipe, TRACE_INDIRECT,
};
pub use resources::Resources;

/// One compiled shader, embedded by the build script.
#[derive(Debug)]
pub struct Shader {
    /// Its source's path under `src/`, without the extension.
    pub name: &'static str,
    /// SPIR-V words as bytes.
    pub spirv: &'static [u8],
}

impl Shader {
    /// SHA-256 of the SPIR-V, in hexadecimal: what a record names a kernel by.
    pub fn sha256(&self) -> String {
        use sha2::{Digest, Sha256};
        Sha256::digest(self.spirv).iter().map(|b| format!("{b:02x}")).collect()
    }
}

/// Every shader of this build.
pub mod shaders {
    use super::Shader;
    use crate::permutations::Layout;
    include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
}

/// Workgroups of `size` invocations that cover `items`.
pub fn groups(items: usize, size: u32) -> u32 {
    u32::try_from(items.div_ceil(size as usize)).expect("fewer than 2^32 workgroups")
}
