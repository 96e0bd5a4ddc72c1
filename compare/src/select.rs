//! The points of a record, by scene, variant and pass.

use crate::figure::Figure;
use record::{OF_SCENE, Parameters, Point, Record, Value};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// The variant that others are compared with, unless somebody says otherwise.
pub const REFERENCE: &str = "Binary";

/// What distinguishes points of one variant from each other on the same scene: parameters and their values. Most
/// records have one point for each scene and variant, and so one pass, the normal one.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Pass(pub BTreeMap<String, String>);

impl Pass {
    /// The same without the scene's parameters.
    pub fn of_variant(&self) -> Pass {
        let own = self.0.iter().filter(|(name, _)| !name.starts_with(OF_SCENE));
        Pass(own.map(|(name, value)| (name.clone(), value.clone())).collect())
    }

    /// What is not the same in another one.
    pub fn beside(&self, other: &Pass) -> Pass {
        let own = self.0.iter().filter(|(name, value)| other.0.get(*name) != Some(value));
        Pass(own.map(|(name, value)| (name.clone(), value.clone())).collect())
    }
}

/// As text.
impl serde::Serialize for Pass {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

impl fmt::Display for Pass {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return out.pad("normal");
        }
        let all: Vec<String> = self.0.iter().map(|(name, value)| format!("{name}={value}")).collect();
        out.pad(&all.join(", "))
    }
}

/// A point and where it belongs.
#[derive(Clone, Debug)]
pub struct Entry<'r> {
    /// The point.
    pub point: &'r Point,
    /// Its place in the record's `results`.
    pub index: usize,
    /// All parameters that held for it, those of the run included, and those of the scene's generator as `scene.…`.
    pub parameters: Parameters,
    /// What sets it apart from other points of its scene and variant.
    pub pass: Pass,
}

impl Entry<'_> {
    /// Name of the scene.
    pub fn scene(&self) -> &str {
        &self.point.scene.name
    }

    /// Name of the variant.
    pub fn variant(&self) -> &str {
        &self.point.variant
    }

    /// The variant, and in parentheses what sets the point apart but belongs not to its scene.
    pub fn named(&self) -> String {
        let own = self.pass.0.iter().filter(|(name, _)| !name.starts_with(OF_SCENE));
        let own: Vec<String> = own.map(|(name, value)| format!("{name}={value}")).collect();
        let own = if own.is_empty() { String::new() } else { format!(" ({})", own.join(", ")) };
        format!("{}{own}", self.variant())
    }
}

/// The points that were chosen of a record, in the record's order.
#[derive(Clone, Debug)]
pub struct Selection<'r> {
    /// The record.
    pub record: &'r Record,
    /// The points.
    pub entries: Vec<Entry<'r>>,
}

/// Which points are chosen; all where nobody says otherwise.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Filter {
    /// Only this scene; `*` stands for any text [may be given several times]
    #[arg(long = "scene", value_name = "SCENE")]
    pub scenes: Vec<String>,
    /// Only this variant, such as 'Wide4*' [may be given several times]
    #[arg(long = "variant", value_name = "VARIANT")]
    pub variants: Vec<String>,
}

impl Filter {
    fn admits(&self, point: &Point) -> bool {
        let among = |patterns: &[String], name: &str| {
            patterns.is_empty() || patterns.iter().any(|pattern| matches(pattern, name))
        };
        among(&self.scenes, &point.scene.name) && among(&self.variants, &point.variant)
    }
}

/// Whether a pattern with `*` for any text describes all of a name.
pub fn matches(pattern: &str, name: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == name,
        Some((before, after)) => name.strip_prefix(before).is_some_and(|rest| {
            (0..=rest.len()).any(|at| rest.is_char_boundary(at) && matches(after, &rest[at..]))
        }),
    }
}

