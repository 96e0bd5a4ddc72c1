//! Samples one after another, with the clock: whether a run was steady.

use super::chart::{Axis, Body, Chart, Curve, Place, Plane, Scale, Series, Value, slug};
use super::notes::{self, Found};
use super::ratios::{only, settled};
use super::theme::{Dash, Hatch, Look, Marker, Tone};
use crate::select::Selection;
use record::{Point, Rays, Sample, View};

/// What the curves are, in the legend's order.
const PRIMARY: usize = 0;
const SECONDARY: usize = 1;
const EXCLUDED: usize = 2;
const CLOCK: usize = 3;

/// One chart a scene, with a panel a variant; and one of the point that a sweep measured again and again.
pub fn charts(selection: &Selection) -> Found {
    let mut found = Found::default();
    let variants = settled(selection);
    for scene in selection.scenes() {
        let points = variants.iter().filter_map(|variant| Some(only(selection, scene, variant)?.point));
        let points: Vec<&Point> = points.collect();
        let panels = points.iter().filter_map(|point| panel(&point.variant, &[point]));
        let name = format!("samples-{}", slug(scene));
        found.charts.extend(chart(
            selection,
            name,
            format!("Samples in the order measured: {scene}"),
            &points,
            panels.collect(),
        ));
    }
    let mut references: Vec<&Point> = selection.record.references.iter().collect();
    references.sort_by_key(|point| point.measurement.as_ref().map(|measurement| measurement.started));
    if let Some(first) = references.first() {
        let title = format!("{} on {}, measured again and again", first.variant, first.scene.name);
        let panels = panel(&title, &references).into_iter().collect();
        let title = "The sweep's reference point in the order measured".to_owned();
        found.charts.extend(chart(selection, "samples-reference".into(), title, &references, panels));
    }
    if found.charts.is_empty() {
        found.remarks.push("no view of a variant with one set of parameters has two samples".into());
    }
    found
}

fn chart(
    selection: &Selection,
    name: String,
    title: String,
    points: &[&Point],
    panels: Vec<Plane>,
) -> Option<Chart> {
    if panels.is_empty() {
        return None;
    }
    let look = |tone, marker, dash| Look { tone, hatch: Hatch::Plain, marker, dash };
    let all = [
        ("primary rays", look(Tone::Blue, Marker::Disc, Dash::Solid)),
        ("secondary rays", look(Tone::Orange, Marker::Square, Dash::Solid)),
        ("does not count", look(Tone::Vermilion, Marker::Cross, Dash::Absent)),
        ("clock (right axis)", look(Tone::Muted, Marker::Nothing, Dash::Dashed)),
    ];
    // Only what is there is in the legend; the curves' numbers follow.
    let mut panels = panels;
    let used: Vec<usize> = (0..all.len())
        .filter(|number| panels.iter().flat_map(|panel| &panel.curves).any(|curve| curve.series == *number))
        .collect();
    // One range of rates, and one of clocks, for all panels, so that they can be compared.
    let rates = panels.iter().flat_map(|panel| &panel.curves).filter(|curve| !curve.right);
    let rates: Vec<f64> = rates.flat_map(|curve| &curve.places).map(|place| place.y.value).collect();
    let ends = [rates.iter().copied().fold(100.0, f64::min), rates.iter().copied().fold(100.0, f64::max)];
    let clocks: Vec<f64> = panels
        .iter()
        .filter_map(|panel| panel.right.as_ref())
        .flat_map(|axis| axis.includes.clone())
        .collect();
    for panel in &mut panels {
        panel.y.includes.extend(ends);
        if let Some(axis) = &mut panel.right {
            axis.includes = clocks.clone();
        }
    }
    for curve in panels.iter_mut().flat_map(|panel| &mut panel.curves) {
        curve.series = used.iter().position(|number| *number == curve.series).unwrap_or(0);
    }
    let clock = match (&selection.record.run.clock, used.contains(&CLOCK)) {
        (Some(clock), true) => format!(" The clock is held against {} MHz.", clock.mhz),
        (None, true) => String::new(),
        (_, false) => " No clock was read.".into(),
    };
    Some(Chart {
        name,
        title,
        note: format!(
            "Views one after another; each rate is relative to the mean of its view, so that views can be \
             compared.{clock} {}{}",
            notes::device(selection),
            notes::unreliable(points.iter().copied())
        ),
        series: used
            .iter()
            .map(|&number| Series { label: all[number].0.into(), look: all[number].1 })
            .collect(),
        body: Body::Planes(panels),
    })
}

