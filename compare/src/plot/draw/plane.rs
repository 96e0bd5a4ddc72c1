//! Panels with lines and places.

use super::axis::Range;
use super::font;
use super::sketch::{Anchor, Sketch};
use super::{Area, MARGIN};
use crate::plot::chart::{Axis, Curve, Plane, Series};
use crate::plot::theme::{Dash, GAP, LABEL, Look, Marker, SMALL, Tone, WIDTH};

/// Room for an axis beside a panel.
const AXIS: f64 = 46.0;

/// How much a band hides of what is below it.
const COVER: f64 = 0.22;

/// A curve with more places than this is a thin line without markers.
const MANY: usize = 60;

/// Draws the panels from `top` on, and tells where they end.
pub fn draw(sketch: &mut Sketch, panels: &[Plane], series: &[Series], top: f64) -> f64 {
    let columns = match panels.len() {
        0 | 1 => 1,
        3 | 5.. if panels.iter().all(|panel| panel.right.is_none()) => 3,
        _ => 2,
    };
    let width = (WIDTH - 2.0 * MARGIN - GAP * (columns - 1) as f64) / columns as f64;
    let height = match (columns, panels.len()) {
        (1, _) => 220.0,
        (_, 0..=3) => 170.0,
        _ => 84.0,
    };
    let rows = panels.len().div_ceil(columns);
    let mut y = top;
    for (number, row) in panels.chunks(columns).enumerate() {
        let mut end = y;
        for (column, panel) in row.iter().enumerate() {
            // Of many panels only the last of a column says what its axis is.
            let below = rows < 3 || (number * columns + column + columns) >= panels.len();
            let left = MARGIN + (width + GAP) * column as f64;
            let area = Area { left, right: left + width, top: y, bottom: y + height };
            end = end.max(panel_in(sketch, panel, series, area, below));
        }
        y = end + GAP;
    }
    y - GAP
}

fn panel_in(sketch: &mut Sketch, panel: &Plane, series: &[Series], area: Area, below: bool) -> f64 {
    let title = area.top + LABEL / 2.0;
    sketch.text((area.left, title), Anchor::Start, panel.title.clone(), LABEL, Tone::Ink);
    let plot = Area {
        left: area.left + AXIS,
        right: area.right - if panel.right.is_some() { AXIS } else { 6.0 },
        top: title + LABEL,
        bottom: title + LABEL + area.bottom - area.top,
    };
    let places = || panel.curves.iter().flat_map(|curve| &curve.places);
    let bands = || panel.curves.iter().flat_map(|curve| &curve.band);
    let x = Range::new(&panel.x, places().map(|place| place.x).chain(bands().map(|(x, _)| *x)), 6, false);
    let y = Range::new(&panel.y, heights(panel, false), 5, true);
    let right = panel.right.as_ref().map(|axis| Range::new(axis, heights(panel, true), 5, true));
    // Ends of the paper inside of the frame, so that no marker lies on it.
    let inner = Area {
        left: plot.left + 6.0,
        right: plot.right - 6.0,
        top: plot.top + 4.0,
        bottom: plot.bottom - 4.0,
    };

    for (tick, text) in &y.ticks {
        let at = inner.up(y.share(*tick));
        sketch.line([(plot.left, at), (plot.right, at)], Tone::Grid, 0.6);
        sketch.text((plot.left - 4.0, at), Anchor::End, text.clone(), SMALL, Tone::Ink);
    }
    ticks_below(sketch, &x, inner, plot.bottom);
    for (tick, text) in right.iter().flat_map(|range| &range.ticks) {
        let at = inner.up(right.as_ref().map_or(0.0, |range| range.share(*tick)));
        sketch.line([(plot.right, at), (plot.right + 3.0, at)], Tone::Muted, 0.6);
        sketch.text((plot.right + 5.0, at), Anchor::Start, text.clone(), SMALL, Tone::Muted);
    }
    for curve in &panel.curves {
        let up = if curve.right { right.as_ref().unwrap_or(&y) } else { &y };
        curve_in(sketch, curve, series, inner, &x, up);
    }
    frame(sketch, plot);
    titles(sketch, panel, area, plot, below)
}

