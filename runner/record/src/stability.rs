use crate::{Telemetry, ThrottleReason, Timestamp, Tool};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::{fmt, fs, io};

/// The environment variable in which a command under `stabilize` finds the path of the [`Report`].
pub const REPORT_VARIABLE: &str = "STABILIZE_REPORT";

/// A run may be slowed down for this share of its time and still be trusted, if nobody says otherwise.
pub const TOLERANCE: f64 = 0.001;

/// What `stabilize` says about one command: how the clocks of each GPU were held, what was put back, and whether
/// the run can be trusted. It is written once before the command starts, and again when all is over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// Number of the schema, as in a record.
    pub schema: u32,
    /// The program that wrote it.
    pub tool: Tool,
    /// Its process.
    pub process: u32,
    /// When that process started, in clock ticks since the computer did: process numbers are used again.
    pub process_started: u64,
    /// The command and its arguments.
    pub command: Vec<String>,
    /// When the command started.
    pub started: Timestamp,
    /// When it ended; absent while it runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finished: Option<Timestamp>,
    /// Its exit status, 128 and the signal's number where it was killed; absent while it runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub status: Option<i32>,
    /// Processes that it left running.
    #[serde(default)]
    pub left_behind: u32,
    /// A GPU may be slowed down for this share of the run.
    pub tolerance: f64,
    /// What comes of all GPUs.
    pub verdict: Verdict,
    /// The GPUs that were asked for.
    pub gpus: Vec<Stabilized>,
    /// What keeps the screen awake, and the computer.
    #[serde(default)]
    pub awake: Vec<Inhibition>,
    /// What else the user was told.
    #[serde(default)]
    pub remarks: Vec<String>,
}

/// One GPU in a [`Report`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Stabilized {
    /// Its number in `stabilize doctor`.
    pub index: u32,
    /// What its driver calls it.
    pub name: String,
    /// The driver's own identifier of it, such as `GPU-00112233-4455-6677-8899-aabbccddeeff`.
    pub uuid: String,
    /// Its PCI address, such as `0000:01:00.0`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pci: Option<String>,
    /// Version of its driver.
    pub driver: String,
    /// How its clocks were held.
    pub policy: Policy,
    /// What it said right before the command.
    pub before: State,
    /// What it said right after.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub after: Option<State>,
    /// For how long it was slowed down meanwhile, by each reason that it counts.
    #[serde(default)]
    pub throttling: Vec<Throttling>,
    /// Whether the run can be trusted, as far as this GPU goes.
    pub verdict: Verdict,
    /// What was put back, and what could not be.
    #[serde(default)]
    pub restored: Vec<Restoration>,
    /// Readings during the run, where they were asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub timeline: Vec<Telemetry>,
}

/// How a GPU's clocks are held.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Policy {
    /// The clock of the cores.
    pub graphics: Hold,
    /// The clock of the memory.
    pub memory: Hold,
    /// Whether the driver stays loaded when nobody uses the GPU (NVIDIA's persistence mode); absent where there
    /// is no such thing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub persistence: Option<bool>,
}

/// How one clock is held.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Hold {
    /// What was asked for: `auto`, `max`, `base`, `keep` or a number of MHz.
    pub asked: String,
    /// What it is locked to in MHz; absent where it is free.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub locked_mhz: Option<u32>,
    /// What the GPU then ran at in MHz, where it tells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delivered_mhz: Option<u32>,
    /// Why it is not locked, or what is odd about the lock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
}

/// What a GPU says of itself at one moment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct State {
    /// Clocks, temperature and power.
    pub reading: Telemetry,
    /// How long it has been slowed down so far.
    pub throttled: ThrottleTimes,
}

/// For how many milliseconds a GPU has been slowed down since its driver was loaded, by reason. A reason that it
/// does not count is absent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ThrottleTimes(pub BTreeMap<ThrottleReason, f64>);

/// For how long a GPU was slowed down for one reason.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Throttling {
    /// The reason.
    pub reason: ThrottleReason,
    /// Milliseconds.
    pub milliseconds: f64,
    /// As a share of the run.
    pub share: f64,
}

/// Whether a run can be trusted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "state", rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing slowed the GPU down for longer than is tolerated.
    Trusted,
    /// Nobody knows.
    Unknown {
        /// Why not.
        reason: String,
    },
    /// The GPU was slowed down.
    Throttled {
        /// By what; only what exceeds the tolerance, longest first.
        by: Vec<Throttling>,
    },
}

