//! One GPU, and what its clocks do.

use nvml_wrapper_sys::bindings::NVML_DEVICE_ARCH_HOPPER;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The counters of time for which a GPU was slowed down. `power` and `thermal` are read as violation
/// status, the others as field values.
pub const COUNTERS: &[&str] =
    &["power", "thermal", "sw_power_cap", "sync_boost", "sw_thermal", "hw_thermal", "hw_power_brake"];

/// Coldest that a GPU gets while it cools, in °C.
const COLD_CELSIUS: u32 = 30;

/// One GPU. What is left out of the file is as in [`Gpu::default`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Gpu {
    /// Product name.
    pub name: String,
    /// NVML's UUID, as `GPU-5f1c2a7e-…`.
    pub uuid: String,
    /// PCI address, as `00000000:01:00.0`.
    pub pci_bus_id: String,
    /// NVML's number of the architecture (`NVML_DEVICE_ARCH_*`). Before Volta (5) the graphics clock
    /// cannot be locked, before Ampere (7) the memory clock.
    pub architecture: u32,
    /// Whether persistence mode is on.
    pub persistence: bool,
    /// Lowest and highest graphics clock in MHz as they were locked.
    pub locked_graphics: Option<(u32, u32)>,
    /// Lowest and highest memory clock in MHz as they were locked.
    pub locked_memory: Option<(u32, u32)>,
    /// Graphics clock in MHz without a lock.
    pub idle_graphics_mhz: u32,
    /// Memory clock in MHz without a lock.
    pub idle_memory_mhz: u32,
    /// Highest graphics clock in MHz that NVML reports.
    pub max_graphics_mhz: u32,
    /// Highest graphics clock in MHz that the chip runs at, whatever NVML reports.
    pub reachable_graphics_mhz: u32,
    /// Highest memory clock in MHz.
    pub max_memory_mhz: u32,
    /// Default application clock in MHz; `None` if the GPU does not tell, for memory too.
    pub base_graphics_mhz: Option<u32>,
    /// Supported graphics clocks in MHz, descending as NVML gives them. A lock is rounded down to one.
    pub graphics_steps: Vec<u32>,
    /// Supported memory clocks in MHz, descending. A lock is rounded down to one.
    pub memory_steps: Vec<u32>,
    /// Temperature in °C that the next read gives.
    pub temperature_celsius: u32,
    /// The temperature falls by so many °C with each read, down to 30 °C.
    pub cooling_celsius_per_read: u32,
    /// Power in mW.
    pub power_milliwatts: u32,
    /// NVML's bits of the reasons for which the GPU is slowed down now.
    pub throttle_reasons: u64,
    /// Time in ns for which the GPU was slowed down, by the names in [`COUNTERS`]; 0 where left out.
    pub counters: BTreeMap<String, u64>,
    /// The counters that this GPU does not have.
    pub missing_counters: Vec<String>,
    /// Whether a lock has an effect on the graphics clock. Otherwise it is accepted, and the clock goes
    /// to `stuck_graphics_mhz`.
    pub graphics_clock_follows: bool,
    /// Graphics clock in MHz under a lock that it does not follow; the idle clock if `None`.
    pub stuck_graphics_mhz: Option<u32>,
    /// The most that the graphics clock delivers, in MHz, while the memory clock is locked.
    pub memory_lock_moves_graphics_mhz: Option<u32>,
    /// Whether the memory clock can be locked.
    pub memory_lock_supported: bool,
    /// So many reads of a clock after a lock or a reset show it on its way, from the old clock on in
    /// equal steps; the next one shows it arrived.
    pub settling_reads: u32,
    /// Where the graphics clock is on its way.
    pub graphics_ramp: Option<Ramp>,
    /// Where the memory clock is on its way.
    pub memory_ramp: Option<Ramp>,
}

/// A clock on its way to where it was locked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ramp {
    /// Where it set out, in MHz.
    pub from_mhz: u32,
    /// How many reads are left that show it on its way.
    pub reads_left: u32,
}

/// What a tool that locks clocks may change, and has to put back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Whether persistence mode is on.
    pub persistence: bool,
    /// Lowest and highest graphics clock in MHz, if it is locked.
    pub locked_graphics: Option<(u32, u32)>,
    /// Lowest and highest memory clock in MHz, if it is locked.
    pub locked_memory: Option<(u32, u32)>,
}

