//! GPUs whose clocks can be held still.

mod amd;
mod nvidia;

use record::{Telemetry, ThrottleTimes};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A GPU, as far as its driver lets its clocks be read and locked.
pub trait Gpu {
    /// Which one it is.
    fn identity(&self) -> &Identity;
    /// The clock now, in MHz.
    fn clock(&self, domain: Domain) -> Answer<u32>;
    /// The highest clock that the driver names, in MHz. The GPU need not reach it.
    fn highest(&self, domain: Domain) -> Answer<u32>;
    /// The clock in MHz that the GPU is sold to run at.
    fn base(&self, domain: Domain) -> Answer<u32>;
    /// The clocks in MHz that can be locked, from the lowest; empty where the driver does not tell.
    fn steps(&self, domain: Domain) -> Answer<Vec<u32>>;
    /// Clocks, temperature and power.
    fn reading(&self) -> Telemetry;
    /// How long it has been slowed down so far.
    fn throttle_times(&self) -> ThrottleTimes;
    /// Whether the driver stays loaded when nobody uses the GPU; nothing where there is no such mode.
    fn persistence(&self) -> Answer<Option<bool>>;
    /// What must be changed before a clock is locked.
    fn preparations(&self) -> Answer<Vec<Change>>;
    /// What takes a change back, given what is in force now; nothing where another change's undoing does.
    fn undo_of(&self, change: &Change) -> Answer<Option<Change>>;
    /// Makes a change.
    fn apply(&self, change: &Change) -> Answer<()>;
    /// What keeps a clock from being locked, as far as that can be told without trying.
    fn obstacle(&self, domain: Domain) -> Option<Trouble>;
}

/// Which GPU something is about.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// Who made it.
    pub vendor: Vendor,
    /// What its driver calls it.
    pub name: String,
    /// The driver's own identifier.
    pub uuid: String,
    /// Its PCI address, such as `0000:01:00.0`.
    pub pci: Option<String>,
    /// Version of its driver.
    pub driver: String,
}

/// Makers of GPUs whose clocks can be locked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Vendor {
    /// Through NVML.
    Nvidia,
    /// Through amdgpu's files in sysfs.
    Amd,
}

/// Parts of a GPU with a clock of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Domain {
    /// The cores.
    Graphics,
    /// The memory.
    Memory,
}

/// Something that is changed about a GPU, or changed back.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "change", rename_all = "snake_case")]
pub enum Change {
    /// Whether the driver stays loaded when nobody uses the GPU.
    Persistence {
        /// Whether it does.
        on: bool,
    },
    /// A clock is held at a value.
    Lock {
        /// Which clock.
        domain: Domain,
        /// The value.
        mhz: u32,
    },
    /// A clock is left to the driver.
    Unlock {
        /// Which clock.
        domain: Domain,
    },
    /// How amdgpu chooses clocks (`power_dpm_force_performance_level`).
    Level {
        /// One of its words.
        level: String,
    },
}

/// What a GPU answered, or why it did not.
pub type Answer<T> = Result<T, Trouble>;

/// Why a GPU did not do as it was told.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Trouble {
    /// It takes root.
    #[error("no permission")]
    NoPermission,
    /// This GPU or this driver cannot.
    #[error("not supported by this GPU or its driver")]
    NotSupported,
    /// This version of the driver lacks the function.
    #[error("the driver is too old: it has no {0}")]
    Missing(String),
    /// It fell off the bus.
    #[error("the GPU is lost")]
    Lost,
    /// Something else.
    #[error("{0}")]
    Other(String),
}

impl fmt::Display for Domain {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Domain::Graphics => "graphics clock",
            Domain::Memory => "memory clock",
        })
    }
}

impl fmt::Display for Change {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Change::Persistence { on } => write!(out, "persistence mode {}", if *on { "on" } else { "off" }),
            Change::Lock { domain, mhz } => write!(out, "{domain} locked to {mhz} MHz"),
            Change::Unlock { domain } => write!(out, "{domain} unlocked"),
            Change::Level { level } => write!(out, "performance level {level}"),
        }
    }
}

/// The GPUs of this computer, and why there may be more that nobody could ask.
pub struct Found {
    /// NVIDIA's in NVML's order, then AMD's by their PCI addresses.
    pub gpus: Vec<Box<dyn Gpu>>,
    /// What went wrong with a vendor as a whole, such as a library that is not there.
    pub missing: Vec<String>,
}

/// Looks for GPUs.
pub fn find() -> Found {
    let mut found = Found { gpus: Vec::new(), missing: Vec::new() };
    match nvidia::find() {
        Ok(gpus) => found.gpus.extend(gpus.into_iter().map(|gpu| Box::new(gpu) as Box<dyn Gpu>)),
        Err(reason) => found.missing.push(reason),
    }
    match amd::root().and_then(|root| amd::find(&root)) {
        Ok(gpus) => found.gpus.extend(gpus.into_iter().map(|gpu| Box::new(gpu) as Box<dyn Gpu>)),
        Err(reason) => found.missing.push(reason),
    }
    found
}
