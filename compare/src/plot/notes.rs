//! What stands below a picture, and what is said about those that cannot be drawn.

use super::chart::{Bars, Body, Chart};
use crate::select::Selection;
use crate::unreliable;
use record::Point;

/// The charts of one kind that a record has, and why others are left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// The charts.
    pub charts: Vec<Chart>,
    /// What is left out, and why.
    pub remarks: Vec<String>,
}

impl Found {
    /// No chart, and why.
    pub fn nothing(reason: impl Into<String>) -> Found {
        Found { charts: Vec::new(), remarks: vec![reason.into()] }
    }

    /// A chart of bars, if it has panels.
    pub fn bars(chart: Chart) -> Found {
        match &chart.body {
            Body::Bars(panels) if panels.is_empty() => {
                Found::nothing(format!("nothing is known of what {:?} would show", chart.title))
            }
            _ => Found { charts: vec![chart], remarks: Vec::new() },
        }
    }

    /// Adds others.
    pub fn add(&mut self, other: Found) {
        self.charts.extend(other.charts);
        self.remarks.extend(other.remarks);
    }
}

/// Why nothing can be relative to a variant.
pub fn no_reference(selection: &Selection, reference: &str) -> Option<String> {
    match selection.passes(reference).len() {
        0 => Some(format!("there is no variant {reference:?} to compare with; --reference names another")),
        1 => None,
        count => {
            Some(format!("{reference} was measured with {count} sets of parameters, so it is no reference"))
        }
    }
}

/// The device, as far as a picture needs it.
pub fn device(selection: &Selection) -> String {
    let device = &selection.record.device;
    // As the vendor writes it, where Vulkan has nothing but a number.
    let driver = if device.driver.info.is_empty() { &device.driver.version } else { &device.driver.info };
    format!("{}, driver {driver}.", device.name)
}

/// Says which of the points that a picture shows are unreliable, behind other sentences.
pub fn unreliable<'r>(points: impl IntoIterator<Item = &'r Point>) -> String {
    unreliable::sentence(points, |point| point, |point| format!("{} on {}", point.variant, point.scene.name))
}

/// Puts before a chart's note why its points should not be compared, where something stands against it.
pub fn mark(chart: &mut Chart, obstacles: &[String]) {
    if !obstacles.is_empty() {
        chart.note = format!("Not comparable: {}. {}", obstacles.join("; "), chart.note);
    }
}

/// What the last group of several scenes is.
pub fn mean(selection: &Selection) -> &'static str {
    if selection.scenes().len() > 1 { "; mean: geometric mean over the scenes" } else { "" }
}

/// Which way values are better.
pub const BETTER: &str = "More MRps is better, and less of all else.";

/// What error bars are, or why there are none.
pub fn error_bars(panels: &[Bars]) -> &'static str {
    let mut bars =
        panels.iter().flat_map(|panel| &panel.groups).flat_map(|group| group.bars.iter().flatten());
    if bars.any(|bar| bar.interval.is_some()) {
        "Error bars: 95% confidence intervals of rates and times."
    } else {
        "No error bars: the record has too few samples."
    }
}
