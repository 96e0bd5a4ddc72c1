//! NVIDIA's GPUs, through NVML.

use super::{Answer, Change, Domain, Gpu, Identity, Trouble, Vendor};
use nvml_wrapper::enum_wrappers::device::{Clock, ClockId};
use nvml_wrapper::enums::device::GpuLockedClocksSetting;
use nvml_wrapper::error::{NvmlError, nvml_try, nvml_try_count};
use nvml_wrapper::{Device, Nvml};
use record::{Telemetry, ThrottleTimes};
use std::rc::Rc;

/// One of them.
pub struct Nvidia {
    nvml: Rc<Nvml>,
    /// NVML's number of it.
    index: u32,
    identity: Identity,
}

/// All that NVML knows.
///
/// # Errors
/// There is no NVML, or it does not work.
pub fn find() -> Result<Vec<Nvidia>, String> {
    let nvml = Rc::new(nvml::load()?);
    let driver = nvml.sys_driver_version().unwrap_or_default();
    let count = nvml.device_count().map_err(|error| format!("NVML: {error}"))?;
    let mut gpus = Vec::new();
    for index in 0..count {
        // One that cannot even be named is lost; the others are as good as before.
        let Ok(device) = nvml.device_by_index(index) else { continue };
        let Ok(uuid) = device.uuid() else { continue };
        let identity = Identity {
            vendor: Vendor::Nvidia,
            name: device.name().unwrap_or_else(|_| "NVIDIA GPU".into()),
            uuid,
            pci: nvml::pci_address(&device),
            driver: driver.clone(),
        };
        gpus.push(Nvidia { nvml: Rc::clone(&nvml), index, identity });
    }
    Ok(gpus)
}

impl Nvidia {
    fn device(&self) -> Answer<Device<'_>> {
        Ok(self.nvml.device_by_index(self.index)?)
    }
}

impl Gpu for Nvidia {
    fn identity(&self) -> &Identity {
        &self.identity
    }

    fn clock(&self, domain: Domain) -> Answer<u32> {
        Ok(self.device()?.clock_info(domain.into())?)
    }

    fn highest(&self, domain: Domain) -> Answer<u32> {
        Ok(self.device()?.max_clock_info(domain.into())?)
    }

    fn base(&self, domain: Domain) -> Answer<u32> {
        Ok(self.device()?.clock(domain.into(), ClockId::DefaultAppClock)?)
    }

    fn steps(&self, domain: Domain) -> Answer<Vec<u32>> {
        let device = self.device()?;
        let memory = device.supported_memory_clocks();
        let steps = match domain {
            Domain::Memory => memory,
            // Which graphics clocks there are goes by the memory's; the highest has them all.
            Domain::Graphics => memory.and_then(|memory| {
                let highest = memory.into_iter().max().ok_or(NvmlError::NotSupported)?;
                graphics_clocks(&device, highest)
            }),
        };
        match steps {
            Ok(mut steps) => {
                steps.sort_unstable();
                Ok(steps)
            }
            Err(NvmlError::NotSupported | NvmlError::FailedToLoadSymbol(_)) => Ok(Vec::new()),
            Err(error) => Err(error.into()),
        }
    }

    fn reading(&self) -> Telemetry {
        match self.device() {
            Ok(device) => nvml::reading(&device),
            Err(trouble) => Telemetry::unavailable(trouble.to_string()),
        }
    }

    fn throttle_times(&self) -> ThrottleTimes {
        self.device().map(|device| nvml::throttle_times(&device)).unwrap_or_default()
    }

