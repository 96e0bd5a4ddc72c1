//! `runner best`: which value of each axis is best for each variant.
//!
//! The rule is the thesis's (Cezner 2025, section 6.2.1). In each scene, the rate with a value is divided by the
//! best rate that any value has there. The value with the largest minimum over the scenes is chosen, and among
//! those that are equal to three decimals the one with the largest mean. So a value that is a little slower
//! everywhere is taken before one that is fast in most scenes and bad in one.
//!
//! Where several axes were crossed, a value is judged by the best that the others can make of it.

use crate::{
    args::{self, Global},
    commands::print,
    progress::remark,
    sweep,
    table::{self, table},
    tuned::{self, Tuned},
    variant::Variant,
};
use anyhow::bail;
use record::{Parameters, Point, Rays, Record, Value, stats::Estimate};
use serde::Serialize;
use std::collections::BTreeMap;

/// A difference that chance makes in less than one of twenty cases is taken for real.
const SIGNIFICANT: f64 = 0.05;

/// The best value of one axis for one variant.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Choice {
    /// Name of the variant.
    pub variant: String,
    /// The parameter.
    pub axis: String,
    /// Which rays decided.
    pub rays: &'static str,
    /// The best value.
    pub value: Value,
    /// Its smallest rate over the scenes, relative to the best of each.
    pub minimum: f64,
    /// The mean of the same.
    pub mean: f64,
    /// The next one; absent where there is but one value.
    pub second: Option<Second>,
    /// Scenes that decided.
    pub scenes: Vec<String>,
}

/// The value after the best one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Second {
    /// The value.
    pub value: Value,
    /// Its smallest rate over the scenes, relative to the best of each.
    pub minimum: f64,
    /// The mean of the same.
    pub mean: f64,
    /// By how much the best one is ahead, in what decided: the minimum, or the mean where minima are equal.
    pub margin: f64,
    /// How probable so large a margin is where there is none in truth; absent where too few samples tell.
    pub probability: Option<f64>,
}

impl Second {
    /// Whether the margin is more than chance makes; nothing where too few samples tell.
    pub fn significant(&self) -> Option<bool> {
        self.probability.map(|probability| probability < SIGNIFICANT)
    }
}

/// Prints the best values of a record's axes, and writes them as a config.
///
/// # Errors
/// The record cannot be read, or nothing was varied in it.
pub fn best(global: &Global, arguments: &args::Best) -> anyhow::Result<()> {
    let (mut all, mut notes, mut heads) = (Vec::new(), Vec::new(), Vec::new());
    for path in &arguments.records {
        let record = sweep::read(path)?;
        let (choices, own) = choices(&record, arguments.rays.map(Rays::from));
        if choices.is_empty() {
            bail!(
                "{} has no axis with more than one value in a common scene{}",
                path.display(),
                own.iter().map(|note| format!("\n  {note}")).collect::<String>()
            );
        }
        heads.push(head(&record, &choices));
        all.extend(choices);
        notes.extend(own);
    }
    let choices = all;
    if arguments.json {
        print(&serde_json::to_string_pretty(&choices)?)?;
    } else {
        print(&shown(&choices, &notes))?;
    }
    if let Some(output) = &arguments.output {
        let mut tuned: Vec<Tuned> = Vec::new();
        for choice in &choices {
            let margin = match &choice.second {
                None => "the only value".to_owned(),
                Some(second) => format!("{} before {}: {}", choice.value, second.value, surely(second)),
            };
            let variant = Variant::one(&choice.variant)?;
            let place = tuned.iter().position(|tuned| tuned.variant == variant).unwrap_or_else(|| {
                tuned.push(Tuned { variant, comments: Vec::new(), parameters: Parameters::default() });
                tuned.len() - 1
            });
            tuned[place].comments.push(format!("{}: {margin}", choice.axis));
            tuned[place].parameters.set(choice.axis.as_str(), choice.value.clone());
        }
        tuned::write(output, &heads.join("\n"), &tuned)?;
        remark(global.quiet, format_args!("config: {}", output.display()));
    }
    Ok(())
}

/// Where choices come from.
fn head(record: &Record, choices: &[Choice]) -> String {
    let title = record.sweep.as_ref().map_or("a run", |sweep| sweep.title.as_str());
    let scenes = distinct(choices.iter().flat_map(|choice| choice.scenes.clone()).collect());
    format!(
        "Best values on {}, driver {}.\nFrom {title}, begun {}, {}x{}, over {}.",
        record.device.name,
        record.device.driver.info,
        record.started,
        record.run.width,
        record.run.height,
        scenes.join(", ")
    )
}

fn distinct(mut names: Vec<String>) -> Vec<String> {
    let mut seen = Vec::new();
    names.retain(|name| {
        let new = !seen.contains(name);
        seen.push(name.clone());
        new
    });
    names
}