/// The samples of some points, one after another; nothing if no view has two.
fn panel(title: &str, points: &[&Point]) -> Option<Plane> {
    let views: Vec<&View> = points.iter().flat_map(|point| &point.views).collect();
    if views.iter().all(|view| view.samples.len() < 2) {
        return None;
    }
    let mut curves = Vec::new();
    let mut excluded = Vec::new();
    for (series, rays) in [(PRIMARY, Rays::Primary), (SECONDARY, Rays::Secondary)] {
        let mut places = Vec::new();
        // Once a view: a mean goes through all of its samples.
        let means: Vec<Option<f64>> = views.iter().map(|view| view.rate(rays)).collect();
        for (number, of, sample) in numbered(&views) {
            let Some(share) = means[of].and_then(|mean| Some(sample.rate(rays)? / mean)) else {
                continue;
            };
            let place = Place { x: number as f64, y: Value::bare(100.0 * share) };
            places.push(place);
            if sample.excluded.is_some() {
                excluded.push(place);
            }
        }
        if !places.is_empty() {
            curves.push(Curve { series, right: false, places, band: Vec::new() });
        }
    }
    if curves.is_empty() {
        return None;
    }
    if !excluded.is_empty() {
        curves.push(Curve { series: EXCLUDED, right: false, places: excluded, band: Vec::new() });
    }
    let clock = clock(&views);
    let right = (!clock.is_empty()).then(|| {
        // A steady clock is at the top, out of the way of the rates.
        let least = clock.iter().map(|place| place.y.value).fold(f64::MAX, f64::min);
        let most = clock.iter().map(|place| place.y.value).fold(0.0, f64::max);
        curves.insert(0, Curve { series: CLOCK, right: true, places: clock, band: Vec::new() });
        axis("clock (MHz)", [least.min(0.75 * most), most])
    });
    let mut x = axis("sample (marked: the first of a view)", [1.0]);
    x.ticks = firsts(&views);
    Some(Plane { title: title.to_owned(), x, y: axis("rate (% of mean)", [100.0]), right, curves })
}

fn axis(title: &str, includes: impl Into<Vec<f64>>) -> Axis {
    Axis {
        title: title.to_owned(),
        scale: Scale::Linear,
        ticks: Vec::new(),
        names: Vec::new(),
        includes: includes.into(),
    }
}

/// The number of each view's first sample.
fn firsts(views: &[&View]) -> Vec<f64> {
    let mut next = 1;
    views
        .iter()
        .map(|view| {
            let first = next;
            next += view.samples.len();
            first as f64
        })
        .collect()
}

/// All samples with their numbers, from 1, and the places of their views.
fn numbered<'v>(views: &'v [&'v View]) -> impl Iterator<Item = (usize, usize, &'v Sample)> {
    let views = views.iter().enumerate();
    let samples = views.flat_map(|(of, view)| view.samples.iter().map(move |sample| (of, sample)));
    samples.enumerate().map(|(index, (of, sample))| (index + 1, of, sample))
}

/// The clock of the multiprocessors in MHz: after each sample where it was read, else before and after each view.
fn clock(views: &[&View]) -> Vec<Place> {
    let place = |number: usize, mhz: u32| Place { x: number as f64, y: Value::bare(f64::from(mhz)) };
    let after_samples: Vec<Place> =
        numbered(views).filter_map(|(number, _, sample)| Some(place(number, sample.sm_clock_mhz?))).collect();
    if !after_samples.is_empty() {
        return after_samples;
    }
    let mut places = Vec::new();
    let mut number = 0;
    for view in views {
        let at = |telemetry: &record::Telemetry| telemetry.reading()?.sm_clock_mhz;
        let first = number + 1;
        number += view.samples.len();
        places.extend(at(&view.before).map(|mhz| place(first, mhz)));
        places.extend(at(&view.after).map(|mhz| place(number.max(first), mhz)));
    }
    places
}
