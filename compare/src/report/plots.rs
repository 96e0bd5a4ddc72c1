//! The plots of a chapter, inside the page.

use super::chapter::Chapter;
use super::number::bytes;
use super::slim;
use crate::plot::{Chart, Kind, charts};
use maud::{Markup, PreEscaped, html};

/// Larger plots are left out, in bytes of SVG: those of very many samples.
const LARGEST: usize = 600_000;

/// All plots of a record together are not larger than this, in bytes of SVG.
const TOGETHER: usize = 4_000_000;

/// What a kind of plots is called, and whether it is for those who ask.
fn title(kind: Kind) -> (&'static str, bool) {
    match kind {
        Kind::Overall => ("Over all scenes", false),
        Kind::Scenes => ("Each scene", false),
        Kind::Pairs => ("What a word of a name changes", false),
        Kind::Records => ("What changed between records", false),
        Kind::Sweep => ("What parameters do", false),
        Kind::Build => ("Where the time of builds goes", true),
        Kind::Cost => ("Cost by number of triangles", false),
        Kind::Samples => ("Samples in the order measured", true),
        Kind::Frames => ("Frames around a scene", false),
        Kind::Roofline => ("How near to what the device can do at best", false),
    }
}

/// The plots, by kind.
pub fn markup(chapter: &Chapter) -> Markup {
    let mut left = TOGETHER;
    let mut out = Vec::new();
    let mut without = Vec::new();
    for kind in Kind::ALL.into_iter().filter(|kind| ![Kind::Records, Kind::Roofline].contains(kind)) {
        let found = charts(&chapter.selection, kind, chapter.reference);
        // That there is no orbit is no news.
        if kind != Kind::Frames {
            without.extend(found.remarks.into_iter().map(|remark| format!("{kind}: {remark}")));
        }
        let mut drawn = Vec::new();
        for chart in &found.charts {
            let picture = slim::svg(chart);
            if picture.len() <= LARGEST.min(left) {
                left -= picture.len();
                drawn.push(figure(chart, &picture));
            } else {
                let size = bytes(picture.len() as u64);
                without.push(format!(
                    "{kind}: {:?} is too large for a page ({size}); `compare plot --only {kind}` draws it",
                    chart.title
                ));
            }
        }
        if !drawn.is_empty() {
            out.push((title(kind), drawn));
        }
    }
    html! {
        @if out.is_empty() { p { "Nothing can be drawn." } }
        @for ((title, asked), drawn) in &out {
            @if *asked {
                details { summary { (title) " (" (drawn.len()) ")" } div.plots { @for one in drawn { (one) } } }
            } @else {
                h4 { (title) }
                div.plots { @for one in drawn { (one) } }
            }
        }
        @if !without.is_empty() {
            details {
                summary { "Not drawn (" (without.len()) ")" }
                ul { @for remark in &without { li { (remark) } } }
            }
        }
    }
}

/// A plot with what it is for those who cannot see it; the tables have its numbers.
pub fn figure(chart: &Chart, svg: &str) -> Markup {
    html! {
        figure.chart {
            div role="img" aria-label=(format!("{}. {} The tables have the numbers.", chart.title, chart.note)) {
                (PreEscaped(svg))
            }
        }
    }
}
