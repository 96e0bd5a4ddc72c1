//! Colours and sizes of all pictures, in one place.
//!
//! Colours are those of Okabe and Ito (2008), which people who see few colours can tell apart. They differ in
//! lightness too, and areas of similar lightness are hatched differently, so a print in grey still tells them apart.

use std::fmt;

/// What a colour is for; on dark paper it is another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// The background.
    Paper,
    /// Text, axes and outlines.
    Ink,
    /// Remarks and what is there for orientation.
    Muted,
    /// Lines of the grid.
    Grid,
    /// Of things that are counted as one of several.
    Slate,
    /// The same.
    Blue,
    /// The same.
    Orange,
    /// The same.
    Green,
    /// The same.
    Purple,
    /// The same.
    Sky,
    /// The same.
    Vermilion,
    /// The same.
    Yellow,
    /// A lighter [`Tone::Blue`].
    PaleBlue,
    /// A lighter [`Tone::Orange`].
    PaleOrange,
}

/// Red, green and blue, as in sRGB.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rgb(pub u8, pub u8, pub u8);

impl fmt::Display for Rgb {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Rgb(red, green, blue) = self;
        write!(out, "#{red:02X}{green:02X}{blue:02X}")
    }
}

impl Tone {
    /// All of them.
    pub const ALL: [Tone; 14] = [
        Tone::Paper,
        Tone::Ink,
        Tone::Muted,
        Tone::Grid,
        Tone::Slate,
        Tone::Blue,
        Tone::Orange,
        Tone::Green,
        Tone::Purple,
        Tone::Sky,
        Tone::Vermilion,
        Tone::Yellow,
        Tone::PaleBlue,
        Tone::PaleOrange,
    ];

    /// On white paper: what files have.
    pub fn light(self) -> Rgb {
        match self {
            Tone::Paper => Rgb(0xff, 0xff, 0xff),
            Tone::Ink => Rgb(0x1a, 0x1a, 0x1a),
            Tone::Muted => Rgb(0x5f, 0x5f, 0x5f),
            Tone::Grid => Rgb(0xdd, 0xdd, 0xdd),
            Tone::Slate => Rgb(0x47, 0x4f, 0x57),
            Tone::Blue => Rgb(0x00, 0x72, 0xb2),
            Tone::Orange => Rgb(0xe6, 0x9f, 0x00),
            Tone::Green => Rgb(0x00, 0x9e, 0x73),
            Tone::Purple => Rgb(0xcc, 0x79, 0xa7),
            Tone::Sky => Rgb(0x56, 0xb4, 0xe9),
            Tone::Vermilion => Rgb(0xd5, 0x5e, 0x00),
            Tone::Yellow => Rgb(0xf0, 0xe4, 0x42),
            Tone::PaleBlue => Rgb(0xa6, 0xcf, 0xe8),
            Tone::PaleOrange => Rgb(0xfb, 0xe3, 0xae),
        }
    }

    /// On a dark page.
    pub fn dark(self) -> Rgb {
        match self {
            Tone::Paper => Rgb(0x16, 0x18, 0x1b),
            Tone::Ink => Rgb(0xe8, 0xe8, 0xe8),
            Tone::Muted => Rgb(0xa6, 0xa6, 0xa6),
            Tone::Grid => Rgb(0x38, 0x3c, 0x41),
            Tone::Slate => Rgb(0xb4, 0xbc, 0xc4),
            Tone::Blue => Rgb(0x2f, 0x8f, 0xcd),
            Tone::PaleBlue => Rgb(0x2b, 0x55, 0x73),
            Tone::PaleOrange => Rgb(0x7a, 0x5c, 0x1d),
            other => other.light(),
        }
    }

    /// How light it is on white paper, from 0 to 1: relative luminance as WCAG 2 defines it.
    pub fn luminance(self) -> f64 {
        let linear = |byte: u8| {
            let value = f64::from(byte) / 255.0;
            if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        };
        let Rgb(red, green, blue) = self.light();
        0.2126 * linear(red) + 0.7152 * linear(green) + 0.0722 * linear(blue)
    }
}

