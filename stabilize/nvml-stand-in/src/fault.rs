//! Calls that go wrong.

use crate::State;
use nvml_wrapper_sys::bindings::*;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Something that goes wrong when a function is called. If several faults are due in one call all
/// happen; of those that decide what is returned, the first.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// The function's name in C without `nvml`, as `DeviceSetGpuLockedClocks` or `Init_v2`; `*` stands
    /// for all that take a device's handle or give one.
    pub function: String,
    /// So many calls pass before the first that is hit; each that passes takes one away.
    #[serde(default)]
    pub skip: u32,
    /// So many calls are still to be hit; all that follow if `None`.
    #[serde(default)]
    pub times: Option<u32>,
    /// What happens.
    pub kind: FaultKind,
}

/// What happens in a call that a [`Fault`] hits.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FaultKind {
    /// The call does nothing but fail.
    Error(ErrorCode),
    /// The call does its work and returns late. The settings are changed before the wait: that is the
    /// harder case for a caller that is killed meanwhile.
    Slow {
        /// How long it waits, in milliseconds.
        milliseconds: u64,
    },
    /// The GPU is being slowed down: one of its counters rises, and the call does its work. A call
    /// that is about no certain GPU raises the counter of all.
    Throttle {
        /// Which counter, one of [`COUNTERS`](crate::COUNTERS).
        counter: String,
        /// By how much it rises, in nanoseconds.
        nanoseconds: u64,
    },
    /// The call does nothing and reports success. One that reads leaves the caller's memory as it is.
    Silent,
}

/// How a call fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ErrorCode {
    /// `NVML_ERROR_NO_PERMISSION`
    NoPermission,
    /// `NVML_ERROR_NOT_SUPPORTED`
    NotSupported,
    /// `NVML_ERROR_GPU_IS_LOST`
    GpuIsLost,
    /// `NVML_ERROR_UNKNOWN`
    Unknown,
    /// `NVML_ERROR_TIMEOUT`
    Timeout,
    /// `NVML_ERROR_INVALID_ARGUMENT`
    InvalidArgument,
    /// `NVML_ERROR_DRIVER_NOT_LOADED`
    DriverNotLoaded,
}

impl ErrorCode {
    /// NVML's number.
    pub fn code(self) -> u32 {
        match self {
            ErrorCode::NoPermission => nvmlReturn_enum_NVML_ERROR_NO_PERMISSION,
            ErrorCode::NotSupported => nvmlReturn_enum_NVML_ERROR_NOT_SUPPORTED,
            ErrorCode::GpuIsLost => nvmlReturn_enum_NVML_ERROR_GPU_IS_LOST,
            ErrorCode::Unknown => nvmlReturn_enum_NVML_ERROR_UNKNOWN,
            ErrorCode::Timeout => nvmlReturn_enum_NVML_ERROR_TIMEOUT,
            ErrorCode::InvalidArgument => nvmlReturn_enum_NVML_ERROR_INVALID_ARGUMENT,
            ErrorCode::DriverNotLoaded => nvmlReturn_enum_NVML_ERROR_DRIVER_NOT_LOADED,
        }
    }
}

impl Fault {
    /// The fault that hits every call of a function.
    pub fn always(function: &str, kind: FaultKind) -> Fault {
        Fault { function: function.into(), skip: 0, times: None, kind }
    }

    fn concerns(&self, function: &str) -> bool {
        match self.function.as_str() {
            "*" => function.starts_with("Device") && function != "DeviceGetCount_v2",
            name => name == function,
        }
    }

    /// Counts a call of its function, and says whether it is hit.
    fn is_due(&mut self) -> bool {
        if self.skip > 0 {
            self.skip -= 1;
            return false;
        }
        match &mut self.times {
            None => true,
            Some(0) => false,
            Some(times) => {
                *times -= 1;
                true
            }
        }
    }
}

/// What the faults make of one call.
#[derive(Default)]
pub(crate) struct Met {
    /// What is returned at once, without doing the work.
    pub outcome: Option<Result<(), nvmlReturn_t>>,
    /// How much later the call returns.
    pub pause: Duration,
}

/// Lets the faults see one call of `function`, for the GPU at `index` if it is for one.
pub(crate) fn meet(state: &mut State, function: &str, index: Option<usize>) -> Met {
    let mut met = Met::default();
    for fault in &mut state.faults {
        if !fault.concerns(function) || !fault.is_due() {
            continue;
        }
        match &fault.kind {
            FaultKind::Error(code) => {
                met.outcome.get_or_insert(Err(code.code()));
            }
            FaultKind::Silent => {
                met.outcome.get_or_insert(Ok(()));
            }
            FaultKind::Slow { milliseconds } => met.pause += Duration::from_millis(*milliseconds),
            FaultKind::Throttle { counter, nanoseconds } => {
                for (at, gpu) in state.gpus.iter_mut().enumerate() {
                    if index.is_none_or(|index| index == at) {
                        *gpu.counters.entry(counter.clone()).or_default() += nanoseconds;
                    }
                }
            }
        }
    }
    met
}
