//! How a rate went.

use super::version::{Commit, Version};
use crate::diff::{Change, Comparison, Named, Thresholds, Verdict, compare};
use crate::figure::Figure;
use crate::select::{Filter, Pass, Selection, geometric_mean, in_order};
use anyhow::bail;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

/// What is followed, the rate that tells trees apart first.
const FIGURES: [Figure; 2] = [Figure::Secondary, Figure::Primary];

/// How a record went.
#[derive(Debug, Serialize)]
pub struct History {
    /// The record, from the topmost folder.
    pub path: String,
    /// The scenes over which rates are averaged.
    pub scenes: Vec<String>,
    /// Its versions, the oldest first.
    pub versions: Vec<Told>,
    /// The rates.
    pub courses: Vec<Course>,
}

/// A version, in short.
#[derive(Debug, Serialize)]
pub struct Told {
    /// The commit.
    #[serde(flatten)]
    pub commit: Commit,
    /// Where the record was.
    pub path: String,
    /// When it was measured; absent where it cannot be read.
    pub started: Option<String>,
    /// On what.
    pub device: Option<String>,
    /// Why it cannot be read, or not be compared with the one before.
    pub problem: Option<String>,
}

/// How one rate of one variant in one pass went.
#[derive(Debug, Serialize)]
pub struct Course {
    /// Name of the variant.
    pub variant: String,
    /// What sets its points apart from others of the same variant.
    pub pass: Pass,
    /// The rate, by the name of its column.
    pub figure: Figure,
    /// Its values, the oldest first.
    pub steps: Vec<Step>,
}

/// The rate in one version.
#[derive(Debug, Serialize)]
pub struct Step {
    /// The version's place among all.
    pub version: usize,
    /// The geometric mean over the scenes.
    pub value: f64,
    /// From the version before that has the rate; absent of the first, and where the two are not comparable.
    pub change: Option<Change>,
    /// From the first version since the last change point, where that is another one.
    pub since: Option<Since>,
    /// Whether the rate has changed here.
    pub change_point: bool,
}

/// A change over several versions.
#[derive(Debug, Serialize)]
pub struct Since {
    /// The place of the version that it is a change from.
    pub version: usize,
    /// The change.
    #[serde(flatten)]
    pub change: Change,
}

impl History {
    /// Of these versions.
    ///
    /// # Errors
    /// None of them can be read, the filter admits nothing, or no scene is in all of them.
    pub fn of(versions: &[Version], filter: &Filter) -> anyhow::Result<History> {
        let mut selections: Vec<Option<Selection>> = Vec::new();
        let mut refused = None;
        for version in versions {
            let selection = version.record.as_ref().ok().map(|record| Selection::filtered(record, filter));
            selections.push(match selection {
                Some(Err(error)) => {
                    refused = Some(error);
                    None
                }
                other => other.and_then(Result::ok),
            });
        }
        let of_scenes = || selections.iter().flatten().map(Selection::scenes);
        let Some(first) = of_scenes().next() else {
            let problem = versions.iter().find_map(|version| version.record.as_ref().err());
            return Err(refused.unwrap_or_else(|| {
                anyhow::anyhow!("no version can be read; the first: {}", problem.map_or("", String::as_str))
            }));
        };
        let mut scenes = first;
        scenes.retain(|scene| of_scenes().all(|own| own.contains(scene)));
        if scenes.is_empty() {
            bail!(
                "no scene is in all versions, which have {}; choose with --scene which are followed",
                in_order(of_scenes().flatten()).join(", ")
            );
        }
        let of_all = Filter {
            scenes: scenes.iter().map(|scene| scene.to_string()).collect(),
            variants: filter.variants.clone(),
        };
        let mut pairs = Pairs { versions, filter: &of_all, compared: HashMap::new() };
        let mut courses = Vec::new();
        for (variant, pass, axes) in keys(&selections) {
            for figure in FIGURES {
                let value = |selection: &Option<Selection>| {
                    value(selection.as_ref()?, &scenes, &variant, &pass, &axes, figure)
                };
                let values: Vec<(usize, f64)> = (selections.iter().map(value).enumerate())
                    .filter_map(|(version, value)| Some((version, value?)))
                    .collect();
                if !values.is_empty() {
                    let steps = steps(&values, |old, new| pairs.change(old, new, &variant, &pass, figure));
                    courses.push(Course { variant: variant.clone(), pass: pass.clone(), figure, steps });
                }
            }
        }
        let told = |(index, version): (usize, &Version)| {
            let record = version.record.as_ref().ok();
            let before = (0..index).rev().find(|&at| selections[at].is_some());
            let problem = match (&version.record, before) {
                (Err(error), _) => Some(error.clone()),
                _ if selections[index].is_none() => Some("it has no such scene or variant".into()),
                (_, Some(before)) => pairs.problem(before, index),
                (_, None) => None,
            };
            Told {
                commit: version.commit.clone(),
                path: version.path.clone(),
                started: record.map(|record| record.started.to_string()),
                device: record.map(|record| record.device.name.clone()),
                problem,
            }
        };
        let told = versions.iter().enumerate().map(told).collect();
        let scenes = scenes.into_iter().map(String::from).collect();
        let path = versions.last().map_or_else(String::new, |version| version.path.clone());
        Ok(History { path, scenes, versions: told, courses })
    }
}

