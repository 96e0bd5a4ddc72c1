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
mod telemetry;
mod timestamp;
mod validate;

pub use derived::{PerRay, mean};
pub use device::{Device, DeviceKind, Driver, Heap, Limits};
pub use example::example;
pub use file::Error;
pub use host::{Commit, Host, Tool};
pub use kernel::{Kernel, OccupancyLimit};
pub use parameters::{Parameters, Value};
pub use point::{
    Adaptation, Build, Count, Counters, Launch, Phase, Point, Repetition, Sample, Scene, Source, Tree, View,
};
pub use telemetry::{Reading, Telemetry, ThrottleReason};
pub use timestamp::Timestamp;
pub use validate::{Fault, Problem};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The number of the schema that this version writes, and the newest that it reads.
pub const SCHEMA: u32 = 1;

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
    /// Parameters of all stages, as `stage.name`; a [`Point`] overrides those in which it differs.
    pub parameters: Parameters,
    /// One entry per scene, variant and set of parameters, in the order measured.
    pub results: Vec<Point>,
}

/// Settings of a whole run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Run {
    /// Width of the picture in pixels.
    pub width: u32,
    /// Height of the picture in pixels.
    pub height: u32,
    /// Measured path samples per pixel and view.
    pub samples: u32,
    /// Samples traced before the measured ones, and thrown away.
    pub warm_up: u32,
    /// Most rays in one path, the primary ray included.
    pub depth: u32,
    /// Seed of the random numbers.
    pub seed: u64,
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
            parameters: Parameters::default(),
            results: Vec::new(),
        }
    }

    /// All parameters that held for one point: those of the run, with the point's own on top.
    pub fn parameters_of(&self, point: &Point) -> Parameters {
        let mut all = self.parameters.clone();
        all.0.extend(point.parameters.0.clone());
        all
    }
}

/// The JSON Schema of a record.
pub fn json_schema() -> serde_json::Value {
    let mut schema = schemars::schema_for!(Record);
    schema.insert("title".into(), "Broadleaf benchmark record".into());
    schema.to_value()
}
