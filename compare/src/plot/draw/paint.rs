//! From a sketch to a file.

use super::font::{self, FAMILY, LINE, MIDDLE};
use super::sketch::{Anchor, Mark, Sketch, Spot};
use crate::plot::theme::{CLASS, Tone, WIDTH};
use anyhow::Context;
use plotters::backend::{BitMapBackend, DrawingBackend, SVGBackend};
use plotters::prelude::{Color, RGBAColor, RGBColor, ShapeStyle};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontDesc, FontFamily, FontStyle, FontTransform, TextStyle};

/// Plotters counts in whole pixels; so many of them are a unit in SVG.
const FINE: u32 = 10;

/// Pixels that are a unit in PNG: 1920 of them across.
const PIXELS: u32 = 3;

/// In PNG everything is drawn so many times larger and then made smaller, or edges would be jagged.
const SMOOTH: u32 = 3;

/// What plotters makes of a text's position and size, which is not the same in both kinds of files.
#[derive(Clone, Copy)]
struct Dialect {
    /// Pixels of a unit.
    scale: f64,
    /// What is to be asked for, to get letters of size 1.
    size: f64,
    /// What `at` is of a text.
    vertical: VPos,
    /// By how much a text comes out too low, in sizes.
    low: f64,
}

/// Of SVG: the size is divided by 1.24, and "center" is half the height of small letters.
const SVG: Dialect = Dialect { scale: FINE as f64, size: 1.24, vertical: VPos::Center, low: 0.0 };

/// Of bitmaps: the size is the height of a line, and its base line is half of that below "top".
const BITMAP: Dialect =
    Dialect { scale: (PIXELS * SMOOTH) as f64, size: LINE, vertical: VPos::Top, low: LINE / 2.0 - MIDDLE };

/// The sketch as a file in SVG, which needs no other file.
pub fn svg(sketch: &Sketch) -> String {
    let [width, height] = [WIDTH, sketch.height].map(|length| (length * SVG.scale).round() as u32);
    let mut text = String::new();
    {
        let mut backend = SVGBackend::with_string(&mut text, (width, height));
        // Nothing can fail: what is drawn goes to memory, and SVG does not look into the font.
        let _ = paint(sketch, &mut backend, SVG);
        let _ = backend.present();
    }
    // The numbers inside are ten to the unit, the picture's own size is in units.
    let size = format!("width=\"{width}\" height=\"{height}\"");
    let scaled = format!("class=\"{CLASS}\" width=\"{WIDTH}\" height=\"{}\"", f64::from(height) / SVG.scale);
    text.replacen(&size, &scaled, 1)
}

/// The sketch as a file in PNG.
///
/// # Errors
/// The font cannot be drawn, or the picture cannot be encoded.
pub fn png(sketch: &Sketch) -> anyhow::Result<Vec<u8>> {
    let [width, height] = [WIDTH, sketch.height].map(|length| (length * f64::from(PIXELS)).round() as u32);
    let mut large = vec![0; (width * height * 3 * SMOOTH * SMOOTH) as usize];
    {
        let mut backend = BitMapBackend::with_buffer(&mut large, (width * SMOOTH, height * SMOOTH));
        paint(sketch, &mut backend, BITMAP)?;
    }
    let pixels = smaller(&large, width as usize, height as usize);
    encode(&pixels, width, height).context("cannot encode the picture")
}

/// Each pixel is the mean of those that it is made of.
fn smaller(large: &[u8], width: usize, height: usize) -> Vec<u8> {
    let smooth = SMOOTH as usize;
    let mut pixels = Vec::with_capacity(width * height * 3);
    for y in 0..height {
        for x in 0..width {
            for channel in 0..3 {
                let at = |dx: usize, dy: usize| {
                    ((y * smooth + dy) * width * smooth + x * smooth + dx) * 3 + channel
                };
                let sum: u32 = (0..smooth)
                    .flat_map(|dy| (0..smooth).map(move |dx| (dx, dy)))
                    .map(|(dx, dy)| u32::from(large[at(dx, dy)]))
                    .sum();
                pixels.push((sum / (SMOOTH * SMOOTH)) as u8);
            }
        }
    }
    pixels
}

fn encode(pixels: &[u8], width: u32, height: u32) -> Result<Vec<u8>, png::EncodingError> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_filter(png::Filter::Up);
    // As wide as a page's text, 170 mm: letters of ten units are then 7.5 points.
    let dots = (f64::from(width) / 0.17).round() as u32;
    encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: dots, yppu: dots, unit: png::Unit::Meter }));
    encoder.write_header()?.write_image_data(pixels)?;
    Ok(file)
}

fn paint<B: DrawingBackend>(sketch: &Sketch, backend: &mut B, dialect: Dialect) -> anyhow::Result<()> {
    font::register();
    let spot = |(x, y): Spot| ((x * dialect.scale).round() as i32, (y * dialect.scale).round() as i32);
    let paper = Mark::Rectangle { from: (0.0, 0.0), to: (WIDTH, sketch.height), tone: Tone::Paper };
    for mark in std::iter::once(&paper).chain(&sketch.marks) {
        let drawn = match mark {
            Mark::Rectangle { from, to, tone } => {
                backend.draw_rect(spot(*from), spot(*to), &ink(*tone, 1.0), true)
            }
            Mark::Area { corners, tone, cover } => {
                backend.fill_polygon(corners.iter().copied().map(spot), &ink(*tone, *cover))
            }
            Mark::Line { places, tone, width } => {
                let width = (width * dialect.scale).round().max(1.0) as u32;
                let style = ShapeStyle { color: color(*tone, 1.0), filled: false, stroke_width: width };
                backend.draw_path(places.iter().copied().map(spot), &style)
            }
            Mark::Text { at, anchor, text, size, tone, upwards } => {
                let low = dialect.low * size;
                let at = if *upwards { (at.0 - low, at.1) } else { (at.0, at.1 - low) };
                backend.draw_text(text, &style(*anchor, *size, *tone, *upwards, dialect), spot(at))
            }
        };
        drawn.map_err(|error| anyhow::anyhow!("cannot draw: {error}"))?;
    }
    Ok(())
}

fn style(anchor: Anchor, size: f64, tone: Tone, upwards: bool, dialect: Dialect) -> TextStyle<'static> {
    let size = size * dialect.size * dialect.scale;
    let transform = if upwards { FontTransform::Rotate270 } else { FontTransform::None };
    let font = FontDesc::new(FontFamily::Name(FAMILY), size, FontStyle::Normal).transform(transform);
    let across = match anchor {
        Anchor::Start => HPos::Left,
        Anchor::Middle => HPos::Center,
        Anchor::End => HPos::Right,
    };
    let color = color(tone, 1.0).to_backend_color();
    TextStyle { font, color, pos: Pos::new(across, dialect.vertical) }
}

fn ink(tone: Tone, cover: f64) -> ShapeStyle {
    ShapeStyle { color: color(tone, cover), filled: true, stroke_width: 1 }
}

fn color(tone: Tone, cover: f64) -> RGBAColor {
    let rgb = tone.light();
    RGBColor(rgb.0, rgb.1, rgb.2).mix(cover)
}
