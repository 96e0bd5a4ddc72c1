use crate::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fmt;

/// What the device said about itself at one moment. A sample without its clock is not trusted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "state", rename_all = "snake_case")]
pub enum Telemetry {
    /// The device answered.
    Available(Reading),
    /// Nobody could be asked.
    Unavailable {
        /// Why not.
        reason: String,
    },
}

/// Clocks, temperature and power at one moment. What this device does not report is absent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reading {
    /// When it was read.
    pub time: Timestamp,
    /// Clock of the graphics engine in MHz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub graphics_clock_mhz: Option<u32>,
    /// Clock of the streaming multiprocessors in MHz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sm_clock_mhz: Option<u32>,
    /// Clock of the memory in MHz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory_clock_mhz: Option<u32>,
    /// Temperature of the GPU in degrees Celsius.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature_celsius: Option<u32>,
    /// Power drawn by the board in watts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power_watts: Option<f64>,
    /// Performance state: 0 is the fastest, 15 the slowest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub performance_state: Option<u32>,
    /// Why the clocks were not higher at that moment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub throttle_reasons: Option<BTreeSet<ThrottleReason>>,
}

/// Why a GPU's clocks are what they are, in NVML's words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ThrottleReason {
    /// Nothing runs on the GPU.
    GpuIdle,
    /// Somebody chose these clocks.
    ApplicationsClocksSetting,
    /// The limit of power.
    SoftwarePowerCap,
    /// Heat, power brake or a fast rise of current: the hardware halves the clocks or worse.
    HardwareSlowdown,
    /// Another GPU of the same group is slower.
    SyncBoost,
    /// The driver's limit of temperature.
    SoftwareThermalSlowdown,
    /// The hardware's limit of temperature.
    HardwareThermalSlowdown,
    /// The power supply asked for less.
    HardwarePowerBrake,
    /// The display's clock.
    DisplayClockSetting,
    /// One that this version does not know.
    Other,
}

impl ThrottleReason {
    /// Whether the reason slows a running kernel against anybody's will: being idle does not, nor do
    /// clocks that somebody chose.
    pub fn slows(self) -> bool {
        !matches!(
            self,
            ThrottleReason::GpuIdle
                | ThrottleReason::ApplicationsClocksSetting
                | ThrottleReason::DisplayClockSetting
        )
    }
}

impl fmt::Display for ThrottleReason {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            ThrottleReason::GpuIdle => "idle",
            ThrottleReason::ApplicationsClocksSetting => "chosen clocks",
            ThrottleReason::SoftwarePowerCap => "software power cap",
            ThrottleReason::HardwareSlowdown => "hardware slowdown",
            ThrottleReason::SyncBoost => "sync boost",
            ThrottleReason::SoftwareThermalSlowdown => "software thermal slowdown",
            ThrottleReason::HardwareThermalSlowdown => "hardware thermal slowdown",
            ThrottleReason::HardwarePowerBrake => "hardware power brake",
            ThrottleReason::DisplayClockSetting => "display clock",
            ThrottleReason::Other => "another reason",
        })
    }
}

impl Telemetry {
    /// Telemetry that is not there, and why.
    pub fn unavailable(reason: impl Into<String>) -> Telemetry {
        Telemetry::Unavailable { reason: reason.into() }
    }

    /// The reading, where there is one.
    pub fn reading(&self) -> Option<&Reading> {
        match self {
            Telemetry::Available(reading) => Some(reading),
            Telemetry::Unavailable { .. } => None,
        }
    }

    /// Whether the device was being slowed down at that moment; unknown where it did not say.
    pub fn throttled(&self) -> Option<bool> {
        let reasons = self.reading()?.throttle_reasons.as_ref()?;
        Some(reasons.iter().any(|reason| reason.slows()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(reasons: &[ThrottleReason]) -> Telemetry {
        let mut reading = crate::example().results[0].views[0].before.reading().unwrap().clone();
        reading.throttle_reasons = Some(reasons.iter().copied().collect());
        Telemetry::Available(reading)
    }

    #[test]
    fn idling_and_chosen_clocks_are_no_throttling() {
        let harmless = [ThrottleReason::GpuIdle, ThrottleReason::ApplicationsClocksSetting];
        assert_eq!(with(&harmless).throttled(), Some(false));
        assert_eq!(with(&[]).throttled(), Some(false));
    }

    #[test]
    fn heat_and_power_are_throttling() {
        for reason in [
            ThrottleReason::SoftwarePowerCap,
            ThrottleReason::HardwareSlowdown,
            ThrottleReason::HardwareThermalSlowdown,
        ] {
            assert_eq!(with(&[ThrottleReason::GpuIdle, reason]).throttled(), Some(true));
        }
    }

    #[test]
    fn nobody_asked_means_nobody_knows() {
        assert_eq!(Telemetry::unavailable("no driver").throttled(), None);
    }
}