/// The rays that an axis is for.
fn concerned(axis: &str, otherwise: Option<Rays>) -> Rays {
    if axis.starts_with("trace.primary_") {
        Rays::Primary
    } else if axis.starts_with("trace.secondary_") {
        Rays::Secondary
    } else {
        otherwise.unwrap_or(Rays::All)
    }
}

/// The best values of all axes and variants, and what was left out of the judgement.
pub fn choices(record: &Record, rays: Option<Rays>) -> (Vec<Choice>, Vec<String>) {
    let all: Vec<(&Point, Parameters)> =
        record.results.iter().map(|point| (point, record.parameters_of(point))).collect();
    let mut variants: Vec<&str> = all.iter().map(|(point, _)| point.variant.as_str()).collect();
    variants.sort_by_key(|name| Variant::ALL.iter().position(|variant| variant.name() == *name));
    variants.dedup();
    let (mut choices, mut notes) = (Vec::new(), Vec::new());
    for variant in variants {
        let own: Vec<_> = all.iter().filter(|(point, _)| point.variant == variant).collect();
        let mut axes: Vec<&String> = own.iter().flat_map(|(_, parameters)| parameters.0.keys()).collect();
        axes.sort();
        axes.dedup();
        let named = record.sweep.as_ref().map(|sweep| &sweep.axes).filter(|axes| !axes.is_empty());
        for axis in axes.into_iter().filter(|axis| named.is_none_or(|named| named.contains(axis))) {
            let rays = concerned(axis, rays);
            let mut tried = Tried::default();
            for (point, parameters) in &own {
                let unreliable = point.measurement.as_ref().is_some_and(|m| m.unreliable);
                let Some(value) = parameters.get(axis) else { continue };
                match point.rate(rays).filter(|_| !unreliable) {
                    Some(rate) => tried.add(value, &point.scene.name, rate, point.estimate(rays)),
                    None => notes.push(format!(
                        "{}, {variant}, {axis}={value}: left out, because too few samples count",
                        point.scene.name
                    )),
                }
            }
            for what in tried.drop_incomplete() {
                notes.push(format!("{what}, {variant}: left out for {axis}, because not all was measured"));
            }
            if tried.values.len() > 1
                && let Some(choice) = tried.choose()
            {
                choices.push(Choice {
                    variant: variant.into(),
                    axis: axis.clone(),
                    rays: named_rays(rays),
                    ..choice
                });
            }
        }
    }
    notes.dedup();
    (choices, notes)
}

fn named_rays(rays: Rays) -> &'static str {
    match rays {
        Rays::Primary => "primary",
        Rays::Secondary => "secondary",
        Rays::All => "all",
    }
}

/// A rate, and how sure it is where that is known.
type Rate = (f64, Option<Estimate>);

/// What each value of an axis came to in each scene.
#[derive(Default)]
struct Tried {
    values: Vec<(Value, BTreeMap<String, Rate>)>,
}

impl Tried {
    fn add(&mut self, value: &Value, scene: &str, rate: f64, estimate: Option<Estimate>) {
        let place = match self.values.iter().position(|(known, _)| known == value) {
            Some(place) => place,
            None => {
                self.values.push((value.clone(), BTreeMap::new()));
                self.values.len() - 1
            }
        };
        let scenes = &mut self.values[place].1;
        if scenes.get(scene).is_none_or(|(best, _)| rate > *best) {
            scenes.insert(scene.into(), (rate, estimate));
        }
    }

    /// Drops scenes that lack a value or, where that would leave none, values that a scene lacks; names them.
    fn drop_incomplete(&mut self) -> Vec<String> {
        let mut scenes: Vec<String> = self.values.iter().flat_map(|(_, s)| s.keys().cloned()).collect();
        scenes.sort();
        scenes.dedup();
        let whole = |scene: &String| self.values.iter().all(|(_, of)| of.contains_key(scene));
        if !scenes.iter().any(whole) {
            let (kept, dropped) = std::mem::take(&mut self.values)
                .into_iter()
                .partition(|(_, of)| scenes.iter().all(|scene| of.contains_key(scene)));
            self.values = kept;
            let dropped: Vec<(Value, _)> = dropped;
            return dropped.into_iter().map(|(value, _)| value.to_string()).collect();
        }
        scenes.retain(|scene| !whole(scene));
        for (_, of) in &mut self.values {
            of.retain(|scene, _| !scenes.contains(scene));
        }
        scenes
    }

