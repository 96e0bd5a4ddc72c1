//! The live chart: rates of primary and secondary rays, and the time of a frame.

use super::draw::{self, Area, Paint};
use crate::picture::Picture;
use std::collections::VecDeque;
use tracer::path;

/// What a sample came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Millions of primary rays a second, over the time of the traversal kernel alone.
    pub primary: f64,
    /// The same of the rays of all bounces; nothing where there were none.
    pub secondary: Option<f64>,
    /// Milliseconds that all kernels of the sample took, from the first to the last.
    pub frame: f64,
}

impl Entry {
    /// Of a sample; nothing where no ray was traced, or in no time.
    pub fn of(sample: &path::Sample) -> Option<Self> {
        let rate = |waves: &[path::WaveTime]| {
            let rays: u64 = waves.iter().map(|wave| wave.rays).sum();
            let milliseconds: f64 = waves.iter().map(|wave| wave.milliseconds).sum();
            (rays > 0 && milliseconds > 0.0).then(|| rays as f64 / milliseconds / 1e3)
        };
        let (first, rest) = sample.waves.split_at_checked(1)?;
        Some(Self { primary: rate(first)?, secondary: rate(rest), frame: sample.milliseconds })
    }
}

/// The last samples.
#[derive(Debug, Default)]
pub struct History {
    entries: VecDeque<Entry>,
}

/// So many samples are kept, each a step of the chart.
const KEPT: usize = 200;
/// Fewer than these do not fill it.
const FEW: usize = 24;

impl History {
    /// One more; the oldest is forgotten where there are too many.
    pub fn add(&mut self, entry: Entry) {
        if self.entries.len() == KEPT {
            self.entries.pop_front();
        }
        self.entries.push_back(entry);
    }

    /// From now on, something else is measured.
    pub fn clear(&mut self) {
        self.entries.clear();
    }

    /// Values from the oldest to the newest.
    fn values(&self, of: impl Fn(&Entry) -> Option<f64>) -> Vec<f64> {
        self.entries.iter().filter_map(of).collect()
    }
}