/// All variants with their passes, by the parameters that tell points apart in any version.
fn keys(selections: &[Option<Selection>]) -> Vec<(String, Pass, BTreeSet<String>)> {
    let mut keys = Vec::new();
    for variant in in_order(selections.iter().flatten().flat_map(Selection::variants)) {
        let axes: BTreeSet<String> =
            selections.iter().flatten().flat_map(|selection| selection.axes(variant)).collect();
        let entries = selections.iter().flatten().flat_map(|selection| &selection.entries);
        let own = entries.filter(|entry| entry.variant() == variant);
        for pass in in_order(own.map(|entry| entry.pass_of(&axes))) {
            keys.push((variant.to_owned(), pass, axes.clone()));
        }
    }
    keys
}

/// The mean of a rate over the scenes; nothing where one of them lacks it.
fn value(
    selection: &Selection,
    scenes: &[&str],
    variant: &str,
    pass: &Pass,
    axes: &BTreeSet<String>,
    figure: Figure,
) -> Option<f64> {
    let of = |scene: &&str| {
        let is = |entry: &&crate::select::Entry| {
            entry.variant() == variant && entry.scene() == *scene && entry.pass_of(axes) == *pass
        };
        figure.of(selection.entries.iter().find(is)?.point)
    };
    geometric_mean(scenes.iter().map(of).collect::<Option<Vec<f64>>>()?)
}

/// The steps of these values, given what the change from one version to another is: nothing where they are not
/// comparable.
fn steps(values: &[(usize, f64)], mut change: impl FnMut(usize, usize) -> Option<Change>) -> Vec<Step> {
    let mut steps: Vec<Step> = Vec::new();
    // The first version of those that do not differ.
    let mut level = 0;
    for &(version, value) in values {
        let Some(before) = steps.last().map(|step| step.version) else {
            level = version;
            steps.push(Step { version, value, change: None, since: None, change_point: false });
            continue;
        };
        let from_last = change(before, version);
        let since = if from_last.is_some() && level != before {
            change(level, version).map(|change| Since { version: level, change })
        } else {
            None
        };
        let differs = |change: &Change| matches!(change.verdict, Verdict::Faster | Verdict::Slower);
        let change_point = from_last.as_ref().is_some_and(differs)
            || since.as_ref().is_some_and(|since| differs(&since.change));
        if change_point || from_last.is_none() {
            level = version;
        }
        steps.push(Step { version, value, change: from_last, since, change_point });
    }
    steps
}

/// Comparisons of versions, each made once.
struct Pairs<'v> {
    versions: &'v [Version],
    filter: &'v Filter,
    compared: HashMap<(usize, usize), Result<Comparison, String>>,
}

impl Pairs<'_> {
    fn compared(&mut self, old: usize, new: usize) -> &Result<Comparison, String> {
        let (versions, filter) = (self.versions, self.filter);
        self.compared.entry((old, new)).or_insert_with(|| {
            let [old, new] = [&versions[old], &versions[new]];
            let (before, after) = (old.record.as_ref(), new.record.as_ref());
            let (before, after) = (before.map_err(String::clone)?, after.map_err(String::clone)?);
            let old = Named::new(Path::new(&old.path), before);
            let new = Named::new(Path::new(&new.path), after);
            compare(old, new, filter, Thresholds::default()).map_err(|error| format!("{error:#}"))
        })
    }

    /// Why two versions are not comparable.
    fn problem(&mut self, old: usize, new: usize) -> Option<String> {
        match self.compared(old, new) {
            Ok(comparison) if comparison.obstacles.is_empty() => None,
            Ok(comparison) => {
                Some(format!("not comparable with the one before: {}", comparison.obstacles.join("; ")))
            }
            Err(error) => Some(error.clone()),
        }
    }

    /// The change of a rate: of its mean over the scenes, or of the only scene.
    fn change(
        &mut self,
        old: usize,
        new: usize,
        variant: &str,
        pass: &Pass,
        figure: Figure,
    ) -> Option<Change> {
        let comparison = self.compared(old, new).as_ref().ok().filter(|found| found.obstacles.is_empty())?;
        // Two versions may need fewer parameters to tell points apart than all of them together.
        let within = |other: &BTreeMap<String, String>| {
            other.iter().all(|(name, value)| pass.0.get(name) == Some(value))
        };
        let mut sections = comparison
            .sections
            .iter()
            .filter(|section| section.variant == variant && within(&section.pass.0));
        let section = sections.next().filter(|_| sections.next().is_none())?;
        let line = section.lines.iter().find(|line| line.figure == figure)?;
        line.mean.as_ref().or(line.scenes.first()).cloned()
    }
}
