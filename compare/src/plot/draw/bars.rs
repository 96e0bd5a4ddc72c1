//! Panels of bars side by side.

use super::axis::Range;
use super::font;
use super::sketch::{Anchor, Sketch};
use super::{Area, MARGIN};
use crate::plot::chart::{Bars, Group, Series};
use crate::plot::theme::{GAP, LABEL, SMALL, Tone, WIDTH};

/// Height of a panel without its texts.
const HEIGHT: f64 = 120.0;
/// A bar is at most so wide.
const WIDEST: f64 = 22.0;
/// A bar narrower than this cannot be told from its neighbour.
const NARROWEST: f64 = 5.0;

/// How the labels of groups are written.
#[derive(Clone, Debug, PartialEq)]
struct Labels {
    /// In lines, for each group.
    lines: Vec<Vec<String>>,
    /// Whether they read upwards.
    upwards: bool,
}

/// Where each group begins and ends, from 0 on, and how wide a bar is.
#[derive(Clone, Debug, PartialEq)]
struct Places {
    spans: Vec<[f64; 2]>,
    bar: f64,
}

/// Draws the panels from `top` on, and tells where they end.
pub fn draw(sketch: &mut Sketch, panels: &[Bars], series: &[Series], top: f64) -> f64 {
    let columns = [2, 1].into_iter().find(|&columns| {
        columns == 1 || panels.len() >= columns && panels.iter().all(|panel| fits(panel, columns))
    });
    let columns = columns.unwrap_or(1);
    let mut y = top;
    for row in panels.chunks(columns) {
        let ends = row.iter().enumerate().map(|(column, panel)| {
            let area = column_area(column, columns, y);
            panel_in(sketch, panel, series, area)
        });
        y = ends.fold(y, f64::max) + GAP;
    }
    y - GAP
}

/// A column's share of the paper, axis and titles included.
fn column_area(column: usize, columns: usize, top: f64) -> Area {
    let width = (WIDTH - 2.0 * MARGIN - GAP * (columns - 1) as f64) / columns as f64;
    let left = MARGIN + (width + GAP) * column as f64;
    Area { left, right: left + width, top, bottom: top }
}

/// Room for the axis beside a panel.
const AXIS: f64 = 40.0;

fn fits(panel: &Bars, columns: usize) -> bool {
    let width = column_area(0, columns, 0.0).width() - AXIS;
    let labels = labels(panel, width);
    !labels.upwards && places(panel, &labels, width).bar >= NARROWEST
}

/// Labels in as few lines as they fit into, upwards if nothing else does.
fn labels(panel: &Bars, width: f64) -> Labels {
    let share = width / panel.groups.len().max(1) as f64 - 4.0;
    let whole: Vec<Vec<String>> = panel.groups.iter().map(|group| vec![group.label.clone()]).collect();
    let broken: Vec<Vec<String>> = panel.groups.iter().map(|group| broken(&group.label, share)).collect();
    for lines in [&whole, &broken] {
        let labels = Labels { lines: lines.clone(), upwards: false };
        let least: f64 =
            panel.groups.iter().zip(lines).map(|(group, lines)| group_width(group, lines, 0.0)).sum();
        if least <= width && places(panel, &labels, width).bar >= NARROWEST {
            return labels;
        }
    }
    Labels { lines: whole, upwards: true }
}

/// A name in lines that fit, broken after `_`, `-` and blanks.
fn broken(label: &str, width: f64) -> Vec<String> {
    let mut lines = vec![String::new()];
    for part in label.split_inclusive(['_', '-', ' ']) {
        let last = lines.len() - 1;
        if !lines[last].is_empty() && font::width(&format!("{}{part}", lines[last]), SMALL) > width {
            lines.push(String::new());
        }
        let last = lines.len() - 1;
        lines[last].push_str(part);
    }
    lines
}

/// How many bars a group has room for: those that it has, and the gaps between them.
fn slots(group: &Group) -> f64 {
    let first = group.bars.iter().position(Option::is_some);
    let last = group.bars.iter().rposition(Option::is_some);
    match (first, last) {
        (Some(first), Some(last)) => (last - first + 1) as f64,
        _ => 1.0,
    }
}

/// The room that a group needs, with its bars that wide.
fn group_width(group: &Group, lines: &[String], bar: f64) -> f64 {
    let label = lines.iter().map(|line| font::width(line, SMALL)).fold(0.0, f64::max);
    (slots(group) * bar + bar.max(6.0)).max(label + 6.0)
}

