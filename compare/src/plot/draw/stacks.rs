//! Panels of level bars, each of several parts.

use super::axis::Range;
use super::font;
use super::sketch::{Anchor, Sketch};
use super::{Area, MARGIN};
use crate::plot::chart::{Series, Stacks};
use crate::plot::theme::{GAP, LABEL, SMALL, Tone, WIDTH};

/// From one bar to the next.
const PITCH: f64 = 13.0;
/// How much of that the bar takes.
const BAR: f64 = 9.5;

/// Draws the panels from `top` on, several beside each other, and tells where they end.
pub fn draw(sketch: &mut Sketch, panels: &[Stacks], series: &[Series], top: f64) -> f64 {
    let rows = panels.iter().flat_map(|panel| &panel.rows);
    let names = rows.map(|row| font::width(&row.label, SMALL)).fold(0.0, f64::max) + 6.0;
    let columns = match panels.len() {
        0 | 1 => 1,
        2 | 4 => 2,
        _ => 3,
    };
    let mut y = top;
    for row in panels.chunks(columns) {
        // Names stand beside the first column only, if all have the same.
        let same = row.windows(2).all(|pair| {
            pair[0].rows.iter().map(|row| &row.label).eq(pair[1].rows.iter().map(|row| &row.label))
        });
        let labels = if same { names } else { names * columns as f64 };
        let width = (WIDTH - 2.0 * MARGIN - labels - 2.0 * GAP * (columns - 1) as f64) / columns as f64;
        let mut x = MARGIN;
        let mut end = y;
        for (column, panel) in row.iter().enumerate() {
            let named = column == 0 || !same;
            let left = x + if named { names } else { 0.0 };
            let area = Area { left, right: left + width, top: y, bottom: y };
            end = end.max(panel_in(sketch, panel, series, area, named));
            x = left + width + 2.0 * GAP;
        }
        y = end + GAP;
    }
    y - GAP
}

fn panel_in(sketch: &mut Sketch, panel: &Stacks, series: &[Series], area: Area, named: bool) -> f64 {
    let title = area.top + LABEL / 2.0;
    sketch.text((area.left, title), Anchor::Start, panel.title.clone(), LABEL, Tone::Ink);
    let top = title + LABEL;
    let plot = Area { top, bottom: top + PITCH * panel.rows.len() as f64, ..area };
    let sum = |parts: &[Option<f64>]| parts.iter().flatten().sum::<f64>();
    let ends = panel.rows.iter().flat_map(|row| {
        let [low, high] = row.interval.unwrap_or([0.0; 2]);
        [sum(&row.parts), low, high]
    });
    let range = Range::linear(ends.chain([0.0]), if plot.width() > 300.0 { 7 } else { 4 });
    for (tick, text) in &range.ticks {
        let x = plot.across(range.share(*tick));
        sketch.line([(x, plot.top), (x, plot.bottom)], Tone::Grid, 0.6);
        sketch.text((x, plot.bottom + 8.0), Anchor::Middle, text.clone(), SMALL, Tone::Ink);
    }
    for (number, row) in panel.rows.iter().enumerate() {
        let y = plot.top + PITCH * (number as f64 + 0.5);
        if named {
            sketch.text((plot.left - 5.0, y), Anchor::End, row.label.clone(), SMALL, Tone::Ink);
        }
        let mut from = 0.0;
        for (part, entry) in row.parts.iter().zip(series) {
            let to = from + part.unwrap_or(0.0);
            if to > from {
                let [left, right] = [from, to].map(|value| plot.across(range.share(value)));
                sketch.filled((left, y - BAR / 2.0), (right, y + BAR / 2.0), entry.look);
            }
            from = to;
        }
        if let Some(ends) = row.interval {
            let [low, high] = ends.map(|end| plot.across(range.share(end.max(0.0))));
            sketch.error_bar((low, y), (high, y), 5.0);
        }
    }
    let zero = plot.across(range.share(0.0));
    sketch.line([(zero, plot.top), (zero, plot.bottom)], Tone::Ink, 0.8);
    let axis = plot.bottom + 8.0 + SMALL * 1.3;
    sketch.text(((plot.left + plot.right) / 2.0, axis), Anchor::Middle, panel.axis.clone(), SMALL, Tone::Ink);
    axis + SMALL / 2.0
}