/// The end of a scale that holds `greatest`: 1, 2 or 5 times a power of ten, a little above.
fn end_of_scale(greatest: f64) -> f64 {
    if !(greatest.is_finite() && greatest > 0.0) {
        return 1.0;
    }
    let wanted = 1.05 * greatest;
    let power = 10f64.powf(wanted.log10().floor());
    let steps = [1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
    steps.into_iter().map(|step| step * power).find(|end| *end >= wanted).unwrap_or(10.0 * power)
}

/// A number with about three digits that count.
pub fn short(value: f64) -> String {
    match value.abs() {
        100.0.. => format!("{value:.0}"),
        10.0.. => format!("{value:.1}"),
        _ => format!("{value:.2}"),
    }
}

pub const PANEL: Paint = Paint([12, 14, 18], 0.8);
pub const INK: Paint = Paint([235, 238, 242], 1.0);
pub const FAINT: Paint = Paint([235, 238, 242], 0.7);
const GRID: Paint = Paint([235, 238, 242], 0.16);
const PRIMARY: Paint = Paint([255, 196, 77], 1.0);
const SECONDARY: Paint = Paint([96, 184, 255], 1.0);
const FRAME: Paint = Paint([126, 217, 140], 1.0);

/// A line of the chart.
struct Line {
    name: &'static str,
    paint: Paint,
    values: Vec<f64>,
}

/// Draws the chart into the lower left corner of a frame, with letters of `size` pixels. Nothing where the frame is too
/// small to show any of it.
pub fn draw(frame: &mut Picture, history: &History, size: f32) {
    let (width, height) = (frame.width as i32, frame.height as i32);
    let (unit, line) = (size as i32, draw::line_height(size));
    let panel = Area {
        left: unit / 2,
        top: 0,
        width: (30 * unit).min(width - unit),
        height: (2 * (line + 5 * unit) + unit).min(height / 2),
    };
    let panel = Area { top: height - unit / 2 - panel.height, ..panel };
    if panel.width < 8 * unit || panel.height < 4 * line {
        return;
    }
    draw::fill(frame, panel, PANEL);
    let inside = panel.within(unit / 2);
    let half = inside.height / 2;
    let upper = Area { height: half - unit / 4, ..inside };
    let lower = Area { top: inside.top + half + unit / 4, ..upper };
    let rates = [
        Line { name: "primary", paint: PRIMARY, values: history.values(|e| Some(e.primary)) },
        Line { name: "secondary", paint: SECONDARY, values: history.values(|e| e.secondary) },
    ];
    plot(frame, upper, size, "MRps", &rates);
    let times = [Line { name: "frame", paint: FRAME, values: history.values(|e| Some(e.frame)) }];
    plot(frame, lower, size, "ms", &times);
}

/// One chart: a heading with the newest values, and lines from zero to the end of the scale.
fn plot(frame: &mut Picture, area: Area, size: f32, unit: &str, lines: &[Line]) {
    let heading = draw::line_height(size);
    let mut x = area.left;
    if lines.iter().all(|line| line.values.is_empty()) {
        draw::text(frame, x, area.top, size, FAINT, &format!("no {unit} yet: no light was traced"));
    }
    for line in lines.iter().filter(|line| !line.values.is_empty()) {
        let newest = line.values.last().copied().unwrap_or_default();
        let text = format!("{} {} {unit}", line.name, short(newest));
        draw::text(frame, x, area.top, size, line.paint, &text);
        x += draw::text_width(size, &text) + size as i32;
    }
    let field = Area { top: area.top + heading, height: area.height - heading, ..area };
    let greatest = lines.iter().flat_map(|line| &line.values).copied().fold(0.0, f64::max);
    let end = end_of_scale(greatest);
    // The scale stands at the right, outside the field: its end above, zero below.
    let label = draw::text_width(size, "00000") + size as i32 / 3;
    let field = Area { width: field.width - label, ..field };
    let beside = field.left + field.width + size as i32 / 3;
    let small = 0.85 * size;
    draw::text(frame, beside, field.top - 2, small, FAINT, &short(end));
    draw::text(frame, beside, field.top + field.height - draw::line_height(small) + 2, small, FAINT, "0");
    for share in [0.0, 0.5, 1.0] {
        let top = field.top + ((field.height - 1) as f32 * share) as i32;
        draw::fill(frame, Area { top, height: 1, ..field }, GRID);
    }
    for line in lines {
        draw::curve(frame, &points(&line.values, field, end), (size / 8.0).round().max(2.0), line.paint);
    }
}

/// Where values lie in a field for values up to `end`: the newest at its right edge, and the oldest at the left one where
/// they are not very few.
fn points(values: &[f64], field: Area, end: f64) -> Vec<(f32, f32)> {
    let step = field.width as f32 / (values.len().max(FEW) - 1) as f32;
    let right = (field.left + field.width) as f32;
    let at = |(age, value): (usize, &f64)| {
        let share = (value / end).clamp(0.0, 1.0) as f32;
        let bottom = (field.top + field.height - 1) as f32;
        // On the grid of pixels, where a level line is sharp.
        (right - step * age as f32, (bottom - share * (field.height - 2) as f32).round())
    };
    let mut points: Vec<_> = values.iter().rev().enumerate().map(at).collect();
    points.reverse();
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracer::path::WaveTime;

    fn entry(primary: f64) -> Entry {
        Entry { primary, secondary: Some(primary / 2.0), frame: 10.0 }
    }

    #[test]
    fn rates_are_rays_over_the_time_of_their_kernels() {
        let wave = |rays, milliseconds| WaveTime { rays, milliseconds };
        let sample = path::Sample {
            waves: vec![wave(64_000, 2.0), wave(50_000, 10.0), wave(10_000, 5.0)],
            milliseconds: 25.0,
        };
        let expected = Entry { primary: 32.0, secondary: Some(4.0), frame: 25.0 };
        assert_eq!(Entry::of(&sample), Some(expected));
        let primary = path::Sample { waves: vec![wave(64_000, 2.0)], milliseconds: 3.0 };
        assert_eq!(Entry::of(&primary).unwrap().secondary, None);
        assert_eq!(Entry::of(&path::Sample { waves: vec![], milliseconds: 3.0 }), None);
        let none = path::Sample { waves: vec![wave(5, 0.0)], milliseconds: 3.0 };
        assert_eq!(Entry::of(&none), None);
    }

    #[test]
    fn the_oldest_is_forgotten() {
        let mut history = History::default();
        for i in 0..KEPT + 5 {
            history.add(entry(i as f64));
        }
        let values = history.values(|e| Some(e.primary));
        assert_eq!((values.len(), values[0], values[KEPT - 1]), (KEPT, 5.0, (KEPT + 4) as f64));
        history.clear();
        assert!(history.values(|e| e.secondary).is_empty());
    }

    #[test]
    fn scales_end_above_what_they_hold() {
        for (greatest, end) in
            [(0.9, 1.0), (1.0, 1.5), (7.0, 8.0), (96.0, 150.0), (1234.0, 1500.0), (0.013, 0.015)]
        {
            assert!(
                (end_of_scale(greatest) / end - 1.0).abs() < 1e-9,
                "{greatest}: {}",
                end_of_scale(greatest)
            );
        }
        for nothing in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(end_of_scale(nothing), 1.0);
        }
        assert_eq!([short(0.123), short(12.34), short(1234.5)], ["0.12", "12.3", "1234"]);
    }

    #[test]
    fn the_newest_value_is_at_the_right_and_great_ones_are_high() {
        let field = Area { left: 10, top: 20, width: 46, height: 50 };
        let many = points(&[1.0; 100], field, 10.0);
        assert!((many[0].0 - 10.0).abs() < 1e-3 && (many[99].0 - 56.0).abs() < 1e-3);
        let points = points(&[0.0, 5.0, 10.0], field, 10.0);
        assert_eq!(points, [(52.0, 69.0), (54.0, 45.0), (56.0, 21.0)]);
    }

    #[test]
    fn a_chart_shows_its_lines_and_fits_its_frame() {
        let shown = |width: usize, height: usize, samples: usize| {
            let mut frame = Picture { width, height, pixels: vec![[128; 3]; width * height] };
            let mut history = History::default();
            (0..samples).for_each(|_| history.add(entry(3.0)));
            draw(&mut frame, &history, 13.0);
            frame
        };
        let full = shown(640, 400, 100);
        for paint in [PRIMARY, SECONDARY, FRAME] {
            let count = full.pixels.iter().filter(|p| **p == paint.0).count();
            assert!(count >= 200, "{count} pixels of {paint:?}");
        }
        assert!(full.pixels[..640 * 200].iter().all(|p| *p == [128; 3]), "the upper half is left alone");
        assert_ne!(shown(640, 400, 0).pixels, vec![[128; 3]; 640 * 400], "an empty chart is a chart");
        for (width, height) in [(1, 1), (60, 40), (4000, 10), (10, 4000)] {
            assert!(shown(width, height, 5).pixels.iter().all(|p| *p == [128; 3]), "{width}×{height}");
        }
    }
}
