//! What the value of a parameter does: figures 23 to 25 of the thesis (Cezner 2025), for any parameter of a sweep.

use super::chart::{Axis, Body, Chart, Curve, Place, Plane, Scale, Series, Value, slug};
use super::names::{without, words};
use super::notes::{self, Found};
use super::ratios::{Pair, only, ratios};
use super::theme::{Dash, Hatch, Look, Marker, Tone};
use crate::figure::Figure;
use crate::select::{Entry, Selection, geometric_mean, in_order, ratio};
use crate::unreliable::unreliable;
use record::OF_SCENE;
use std::collections::BTreeMap;

/// What the curves are, in the legend's order.
const MEAN: usize = 0;
const WITHOUT: usize = 1;
const SAMPLING: usize = 2;

/// A parameter that was varied, with others that always went along.
#[derive(Clone, Debug, PartialEq)]
struct Varied {
    name: String,
    along: Vec<String>,
}

/// The points of one variant with one set of all other parameters.
#[derive(Clone, Debug)]
struct Line<'s, 'r> {
    variant: String,
    rest: String,
    scene: String,
    /// By value of the parameter.
    entries: Vec<(f64, &'s Entry<'r>)>,
}

/// One chart for each parameter that has at least three values.
pub fn charts(selection: &Selection) -> Found {
    let varied = varied(selection);
    if varied.is_empty() {
        return Found::nothing("no parameter was varied");
    }
    let mut found = Found::default();
    for varied in varied {
        match chart(selection, &varied) {
            Ok(chart) => found.charts.push(chart),
            Err(reason) => found.remarks.push(format!("{}: {reason}", varied.name)),
        }
    }
    found
}

/// The parameters that were varied. Of those that say the same about all points, the first stands for all.
fn varied(selection: &Selection) -> Vec<Varied> {
    let variants = selection.variants();
    let names = in_order(variants.iter().flat_map(|variant| selection.axes(variant)));
    // What the size of a scene does is another picture: its rates have nothing in common.
    let names = names.into_iter().filter(|name| !name.starts_with(OF_SCENE));
    let mut all: Vec<Varied> = Vec::new();
    for name in names {
        match all.iter_mut().find(|other| go_along(selection, &other.name, &name)) {
            Some(other) => other.along.push(name),
            None => all.push(Varied { name, along: Vec::new() }),
        }
    }
    all
}

/// Whether the value of each of two parameters follows from the other's.
fn go_along(selection: &Selection, a: &str, b: &str) -> bool {
    let mut forth: BTreeMap<&str, &str> = BTreeMap::new();
    let mut back: BTreeMap<&str, &str> = BTreeMap::new();
    selection.entries.iter().all(|entry| match (entry.pass.0.get(a), entry.pass.0.get(b)) {
        (None, None) => true,
        (Some(a), Some(b)) => *forth.entry(a).or_insert(b) == b && *back.entry(b).or_insert(a) == a,
        _ => false,
    })
}

fn chart(selection: &Selection, varied: &Varied) -> Result<Chart, String> {
    let lines = lines(selection, varied);
    let mut values: Vec<f64> =
        lines.iter().flat_map(|line| line.entries.iter().map(|(value, _)| *value)).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    if values.len() < 3 {
        return Err(format!("it has fewer than three numbers as values{}", left_out(selection, varied)));
    }
    let known = Known::of(&varied.name);
    let base = if known.greatest { values[values.len() - 1] } else { values[0] };
    let lines: Vec<Line> =
        lines.into_iter().filter(|line| line.at(base).is_some() && line.entries.len() > 1).collect();
    if lines.is_empty() {
        let left_out = left_out(selection, varied);
        return Err(format!(
            "nothing was measured with {base}, which the others would be relative to{left_out}"
        ));
    }
    let sampling = sampling(&lines, &values, base);
    let panels = [(Figure::Primary, "Primary rays"), (Figure::Secondary, "Secondary rays")]
        .into_iter()
        .filter_map(|(figure, title)| {
            let mut curves = Vec::new();
            if sampling.len() > 1 {
                curves.push(Curve {
                    series: SAMPLING,
                    right: true,
                    places: sampling.clone(),
                    band: Vec::new(),
                });
            }
            curves.extend(counterparts(selection, &lines, figure, base, &values));
            curves.push(mean(&lines, figure, &values, base)?);
            Some(Plane {
                title: title.to_owned(),
                x: Axis {
                    title: known.axis.clone(),
                    scale: scale(&values),
                    ticks: values.clone(),
                    names: Vec::new(),
                    includes: Vec::new(),
                },
                y: Axis {
                    title: "MRps, relative".into(),
                    scale: Scale::Linear,
                    ticks: Vec::new(),
                    names: Vec::new(),
                    includes: vec![1.0],
                },
                right: (sampling.len() > 1).then(|| Axis {
                    title: "time of sampling (%)".into(),
                    scale: spread(&sampling),
                    ticks: Vec::new(),
                    names: Vec::new(),
                    includes: vec![0.0; usize::from(spread(&sampling) == Scale::Linear)],
                }),
                curves,
            })
        });
    let panels: Vec<Plane> = panels.collect();
    if panels.is_empty() {
        return Err("some of its points have no rates".into());
    }
    Ok(finished(selection, varied, &known, base, &lines, panels))
}

