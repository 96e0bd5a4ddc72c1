use crate::{Host, Point, Rays, Record, Timestamp, stats};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The experiment behind a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sweep {
    /// What it is called.
    pub title: String,
    /// Names of the parameters that were varied.
    pub axes: Vec<String>,
    /// All of the config, with what was set and chosen on the command line and every default.
    pub config: serde_json::Value,
    /// Seed of the order in which points were measured.
    pub order_seed: u64,
    /// Points of the whole experiment, over all shards.
    pub points: u64,
    /// The share that was measured, such as `2/4`; absent where it was all of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<String>,
}

/// One of several processes that measured a record's points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Part {
    /// Its computer.
    pub host: Host,
    /// Name of its device.
    pub device: String,
    /// Vulkan's UUID of its device.
    pub device_uuid: String,
    /// Version of its driver.
    pub driver: String,
    /// Its command line, program name first.
    pub command_line: Vec<String>,
    /// When it began.
    pub started: Timestamp,
    /// When its last point ended.
    pub finished: Timestamp,
    /// The share that it measured, such as `2/4`; absent where it was all of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<String>,
}

/// How the rate of the point that one part measured again and again went with time.
#[derive(Clone, Debug, PartialEq)]
pub struct Drift {
    /// Which part.
    pub part: u32,
    /// Which rays.
    pub rays: Rays,
    /// How often the point was measured.
    pub count: usize,
    /// Spearman's correlation of the rate with the time, and how probable so strong a one is by chance.
    pub correlation: stats::Correlation,
    /// The last rate over the first one.
    pub change: f64,
}

impl Drift {
    /// Whether chance is a poor explanation: it gives so strong a correlation in less than one of twenty runs.
    pub fn significant(&self) -> bool {
        self.correlation.probability < 0.05
    }
}

impl Record {
    /// How the rates of the reference point went with time, for each part that measured it at least four
    /// times: with fewer no order is improbable enough to mean something.
    pub fn drifts(&self) -> Vec<Drift> {
        let part = |point: &Point| point.measurement.as_ref().map_or(0, |m| m.part);
        let mut parts: Vec<u32> = self.references.iter().map(part).collect();
        parts.sort_unstable();
        parts.dedup();
        let mut drifts = Vec::new();
        for of in parts {
            for rays in [Rays::Primary, Rays::Secondary] {
                let mut rates: Vec<(Timestamp, f64)> = (self.references.iter())
                    .filter(|point| part(point) == of)
                    .filter_map(|point| Some((point.measurement.as_ref()?.started, point.rate(rays)?)))
                    .collect();
                rates.sort_by_key(|(time, _)| *time);
                let values: Vec<f64> = rates.iter().map(|(_, rate)| *rate).collect();
                let times: Vec<f64> = (0..rates.len()).map(|position| position as f64).collect();
                if let Some(correlation) = stats::spearman(&times, &values) {
                    let change = values[values.len() - 1] / values[0];
                    drifts.push(Drift { part: of, rays, count: values.len(), correlation, change });
                }
            }
        }
        drifts
    }
}
