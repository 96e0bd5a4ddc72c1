//! The benchmark record: the one file in which Broadleaf's three tools meet. `runner` writes it,
//! `stabilize` stamps it, `compare` reads it. There is no Vulkan in here.
//!
//! A record keeps **every sample**. Rates, means and counters per ray are methods, never fields, so
//! that nobody has to trust an average whose parts are gone. Units are in the field names.
//!
//! ```
//! # fn main() -> Result<(), record::Error> {
//! # let folder = tempfile::tempdir().unwrap();
//! # let path = folder.path().join("out/record.json");
//! # let mut record = record::example();
//! record.write_atomic(&path)?; // after each point, so that an interrupted run loses one at most
//! let record = record::Record::read(&path)?;
//! for point in &record.results {
//!     println!("{} {}: {:?} MRps", point.scene.name, point.variant, point.secondary_mrps());
//! }
//! # Ok(())
//! # }
//! ```

mod derived;
mod device;
mod example;
mod file;
mod host;
mod kernel;
mod parameters;
mod point;
mod roofline;
mod stability;
pub mod stats;
mod sweep;
mod telemetry;
mod timestamp;
mod validate;

pub use derived::{BOUNCES, Launches, PerRay, Rays, mean};
pub use device::{Device, DeviceKind, Driver, Heap, Limits};
pub use example::{example, example_report};
pub use file::{Error, replace};
pub use host::{Commit, Host, Tool};
pub use kernel::{Kernel, OccupancyLimit};
pub use parameters::{Parameters, Value};
pub use point::{
    Adaptation, Adopted, Build, Count, Counters, Exclusion, Launch, Measurement, OF_SCENE, Phase, Point,
    Repetition, Sample, Scene, Source, Stop, Tree, Utilization, View,
};
pub use roofline::{NodeReads, Operation, ROOFLINE_SCHEMA, Rate, Roofline, example_roofline};
pub use stability::{
    Hold, Inhibition, Policy, REPORT_VARIABLE, Report, Restoration, Stabilized, State, TOLERANCE,
    ThrottleTimes, Throttling, Verdict, process_started,
};
pub use sweep::{Drift, Part, Sweep};
pub use telemetry::{Reading, Telemetry, ThrottleReason};
pub use timestamp::Timestamp;
pub use validate::{Fault, Problem};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// The number of the schema that this version writes, and the newest that it reads.
///
/// Since 2, what is not known of a tree is absent.
pub const SCHEMA: u32 = 2;

/// One run of `runner`: what ran, where, with which settings, and everything it measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Record {
    /// Number of the schema this record follows; see [`SCHEMA`].
    pub schema: u32,
    /// The program that measured.
    pub tool: Tool,
    /// The command line, program name first.
    pub command_line: Vec<String>,
    /// When the run began.
    pub started: Timestamp,
    /// When the run ended; absent while it is under way, and in the record of an interrupted run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finished: Option<Timestamp>,
    /// The computer.
    pub host: Host,
    /// The Vulkan device.
    pub device: Device,
    /// SHA-256 of each shader's SPIR-V, in hexadecimal, by the shader's name.
    pub shaders: BTreeMap<String, String>,
    /// What every point of the run has in common.
    pub run: Run,
    /// The experiment, where the run was a sweep.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sweep: Option<Sweep>,
    /// The processes that measured, where there were several: `host`, `device` and `command_line` above are then
    /// the first one's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<Part>,
    /// Parameters of all stages, as `stage.name`; a [`Point`] overrides those in which it differs.
    pub parameters: Parameters,
    /// One entry per scene, variant and set of parameters, in the order measured.
    pub results: Vec<Point>,
    /// One point of a sweep, measured again and again between the others, to see whether the device drifted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub references: Vec<Point>,
    /// Variants that were asked for and could not be measured.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOut>,
}