fn finished(
    selection: &Selection,
    varied: &Varied,
    known: &Known,
    base: f64,
    lines: &[Line],
    mut panels: Vec<Plane>,
) -> Chart {
    let look = |tone, marker, dash| Look { tone, hatch: Hatch::Plain, marker, dash };
    let variants = in_order(lines.iter().map(|line| line.variant.as_str()));
    let scenes = in_order(lines.iter().map(|line| line.scene.as_str()));
    let banded = panels.iter().flat_map(|panel| &panel.curves).any(|curve| !curve.band.is_empty());
    let others = in_order(lines.iter().map(|line| line.rest.as_str())).len();
    // What the band runs over.
    let mean = match (banded, variants.len(), others) {
        (false, ..) => "mean".to_owned(),
        (true, _, 1) => "mean; band: from the least to the greatest variant".to_owned(),
        (true, 1, _) => "mean; band: from the least to the greatest set of other parameters".to_owned(),
        _ => "mean; band: from the least to the greatest variant and set of other parameters".to_owned(),
    };
    let all = [
        (mean.as_str(), look(Tone::Blue, Marker::Disc, Dash::Solid)),
        ("the same variants without CBTC", look(Tone::Ink, Marker::Nothing, Dash::Dashed)),
        ("time of sampling (right axis)", look(Tone::Vermilion, Marker::Square, Dash::Dotted)),
    ];
    let used: Vec<usize> = (0..all.len())
        .filter(|number| panels.iter().flat_map(|panel| &panel.curves).any(|curve| curve.series == *number))
        .collect();
    for curve in panels.iter_mut().flat_map(|panel| &mut panel.curves) {
        curve.series = used.iter().position(|number| *number == curve.series).unwrap_or(0);
    }
    let along = match varied.along.len() {
        0 => String::new(),
        _ => format!(" {} went along with {}.", varied.along.join(", "), varied.name),
    };
    let bars = panels.iter().flat_map(|panel| &panel.curves).flat_map(|curve| &curve.places);
    let bars = if bars.clone().any(|place| place.y.interval.is_some()) {
        " Error bars: 95% confidence intervals of the mean."
    } else {
        ""
    };
    let band = match (banded, others) {
        (false, _) => String::new(),
        (true, 1) => "; the band is that of the variants' means".into(),
        (true, others) => format!("; the band is that of the means with {others} sets of other parameters"),
    };
    let note = format!(
        "Relative to {} = {base}. Geometric means of {} over {}{band}{}.{bars}{along} {}",
        varied.name,
        variants.join(", "),
        scenes.join(", "),
        left_out(selection, varied),
        notes::device(selection)
    );
    Chart {
        name: format!("sweep-{}", slug(&varied.name)),
        title: format!("{} and the rates of rays", known.title),
        note,
        series: used
            .iter()
            .map(|&number| Series { label: all[number].0.into(), look: all[number].1 })
            .collect(),
        body: Body::Planes(panels),
    }
}

/// How many points do not count, behind a clause.
fn left_out(selection: &Selection, varied: &Varied) -> String {
    let all = selection.entries.iter().filter(|entry| of(entry, varied).is_some());
    match all.clone().filter(|entry| unreliable(entry.point)).count() {
        0 => String::new(),
        count => format!(
            "; {count} of {} points are left out, because too few of their samples count",
            all.count()
        ),
    }
}

/// What is known of a parameter beyond its name.
#[derive(Clone, Debug, PartialEq)]
struct Known {
    title: String,
    /// The same with its unit.
    axis: String,
    /// Whether the greatest value is the one that the others are relative to: with it most rays are sampled.
    greatest: bool,
}

impl Known {
    fn of(name: &str) -> Known {
        let (title, unit, greatest) = match name {
            "cbtc.threshold" => ("CBTC threshold", "visits of a node", false),
            "cbtc.depth-limit" => ("Depth limit of sample rays", "bounces", true),
            "cbtc.subsampling" => ("Subsampling of sample rays", "pixels per ray", false),
            "collapse.c_t" => ("Traversal cost", "c_t", false),
            "trace.primary_subgroups" | "trace.secondary_subgroups" => ("Workgroup size", "subgroups", false),
            _ => (name, "", false),
        };
        let axis = if unit.is_empty() { title.to_owned() } else { format!("{title} ({unit})") };
        Known { title: title.into(), axis, greatest }
    }
}