impl<'r> Selection<'r> {
    /// All points of a record.
    pub fn new(record: &'r Record) -> Selection<'r> {
        Selection::filtered(record, &Filter::default()).unwrap_or(Selection { record, entries: Vec::new() })
    }

    /// The points that a filter admits.
    ///
    /// # Errors
    /// There are none; the error says which scenes and variants there are.
    pub fn filtered(record: &'r Record, filter: &Filter) -> anyhow::Result<Selection<'r>> {
        let entries: Vec<Entry<'r>> = (record.results.iter().enumerate())
            .filter(|(_, point)| filter.admits(point))
            .map(|(index, point)| {
                let mut parameters = record.parameters_of(point);
                parameters.0.extend(point.scene.parameters().0);
                Entry { point, index, parameters, pass: Pass::default() }
            })
            .collect();
        if entries.is_empty() {
            let names = |of: fn(&Point) -> &str| in_order(record.results.iter().map(of)).join(", ");
            anyhow::bail!(
                "no point is of these scenes and variants; there are the scenes {} and the variants {}",
                names(|point| &point.scene.name),
                names(|point| &point.variant)
            );
        }
        let mut selection = Selection { record, entries };
        let axes: BTreeMap<String, BTreeSet<String>> =
            selection.variants().iter().map(|&name| (name.to_owned(), selection.axes(name))).collect();
        for entry in &mut selection.entries {
            entry.pass = entry.pass_of(&axes[&entry.point.variant]);
        }
        Ok(selection)
    }

    /// Names of the scenes, in order of first appearance.
    pub fn scenes(&self) -> Vec<&str> {
        in_order(self.entries.iter().map(Entry::scene))
    }

    /// Names of the variants, in order of first appearance.
    pub fn variants(&self) -> Vec<&str> {
        in_order(self.entries.iter().map(Entry::variant))
    }

    /// The passes of a variant, in order of first appearance.
    pub fn passes(&self, variant: &str) -> Vec<&Pass> {
        in_order(self.entries.iter().filter(|entry| entry.variant() == variant).map(|entry| &entry.pass))
    }

    /// Names of the parameters in which points of this variant on one scene differ.
    pub fn axes(&self, variant: &str) -> BTreeSet<String> {
        let mut axes = BTreeSet::new();
        let mut first: BTreeMap<&str, &Parameters> = BTreeMap::new();
        for entry in self.entries.iter().filter(|entry| entry.variant() == variant) {
            let other = *first.entry(entry.scene()).or_insert(&entry.parameters);
            axes.extend(differing(other, &entry.parameters));
        }
        axes
    }

    /// The point of a scene, a variant and a pass, where there is one.
    pub fn entry(&self, scene: &str, variant: &str, pass: &Pass) -> Option<&Entry<'r>> {
        let is = |entry: &&Entry| entry.scene() == scene && entry.variant() == variant;
        self.entries.iter().filter(is).find(|entry| entry.pass == *pass)
    }

    /// The point that another is relative to: of the same scene and of the variant `reference`, of the same pass
    /// if there are several.
    pub fn reference(&self, entry: &Entry, reference: &str) -> Option<&Entry<'r>> {
        // Generated scenes of one name may be of different sizes.
        let same = |other: &Entry| {
            other.scene() == entry.scene() && other.point.scene.parameters() == entry.point.scene.parameters()
        };
        let is = |other: &&Entry| same(other) && other.variant() == reference;
        let found: Vec<_> = self.entries.iter().filter(is).collect();
        match found[..] {
            [one] => Some(one),
            _ => found.into_iter().find(|other| other.pass.of_variant() == entry.pass.of_variant()),
        }
    }

    /// A figure as a multiple of that of the variant `reference` on the same scene.
    pub fn relative(&self, entry: &Entry, reference: &str, figure: Figure) -> Option<f64> {
        ratio(figure.of(entry.point)?, figure.of(self.reference(entry, reference)?.point)?)
    }
}

impl Entry<'_> {
    /// The values that these parameters have here.
    pub fn pass_of(&self, axes: &BTreeSet<String>) -> Pass {
        let values = axes.iter().filter_map(|name| Some((name.clone(), text(self.parameters.get(name)?))));
        Pass(values.collect())
    }
}

/// Names of the parameters that differ, or that only one has.
pub fn differing(a: &Parameters, b: &Parameters) -> BTreeSet<String> {
    let names = a.0.keys().chain(b.0.keys());
    names.filter(|name| a.get(name).map(text) != b.get(name).map(text)).cloned().collect()
}

/// A value as text, in which `2` and `2.0` are the same number.
pub fn text(value: &Value) -> String {
    match value {
        Value::Number(number) => match number.as_f64() {
            Some(float) if number.is_f64() => float.to_string(),
            _ => number.to_string(),
        },
        other => other.to_string(),
    }
}

/// One value as a multiple of another; nothing where that is no positive number.
pub fn ratio(value: f64, reference: f64) -> Option<f64> {
    Some(value / reference).filter(|ratio| reference > 0.0 && ratio.is_finite())
}

/// The geometric mean: of ratios, the one that does not depend on which side is the reference. Nothing of nothing,
/// or where a value is not positive.
pub fn geometric_mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let logarithms: Vec<f64> =
        values.into_iter().map(|value| (value > 0.0).then(|| value.ln())).collect::<Option<_>>()?;
    record::mean(logarithms.into_iter().map(Some)).map(f64::exp)
}

/// Each value once, where it appears first.
pub fn in_order<T: PartialEq>(values: impl IntoIterator<Item = T>) -> Vec<T> {
    values.into_iter().fold(Vec::new(), |mut all, value| {
        if !all.contains(&value) {
            all.push(value);
        }
        all
    })
}

#[cfg(test)]
mod tests;