/// A variant that was asked for and could not be measured.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LeftOut {
    /// Its name.
    pub variant: String,
    /// Why not.
    pub reason: String,
}

/// Settings of a whole run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Run {
    /// Width of the picture in pixels.
    pub width: u32,
    /// Height of the picture in pixels.
    pub height: u32,
    /// How rays were launched; absent where whole paths were traced.
    #[serde(default, skip_serializing_if = "Method::is_paths")]
    pub method: Method,
    /// Measured samples of a view, of paths or of launches as `method` says; where `stopping` decides, the most there
    /// can be.
    pub samples: u32,
    /// Samples traced before the measured ones, and thrown away.
    pub warm_up: u32,
    /// Most rays in one path, the primary ray included.
    pub depth: u32,
    /// Seed of the random numbers.
    pub seed: u64,
    /// When measuring a point ended; absent where each view has `samples`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stopping: Option<Stopping>,
    /// What a sample's clock was held against; absent where no clock could be read, or none is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clock: Option<Clock>,
    /// How `stabilize` held the device's clocks; absent where it did not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub policy: Option<Policy>,
}

/// How rays are launched while they are timed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Each sample traces whole paths of its own, one a pixel (Cezner 2025, section 6.2).
    #[default]
    Paths,
    /// The rays of each bounce of one path a pixel are collected, and each sample launches the same ones once more
    /// (Ylitie et al. 2017, section 5).
    Replay,
}

impl Method {
    fn is_paths(&self) -> bool {
        *self == Method::Paths
    }
}

impl fmt::Display for Method {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.pad(match self {
            Method::Paths => "paths",
            Method::Replay => "replay",
        })
    }
}

/// Samples of a point go on until its rates are known well enough.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Stopping {
    /// Fewest samples of a view that count.
    pub least: u32,
    /// Most samples of a view.
    pub most: u32,
    /// Half the width of the 95% confidence interval of both rates, as a share of the mean, that is enough.
    pub half_width: f64,
    /// Seconds after which a point gets no more samples than the fewest.
    pub seconds: f64,
}

/// The clock below which samples do not count.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Clock {
    /// What sort of clock it is.
    pub kind: ClockKind,
    /// Clock of the streaming multiprocessors in MHz.
    pub mhz: u32,
    /// Samples whose clock is below this share of it are left out.
    pub least_share: f64,
}

/// What sort of clock samples are held against.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ClockKind {
    /// The device was locked to it.
    Locked,
    /// The device is free to choose, and is sold to run at least at this.
    Base,
}

impl Record {
    /// A record of a run that starts now and has no results yet.
    pub fn new(tool: Tool, host: Host, device: Device, run: Run) -> Record {
        Record {
            schema: SCHEMA,
            tool,
            command_line: std::env::args_os()
                .map(|argument| argument.to_string_lossy().into_owned())
                .collect(),
            started: Timestamp::now(),
            finished: None,
            host,
            device,
            shaders: BTreeMap::new(),
            run,
            sweep: None,
            parts: Vec::new(),
            parameters: Parameters::default(),
            results: Vec::new(),
            references: Vec::new(),
            left_out: Vec::new(),
        }
    }

    /// All parameters that held for one point: those of the run, with the point's own on top. Where its binary tree came
    /// from a file, `bvh.file` and `bvh.sha256` say which: its builds did less than those of others.
    pub fn parameters_of(&self, point: &Point) -> Parameters {
        let mut all = self.parameters.clone();
        all.0.extend(point.parameters.0.clone());
        if let Some(adopted) = &point.adopted {
            all.set("bvh.file", adopted.name.as_str());
            all.set("bvh.sha256", adopted.sha256.as_str());
        }
        all
    }
}

/// The JSON Schema of a record.
pub fn json_schema() -> serde_json::Value {
    let mut schema = schemars::schema_for!(Record);
    schema.insert("title".into(), "Broadleaf benchmark record".into());
    schema.to_value()
}