/// Values that grow by factors have a logarithmic axis.
fn scale(values: &[f64]) -> Scale {
    let positive = values.iter().copied().filter(|value| *value > 0.0);
    let (least, most) =
        positive.fold((f64::MAX, 0.0), |(least, most): (f64, f64), v| (least.min(v), most.max(v)));
    if values.iter().all(|value| *value >= 0.0) && most >= 20.0 * least {
        Scale::Logarithmic
    } else {
        Scale::Linear
    }
}

fn spread(places: &[Place]) -> Scale {
    scale(&places.iter().map(|place| place.y.value).collect::<Vec<_>>())
}

/// The value of a parameter, if it is a number.
fn of(entry: &Entry, varied: &Varied) -> Option<f64> {
    entry.pass.0.get(&varied.name)?.parse().ok()
}

/// All lines of a parameter, of the points that are reliable.
fn lines<'s, 'r>(selection: &'s Selection<'r>, varied: &Varied) -> Vec<Line<'s, 'r>> {
    let mut lines: Vec<Line> = Vec::new();
    for entry in &selection.entries {
        let Some(value) = of(entry, varied).filter(|_| !unreliable(entry.point)) else { continue };
        let mut rest = entry.pass.clone();
        rest.0.retain(|name, _| *name != varied.name && !varied.along.contains(name));
        let rest = rest.to_string();
        let is = |line: &&mut Line| {
            line.scene == entry.scene() && line.variant == entry.variant() && line.rest == rest
        };
        match lines.iter_mut().find(is) {
            Some(line) => line.entries.push((value, entry)),
            None => lines.push(Line {
                variant: entry.variant().to_owned(),
                rest,
                scene: entry.scene().to_owned(),
                entries: vec![(value, entry)],
            }),
        }
    }
    lines
}

impl<'s, 'r> Line<'s, 'r> {
    fn at(&self, value: f64) -> Option<&'s Entry<'r>> {
        self.entries.iter().find(|(other, _)| *other == value).map(|(_, entry)| *entry)
    }

    fn relative(&self, figure: Figure, value: f64, base: f64) -> Option<f64> {
        ratio(figure.of(self.at(value)?.point)?, figure.of(self.at(base)?.point)?)
    }

    fn group(&self) -> (&str, &str) {
        (&self.variant, &self.rest)
    }
}

/// The mean over all lines at each value that all have, and between what the means over scenes are.
fn mean(lines: &[Line], figure: Figure, values: &[f64], base: f64) -> Option<Curve> {
    let groups = in_order(lines.iter().map(Line::group));
    let mut curve = Curve { series: MEAN, right: false, places: Vec::new(), band: Vec::new() };
    for &value in values {
        let pairs: Vec<Option<Pair>> =
            lines.iter().map(|line| Some([line.at(base)?.point, line.at(value)?.point])).collect();
        let Some(mean) = ratios(&pairs, figure).mean else { continue };
        // At the base everything is 1, whatever the samples.
        let y = if value == base { Value::bare(1.0) } else { mean };
        curve.places.push(Place { x: value, y });
        let of_group = |group: &(&str, &str)| {
            let of = lines.iter().filter(|line| line.group() == *group);
            geometric_mean(of.filter_map(|line| line.relative(figure, value, base)))
        };
        let means: Vec<f64> = groups.iter().filter_map(of_group).collect();
        let ends = means.iter().fold([f64::MAX, f64::MIN], |[low, high], &v| [low.min(v), high.max(v)]);
        if groups.len() > 1 {
            curve.band.push((value, ends));
        }
    }
    (curve.places.len() > 1).then_some(curve)
}

/// The variants that go by area in place of those that go by view, level across the panel.
fn counterparts(
    selection: &Selection,
    lines: &[Line],
    figure: Figure,
    base: f64,
    values: &[f64],
) -> Option<Curve> {
    let relative = |line: &Line| -> Option<f64> {
        let word = words(&line.variant).into_iter().find(|word| *word == "CBTC")?;
        let other = only(selection, &line.scene, &without(&line.variant, word)?)?;
        ratio(
            figure.of(Some(other.point).filter(|point| !unreliable(point))?)?,
            figure.of(line.at(base)?.point)?,
        )
    };
    let all: Vec<f64> = lines.iter().map(relative).collect::<Option<_>>()?;
    let y = Value::bare(geometric_mean(all)?);
    let ends = [values[0], values[values.len() - 1]];
    Some(Curve {
        series: WITHOUT,
        right: false,
        places: ends.map(|x| Place { x, y }).to_vec(),
        band: Vec::new(),
    })
}

/// The time of sampling in percent of that at the base.
fn sampling(lines: &[Line], values: &[f64], base: f64) -> Vec<Place> {
    let at = |value: f64| -> Option<Place> {
        let all: Vec<f64> =
            lines.iter().map(|line| line.relative(Figure::Sampling, value, base)).collect::<Option<_>>()?;
        Some(Place { x: value, y: Value::bare(100.0 * geometric_mean(all)?) })
    };
    values.iter().filter_map(|&value| at(value)).collect()
}