    fn choose(&self) -> Option<Choice> {
        let scenes: Vec<&String> = self.values.first()?.1.keys().collect();
        if scenes.is_empty() {
            return None;
        }
        let fastest =
            |scene: &String| self.values.iter().map(|(_, of)| of[scene].0).fold(f64::MIN_POSITIVE, f64::max);
        // Relative rates of each value, in the order of the scenes.
        let mut judged: Vec<(&Value, Vec<Rate>)> = (self.values.iter())
            .map(|(value, of)| {
                let relative = |scene: &&String| {
                    let (rate, estimate) = of[*scene];
                    let scale = 1.0 / fastest(scene);
                    let estimate = estimate.map(|e| Estimate {
                        mean: e.mean * scale,
                        variance: e.variance * scale * scale,
                        ..e
                    });
                    (rate * scale, estimate)
                };
                (value, scenes.iter().map(relative).collect())
            })
            .collect();
        let rank = |rates: &[Rate]| ((1e3 * minimum(rates).1).round(), mean(rates));
        judged.sort_by(|(_, a), (_, b)| {
            let ((min_a, mean_a), (min_b, mean_b)) = (rank(a), rank(b));
            min_b.total_cmp(&min_a).then(mean_b.total_cmp(&mean_a))
        });
        let (value, own) = &judged[0];
        let second = judged.get(1).map(|(value, its)| {
            let (margin, probability) = if rank(own).0 > rank(its).0 {
                // What counts against the second is the scene where it is worst.
                let (scene, least) = minimum(its);
                let ahead = own[scene].1.zip(its[scene].1).map(|(own, its)| own.not_greater(&its));
                (minimum(own).1 - least, ahead)
            } else {
                let average = |rates: &[Rate]| {
                    let known: Option<Vec<Estimate>> = rates.iter().map(|(_, estimate)| *estimate).collect();
                    known.and_then(|known| Estimate::average(&known))
                };
                let ahead = average(own).zip(average(its)).map(|(own, its)| own.not_greater(&its));
                (mean(own) - mean(its), ahead)
            };
            Second { value: (*value).clone(), minimum: minimum(its).1, mean: mean(its), margin, probability }
        });
        Some(Choice {
            variant: String::new(),
            axis: String::new(),
            rays: "",
            value: (*value).clone(),
            minimum: minimum(own).1,
            mean: mean(own),
            second,
            scenes: scenes.into_iter().cloned().collect(),
        })
    }
}

/// The smallest rate and where it is.
fn minimum(rates: &[Rate]) -> (usize, f64) {
    let all = rates.iter().map(|(rate, _)| *rate).enumerate();
    all.min_by(|(_, a), (_, b)| a.total_cmp(b)).expect("at least one scene")
}

fn mean(rates: &[Rate]) -> f64 {
    rates.iter().map(|(rate, _)| rate).sum::<f64>() / rates.len() as f64
}

/// The margin in words.
fn surely(second: &Second) -> String {
    let sure = match second.significant() {
        Some(true) => "significant",
        Some(false) => "not significant",
        None => "too few samples to tell",
    };
    format!("{:+.1}%, {sure}", 100.0 * second.margin)
}