impl Default for Gpu {
    /// A cool, idle GPU with nothing locked, whose steps are 15 MHz apart and whose chip does not reach
    /// the highest of them.
    fn default() -> Gpu {
        Gpu {
            name: "NVIDIA H100 80GB HBM3".into(),
            uuid: "GPU-5f1c2a7e-9b04-4d3f-8e61-0c7d52ab9e13".into(),
            pci_bus_id: "00000000:01:00.0".into(),
            architecture: NVML_DEVICE_ARCH_HOPPER,
            persistence: false,
            locked_graphics: None,
            locked_memory: None,
            idle_graphics_mhz: 345,
            idle_memory_mhz: 1593,
            max_graphics_mhz: 1980,
            reachable_graphics_mhz: 1935,
            max_memory_mhz: 2619,
            base_graphics_mhz: Some(1590),
            graphics_steps: (210..=1980).rev().step_by(15).collect(),
            memory_steps: vec![2619, 1593],
            temperature_celsius: 34,
            cooling_celsius_per_read: 0,
            power_milliwatts: 71_500,
            throttle_reasons: 0,
            counters: BTreeMap::new(),
            missing_counters: Vec::new(),
            graphics_clock_follows: true,
            stuck_graphics_mhz: None,
            memory_lock_moves_graphics_mhz: None,
            memory_lock_supported: true,
            settling_reads: 0,
            graphics_ramp: None,
            memory_ramp: None,
        }
    }
}

impl Gpu {
    /// What a tool that locks clocks has to put back.
    pub fn settings(&self) -> Settings {
        Settings {
            persistence: self.persistence,
            locked_graphics: self.locked_graphics,
            locked_memory: self.locked_memory,
        }
    }

    /// The counter's value in ns, unless the GPU does not have it.
    pub(crate) fn counter(&self, name: &str) -> Option<u64> {
        let has = !self.missing_counters.iter().any(|missing| missing == name);
        has.then(|| self.counters.get(name).copied().unwrap_or(0))
    }

    /// Reads the graphics clock in MHz, and moves it on.
    pub(crate) fn read_graphics_mhz(&mut self) -> u32 {
        let mhz = self.graphics_mhz();
        advance(&mut self.graphics_ramp);
        mhz
    }

    /// Reads the memory clock in MHz, and moves it on.
    pub(crate) fn read_memory_mhz(&mut self) -> u32 {
        let mhz = self.memory_mhz();
        advance(&mut self.memory_ramp);
        mhz
    }

    /// Reads the temperature in °C, and cools down.
    pub(crate) fn read_celsius(&mut self) -> u32 {
        let now = self.temperature_celsius;
        let cooler = now.saturating_sub(self.cooling_celsius_per_read).max(COLD_CELSIUS);
        self.temperature_celsius = cooler.min(now);
        now
    }

    /// Changes locks. The clocks that this moves set out from where they are.
    pub(crate) fn lock(&mut self, change: impl FnOnce(&mut Gpu)) {
        let (graphics, memory) = (self.graphics_mhz(), self.memory_mhz());
        change(self);
        let set_out = |from_mhz: u32, to: u32| {
            let moves = from_mhz != to && self.settling_reads > 0;
            moves.then_some(Ramp { from_mhz, reads_left: self.settling_reads })
        };
        (self.graphics_ramp, self.memory_ramp) =
            (set_out(graphics, self.graphics_goal()), set_out(memory, self.memory_goal()));
    }

    fn graphics_mhz(&self) -> u32 {
        on_the_way(self.graphics_ramp, self.settling_reads, self.graphics_goal())
    }

    fn memory_mhz(&self) -> u32 {
        on_the_way(self.memory_ramp, self.settling_reads, self.memory_goal())
    }

    fn graphics_goal(&self) -> u32 {
        let goal = match self.locked_graphics {
            None => self.idle_graphics_mhz,
            Some(_) if !self.graphics_clock_follows => {
                self.stuck_graphics_mhz.unwrap_or(self.idle_graphics_mhz)
            }
            Some((_, high)) => round_down(high, &self.graphics_steps).min(self.reachable_graphics_mhz),
        };
        match self.memory_lock_moves_graphics_mhz {
            Some(most) if self.locked_memory.is_some() => goal.min(most),
            _ => goal,
        }
    }

    fn memory_goal(&self) -> u32 {
        match self.locked_memory {
            None => self.idle_memory_mhz,
            Some((_, high)) => round_down(high, &self.memory_steps).min(self.max_memory_mhz),
        }
    }
}

/// The highest step that is not above `mhz`, or else the lowest; `mhz` itself if there are no steps.
fn round_down(mhz: u32, steps: &[u32]) -> u32 {
    let below = steps.iter().filter(|&&step| step <= mhz).max();
    *below.or(steps.iter().min()).unwrap_or(&mhz)
}

/// The clock in MHz that a read shows now, of `reads` on the whole way to `goal`.
fn on_the_way(ramp: Option<Ramp>, reads: u32, goal: u32) -> u32 {
    let Some(Ramp { from_mhz, reads_left }) = ramp.filter(|_| reads > 0) else { return goal };
    let (from, goal, reads) = (i64::from(from_mhz), i64::from(goal), i64::from(reads));
    let done = (reads - i64::from(reads_left)).max(0);
    // Between two numbers of 32 bits.
    (from + (goal - from) * done / reads) as u32
}

fn advance(ramp: &mut Option<Ramp>) {
    *ramp = ramp
        .map(|ramp| Ramp { reads_left: ramp.reads_left.saturating_sub(1), ..ramp })
        .filter(|ramp| ramp.reads_left > 0);
}
