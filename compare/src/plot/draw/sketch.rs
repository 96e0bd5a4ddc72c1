//! What is drawn, in units of the picture: all that both kinds of files have in common.

use super::font;
use crate::plot::theme::{Dash, Hatch, Look, Marker, Tone};

/// A place: to the right and downwards.
pub type Spot = (f64, f64);

/// One thing on the paper.
#[derive(Clone, Debug, PartialEq)]
pub enum Mark {
    /// A filled rectangle.
    Rectangle {
        /// Its upper left corner.
        from: Spot,
        /// Its lower right corner.
        to: Spot,
        /// Its colour.
        tone: Tone,
    },
    /// A filled polygon.
    Area {
        /// Its corners.
        corners: Vec<Spot>,
        /// Its colour.
        tone: Tone,
        /// How much of what is below it hides, from 0 to 1.
        cover: f64,
    },
    /// A line through places.
    Line {
        /// The places.
        places: Vec<Spot>,
        /// Its colour.
        tone: Tone,
        /// Its width.
        width: f64,
    },
    /// A text in one line.
    Text {
        /// Where it is anchored: in the middle of its height.
        at: Spot,
        /// Which part of it is there.
        anchor: Anchor,
        /// The text.
        text: String,
        /// The size of its letters.
        size: f64,
        /// Its colour.
        tone: Tone,
        /// Whether it reads upwards.
        upwards: bool,
    },
}

/// Which part of a text is where it says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// Its first letter.
    Start,
    /// Its middle.
    Middle,
    /// Its last letter.
    End,
}

/// A drawing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sketch {
    /// What is on it, the lowermost first.
    pub marks: Vec<Mark>,
    /// Its height.
    pub height: f64,
}

/// Between lines of a hatching, across.
const HATCH: f64 = 4.0;

impl Sketch {
    /// A filled rectangle.
    pub fn rectangle(&mut self, from: Spot, to: Spot, tone: Tone) {
        self.marks.push(Mark::Rectangle { from, to, tone });
    }

    /// A line.
    pub fn line(&mut self, places: impl Into<Vec<Spot>>, tone: Tone, width: f64) {
        self.marks.push(Mark::Line { places: places.into(), tone, width });
    }

    /// A line that may be in pieces.
    pub fn dashed(&mut self, places: &[Spot], dash: Dash, tone: Tone, width: f64) {
        let lengths = match dash {
            Dash::Solid => return self.line(places, tone, width),
            Dash::Absent => return,
            Dash::Dashed => [5.0, 3.0],
            Dash::Dotted => [1.5, 2.0],
        };
        for piece in pieces(places, lengths) {
            self.line(piece, tone, width);
        }
    }

    /// A text, level.
    pub fn text(&mut self, at: Spot, anchor: Anchor, text: impl Into<String>, size: f64, tone: Tone) {
        self.marks.push(Mark::Text { at, anchor, text: text.into(), size, tone, upwards: false });
    }

    /// A text that reads upwards.
    pub fn upwards(&mut self, at: Spot, anchor: Anchor, text: impl Into<String>, size: f64, tone: Tone) {
        self.marks.push(Mark::Text { at, anchor, text: text.into(), size, tone, upwards: true });
    }

    /// A text over several lines, the first one in the middle of its height at `at`; tells how many there are.
    pub fn paragraph(&mut self, at: Spot, text: &str, width: f64, size: f64, tone: Tone) -> usize {
        let lines = wrapped(text, width, size);
        let count = lines.len();
        for (number, line) in lines.into_iter().enumerate() {
            self.text((at.0, at.1 + number as f64 * size * 1.3), Anchor::Start, line, size, tone);
        }
        count
    }

    /// A rectangle as a series looks, outlined.
    pub fn filled(&mut self, from: Spot, to: Spot, look: Look) {
        let (from, to) = ((from.0.min(to.0), from.1.min(to.1)), (from.0.max(to.0), from.1.max(to.1)));
        self.rectangle(from, to, look.tone);
        let tone = if look.tone.luminance() < 0.45 { Tone::Paper } else { Tone::Ink };
        for line in hatching(look.hatch, from, to) {
            self.line(line, tone, 0.7);
        }
        let corners = [from, (to.0, from.1), to, (from.0, to.1), from];
        self.line(corners, Tone::Ink, 0.5);
    }

    /// A marker as a series has it.
    pub fn marker(&mut self, (x, y): Spot, look: Look, size: f64) {
        let r = size / 2.0;
        let around = |corners: usize, first: f64, r: f64| -> Vec<Spot> {
            let angle = |corner: usize| first + std::f64::consts::TAU * corner as f64 / corners as f64;
            (0..corners).map(|corner| (x + r * angle(corner).cos(), y + r * angle(corner).sin())).collect()
        };
        use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
        let corners = match look.marker {
            Marker::Disc | Marker::Ring => around(16, 0.0, r),
            Marker::Square => around(4, FRAC_PI_4, 1.25 * r),
            Marker::Triangle => around(3, -FRAC_PI_2, 1.3 * r),
            Marker::Diamond => around(4, 0.0, 1.3 * r),
            Marker::Cross => {
                self.line([(x - r, y - r), (x + r, y + r)], look.tone, 1.0);
                return self.line([(x - r, y + r), (x + r, y - r)], look.tone, 1.0);
            }
            Marker::Nothing => return,
        };
        let mut outline = corners.clone();
        outline.push(corners[0]);
        let hollow = look.marker == Marker::Ring;
        let (fill, line) = if hollow { (Tone::Paper, look.tone) } else { (look.tone, Tone::Paper) };
        self.marks.push(Mark::Area { corners, tone: fill, cover: 1.0 });
        self.line(outline, line, if hollow { 1.0 } else { 0.4 });
    }

