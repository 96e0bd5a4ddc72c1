//! What the looks mean, above the panels and outside of them.

use super::font;
use super::sketch::{Anchor, Sketch};
use crate::plot::chart::{Body, Series};
use crate::plot::theme::{SMALL, Tone};

/// Width of the sample beside a name.
const SAMPLE: f64 = 16.0;

/// Draws it from `left` and `top` on, and tells where it ends.
pub fn draw(sketch: &mut Sketch, series: &[Series], body: &Body, left: f64, top: f64, width: f64) -> f64 {
    let line = SMALL * 1.55;
    let (mut x, mut y) = (left, top + SMALL / 2.0);
    for entry in series {
        let text = font::width(&entry.label, SMALL);
        if x + SAMPLE + 5.0 + text > left + width && x > left {
            (x, y) = (left, y + line);
        }
        match body {
            Body::Planes(_) => {
                sketch.dashed(&[(x, y), (x + SAMPLE, y)], entry.look.dash, entry.look.tone, 1.6);
                sketch.marker((x + SAMPLE / 2.0, y), entry.look, 5.5);
            }
            _ => sketch.filled((x, y - 5.0), (x + SAMPLE, y + 5.0), entry.look),
        }
        sketch.text((x + SAMPLE + 5.0, y), Anchor::Start, entry.label.clone(), SMALL, Tone::Ink);
        x += SAMPLE + 5.0 + text + 14.0;
    }
    y + SMALL / 2.0
}
