//! What is drawn over the picture: boxes, lines and words.

use crate::picture::Picture;
use ab_glyph::{Font, FontRef, Glyph, PxScale, ScaleFont, point};
use std::sync::LazyLock;

/// The font of `compare`'s charts.
static FONT: LazyLock<FontRef<'static>> = LazyLock::new(|| {
    let bytes: &'static [u8] = include_bytes!("../../../compare/fonts/Roboto-Regular.ttf");
    FontRef::try_from_slice(bytes).expect("a test holds that it is a font")
});

/// A colour in sRGB and how much of it covers what is below, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paint(pub [u8; 3], pub f32);

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Area {
    pub left: i32,
    pub top: i32,
    pub width: i32,
    pub height: i32,
}

impl Area {
    /// What is left within margins of so many pixels.
    pub fn within(self, margin: i32) -> Self {
        Self {
            left: self.left + margin,
            top: self.top + margin,
            width: (self.width - 2 * margin).max(0),
            height: (self.height - 2 * margin).max(0),
        }
    }
}

fn blend(picture: &mut Picture, x: i32, y: i32, Paint(colour, cover): Paint) {
    let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
    if x < picture.width && y < picture.height {
        let below = &mut picture.pixels[y * picture.width + x];
        for (below, above) in below.iter_mut().zip(colour) {
            let mixed = f32::from(*below) + cover.clamp(0.0, 1.0) * (f32::from(above) - f32::from(*below));
            *below = mixed.round() as u8;
        }
    }
}

/// Paints a rectangle; parts outside the picture are left out.
pub fn fill(picture: &mut Picture, area: Area, paint: Paint) {
    let clip = |from: i32, length: i32, limit: usize| {
        from.max(0)..from.saturating_add(length).min(i32::try_from(limit).unwrap_or(i32::MAX))
    };
    for y in clip(area.top, area.height, picture.height) {
        for x in clip(area.left, area.width, picture.width) {
            blend(picture, x, y, paint);
        }
    }
}

/// Draws a line of points from left to right, `thickness` pixels thick; each column is covered once.
pub fn curve(picture: &mut Picture, points: &[(f32, f32)], thickness: f32, paint: Paint) {
    for pair in points.windows(2) {
        let [(x0, y0), (x1, y1)] = [pair[0], pair[1]];
        for x in (x0.ceil() as i32)..=(x1.ceil() as i32 - 1).max(x0.ceil() as i32) {
            // The part of the line within half a pixel of the column's middle, and half the thickness around it.
            let at = |x: f32| y0 + (y1 - y0) * ((x - x0) / (x1 - x0).max(1e-6)).clamp(0.0, 1.0);
            let (a, b) = (at(x as f32 - 0.5), at(x as f32 + 0.5));
            let (low, high) = (a.min(b) - thickness / 2.0, a.max(b) + thickness / 2.0);
            for y in low.floor() as i32..=high.ceil() as i32 {
                let cover = (high.min(y as f32 + 1.0) - low.max(y as f32)).clamp(0.0, 1.0);
                blend(picture, x, y, Paint(paint.0, paint.1 * cover));
            }
        }
    }
}

/// Writes a line of text, letters of `size` pixels, whose upper left corner is there.
pub fn text(picture: &mut Picture, left: i32, top: i32, size: f32, paint: Paint, text: &str) {
    let baseline = top as f32 + FONT.as_scaled(size).ascent();
    each_glyph(size, text, |glyph, x| {
        let mut glyph = glyph;
        glyph.position = point(left as f32 + x, baseline);
        if let Some(outline) = FONT.outline_glyph(glyph) {
            let bounds = outline.px_bounds();
            outline.draw(|x, y, cover| {
                let (x, y) = (bounds.min.x as i32 + x as i32, bounds.min.y as i32 + y as i32);
                blend(picture, x, y, Paint(paint.0, paint.1 * cover));
            });
        }
    });
}

/// How many pixels wide a line of text is.
pub fn text_width(size: f32, text: &str) -> i32 {
    each_glyph(size, text, |_, _| ()).ceil() as i32
}

/// How many pixels further down the next line of text begins.
pub fn line_height(size: f32) -> i32 {
    FONT.as_scaled(size).height().ceil() as i32
}

/// Calls `each` with every letter and where it begins; where the text ends.
fn each_glyph(size: f32, text: &str, mut each: impl FnMut(Glyph, f32)) -> f32 {
    let font = FONT.as_scaled(PxScale::from(size));
    let (mut x, mut last) = (0.0, None);
    for letter in text.chars() {
        let id = font.glyph_id(letter);
        if let Some(last) = last {
            x += font.kern(last, id);
        }
        each(id.with_scale(font.scale()), x);
        x += font.h_advance(id);
        last = Some(id);
    }
    x
}