/// Something that was put back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Restoration {
    /// What, such as `graphics clock unlocked`.
    pub what: String,
    /// Why it could not be; absent where it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}

/// A service that was asked to keep the computer awake.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Inhibition {
    /// What it keeps awake, such as `screen saver`.
    pub what: String,
    /// Its name on the bus.
    pub service: String,
    /// Why it does not; absent where it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refusal: Option<String>,
}

impl ThrottleTimes {
    /// For how long the GPU was slowed down between two readings of its counters, `milliseconds` apart, by each
    /// reason that both have.
    ///
    /// # Errors
    /// A counter went backwards: the driver was loaded anew meanwhile.
    pub fn until(&self, later: &ThrottleTimes, milliseconds: f64) -> Result<Vec<Throttling>, String> {
        let mut found = Vec::new();
        for (&reason, &before) in &self.0 {
            let Some(&after) = later.0.get(&reason) else { continue };
            if after < before {
                return Err(format!("the counter of {reason} went backwards: the driver was loaded anew"));
            }
            let slowed = after - before;
            found.push(Throttling { reason, milliseconds: slowed, share: slowed / milliseconds });
        }
        Ok(found)
    }

    /// Whether a run of `milliseconds` between two readings of these counters can be trusted: each reason may
    /// have slowed it down for a share of `tolerance`.
    pub fn judge(&self, later: &ThrottleTimes, milliseconds: f64, tolerance: f64) -> Verdict {
        let throttling = match self.until(later, milliseconds) {
            Ok(throttling) => throttling,
            Err(reason) => return Verdict::Unknown { reason },
        };
        let has = |reason| throttling.iter().any(|t| t.reason == reason);
        let missing: Vec<String> =
            [ThrottleReason::SoftwarePowerCap, ThrottleReason::SoftwareThermalSlowdown]
                .into_iter()
                .filter(|&reason| !has(reason))
                .map(|reason| reason.to_string())
                .collect();
        let mut by: Vec<_> = throttling.into_iter().filter(|t| t.share > tolerance).collect();
        if !by.is_empty() {
            by.sort_by(|a, b| b.milliseconds.total_cmp(&a.milliseconds));
            return Verdict::Throttled { by };
        }
        if missing.is_empty() {
            Verdict::Trusted
        } else {
            Verdict::Unknown { reason: format!("the GPU does not count {}", missing.join(" and ")) }
        }
    }
}

impl Verdict {
    /// Whether it can.
    pub fn is_trusted(&self) -> bool {
        matches!(self, Verdict::Trusted)
    }

    /// How bad it is.
    fn rank(&self) -> u32 {
        match self {
            Verdict::Trusted => 0,
            Verdict::Unknown { .. } => 1,
            Verdict::Throttled { .. } => 2,
        }
    }

    /// The worst of several; the first of those that are equally bad.
    pub fn worst(verdicts: impl IntoIterator<Item = Verdict>) -> Option<Verdict> {
        verdicts.into_iter().reduce(|worst, next| if next.rank() > worst.rank() { next } else { worst })
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Verdict::Trusted => write!(out, "trusted"),
            Verdict::Unknown { reason } => write!(out, "unknown: {reason}"),
            Verdict::Throttled { by } => {
                write!(out, "throttled: ")?;
                for (index, throttling) in by.iter().enumerate() {
                    let comma = if index > 0 { ", " } else { "" };
                    write!(out, "{comma}{throttling}")?;
                }
                Ok(())
            }
        }
    }
}

impl fmt::Display for Throttling {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (time, unit) = match self.milliseconds {
            milliseconds if milliseconds < 1e3 => (milliseconds, "ms"),
            milliseconds => (milliseconds / 1e3, "s"),
        };
        write!(out, "{} for {time:.1} {unit} ({:.2}% of the run)", self.reason, 100.0 * self.share)
    }
}

impl Report {
    /// Reads a report.
    ///
    /// # Errors
    /// It cannot be read, or is none.
    pub fn read(path: &Path) -> io::Result<Report> {
        Ok(serde_json::from_slice(&fs::read(path)?)?)
    }

    /// Whether the `stabilize` that wrote it still runs, and so still holds the clocks.
    pub fn is_current(&self) -> bool {
        process_started(self.process) == Some(self.process_started)
    }
}

