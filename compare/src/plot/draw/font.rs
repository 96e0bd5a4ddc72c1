//! The font that ships with the program: every picture is laid out by it.

use plotters::style::{FontDesc, FontFamily, FontStyle, register_font};
use std::sync::Once;

/// The font, and in SVG those that may stand in for it, which are of about the same width.
pub const FAMILY: &str = "Roboto, Arial, Liberation Sans, Helvetica, sans-serif";

/// Height of the font's lines by the size of its letters: ascent plus descent over units per em, 2400 / 2048.
pub const LINE: f64 = 2400.0 / 2048.0;

/// Half the height of small letters by the size: by so much the middle of a text is above its base line.
pub const MIDDLE: f64 = 0.264;

static BYTES: &[u8] = include_bytes!("../../../fonts/Roboto-Regular.ttf");

/// Makes the font known to plotters.
pub fn register() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // It can only fail for bytes that are no font, and a test holds that these are one.
        let _ = register_font(FAMILY, FontStyle::Normal, BYTES);
    });
}

/// The width of a text whose letters have this size.
pub fn width(text: &str, size: f64) -> f64 {
    /// Plotters counts in whole pixels, so text is measured large.
    const LARGE: f64 = 1000.0;
    register();
    let font = FontDesc::new(FontFamily::Name(FAMILY), LARGE * LINE, FontStyle::Normal);
    // Without a font a guess is good enough: letters are about half as wide as large.
    font.layout_box(text)
        .map_or(text.chars().count() as f64 / 2.0, |(left, right)| f64::from(right.0 - left.0) / LARGE)
        * size
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_is_one() {
        assert!(register_font("test", FontStyle::Normal, BYTES).is_ok());
        assert!(width("WWW", 10.0) > 2.0 * width("iii", 10.0));
        assert_eq!(width("", 10.0), 0.0);
        assert!((width("m", 20.0) - 2.0 * width("m", 10.0)).abs() < 1e-9);
    }
}
