//! Where the time of builds goes: phases one after another, for each variant on each scene.

use super::chart::{Body, Chart, Row, Series, Stacks};
use super::notes::{self, Found};
use super::ratios::{only, settled, total};
use super::theme::{Dash, Hatch, Look, Marker, Tone};
use crate::figure::Figure;
use crate::select::{Selection, in_order};
use record::stats::median;
use record::{Build, Point, mean};

/// The part that traces sample rays.
const SAMPLING: &str = "sample rays";
/// What the phases do not account for.
const BETWEEN: &str = "between phases";
/// Below this share of a build nobody would see it.
const VISIBLE: f64 = 0.002;

/// A variant, its phases and the interval of their sum, in milliseconds.
type Built = (String, Vec<(String, f64)>, Option<[f64; 2]>);

/// One chart, with a panel a scene.
pub fn charts(selection: &Selection) -> Found {
    let scenes = selection.scenes();
    let variants = settled(selection);
    let point = |scene: &str, variant: &str| only(selection, scene, variant).map(|entry| entry.point);
    let found: Vec<Vec<Built>> = scenes
        .iter()
        .map(|scene| {
            let built = |variant: &&'_ str| {
                let point = point(scene, variant)?;
                Some(((*variant).to_owned(), parts(point)?, total(point)?.interval))
            };
            variants.iter().filter_map(built).collect()
        })
        .collect();
    let names = in_order(
        found.iter().flatten().flat_map(|(_, parts, _)| parts.iter().map(|(name, _)| name.as_str())),
    );
    if names.is_empty() {
        return Found::nothing("no variant has one set of parameters and the time of its build");
    }
    let names = ordered(names);
    let row = |(variant, parts, interval): &Built| Row {
        label: variant.clone(),
        parts: names
            .iter()
            .map(|name| parts.iter().find(|(other, _)| other == name).map(|(_, milliseconds)| *milliseconds))
            .collect(),
        interval: *interval,
    };
    let panels = scenes.iter().zip(&found).filter(|(_, rows)| !rows.is_empty()).map(|(scene, rows)| Stacks {
        title: (*scene).to_owned(),
        axis: "device time (ms)".into(),
        rows: rows.iter().map(row).collect(),
    });
    let panels: Vec<Stacks> = panels.collect();
    let note = format!(
        "Medians over the repetitions of a build. A variant that goes by view is built twice, with sample rays \
         between; same phases of both builds are added, and views averaged. {}{}{}",
        if panels.iter().flat_map(|panel| &panel.rows).any(|row| row.interval.is_some()) {
            "Error bars: 95% confidence intervals of the whole. "
        } else {
            ""
        },
        notes::device(selection),
        notes::unreliable(scenes.iter().flat_map(|scene| variants.iter().filter_map(|v| point(scene, v))))
    );
    let series = names
        .iter()
        .enumerate()
        .map(|(number, name)| Series { label: (*name).to_owned(), look: look(name, number) });
    Found {
        charts: vec![Chart {
            name: "build-phases".into(),
            title: "Time of builds by phase".into(),
            note,
            series: series.collect(),
            body: Body::Stacks(panels),
        }],
        remarks: Vec::new(),
    }
}

/// Phases as they run, and last what is none. A phase that this version does not know stands before sampling.
fn ordered(mut names: Vec<&str>) -> Vec<&str> {
    const KNOWN: [&str; 8] =
        ["morton", "sort", "ploc", "hploc", "collapse", "contract", "rearrange", "layout"];
    let rank = |name: &&str| match *name {
        SAMPLING => KNOWN.len() + 1,
        BETWEEN => KNOWN.len() + 2,
        name => KNOWN.iter().position(|known| *known == name).unwrap_or(KNOWN.len()),
    };
    names.sort_by_key(rank);
    names
}

/// The phases of all builds that a picture from one view takes, in milliseconds; nothing without a build.
fn parts(point: &Point) -> Option<Vec<(String, f64)>> {
    let total = Figure::Total.of(point)?;
    let mut parts: Vec<(String, f64)> = Vec::new();
    let mut add = |name: &str, milliseconds: f64| match parts.iter_mut().find(|(other, _)| other == name) {
        Some((_, sum)) => *sum += milliseconds,
        None => parts.push((name.to_owned(), milliseconds)),
    };
    for (name, milliseconds) in phases(&point.build) {
        add(&name, milliseconds);
    }
    let adaptations: Vec<_> = point.views.iter().filter_map(|view| view.adaptation.as_ref()).collect();
    for adaptation in &adaptations {
        for (name, milliseconds) in phases(&adaptation.build) {
            add(&name, milliseconds / adaptations.len() as f64);
        }
    }
    if let Some(sampling) = mean(adaptations.iter().map(|a| median(&a.sampling_milliseconds))) {
        add(SAMPLING, sampling);
    }
    let rest = total - parts.iter().map(|(_, milliseconds)| milliseconds).sum::<f64>();
    if rest > VISIBLE * total {
        parts.push((BETWEEN.to_owned(), rest));
    }
    Some(parts)
}

/// Each phase with its median over the repetitions.
fn phases(build: &Build) -> Vec<(String, f64)> {
    let names =
        in_order(build.repetitions.iter().flat_map(|repetition| &repetition.phases).map(|p| p.name.as_str()));
    let time = |name: &str| {
        let times: Vec<f64> =
            build.repetitions.iter().filter_map(|repetition| repetition.phase(name)).collect();
        median(&times)
    };
    names.into_iter().filter_map(|name| Some((written(name).to_owned(), time(name)?))).collect()
}

/// A record that does not tell phases apart has a single one, `all`.
fn written(phase: &str) -> &str {
    if phase == "all" { "build" } else { phase }
}

fn look(name: &str, number: usize) -> Look {
    let (tone, hatch) = match name {
        "morton" => (Tone::Yellow, Hatch::Plain),
        "sort" => (Tone::Blue, Hatch::Plain),
        "ploc" => (Tone::Sky, Hatch::Plain),
        "hploc" => (Tone::Sky, Hatch::Rising),
        "collapse" => (Tone::Vermilion, Hatch::Plain),
        "contract" => (Tone::Orange, Hatch::Rising),
        "layout" | "rearrange" => (Tone::Green, Hatch::Plain),
        SAMPLING => (Tone::Purple, Hatch::Crossed),
        BETWEEN => (Tone::Paper, Hatch::Plain),
        _ => return Look::numbered(number),
    };
    Look { tone, hatch, marker: Marker::Nothing, dash: Dash::Solid }
}