fn shown(choices: &[Choice], notes: &[String]) -> String {
    let mut rows =
        table(&["variant", "axis", "rays", "best", "min", "mean", "second", "margin", "significant"]);
    let mut variant = "";
    for choice in choices {
        let new = choice.variant != variant;
        variant = &choice.variant;
        let mut row = vec![
            if new { choice.variant.clone() } else { String::new() },
            choice.axis.clone(),
            choice.rays.to_owned(),
            choice.value.to_string(),
            format!("{:.3}", choice.minimum),
            format!("{:.3}", choice.mean),
        ];
        row.extend(match &choice.second {
            None => ["–".to_owned(), "–".to_owned(), "–".to_owned()],
            Some(second) => [
                second.value.to_string(),
                format!("{:.1}%", 100.0 * second.margin),
                match (second.significant(), second.probability) {
                    (Some(sure), Some(p)) => format!("{} (p = {p:.2})", if sure { "yes" } else { "no" }),
                    _ => "unknown".into(),
                },
            ],
        });
        rows.add_row(row);
    }
    table::align(&mut rows, &[0, 1, 2, 8]);
    let scenes = distinct(choices.iter().flat_map(|choice| choice.scenes.clone()).collect());
    let mut text = format!(
        "{}\n\nmin, mean: the rate relative to the best value of each scene, over {}. The largest minimum is best;\n\
         of minima that are equal to three decimals, the one with the largest mean. margin: to the second, in what\n\
         decided. significant: whether chance makes so large a margin in less than one of twenty cases.",
        table::shown(&rows),
        scenes.join(", ")
    );
    for note in notes {
        text += &format!("\n{note}.");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::{Launch, Sample};

    /// A record with a point for each scene, value and rates of samples.
    fn record(points: &[(&str, u32, &[f64])]) -> Record {
        let mut record = record::example();
        let point = record.results[0].clone();
        record.sweep.as_mut().unwrap().axes = vec!["trace.secondary_subgroups".into()];
        record.results = points
            .iter()
            .map(|(scene, value, rates)| {
                let mut point = point.clone();
                point.scene.name = (*scene).into();
                point.parameters.set("trace.secondary_subgroups", *value);
                let samples = rates.iter().map(|rate| Sample {
                    depths: vec![
                        Launch { rays: 1000, milliseconds: 1.0 },
                        Launch { rays: 1_000_000, milliseconds: 1e3 / rate },
                    ],
                    ..Sample::default()
                });
                point.views[0].samples = samples.collect();
                point
            })
            .collect();
        record
    }

    #[track_caller]
    fn one(record: &Record) -> Choice {
        let (choices, _) = choices(record, None);
        assert_eq!(choices.len(), 1, "{choices:?}");
        choices[0].clone()
    }

    /// Thesis table 8, the row of Binary: 32×32 has the largest minimum although 32×28 has the larger mean.
    #[test]
    fn the_largest_minimum_wins() {
        let choice = one(&record(&[
            ("a", 28, &[97.0, 97.1]),
            ("b", 28, &[111.0, 111.1]),
            ("a", 32, &[100.0, 100.1]),
            ("b", 32, &[108.0, 108.1]),
            ("a", 2, &[89.0, 89.1]),
            ("b", 2, &[93.0, 93.1]),
        ]));
        assert_eq!((choice.value.to_string().as_str(), choice.rays), ("32", "secondary"));
        assert!((choice.minimum - 108.05 / 111.05).abs() < 1e-6, "{choice:?}");
        let second = choice.second.unwrap();
        assert_eq!(second.value.to_string(), "28");
        assert!((second.margin - (108.05 / 111.05 - 97.05 / 100.05)).abs() < 1e-6, "{second:?}");
        assert_eq!(second.significant(), Some(true));
    }

    #[test]
    fn the_mean_breaks_ties_and_noise_is_not_significant() {
        let choice = one(&record(&[
            ("a", 2, &[100.0, 104.0]),
            ("b", 2, &[100.0, 104.0]),
            ("a", 4, &[100.01, 104.01]),
            ("b", 4, &[99.98, 103.98]),
        ]));
        assert_eq!(choice.value.to_string(), "2");
        let second = choice.second.unwrap();
        assert!(second.margin < 1e-3 && second.significant() == Some(false), "{second:?}");
    }

    #[test]
    fn scenes_without_a_value_are_left_out_and_named() {
        let record = record(&[("a", 2, &[100.0]), ("a", 4, &[90.0]), ("b", 2, &[10.0])]);
        let (choices, notes) = choices(&record, None);
        assert_eq!(choices[0].scenes, ["a"]);
        assert_eq!(choices[0].second.as_ref().unwrap().significant(), None, "one sample tells no scatter");
        assert!(notes.iter().any(|note| note.starts_with("b,")), "{notes:?}");
    }

    #[test]
    fn where_no_scene_has_all_values_those_are_compared_that_all_scenes_have() {
        let (few, many) = ([90.0, 90.1], [100.0, 100.1]);
        let record = record(&[
            ("a", 2, &many),
            ("a", 4, &few),
            ("a", 8, &many),
            ("b", 2, &many),
            ("b", 4, &few),
            ("b", 16, &many),
        ]);
        let (choices, notes) = choices(&record, None);
        assert_eq!((choices[0].value.to_string().as_str(), choices[0].scenes.len()), ("2", 2));
        assert_eq!(choices[0].second.as_ref().unwrap().value.to_string(), "4");
        assert_eq!(notes.len(), 2, "{notes:?}");
    }

    #[test]
    fn crossed_axes_are_judged_by_their_best() {
        let mut record =
            record(&[("a", 2, &[100.0]), ("a", 4, &[90.0]), ("a", 2, &[80.0]), ("a", 4, &[120.0])]);
        record.sweep.as_mut().unwrap().axes.push("collapse.c_t".into());
        for (point, cost) in record.results.iter_mut().zip([1.0, 1.0, 2.0, 2.0]) {
            point.parameters.set("collapse.c_t", cost);
        }
        let (choices, _) = choices(&record, Some(Rays::Secondary));
        let of = |axis: &str| choices.iter().find(|c| c.axis == axis).unwrap().value.to_string();
        assert_eq!((of("trace.secondary_subgroups"), of("collapse.c_t")), ("4".into(), "2.0".into()));
    }

    #[test]
    fn what_was_not_varied_is_no_choice() {
        assert_eq!(choices(&record(&[("a", 2, &[100.0]), ("b", 2, &[90.0])]), None).0, []);
    }
}
