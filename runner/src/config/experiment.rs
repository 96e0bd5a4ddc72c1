//! What an experiment comes to, whatever way its files say it.

use super::{Config, views};
use crate::params::Params;
use record::Parameters;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::BTreeMap;

/// Differences that are told; of the rest only their number.
const TOLD: usize = 5;

/// Everything that decides what is measured: settings with their defaults, and every point with its
/// parameters. Two configs that mean the same have the same experiment. Titles and the order of points in the
/// files are no part of it, names of files and comments neither.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Experiment {
    /// By dotted name, as files call them.
    settings: Parameters,
    /// The defaults of all parameters.
    defaults: Parameters,
    /// The parameters of each point that are not at these defaults, by its key.
    points: BTreeMap<String, Parameters>,
}

impl Experiment {
    /// In words what has changed since an earlier one; nothing if nothing has.
    pub fn changes_since(&self, earlier: &Self) -> Option<String> {
        let mut changes = Vec::new();
        compare("", &earlier.settings.0, &self.settings.0, &mut changes);
        compare("the default of ", &earlier.defaults.0, &self.defaults.0, &mut changes);
        for (key, was) in &earlier.points {
            match self.points.get(key) {
                Some(now) => compare(&format!("{key}: "), &was.0, &now.0, &mut changes),
                None => changes.push(format!("{key}: is no point any more")),
            }
        }
        let new = self.points.keys().filter(|key| !earlier.points.contains_key(*key));
        changes.extend(new.map(|key| format!("{key}: is a new point")));
        let rest = changes.len().saturating_sub(TOLD);
        changes.truncate(TOLD);
        if rest > 0 {
            changes.push(format!("and {rest} more"));
        }
        (!changes.is_empty()).then(|| changes.join("\n"))
    }
}

fn compare<V: PartialEq + ToString>(
    prefix: &str,
    was: &BTreeMap<String, V>,
    now: &BTreeMap<String, V>,
    changes: &mut Vec<String>,
) {
    let shown = |value: Option<&V>| value.map_or("at its default".into(), ToString::to_string);
    let new = now.keys().filter(|name| !was.contains_key(*name));
    for name in was.keys().chain(new) {
        let (was, now) = (was.get(name), now.get(name));
        if was != now {
            changes.push(format!("{prefix}{name} was {}, now {}", shown(was), shown(now)));
        }
    }
}

impl Config {
    /// What it comes to, with all that [`Config::restrict`] has left.
    ///
    /// # Errors
    /// As [`Config::points`].
    pub fn experiment(&self) -> anyhow::Result<Experiment> {
        // Named one by one, so that a new setting cannot be forgotten here.
        let Self {
            title: _,
            scenes: _,
            variants: _,
            views,
            size,
            method,
            depth: _,
            seed,
            builds,
            warm_up,
            samples,
            order,
            axes: _,
            sets: _,
            only: _,
        } = self;
        let views = views.as_ref().map(|list| views::each(list).map_or(list.clone(), |each| each.join(",")));
        let size = size.map(|size| format!("{}x{}", size.width, size.height));
        let mut settings = Parameters::default();
        for (name, value) in [
            ("views", json!(views)),
            ("size", json!(size)),
            ("method", json!(method)),
            ("depth", json!(self.depth())),
            ("seed", json!(seed)),
            ("builds", json!(builds)),
            ("warm-up", json!(warm_up)),
            ("samples", json!(samples)),
            ("order", json!(order)),
        ] {
            settings.add(name, &value)?;
        }
        let defaults = Params::default().by_name();
        let mut points = BTreeMap::new();
        for point in self.points()? {
            let mut own = point.params.by_name();
            own.0.retain(|name, value| defaults.get(name) != Some(value));
            points.insert(point.key(), own);
        }
        Ok(Experiment { settings, defaults, points })
    }
}
