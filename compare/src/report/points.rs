//! The table of all points.

use super::chapter::Chapter;
use super::number::{gap, plus_minus, ratio, short};
use super::provenance::provenance;
use super::summary::{better, interval};
use super::trust;
use crate::estimate::estimate;
use crate::figure::Figure;
use crate::select::Entry;
use maud::{Markup, html};
use record::{Point, Rays};

/// The columns: figure, title, whether the ratio to the reference stands beside it.
const COLUMNS: [(Figure, &str, bool); 8] = [
    (Figure::Primary, "pMRps", true),
    (Figure::Secondary, "sMRps", true),
    (Figure::Total, "build ms", true),
    (Figure::Nodes, "nodes", false),
    (Figure::Boxes, "boxes", false),
    (Figure::Triangles, "tris", false),
    (Figure::SahCost, "SAH", false),
    (Figure::Bytes, "MiB", false),
];

/// The head of a column; `about` explains it.
pub fn head(title: &str, about: &str, number: bool) -> Markup {
    html! { th scope="col" class=[number.then_some("number")] title=[(!about.is_empty()).then_some(about)] { (title) } }
}

/// The table.
pub fn markup(chapter: &Chapter) -> Markup {
    let shown: Vec<(Figure, &str, bool)> = COLUMNS
        .into_iter()
        .filter(|(figure, ..)| chapter.selection.entries.iter().any(|entry| figure.of(entry.point).is_some()))
        .collect();
    let left_out: Vec<&str> =
        COLUMNS.iter().filter(|column| !shown.contains(column)).map(|(_, title, _)| *title).collect();
    // A column of gaps takes the place of numbers and tells nothing that the section on trust does not.
    let judged = chapter.selection.entries.iter().any(|entry| entry.point.measurement.is_some());
    let times = format!("× {}", chapter.reference);
    let caption = "Every point of the record; each number leads to its samples";
    html! {
        p.filter hidden {
            label for=(chapter.id("filter")) { "Filter " }
            input id=(chapter.id("filter")) type="search" placeholder="scene, variant, …";
            " " output for=(chapter.id("filter")) {}
        }
        div.scroll role="region" tabindex="0" aria-label=(caption) {
            table.sortable.filtered {
                caption { (caption) }
                thead { tr {
                    (head("Scene", "", false))
                    (head("Variant", "", false))
                    @if chapter.has_passes() { (head("Parameters", "what sets it apart", false)) }
                    @for (figure, title, related) in &shown {
                        (head(title, &explained(*figure), true))
                        @if *related {
                            (head(&times, &format!("{title} as a multiple of {}'s on the same scene", chapter.reference), true))
                        }
                    }
                    @if judged { (head("Verdict", "whether the device was slowed down meanwhile", false)) }
                } }
                tbody {
                    @for entry in &chapter.selection.entries {
                        tr {
                            td { (entry.scene()) }
                            th scope="row" { a href=(format!("#{}", chapter.id_of(entry))) { (entry.variant()) } }
                            @if chapter.has_passes() { td { (entry.pass) } }
                            @for (figure, _, related) in &shown {
                                (cell(chapter, entry, *figure))
                                @if *related { (related_cell(chapter, entry, *figure)) }
                            }
                            @if judged { td { (trust::of_point(entry.point)) } }
                        }
                    }
                }
            }
        }
        p.remark {
            "Rates are million rays per second of the traversal kernel's time, " b { "p" } "rimary and "
            b { "s" } "econdary; ± is half the width of their 95% confidence interval. nodes, boxes and tris are what one ray meets."
            @if !left_out.is_empty() { " Not in the record: " (left_out.join(", ")) "." }
        }
    }
}

/// What a column is, for its head.
fn explained(figure: Figure) -> String {
    let text = match figure {
        Figure::Primary => "million primary rays per second",
        Figure::Secondary => "million secondary rays per second",
        Figure::Total => "milliseconds of sampling and all builds that a picture from one view takes",
        Figure::Nodes => "nodes that a ray visits",
        Figure::Boxes => "boxes that a ray is tested against",
        Figure::Triangles => "triangles that a ray is tested against",
        Figure::SahCost => "expected cost by the surface area heuristic; its costs differ between variants",
        Figure::Bytes => "memory of nodes and triangles",
        other => other.column(),
    };
    match better(figure) {
        "" => text.into(),
        better => format!("{text}; {better}"),
    }
}

fn cell(chapter: &Chapter, entry: &Entry, figure: Figure) -> Markup {
    let Some(value) = figure.of(entry.point) else {
        return html! { td.number { (gap("not in the record")) } };
    };
    let shown = if figure == Figure::Bytes { value / 1_048_576.0 } else { value };
    html! {
        td.number data-value=(value) {
            a href=(format!("#{}", chapter.id_of(entry))) title=(provenance(entry.point, figure)) { (short(shown)) }
            @if let Some(share) = half_width(entry.point, figure) { small { " " (plus_minus(share)) } }
        }
    }
}

fn related_cell(chapter: &Chapter, entry: &Entry, figure: Figure) -> Markup {
    let Some(value) = chapter.standings.ratio(entry, figure) else {
        return html! { td.number { (gap("nothing to compare with")) } };
    };
    html! { td.number data-value=(value.value) title=(interval(value)) { (ratio(value.value)) } }
}

/// Half the width of a rate's interval, as a share of the rate.
fn half_width(point: &Point, figure: Figure) -> Option<f64> {
    let rays = match figure {
        Figure::Primary => Rays::Primary,
        Figure::Secondary => Rays::Secondary,
        _ => return None,
    };
    Some(estimate(point, rays)?.relative_half_width()).filter(|share| share.is_finite())
}
