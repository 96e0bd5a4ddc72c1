//! What comes out of a record, in a few lines and one table.

use super::chapter::Chapter;
use super::number::{count, gap, plus_minus, ratio};
use super::points::head;
use super::standing::{COMPARED, Standing};
use crate::figure::{Better, Figure};
use crate::plot::chart::Value;
use maud::{Markup, html};

/// What a compared figure is called.
pub fn name(figure: Figure) -> &'static str {
    match figure {
        Figure::Primary => "Primary rays",
        Figure::Secondary => "Secondary rays",
        Figure::Total => "Build, with sample rays",
        Figure::Nodes => "Nodes per ray",
        Figure::Bytes => "Memory",
        other => other.column(),
    }
}

/// The summary of a chapter.
pub fn markup(chapter: &Chapter) -> Markup {
    let scenes = chapter.selection.scenes().len();
    let known = chapter.selection.variants().contains(&chapter.reference);
    let caption = match known {
        true => format!(
            "Each variant relative to {}, as the geometric mean over {}",
            chapter.reference,
            count(scenes, "scene")
        ),
        false => format!("{} was not measured, so nothing is relative to it", chapter.reference),
    };
    html! {
        p {
            (count(chapter.selection.entries.len(), "point")) ": "
            (count(scenes, "scene")) ", " (count(chapter.selection.variants().len(), "variant"))
            @if chapter.has_passes() { ", some with several sets of parameters" } "."
        }
        @if chapter.standings.all.len() > 1 {
            ul.best {
                @for (index, figure) in COMPARED.into_iter().enumerate() {
                    @if let Some(line) = best(chapter, index, figure) { li { (line) } }
                }
            }
        }
        div.scroll role="region" tabindex="0" aria-label=(caption) {
            table.sortable {
                caption { (caption) }
                thead { tr {
                    (head("Variant", "", false))
                    @if chapter.has_passes() { (head("Parameters", "what sets it apart", false)) }
                    (head("Scenes", "on how many it was measured", true))
                    @for figure in COMPARED { (head(name(figure), better(figure), true)) }
                } }
                tbody {
                    @for standing in &chapter.standings.all {
                        tr {
                            th scope="row" { (standing.variant) }
                            @if chapter.has_passes() { td { (standing.pass) } }
                            td.number data-value=(standing.scenes) {
                                (standing.scenes) @if standing.scenes < scenes { " of " (scenes) }
                            }
                            @for ratio in &standing.ratios {
                                (cell(ratio.as_ref(), chapter.reference, standing.scenes))
                            }
                        }
                    }
                }
            }
        }
        p.remark {
            "A build is all that a picture from one view waits for. Memory is nodes and triangles. "
            "Follow a number of the table of all points to its samples."
        }
    }
}

/// Which way a figure is better, in words.
pub fn better(figure: Figure) -> &'static str {
    match figure.better() {
        Better::High => "more is better",
        Better::Low => "less is better",
        Better::Neither => "",
    }
}

/// A cell with a ratio, and between what it lies.
pub fn cell(value: Option<&Value>, reference: &str, scenes: usize) -> Markup {
    let Some(value) = value else {
        return html! { td.number { (gap("not known on every scene, or without reference")) } };
    };
    let of = format!("relative to {reference}, geometric mean over {}", count(scenes, "scene"));
    html! {
        td.number data-value=(value.value) title=(format!("{of}; {}", interval(value))) {
            (ratio(value.value))
            @if let Some([low, high]) = value.interval {
                small { " " (plus_minus(0.5 * (high - low) / value.value)) }
            }
        }
    }
}

/// Between what a ratio lies.
pub fn interval(value: &Value) -> String {
    match value.interval {
        Some([low, high]) => format!("95% interval {low:.4} to {high:.4}"),
        None => "no interval: it is exact, or there are too few samples".into(),
    }
}

/// Which variant is best at something, and by how much.
fn best(chapter: &Chapter, index: usize, figure: Figure) -> Option<Markup> {
    let ranked = chapter.standings.ranked(index);
    let [first, second, ..] = ranked[..] else { return None };
    if figure.better() == Better::Neither {
        return None;
    }
    let what = match figure {
        Figure::Primary => "Fastest for primary rays",
        Figure::Secondary => "Fastest for secondary rays",
        Figure::Total => "Quickest to build",
        Figure::Nodes => "Fewest nodes visited",
        _ => "Least memory",
    };
    let lead = chapter.standings.against(&chapter.selection, second, first, figure)?;
    Some(html! {
        (what) ": " strong { (named(first)) }
        @if first.variant != chapter.reference && let Some(value) = &first.ratios[index] {
            ", " span title=(interval(value)) { (ratio(value.value)) " times" } " " (chapter.reference)
        }
        " (" span title=(interval(&lead)) { (signed(100.0 * (lead.value - 1.0))) } " against " (named(second))
        @if let Some([low, high]) = lead.interval && low <= 1.0 && high >= 1.0 { ", which chance explains" }
        ")."
    })
}

fn named(standing: &Standing) -> Markup {
    html! { (standing.variant) @if !standing.pass.0.is_empty() { " with " (standing.pass) } }
}

/// A change in percent.
fn signed(change: f64) -> String {
    if change.abs() < 0.05 {
        return "±0.0%".into();
    }
    let text = if change.abs() < 9.95 { format!("{change:+.1}") } else { format!("{change:+.0}") };
    format!("{}%", text.replace('-', "−"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_have_their_sign() {
        assert_eq!(signed(2.34), "+2.3%");
        assert_eq!(signed(-12.3), "−12%");
        assert_eq!(signed(-0.01), "±0.0%");
    }
}
