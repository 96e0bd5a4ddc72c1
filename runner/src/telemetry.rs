//! Clocks, temperature and power of an NVIDIA GPU, through NVML. Only reads: locking clocks is
//! `stabilize`'s business.

use nvml_wrapper::enum_wrappers::device::{Clock, ClockId};
use nvml_wrapper::{Device, Nvml};
use record::ThrottleTimes;

/// PCI's number of the one vendor that can be asked.
const NVIDIA: u32 = 0x10de;

/// A way to ask one device about itself, or the reason why there is none.
pub struct Telemetry(Result<Source, String>);

/// What can be asked between two samples without keeping the device waiting.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Moment {
    /// Clock of the streaming multiprocessors in MHz, where the device tells.
    pub sm_clock_mhz: Option<u32>,
    /// Whether the device is being slowed down, where it tells.
    pub throttled: Option<bool>,
}

struct Source {
    nvml: Nvml,
    /// NVML's number of the device.
    index: u32,
}

impl Source {
    fn device(&self) -> Result<Device<'_>, nvml_wrapper::error::NvmlError> {
        self.nvml.device_by_index(self.index)
    }
}

impl Telemetry {
    /// Finds the device with Vulkan's number of the vendor and UUID, or else with the PCI address
    /// (`0000:01:00.0`). Never fails: what cannot be asked is unavailable, for a reason.
    pub fn open(vendor_id: u32, uuid: [u8; 16], pci: Option<&str>) -> Telemetry {
        if vendor_id != NVIDIA {
            let reason = "clocks and temperature are read through NVML, for NVIDIA's GPUs only";
            return Telemetry(Err(reason.into()));
        }
        Telemetry(nvml::load().and_then(|nvml| {
            let index = nvml::find(&nvml, uuid, pci)
                .map_err(|error| format!("NVML does not know this device: {error}"))?;
            Ok(Source { nvml, index })
        }))
    }

    /// What the device says now.
    pub fn sample(&self) -> record::Telemetry {
        match &self.0 {
            Err(reason) => record::Telemetry::unavailable(reason),
            Ok(source) => match source.device() {
                Ok(device) => nvml::reading(&device),
                Err(error) => record::Telemetry::unavailable(error.to_string()),
            },
        }
    }

    /// The little that says whether a sample can be trusted.
    pub fn moment(&self) -> Moment {
        self.ask(|device| Moment {
            sm_clock_mhz: device.clock_info(Clock::SM).ok(),
            throttled: nvml::throttle_reasons(device)
                .map(|reasons| reasons.iter().any(|reason| reason.slows())),
        })
        .unwrap_or_default()
    }

    /// How long the device has been slowed down so far; nothing where it does not count.
    pub fn throttle_times(&self) -> ThrottleTimes {
        self.ask(nvml::throttle_times).unwrap_or_default()
    }

    /// The clock in MHz that the device runs at by default, where it tells.
    pub fn base_clock(&self) -> Option<u32> {
        self.ask(|device| device.clock(Clock::SM, ClockId::DefaultAppClock).ok())?
    }

    fn ask<T>(&self, question: impl FnOnce(&Device) -> T) -> Option<T> {
        let source = self.0.as_ref().ok()?;
        Some(question(&source.device().ok()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_vendors_are_not_asked() {
        let mesa = 0x10005;
        let record::Telemetry::Unavailable { reason } = Telemetry::open(mesa, [0; 16], None).sample() else {
            panic!("nobody could be asked");
        };
        assert!(reason.contains("NVIDIA"), "{reason}");
    }
}
