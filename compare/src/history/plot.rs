//! A picture of how a variant's rates went.

use super::course::{Course, History, Step};
use crate::figure::Figure;
use crate::plot::chart::{Axis, Body, Chart, Curve, Place, Plane, Scale, Series, Value, slug};
use crate::plot::theme::{Dash, Hatch, Look, Marker, Tone};

/// What the curves are, in the legend's order.
const RATE: usize = 0;
const POINT: usize = 1;

/// A chart for each variant in each pass, with a panel for each rate.
pub fn charts(history: &History) -> Vec<Chart> {
    let same = |a: &Course, b: &Course| a.variant == b.variant && a.pass == b.pass;
    history.courses.chunk_by(same).map(|courses| chart(history, courses)).collect()
}

fn chart(history: &History, courses: &[Course]) -> Chart {
    let first = &courses[0];
    let of = if first.pass.0.is_empty() { String::new() } else { format!(", {}", first.pass) };
    let look = |tone, marker, dash| Look { tone, hatch: Hatch::Plain, marker, dash };
    Chart {
        name: slug(&format!("history {}{of}", first.variant)),
        title: format!("{}{of}, from commit to commit", first.variant),
        note: format!(
            "{}: geometric mean over {}. A change point is faster or slower than the version before, or than the \
             first one since the last change point. Versions that no line joins are not comparable. Error bars: 95% \
             confidence intervals of the change from the version before.",
            history.path,
            history.scenes.join(", ")
        ),
        series: vec![
            Series { label: "MRps".into(), look: look(Tone::Blue, Marker::Disc, Dash::Solid) },
            Series {
                label: "change point".into(),
                look: look(Tone::Vermilion, Marker::Diamond, Dash::Absent),
            },
        ],
        body: Body::Planes(courses.iter().map(|course| plane(history, course)).collect()),
    }
}

fn plane(history: &History, course: &Course) -> Plane {
    let rays = if course.figure == Figure::Primary { "Primary rays" } else { "Secondary rays" };
    let curve = |series, places| Curve { series, right: false, places, band: Vec::new() };
    // What is not comparable with the version before begins a new line.
    let lines = course.steps.chunk_by(|_, step| step.change.is_some());
    let mut curves: Vec<Curve> = lines.map(|steps| curve(RATE, steps.iter().map(place).collect())).collect();
    let points = course.steps.iter().filter(|step| step.change_point);
    curves
        .push(curve(POINT, points.map(|step| Place { y: Value::bare(step.value), ..place(step) }).collect()));
    let axis = |title: &str| Axis {
        title: title.to_owned(),
        scale: Scale::Linear,
        ticks: Vec::new(),
        names: Vec::new(),
        includes: Vec::new(),
    };
    Plane {
        title: rays.to_owned(),
        x: Axis {
            ticks: (0..history.versions.len()).map(|version| version as f64).collect(),
            names: history.versions.iter().map(|version| version.commit.short().to_owned()).collect(),
            ..axis("commit")
        },
        y: axis("MRps"),
        right: None,
        curves,
    }
}

fn place(step: &Step) -> Place {
    let interval = step.change.as_ref().and_then(|change| {
        let before = step.value / change.ratio;
        change.interval.map(|ratio| [before * ratio.low, before * ratio.high])
    });
    Place { x: step.version as f64, y: Value { value: step.value, interval } }
}
