use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// The Vulkan device that built and traced.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Device {
    /// Name as the driver gives it.
    pub name: String,
    /// Name of the vendor.
    pub vendor: String,
    /// Vulkan's number of the vendor (for most, the one of PCI).
    pub vendor_id: u32,
    /// The vendor's number of the device.
    pub device_id: u32,
    /// What sort of device it is.
    pub kind: DeviceKind,
    /// The driver.
    pub driver: Driver,
    /// Version of Vulkan that the device offers, such as `1.3.224`.
    pub api_version: String,
    /// Vulkan's device UUID: 32 hexadecimal digits with hyphens after the 8th, 12th, 16th and 20th.
    pub uuid: String,
    /// Address on the PCI bus, such as `0000:01:00.0`; absent where the driver does not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pci: Option<String>,
    /// The limits that matter to ray tracing.
    pub limits: Limits,
    /// Optional features and extensions that the run used, by their Vulkan names.
    pub features: BTreeSet<String>,
}

/// What sort of device it is, in Vulkan's words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DeviceKind {
    /// A GPU with memory of its own.
    Discrete,
    /// A GPU that shares the host's memory.
    Integrated,
    /// A GPU inside a virtual machine.
    Virtual,
    /// A driver that runs on the CPU.
    Cpu,
    /// Anything else.
    Other,
}

/// The driver of a device.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Driver {
    /// Name of the driver.
    pub name: String,
    /// Its version, as its vendor writes it.
    pub version: String,
    /// What else it says about itself.
    pub info: String,
}

/// The limits of a device that matter to ray tracing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Limits {
    /// Lanes of a subgroup.
    pub subgroup_size: u32,
    /// Fewest lanes of a subgroup, where the size may be chosen.
    pub subgroup_size_min: u32,
    /// Most lanes of a subgroup, where the size may be chosen.
    pub subgroup_size_max: u32,
    /// Shared memory of a workgroup in bytes.
    pub shared_memory_bytes: u32,
    /// Most invocations of a workgroup.
    pub workgroup_invocations: u32,
    /// Most invocations of a workgroup along x, y and z.
    pub workgroup_size: [u32; 3],
    /// Most workgroups of a dispatch along x, y and z.
    pub workgroup_count: [u32; 3],
    /// Most bytes of one storage buffer.
    pub storage_buffer_bytes: u64,
    /// Nanoseconds that one tick of a GPU timestamp takes.
    pub timestamp_period_nanoseconds: f64,
    /// Bits of a timestamp that count.
    pub timestamp_bits: u32,
    /// The memory heaps.
    pub heaps: Vec<Heap>,
}

/// A heap of memory.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Heap {
    /// Size in bytes.
    pub bytes: u64,
    /// Whether it is the device's own memory.
    pub device_local: bool,
}