/// When a process started, in clock ticks since the computer did; nothing where there is no such process. With the
/// number of the process it says which one is meant for as long as the computer runs.
pub fn process_started(process: u32) -> Option<u64> {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The name stands in parentheses and may hold any of them; fields are counted from behind it.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace();
    let dead = matches!(fields.next()?, "Z" | "X");
    if dead { None } else { fields.nth(18)?.parse().ok() }
}

impl fmt::Display for Policy {
    /// What the clocks are held to, and not what came of it.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let hold = |hold: &Hold| match hold.locked_mhz {
            Some(mhz) => format!("locked to {mhz} MHz"),
            None => "free".to_owned(),
        };
        write!(out, "graphics clock {}, memory clock {}", hold(&self.graphics), hold(&self.memory))
    }
}

impl Stabilized {
    /// Whether this is the device with Vulkan's UUID (`00112233-…`), or, where the drivers do not agree about
    /// UUIDs, with a PCI address.
    pub fn is(&self, uuid: &str, pci: Option<&str>) -> bool {
        let own = self.uuid.strip_prefix("GPU-").unwrap_or(&self.uuid);
        own.eq_ignore_ascii_case(uuid) || (pci.is_some() && self.pci.as_deref() == pci)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ThrottleReason::{HardwarePowerBrake, SoftwarePowerCap, SoftwareThermalSlowdown};

    fn times(values: &[(ThrottleReason, f64)]) -> ThrottleTimes {
        ThrottleTimes(values.iter().copied().collect())
    }

    fn both(power: f64, heat: f64) -> ThrottleTimes {
        times(&[(SoftwarePowerCap, power), (SoftwareThermalSlowdown, heat)])
    }

    #[test]
    fn less_than_the_tolerance_is_trusted() {
        let before = both(100.0, 7.0);
        assert_eq!(before.judge(&both(100.0, 7.0), 1000.0, 0.001), Verdict::Trusted);
        assert_eq!(before.judge(&both(100.5, 7.0), 1000.0, 0.001), Verdict::Trusted);
        assert_ne!(before.judge(&both(102.0, 7.0), 1000.0, 0.001), Verdict::Trusted);
        assert_eq!(before.judge(&both(102.0, 7.0), 1000.0, 0.01), Verdict::Trusted);
    }

    #[test]
    fn throttling_is_told_by_reason_longest_first() {
        let verdict = both(0.0, 0.0).judge(&both(30.0, 2500.0), 10_000.0, 0.001);
        let told = "throttled: software thermal slowdown for 2.5 s (25.00% of the run), \
                    software power cap for 30.0 ms (0.30% of the run)";
        assert_eq!(verdict.to_string(), told);
    }

    #[test]
    fn what_is_not_counted_is_unknown_but_what_is_seen_counts() {
        let before = times(&[(SoftwarePowerCap, 0.0), (HardwarePowerBrake, 0.0)]);
        let verdict = before.judge(&before, 1000.0, 0.001);
        let reason = "the GPU does not count software thermal slowdown";
        assert_eq!(verdict, Verdict::Unknown { reason: reason.into() });
        let braked = times(&[(SoftwarePowerCap, 0.0), (HardwarePowerBrake, 50.0)]);
        assert!(matches!(before.judge(&braked, 1000.0, 0.001), Verdict::Throttled { .. }));
        let nothing = ThrottleTimes::default();
        assert!(matches!(nothing.judge(&nothing, 1000.0, 0.001), Verdict::Unknown { .. }));
        assert!(matches!(both(0.0, 0.0).judge(&nothing, 1000.0, 0.001), Verdict::Unknown { .. }));
    }

    #[test]
    fn a_counter_that_starts_again_says_nothing() {
        let verdict = both(9.0, 0.0).judge(&both(1.0, 0.0), 1000.0, 0.001);
        assert!(verdict.to_string().contains("loaded anew"), "{verdict}");
    }

    #[test]
    fn the_worst_verdict_counts() {
        let unknown = Verdict::Unknown { reason: String::new() };
        let throttled = Verdict::Throttled { by: Vec::new() };
        let all = [Verdict::Trusted, unknown.clone(), throttled.clone(), Verdict::Trusted];
        assert_eq!(Verdict::worst(all), Some(throttled));
        assert_eq!(Verdict::worst([unknown.clone(), Verdict::Trusted]), Some(unknown));
        assert_eq!(Verdict::worst([]), None);
    }
}
