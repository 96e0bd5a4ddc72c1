//! From a chart to a drawing, and from that to a file.

mod axis;
mod bars;
mod font;
mod legend;
mod paint;
mod plane;
mod sketch;
mod stacks;

pub use axis::short;
pub use paint::{png, svg};
pub use sketch::{Mark, Sketch};

use super::chart::{Body, Chart};
use super::theme::{GAP, SMALL, TITLE, Tone, WIDTH};

/// Around everything.
const MARGIN: f64 = 10.0;

/// Where something may be drawn: its left and right end, and its upper and lower one.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Area {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl Area {
    fn width(&self) -> f64 {
        self.right - self.left
    }

    /// What is at this share of the way to the right.
    fn across(&self, share: f64) -> f64 {
        self.left + share * self.width()
    }

    /// What is at this share of the way up.
    fn up(&self, share: f64) -> f64 {
        self.bottom - share * (self.bottom - self.top)
    }
}

/// Draws a chart: its title, the legend, the panels and the note, from top to bottom.
pub fn draw(chart: &Chart) -> Sketch {
    let mut sketch = Sketch::default();
    let width = WIDTH - 2.0 * MARGIN;
    let mut y = MARGIN + TITLE / 2.0;
    let lines = sketch.paragraph((MARGIN, y), &chart.title, width, TITLE, Tone::Ink);
    y += lines as f64 * TITLE * 1.3;
    y = legend::draw(&mut sketch, &chart.series, &chart.body, MARGIN, y, width) + GAP;
    y = match &chart.body {
        Body::Bars(panels) => bars::draw(&mut sketch, panels, &chart.series, y),
        Body::Stacks(panels) => stacks::draw(&mut sketch, panels, &chart.series, y),
        Body::Planes(panels) => plane::draw(&mut sketch, panels, &chart.series, y),
    };
    if !chart.note.is_empty() {
        y += GAP + SMALL / 2.0;
        let lines = sketch.paragraph((MARGIN, y), &chart.note, width, SMALL, Tone::Muted);
        y += (lines as f64 - 0.5) * SMALL * 1.3;
    }
    sketch.height = (y + MARGIN).ceil();
    sketch
}