    fn persistence(&self) -> Answer<Option<bool>> {
        match self.device()?.is_in_persistent_mode() {
            Ok(on) => Ok(Some(on)),
            // Windows has no such mode, and neither have some virtual GPUs.
            Err(NvmlError::NotSupported) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    fn preparations(&self) -> Answer<Vec<Change>> {
        let off = self.persistence()? == Some(false);
        Ok(if off { vec![Change::Persistence { on: true }] } else { Vec::new() })
    }

    fn undo_of(&self, change: &Change) -> Answer<Option<Change>> {
        Ok(match change {
            // Without knowing what it was there is no way back, so it is not changed.
            Change::Persistence { .. } => {
                Some(Change::Persistence { on: self.persistence()?.ok_or(Trouble::NotSupported)? })
            }
            // NVML does not tell what somebody else had locked.
            Change::Lock { domain, .. } => Some(Change::Unlock { domain: *domain }),
            Change::Unlock { .. } | Change::Level { .. } => None,
        })
    }

    fn apply(&self, change: &Change) -> Answer<()> {
        let mut device = self.device()?;
        match *change {
            Change::Persistence { on } => device.set_persistent(on)?,
            Change::Lock { domain: Domain::Graphics, mhz } => {
                device.set_gpu_locked_clocks(GpuLockedClocksSetting::Numeric {
                    min_clock_mhz: mhz,
                    max_clock_mhz: mhz,
                })?;
            }
            Change::Lock { domain: Domain::Memory, mhz } => device.set_mem_locked_clocks(mhz, mhz)?,
            Change::Unlock { domain: Domain::Graphics } => device.reset_gpu_locked_clocks()?,
            Change::Unlock { domain: Domain::Memory } => device.reset_mem_locked_clocks()?,
            Change::Level { .. } => return Err(Trouble::NotSupported),
        }
        Ok(())
    }

    fn obstacle(&self, domain: Domain) -> Option<Trouble> {
        let lib = self.nvml.lib();
        let (present, name) = match domain {
            Domain::Graphics => (lib.nvmlDeviceSetGpuLockedClocks.is_ok(), "nvmlDeviceSetGpuLockedClocks"),
            Domain::Memory => {
                (lib.nvmlDeviceSetMemoryLockedClocks.is_ok(), "nvmlDeviceSetMemoryLockedClocks")
            }
        };
        if !present {
            return Some(Trouble::Missing(name.into()));
        }
        if let Err(trouble) = self.highest(domain) {
            return Some(trouble);
        }
        (!nix::unistd::geteuid().is_root()).then_some(Trouble::NoPermission)
    }
}

/// The graphics clocks in MHz that go with a memory clock. The wrapper's own function gives zeros where there are
/// more than 128, because it takes "too little room" for an answer.
fn graphics_clocks(device: &Device, memory_mhz: u32) -> Result<Vec<u32>, NvmlError> {
    let function = device
        .nvml()
        .lib()
        .nvmlDeviceGetSupportedGraphicsClocks
        .as_ref()
        .map_err(|error| NvmlError::FailedToLoadSymbol(error.to_string()))?;
    let mut count = 0;
    // SAFETY: the handle belongs to the library that the function comes from. With a count of zero nothing is
    // written but the count.
    nvml_try_count(unsafe { function(device.handle(), memory_mhz, &mut count, std::ptr::null_mut()) })?;
    let mut clocks = vec![0; count as usize];
    // SAFETY: as above; `clocks` has room for as many as `count` says.
    nvml_try(unsafe { function(device.handle(), memory_mhz, &mut count, clocks.as_mut_ptr()) })?;
    clocks.truncate(count as usize);
    Ok(clocks)
}

impl From<Domain> for Clock {
    fn from(domain: Domain) -> Clock {
        match domain {
            Domain::Graphics => Clock::Graphics,
            Domain::Memory => Clock::Memory,
        }
    }
}

impl From<NvmlError> for Trouble {
    fn from(error: NvmlError) -> Trouble {
        match error {
            NvmlError::NoPermission => Trouble::NoPermission,
            NvmlError::NotSupported => Trouble::NotSupported,
            NvmlError::FailedToLoadSymbol(symbol) => Trouble::Missing(symbol),
            NvmlError::GpuLost => Trouble::Lost,
            error => Trouble::Other(error.to_string()),
        }
    }
}
