//! Leaves a part of the points: `--only AXIS=VALUE`.

use super::{Config, source::instead, value, views};
use crate::{params, variant::Variant};
use anyhow::{Context, anyhow, bail};
use record::{Parameters, Value};
use std::collections::BTreeMap;

/// For each axis that is restricted, the values that are left.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Only(BTreeMap<String, Vec<Value>>);

impl Only {
    /// Whether a combination is left. Where a restricted axis is left out, it is not.
    pub fn allows(&self, axes: &Parameters) -> bool {
        self.0.iter().all(|(name, values)| axes.get(name).is_some_and(|value| values.contains(value)))
    }
}

impl Config {
    /// Leaves only what `only` says, AXIS=VALUE each: `scene`, `variant` (with `*`, and `!` to leave out), `view`, or
    /// a parameter that is an axis. Several of one axis leave any of their values.
    ///
    /// # Errors
    /// No such axis, a value that it does not have, or nothing would be left.
    pub fn restrict(&mut self, only: &[String]) -> anyhow::Result<()> {
        let (mut scenes, mut variants, mut views) = (Vec::new(), Vec::new(), Vec::new());
        let mut values: BTreeMap<String, Vec<Value>> = BTreeMap::new();
        for option in only {
            let wrong = |message: String| anyhow!("--only {option}: {message}");
            let (axis, text) = option.split_once('=').with_context(|| wrong("write AXIS=VALUE".into()))?;
            let (axis, text) = (axis.trim(), text.trim());
            match axis {
                "scene" | "scenes" => {
                    if !self.scenes.iter().any(|scene| scene == text) {
                        bail!(wrong(format!("the scenes are {}", self.scenes.join(", "))));
                    }
                    scenes.push(text.to_owned());
                }
                "variant" | "variants" => {
                    let named = Variant::named(text).unwrap_or_default();
                    if !named.iter().any(|variant| self.variants.contains(variant)) {
                        let names: Vec<_> = self.variants.iter().map(|variant| variant.name()).collect();
                        bail!(wrong(format!("the variants are {}", names.join(", "))));
                    }
                    variants.push(text.to_owned());
                }
                "view" | "views" => {
                    let wanted = views::each(text).map_err(&wrong)?;
                    if let Some(list) = &self.views {
                        let all = views::each(list).map_err(&wrong)?;
                        if !wanted.iter().all(|view| all.contains(view)) {
                            bail!(wrong(format!("the views are {}", all.join(", "))));
                        }
                    }
                    views.extend(wanted);
                }
                parameter => {
                    let Some(axis) = self.axes.iter().find(|axis| axis.parameter == parameter) else {
                        let axes = self.axes.iter().map(|axis| axis.parameter.as_str());
                        let instead =
                            instead(parameter, ["scene", "variant", "view"].into_iter().chain(axes));
                        bail!(wrong(format!("{parameter} is no axis of this config{instead}")));
                    };
                    let value = value::of(parameter, &params::value(text))
                        .ok()
                        .filter(|value| axis.values.contains(value))
                        .with_context(|| wrong(format!("its values are {}", value::list(&axis.values))))?;
                    values.entry(parameter.to_owned()).or_default().push(value);
                }
            }
        }
        if !scenes.is_empty() {
            self.scenes.retain(|scene| scenes.contains(scene));
        }
        if !variants.is_empty() {
            // Only what is taken away leaves the rest.
            if variants.iter().all(|pattern| pattern.starts_with('!')) {
                variants.insert(0, "all".into());
            }
            let wanted = Variant::choose(&variants)?;
            self.variants.retain(|variant| wanted.contains(variant));
        }
        if !views.is_empty() {
            self.views = Some(views.join(","));
        }
        self.only.0.extend(values);
        if self.points()?.is_empty() {
            bail!("--only {}: no point is left", only.join(" --only "));
        }
        Ok(())
    }
}