fn places(panel: &Bars, labels: &Labels, width: f64) -> Places {
    let one_line = vec![String::from("0")];
    let needs = |bar: f64| -> Vec<f64> {
        let lines = |index: usize| if labels.upwards { &one_line } else { &labels.lines[index] };
        panel.groups.iter().enumerate().map(|(index, group)| group_width(group, lines(index), bar)).collect()
    };
    // The widest bars with which all groups have room: half a unit is fine enough.
    let mut bar = WIDEST;
    while bar > 0.5 && needs(bar).iter().sum::<f64>() > width {
        bar -= 0.25;
    }
    let widths = needs(bar);
    let total: f64 = widths.iter().sum();
    let more = ((width - total) / widths.len().max(1) as f64).max(0.0);
    let stretch = (width / (total + more * widths.len() as f64)).min(1.0);
    let mut x = 0.0;
    let spans = widths
        .iter()
        .map(|need| {
            let from = x;
            x += (need + more) * stretch;
            [from, x]
        })
        .collect();
    Places { spans, bar }
}

fn panel_in(sketch: &mut Sketch, panel: &Bars, series: &[Series], area: Area) -> f64 {
    let title = area.top + LABEL / 2.0;
    sketch.text((area.left, title), Anchor::Start, panel.title.clone(), LABEL, Tone::Ink);
    let plot = Area {
        left: area.left + AXIS,
        right: area.right,
        top: title + LABEL,
        bottom: title + LABEL + HEIGHT,
    };
    let values = panel.groups.iter().flat_map(|group| group.bars.iter().flatten());
    let ends = values.flat_map(|bar| {
        let [low, high] = bar.interval.unwrap_or([bar.value; 2]);
        [bar.value, low, high]
    });
    let range = Range::linear(ends.chain([panel.floor]).chain(panel.line), 5);
    for (tick, text) in &range.ticks {
        let y = plot.up(range.share(*tick));
        sketch.line([(plot.left, y), (plot.right, y)], Tone::Grid, 0.6);
        sketch.text((plot.left - 4.0, y), Anchor::End, text.clone(), SMALL, Tone::Ink);
    }
    let middle = (plot.top + plot.bottom) / 2.0;
    sketch.upwards((area.left + SMALL / 2.0, middle), Anchor::Middle, panel.axis.clone(), SMALL, Tone::Ink);
    let floor = plot.up(range.share(panel.floor));
    let labels = labels(panel, plot.width());
    let places = places(panel, &labels, plot.width());
    for ((group, span), lines) in panel.groups.iter().zip(&places.spans).zip(&labels.lines) {
        let [from, to] = span.map(|x| plot.left + x);
        if group.apart {
            sketch.line([(from, plot.top), (from, plot.bottom + 4.0)], Tone::Muted, 0.6);
        }
        let middle = (from + to) / 2.0;
        let first = group.bars.iter().position(Option::is_some).unwrap_or(0);
        let begin = middle - slots(group) * places.bar / 2.0;
        for (number, bar) in group.bars.iter().enumerate().skip(first) {
            let Some(bar) = bar else { continue };
            let left = begin + (number - first) as f64 * places.bar;
            let right = left + places.bar;
            let y = plot.up(range.share(bar.value));
            sketch.filled((left, floor), (right, y), series[number].look);
            if let Some([low, high]) = bar.interval {
                let x = (left + right) / 2.0;
                let [low, high] = [low, high].map(|end| plot.up(range.share(end)));
                sketch.error_bar((x, low), (x, high), (places.bar * 0.5).min(6.0));
            }
        }
        for (number, line) in lines.iter().enumerate() {
            let below = plot.bottom + 5.0;
            if labels.upwards {
                sketch.upwards((middle, below), Anchor::End, line.clone(), SMALL, Tone::Ink);
            } else {
                let y = below + SMALL * (0.5 + 1.15 * number as f64);
                sketch.text((middle, y), Anchor::Middle, line.clone(), SMALL, Tone::Ink);
            }
        }
    }
    sketch.line([(plot.left, floor), (plot.right, floor)], Tone::Ink, 0.8);
    if let Some(line) = panel.line {
        let y = plot.up(range.share(line));
        sketch.line([(plot.left, y), (plot.right, y)], Tone::Ink, 0.8);
    }
    let below = if labels.upwards {
        labels.lines.iter().flatten().map(|line| font::width(line, SMALL)).fold(0.0, f64::max)
    } else {
        SMALL * 1.15 * labels.lines.iter().map(Vec::len).max().unwrap_or(1) as f64
    };
    plot.bottom + 5.0 + below
}