fn curve_in(sketch: &mut Sketch, curve: &Curve, series: &[Series], area: Area, x: &Range, y: &Range) {
    let look = series[curve.series].look;
    let at = |right: f64, up: f64| (area.across(x.share(right)), area.up(y.share(up)));
    let lower = curve.band.iter().map(|(right, [low, _])| at(*right, *low));
    let upper = curve.band.iter().rev().map(|(right, [_, high])| at(*right, *high));
    let corners: Vec<_> = lower.chain(upper).collect();
    if curve.band.len() > 1 {
        sketch.marks.push(super::Mark::Area { corners, tone: look.tone, cover: COVER });
    }
    let spots: Vec<_> = curve.places.iter().map(|place| at(place.x, place.y.value)).collect();
    let many = spots.len() > MANY;
    sketch.dashed(&spots, look.dash, look.tone, if many { 0.8 } else { 1.6 });
    for (place, spot) in curve.places.iter().zip(&spots) {
        if let Some(ends) = place.y.interval {
            let [low, high] = ends.map(|end| area.up(y.share(end)));
            sketch.error_bar((spot.0, low), (spot.0, high), 4.0);
        }
        // A long line says enough; places that no line joins are drawn however many they are.
        if spots.len() == 1 && look.marker == Marker::Nothing {
            sketch.marker(*spot, Look { marker: Marker::Disc, ..look }, 4.0);
        } else if !many || look.dash == Dash::Absent {
            sketch.marker(*spot, look, 5.0);
        }
    }
}

/// Ticks with their numbers; one that would touch another's has none, but the first and the last have theirs.
fn ticks_below(sketch: &mut Sketch, x: &Range, inner: Area, bottom: f64) {
    // A long text at the last tick stays on the paper.
    let span = |tick: &(f64, String)| {
        let half = font::width(&tick.1, SMALL) / 2.0 + 2.0;
        let middle = inner.across(x.share(tick.0)).min(WIDTH - half);
        [middle - half, middle + half]
    };
    let last = x.ticks.len().saturating_sub(1);
    let end = x.ticks.last().map_or(f64::INFINITY, |tick| span(tick)[0]);
    let mut free = f64::NEG_INFINITY;
    for (index, tick) in x.ticks.iter().enumerate() {
        let at = inner.across(x.share(tick.0));
        sketch.line([(at, bottom), (at, bottom + 3.0)], Tone::Ink, 0.6);
        let [from, to] = span(tick);
        if from >= free && (index == last || to <= end) {
            let text = tick.1.clone();
            let middle = (from + to) / 2.0;
            sketch.text((middle, bottom + 4.0 + SMALL / 2.0), Anchor::Middle, text, SMALL, Tone::Ink);
            free = to;
        }
    }
}

/// All that one of the axes upwards must have room for.
fn heights(panel: &Plane, right: bool) -> impl Iterator<Item = f64> {
    let curves = panel.curves.iter().filter(move |curve| curve.right == right);
    curves.flat_map(|curve| {
        let places = curve.places.iter().flat_map(|place| {
            let [low, high] = place.y.interval.unwrap_or([place.y.value; 2]);
            [place.y.value, low, high]
        });
        places.chain(curve.band.iter().flat_map(|(_, ends)| *ends))
    })
}

fn frame(sketch: &mut Sketch, plot: Area) {
    let corners = [
        (plot.left, plot.top),
        (plot.right, plot.top),
        (plot.right, plot.bottom),
        (plot.left, plot.bottom),
        (plot.left, plot.top),
    ];
    sketch.line(corners, Tone::Ink, 0.6);
}

/// Writes what the axes are, and tells where the panel ends.
fn titles(sketch: &mut Sketch, panel: &Plane, area: Area, plot: Area, below: bool) -> f64 {
    let middle = (plot.top + plot.bottom) / 2.0;
    let beside = |sketch: &mut Sketch, x: f64, axis: &Axis, tone: Tone| {
        sketch.upwards((x, middle), Anchor::Middle, axis.title.clone(), SMALL, tone);
    };
    beside(sketch, area.left + SMALL / 2.0, &panel.y, Tone::Ink);
    if let Some(axis) = &panel.right {
        beside(sketch, area.right - SMALL / 2.0, axis, Tone::Muted);
    }
    if !below {
        return plot.bottom + 4.0 + SMALL;
    }
    let below = plot.bottom + 5.0 + SMALL * 1.8;
    let center = (plot.left + plot.right) / 2.0;
    sketch.text((center, below), Anchor::Middle, panel.x.title.clone(), SMALL, Tone::Ink);
    below + SMALL / 2.0
}