/// Copies a picture into the middle of a frame, every pixel of it a square of the same whole number of pixels, as large
/// as it fits; a picture that is larger than the frame loses its edges. The rest of the frame stays as it is.
pub fn place(frame: &mut Picture, picture: &Picture) {
    let zoom = (frame.width / picture.width.max(1)).min(frame.height / picture.height.max(1)).max(1);
    let begin = |frame: usize, picture: usize| (frame as isize - (picture * zoom) as isize) / 2;
    let (left, top) = (begin(frame.width, picture.width), begin(frame.height, picture.height));
    let columns = left.max(0)..(left + (picture.width * zoom) as isize).min(frame.width as isize);
    for y in top.max(0)..(top + (picture.height * zoom) as isize).min(frame.height as isize) {
        let from = &picture.pixels[(y - top) as usize / zoom * picture.width..][..picture.width];
        let to = &mut frame.pixels[y as usize * frame.width..][..frame.width];
        for x in columns.clone() {
            to[x as usize] = from[(x - left) as usize / zoom];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn black(width: usize, height: usize) -> Picture {
        Picture { width, height, pixels: vec![[0; 3]; width * height] }
    }

    const WHITE: Paint = Paint([255; 3], 1.0);

    fn lit(picture: &Picture) -> Vec<(usize, usize)> {
        let all = picture.pixels.iter().enumerate().filter(|(_, p)| p[0] > 127);
        all.map(|(i, _)| (i % picture.width, i / picture.width)).collect()
    }

    #[test]
    fn boxes_are_clipped_and_mixed() {
        let mut picture = black(4, 3);
        fill(&mut picture, Area { left: -2, top: 1, width: 4, height: 9 }, WHITE);
        assert_eq!(lit(&picture), [(0, 1), (1, 1), (0, 2), (1, 2)]);
        fill(&mut picture, Area { left: 3, top: 0, width: 1, height: 1 }, Paint([200, 100, 0], 0.5));
        assert_eq!(picture.pixels[3], [100, 50, 0]);
        assert_eq!(Area { left: 0, top: 0, width: 5, height: 9 }.within(3).width, 0);
    }

    #[test]
    fn a_curve_goes_through_its_points_and_has_no_gaps() {
        let mut picture = black(20, 30);
        curve(&mut picture, &[(2.0, 5.0), (6.0, 5.0), (9.0, 25.0), (17.0, 10.0)], 2.0, WHITE);
        let lit = lit(&picture);
        assert!(lit.contains(&(3, 5)) && lit.contains(&(9, 24)));
        for x in 2..17 {
            assert!(lit.iter().any(|p| p.0 == x), "column {x} is empty");
        }
        assert!(lit.iter().all(|p| (2..=17).contains(&p.0)));
        // The level part is as thick as it was asked for.
        assert_eq!(lit.iter().filter(|p| p.0 == 4).count(), 2);
        // What is outside is left out.
        curve(&mut picture, &[(-5.0, -5.0), (40.0, 90.0)], 2.0, WHITE);
    }

    #[test]
    fn words_are_as_wide_as_they_say() {
        let mut picture = black(100, 30);
        text(&mut picture, 10, 4, 16.0, WHITE, "MRps 12");
        let width = text_width(16.0, "MRps 12");
        let lit = lit(&picture);
        assert!(lit.len() > 50, "{} pixels", lit.len());
        let (left, right) = (lit.iter().map(|p| p.0).min().unwrap(), lit.iter().map(|p| p.0).max().unwrap());
        assert!((10..14).contains(&left), "{left}");
        assert!(right < 10 + width as usize && right > 6 + width as usize, "{right} of {width}");
        assert!(lit.iter().all(|p| p.1 >= 4 && p.1 < 4 + line_height(16.0) as usize));
        assert!(text_width(16.0, "WW") > text_width(16.0, "ii"));
        assert_eq!(text_width(16.0, ""), 0);
        text(&mut picture, 95, -8, 16.0, WHITE, "beyond every edge");
    }

    #[test]
    fn a_picture_is_enlarged_by_whole_numbers_in_the_middle() {
        let picture = Picture { width: 2, height: 1, pixels: vec![[10; 3], [20; 3]] };
        let mut frame = black(7, 5);
        place(&mut frame, &picture);
        // Three times as large: six of seven columns, three of five rows.
        assert_eq!(frame.pixels[7..14], [10, 10, 10, 20, 20, 20, 0].map(|x| [x; 3]));
        assert_eq!(frame.pixels[..7], [[0; 3]; 7]);
        assert_eq!(frame.pixels[28..], [[0; 3]; 7]);
        let mut small = black(1, 1);
        place(&mut small, &Picture { width: 3, height: 1, pixels: vec![[1; 3], [2; 3], [3; 3]] });
        assert_eq!(small.pixels, [[2; 3]]);
    }
}
