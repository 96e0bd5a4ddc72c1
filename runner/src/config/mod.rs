//! Configs: one TOML file is one experiment.
//!
//! ```text
//! file, what it includes, --set ─► check ─► Document ─► Config ─► --only ─► points: Setup
//!                               by SCHEMA                              └──► Experiment
//! ```
//!
//! [`document`] is the one definition of the keys. The JSON Schema is made of it, and documents are checked
//! by the schema, so a key exists for all or for nobody. Each source, be it a file or an option, is read on its
//! own, so that what is wrong can be told with its place; then it is put on top of what came before.

mod axis;
mod check;
mod document;
mod experiment;
mod only;
mod reader;
mod schema;
mod set;
mod setup;
mod source;
mod units;
mod value;
mod views;
mod when;

#[cfg(test)]
mod tests;

pub use experiment::Experiment;
pub use set::Set;
pub use setup::Setup;

use crate::{measure, size::Size, variant::Variant};
use anyhow::bail;
use axis::Axis;
use only::Only;
use reader::Reader;
use record::Method;
use serde::{Serialize, Serializer};
use std::{
    path::{Path, PathBuf},
    time::Duration,
};
use tracer::scene::SearchPath;

/// An experiment: what is measured how, and which parameters are varied.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// What it is about.
    pub title: String,
    /// As on the command line; each once.
    pub scenes: Vec<String>,
    /// Each once.
    pub variants: Vec<Variant>,
    /// As in `--views`; all when left out.
    pub views: Option<String>,
    /// Picture size; by the kind of the device when left out.
    pub size: Option<Size>,
    /// How rays are launched while they are timed.
    pub method: Method,
    /// Most rays in a path; by the method when left out.
    pub depth: Option<u32>,
    /// Seed of all random numbers of paths.
    pub seed: u32,
    /// Measured builds of each tree; by the kind of the device when left out.
    pub builds: Option<u32>,
    /// Samples that are thrown away before those that count.
    pub warm_up: u32,
    /// When samples are enough.
    pub samples: Samples,
    /// In which order points are measured.
    pub order: Order,
    axes: Vec<Axis>,
    /// Later ones win.
    sets: Vec<Set>,
    only: Only,
}

/// When samples are enough.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct Samples {
    /// At least so many, however long they take; by the kind of the device when left out.
    pub least: Option<u32>,
    /// At most so many, not less than `least`; by the kind of the device when left out.
    pub most: Option<u32>,
    /// Enough when half the width of the confidence interval is below this share of the mean.
    pub half_width: f64,
    /// After this time a point gets no more than the least.
    #[serde(serialize_with = "seconds")]
    pub time: Duration,
    /// Samples do not count while the clock is below this share of the locked or base clock.
    pub least_clock: f64,
}

/// In which order points are measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct Order {
    /// Seed of the shuffle.
    pub seed: u64,
    /// Points between two repetitions of the reference point; 0 for none.
    pub reference_every: u32,
}

fn seconds<S: Serializer>(time: &Duration, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f64(time.as_secs_f64())
}

impl Default for Config {
    fn default() -> Self {
        let share = |text: &str| text.parse::<units::Share>().expect("a default").0;
        Self {
            title: String::new(),
            scenes: Vec::new(),
            variants: Vec::new(),
            views: None,
            size: None,
            method: Method::default(),
            depth: None,
            seed: 0,
            builds: None,
            warm_up: document::WARM_UP,
            samples: Samples {
                least: None,
                most: None,
                half_width: share(document::HALF_WIDTH),
                time: document::TIME.parse::<units::Time>().expect("a default").0,
                least_clock: share(document::LEAST_CLOCK),
            },
            order: Order { seed: 0, reference_every: document::REFERENCE_EVERY },
            axes: Vec::new(),
            sets: Vec::new(),
            only: Only::default(),
        }
    }
}

/// The JSON Schema of configs.
pub fn json_schema() -> &'static serde_json::Value {
    &schema::SCHEMA
}

impl Config {
    /// How many views are listed; nothing where a scene's own number decides.
    pub fn view_count(&self) -> Option<usize> {
        views::each(self.views.as_ref()?).ok().map(|views| views.len())
    }

    /// Most rays in a path.
    pub fn depth(&self) -> u32 {
        self.depth.unwrap_or(measure::depth(self.method))
    }

    /// The parameters that are varied, each once.
    pub fn axis_names(&self) -> Vec<String> {
        self.axes.iter().map(|axis| axis.parameter.clone()).collect()
    }

    /// Reads an experiment. `includes` are taken as if its `include` ended with them, but from where runner
    /// was started; `overrides` are NAME=VALUE of settings and parameters, and win over everything.
    ///
    /// # Errors
    /// Whatever is wrong with a file or an override, each with its place and what would be right.
    pub fn load(
        path: &Path,
        includes: &[PathBuf],
        overrides: &[String],
        search: &SearchPath,
    ) -> anyhow::Result<Self> {
        let mut reader = Reader::new(search);
        reader.main_file(path, includes)?;
        for option in overrides {
            reader.option(option)?;
        }
        let mut config = reader.finish()?;
        for (name, missing) in
            [("scenes", config.scenes.is_empty()), ("variants", config.variants.is_empty())]
        {
            if missing {
                bail!("{}: neither it nor what it includes says `{name}`", path.display());
            }
        }
        if config.title.is_empty() {
            config.title = path.file_stem().map(|stem| stem.to_string_lossy().into()).unwrap_or_default();
        }
        Ok(config)
    }
}
