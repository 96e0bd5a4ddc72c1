use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A kernel that was timed, and what it takes from the device. What the driver does not tell is absent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Kernel {
    /// Name of its shader, as in the record's `shaders`.
    pub name: String,
    /// What it was launched for, such as `primary` or `secondary` rays.
    pub purpose: String,
    /// Invocations of a workgroup.
    pub workgroup_size: u32,
    /// Invocations of a subgroup.
    pub subgroup_size: u32,
    /// Registers of 32 bits that an invocation takes; vector registers where there are others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub registers: Option<u32>,
    /// Bytes of local memory that an invocation takes: stacks, and registers spilled there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub local_bytes: Option<u64>,
    /// Bytes of shared memory that a workgroup takes, registers spilled there included.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shared_bytes: Option<u64>,
    /// What the compiler found no registers for, as the driver counts it: registers or instructions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spills: Option<u64>,
    /// Bytes of machine code.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub code_bytes: Option<u64>,
    /// Subgroups of it that a multiprocessor can hold at once, as a share of those it can hold of any kernel:
    /// above 0, at most 1. Computed from the fields above and the limits of the device's multiprocessors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub occupancy: Option<f64>,
    /// What keeps a multiprocessor from holding more; there if `occupancy` is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limited_by: Option<OccupancyLimit>,
}

/// What keeps a multiprocessor from holding more workgroups of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OccupancyLimit {
    /// Its subgroups: it is full, or has too few left for another workgroup.
    Subgroups,
    /// Its workgroups, which are small here.
    Workgroups,
    /// Its registers.
    Registers,
    /// Its shared memory.
    SharedMemory,
}
