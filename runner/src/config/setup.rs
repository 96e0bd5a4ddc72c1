//! The points of an experiment.

use super::{Config, axis, value};
use crate::{params::Params, variant::Variant};
use record::Parameters;
use std::{collections::HashSet, fmt};

/// A point: a variant on a scene with parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// As the config names it.
    pub scene: String,
    /// What is measured.
    pub variant: Variant,
    /// What the axes say here; those that are left out are not in it.
    pub axes: Parameters,
    /// All parameters.
    pub params: Params,
}

impl Setup {
    /// A name that no other point of the experiment has, such as `city | Wide4 | ploc.radius=8`. It stays the
    /// same when axes get more values, and says nothing of parameters that are no axes.
    pub fn key(&self) -> String {
        let axes = self.axes.0.iter().map(|(name, value)| format!("{name}={}", value::text(value)));
        let axes: Vec<_> = axes.collect();
        let end = if axes.is_empty() { String::new() } else { format!(" | {}", axes.join(", ")) };
        format!("{} | {}{end}", self.scene, self.variant)
    }
}

impl fmt::Display for Setup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.key())
    }
}

impl Config {
    /// All combinations that [`Config::restrict`] has left, each once: by scene, then by variant, then by
    /// axes, the first of which changes slowest.
    ///
    /// # Errors
    /// A parameter does not take its value; reading the config has seen to it that all do.
    pub fn points(&self) -> anyhow::Result<Vec<Setup>> {
        let groups = axis::groups(&self.axes).unwrap_or_default();
        let mut seen = HashSet::new();
        let mut points = Vec::new();
        for scene in &self.scenes {
            for &variant in &self.variants {
                let mut combinations = Vec::new();
                self.combine(&groups, scene, variant, &Parameters::default(), &mut combinations);
                for axes in combinations.into_iter().filter(|axes| self.only.allows(axes)) {
                    let params = self.params(scene, variant, &axes)?;
                    let point = Setup { scene: scene.clone(), variant, axes, params };
                    if seen.insert(point.key()) {
                        points.push(point);
                    }
                }
            }
        }
        Ok(points)
    }

    /// Adds what `groups` of axes say on top of `axes`, in every combination.
    fn combine(
        &self,
        groups: &[Vec<usize>],
        scene: &str,
        variant: Variant,
        axes: &Parameters,
        combinations: &mut Vec<Parameters>,
    ) {
        let Some((group, rest)) = groups.split_first() else {
            combinations.push(axes.clone());
            return;
        };
        let varied = group.iter().map(|&i| &self.axes[i]);
        let varied: Vec<_> = varied.filter(|axis| axis.when.holds(scene, variant, axes)).collect();
        let Some(first) = varied.first() else {
            return self.combine(rest, scene, variant, axes, combinations);
        };
        for step in 0..first.values.len() {
            let mut axes = axes.clone();
            for axis in &varied {
                axes.set(axis.parameter.as_str(), axis.values[step].clone());
            }
            self.combine(rest, scene, variant, &axes, combinations);
        }
    }

    /// The variant's defaults, then sets, then axes.
    fn params(&self, scene: &str, variant: Variant, axes: &Parameters) -> anyhow::Result<Params> {
        let mut params = Params::of(variant);
        for set in self.sets.iter().filter(|set| set.when.holds(scene, variant, axes)) {
            value::assign(&mut params, &set.parameters)?;
        }
        value::assign(&mut params, axes)?;
        Ok(params)
    }
}