/// The class of every picture's root element in SVG.
pub const CLASS: &str = "plot";

/// Rules that give the pictures of a page its dark colours, for inside of `@media (prefers-color-scheme: dark)` or
/// of a rule of one's own; each begins with `scope`, which may be empty.
///
/// Every element of a picture names its colour in an attribute, and a rule wins over an attribute: so the same
/// SVG is right as a file and on a page.
pub fn dark_css(scope: &str) -> String {
    let mut css = String::new();
    for tone in Tone::ALL {
        let (light, dark) = (tone.light(), tone.dark());
        if light != dark {
            css += &format!("{scope} .{CLASS} [fill=\"{light}\"] {{ fill: {dark} }}\n");
            css += &format!("{scope} .{CLASS} [stroke=\"{light}\"] {{ stroke: {dark} }}\n");
        }
    }
    css
}

/// Lines over an area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hatch {
    /// None.
    Plain,
    /// From bottom left to top right.
    Rising,
    /// From top left to bottom right.
    Falling,
    /// Both.
    Crossed,
    /// Across.
    Level,
}

/// What marks a place on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marker {
    /// A disc.
    Disc,
    /// A square.
    Square,
    /// A triangle that stands on its side.
    Triangle,
    /// A square that stands on its corner.
    Diamond,
    /// A ring.
    Ring,
    /// Two crossed lines.
    Cross,
    /// Nothing.
    Nothing,
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dash {
    /// In one.
    Solid,
    /// In long pieces.
    Dashed,
    /// In short pieces.
    Dotted,
    /// Not at all: only its markers are.
    Absent,
}

/// What one of several things looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Look {
    /// Its colour.
    pub tone: Tone,
    /// Lines over its areas.
    pub hatch: Hatch,
    /// Places on its lines.
    pub marker: Marker,
    /// Its lines.
    pub dash: Dash,
}

impl Look {
    /// That of the thing with this number, of several that have no order or meaning of their own.
    pub fn numbered(number: usize) -> Look {
        const LOOKS: [(Tone, Hatch, Marker); 8] = [
            (Tone::Blue, Hatch::Plain, Marker::Disc),
            (Tone::Orange, Hatch::Plain, Marker::Square),
            (Tone::Green, Hatch::Rising, Marker::Triangle),
            (Tone::Yellow, Hatch::Plain, Marker::Diamond),
            (Tone::Vermilion, Hatch::Falling, Marker::Ring),
            (Tone::Sky, Hatch::Plain, Marker::Disc),
            (Tone::Purple, Hatch::Crossed, Marker::Square),
            (Tone::Slate, Hatch::Plain, Marker::Triangle),
        ];
        let (tone, hatch, marker) = LOOKS[number % LOOKS.len()];
        let dash = [Dash::Solid, Dash::Dashed, Dash::Dotted][number / LOOKS.len() % 3];
        Look { tone, hatch, marker, dash }
    }

    /// The same with other lines over its areas.
    pub fn hatched(self, hatch: Hatch) -> Look {
        Look { hatch, ..self }
    }
}

/// Sizes are in units of a picture; its width is [`WIDTH`] of them.
pub const WIDTH: f64 = 640.0;
/// Text of a picture's title.
pub const TITLE: f64 = 14.0;
/// Text of titles of panels and of axes.
pub const LABEL: f64 = 11.0;
/// Text of ticks, legends and remarks.
pub const SMALL: f64 = 10.0;
/// Between things that have nothing to do with each other.
pub const GAP: f64 = 12.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_colour_stands_for_one_thing_only() {
        for (index, tone) in Tone::ALL.iter().enumerate() {
            assert!(Tone::ALL[..index].iter().all(|other| other.light() != tone.light()), "{tone:?}");
        }
    }

    #[test]
    fn text_can_be_read_on_both_papers() {
        assert!(1.05 / (Tone::Muted.luminance() + 0.05) > 4.5);
        let css = dark_css(".night");
        assert!(css.contains(".night .plot [fill=\"#FFFFFF\"] { fill: #16181B }"), "{css}");
    }
}