    /// A bar that says between what a value lies, with its ends.
    pub fn error_bar(&mut self, from: Spot, to: Spot, end: f64) {
        let across = if from.0 == to.0 { (end / 2.0, 0.0) } else { (0.0, end / 2.0) };
        self.line([from, to], Tone::Ink, 0.8);
        for (x, y) in [from, to] {
            self.line([(x - across.0, y - across.1), (x + across.0, y + across.1)], Tone::Ink, 0.8);
        }
    }
}

/// A text in lines of at most this width, where words allow it.
pub fn wrapped(text: &str, width: f64, size: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if font::width(&format!("{line} {word}"), size) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// The lines of a hatching, cut off at the rectangle.
fn hatching(hatch: Hatch, (x0, y0): Spot, (x1, y1): Spot) -> Vec<[Spot; 2]> {
    let mut lines = Vec::new();
    // Rising lines have one x + y, falling ones one x - y. Counting from the paper's corner lets the lines of
    // neighbours go on in each other.
    let rising = |lines: &mut Vec<[Spot; 2]>| {
        let mut sum = ((x0 + y0) / HATCH).ceil() * HATCH;
        while sum < x1 + y1 {
            let (left, right) = (x0.max(sum - y1), x1.min(sum - y0));
            lines.push([(left, sum - left), (right, sum - right)]);
            sum += HATCH;
        }
    };
    let falling = |lines: &mut Vec<[Spot; 2]>| {
        let mut difference = ((x0 - y1) / HATCH).ceil() * HATCH;
        while difference < x1 - y0 {
            let (left, right) = (x0.max(difference + y0), x1.min(difference + y1));
            lines.push([(left, left - difference), (right, right - difference)]);
            difference += HATCH;
        }
    };
    match hatch {
        Hatch::Plain => {}
        Hatch::Rising => rising(&mut lines),
        Hatch::Falling => falling(&mut lines),
        Hatch::Crossed => {
            rising(&mut lines);
            falling(&mut lines);
        }
        Hatch::Level => {
            let mut y = (y0 / HATCH).ceil() * HATCH;
            while y < y1 {
                lines.push([(x0, y), (x1, y)]);
                y += HATCH;
            }
        }
    }
    lines
}

/// A line cut into pieces: so much is drawn, so much is not.
fn pieces(places: &[Spot], lengths: [f64; 2]) -> Vec<Vec<Spot>> {
    let mut all = Vec::new();
    let mut drawn = true;
    let mut left = lengths[0];
    let mut piece: Vec<Spot> = places.first().copied().into_iter().collect();
    for pair in places.windows(2) {
        let [mut from, to] = [pair[0], pair[1]];
        loop {
            let length = (to.0 - from.0).hypot(to.1 - from.1);
            if length < left || length == 0.0 {
                left -= length;
                if drawn {
                    piece.push(to);
                }
                break;
            }
            let part = left / length;
            from = (from.0 + (to.0 - from.0) * part, from.1 + (to.1 - from.1) * part);
            if drawn {
                piece.push(from);
                all.push(std::mem::take(&mut piece));
            } else {
                piece = vec![from];
            }
            drawn = !drawn;
            left = if drawn { lengths[0] } else { lengths[1] };
        }
    }
    if drawn && piece.len() > 1 {
        all.push(piece);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_cut_into_pieces() {
        let found = pieces(&[(0.0, 0.0), (4.0, 0.0), (4.0, 4.0)], [3.0, 2.0]);
        assert_eq!(found, [vec![(0.0, 0.0), (3.0, 0.0)], vec![(4.0, 1.0), (4.0, 4.0)]]);
        assert!(pieces(&[], [1.0, 1.0]).is_empty());
        assert!(pieces(&[(1.0, 1.0)], [1.0, 1.0]).is_empty());
    }

    #[test]
    fn hatching_stays_inside() {
        for hatch in [Hatch::Rising, Hatch::Falling, Hatch::Crossed, Hatch::Level] {
            let lines = hatching(hatch, (1.0, 2.0), (30.0, 22.5));
            assert!(lines.len() > 4, "{hatch:?}");
            for (x, y) in lines.into_iter().flatten() {
                assert!((1.0 - 1e-9..=30.0 + 1e-9).contains(&x), "{x}");
                assert!((2.0 - 1e-9..=22.5 + 1e-9).contains(&y), "{y}");
            }
        }
    }

    #[test]
    fn text_is_broken_between_words_only() {
        assert_eq!(wrapped("one two", 1000.0, 10.0), ["one two"]);
        assert_eq!(wrapped("one two", 1.0, 10.0), ["one", "two"]);
        assert!(wrapped(" ", 10.0, 10.0).is_empty());
    }
}
