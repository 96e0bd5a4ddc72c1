//! Sums of radiance and costs become PNG files.

use anyhow::Context;
use rayon::prelude::*;
use std::{fs::File, io::BufWriter, path::Path};

/// Eight-bit sRGB, row by row from the top.
pub struct Picture {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<[u8; 3]>,
}

impl Picture {
    /// Tone-maps sums of `samples` samples: exposure in stops, a filmic shoulder, the sRGB curve.
    pub fn tone_mapped(sums: &[[f32; 4]], width: usize, samples: u32, exposure: f32) -> Self {
        let scale = exposure.exp2() / samples as f32;
        let pixels =
            sums.par_iter().map(|p| [p[0], p[1], p[2]].map(|x| to_srgb(shoulder(x * scale)))).collect();
        Self { width, height: sums.len() / width, pixels }
    }

    /// A cost a pixel in false colours, with a scale below.
    pub fn heat_map(costs: &[u32], width: usize) -> (Self, Scale) {
        let (mut picture, scale) = Self::false_colours(costs, width);
        let (height, pixels) = (picture.height, &mut picture.pixels);
        let (strip, digits) = ((height / 24).clamp(8, 24), (height / 60).clamp(1, 4));
        // The scale: a black line, the colours from 0 to the upper end, and the numbers at both ends.
        pixels.extend(std::iter::repeat_n([0; 3], width));
        for _ in 0..strip.max(7 * digits + 2) {
            pixels.extend((0..width).map(|x| heat(x as f32 / (width - 1).max(1) as f32)));
        }
        picture.height = picture.pixels.len() / width;
        let top = height + 1;
        picture.write_number(0, 2, top, digits, [255; 3]);
        let text = scale.upper.to_string();
        let left = width.saturating_sub(text.len() * 4 * digits + 2);
        picture.write_number(scale.upper, left, top, digits, [0; 3]);
        (picture, scale)
    }

    /// A cost a pixel in false colours. Their upper end is the cost that one pixel in a hundred exceeds, so that a few
    /// outliers do not darken the rest.
    pub fn false_colours(costs: &[u32], width: usize) -> (Self, Scale) {
        let mut sorted = costs.to_vec();
        sorted.sort_unstable();
        let at = |share: f64| sorted.get((share * (sorted.len() - 1) as f64) as usize).copied().unwrap_or(0);
        let scale = Scale {
            least: at(0.0),
            median: at(0.5),
            upper: at(0.99).max(1),
            greatest: at(1.0),
            mean: costs.iter().map(|&c| f64::from(c)).sum::<f64>() / costs.len() as f64,
        };
        let pixels = costs.par_iter().map(|&c| heat(c as f32 / scale.upper as f32)).collect();
        (Self { width, height: costs.len() / width, pixels }, scale)
    }

    /// Draws a number with three by five dots a digit, each `size` pixels wide.
    fn write_number(&mut self, number: u32, left: usize, top: usize, size: usize, colour: [u8; 3]) {
        // A digit's rows from the top, three bits each.
        const DIGITS: [u16; 10] = [
            0b111_101_101_101_111,
            0b010_110_010_010_111,
            0b111_001_111_100_111,
            0b111_001_111_001_111,
            0b101_101_111_001_001,
            0b111_100_111_001_111,
            0b111_100_111_101_111,
            0b111_001_010_010_010,
            0b111_101_111_101_111,
            0b111_101_111_001_111,
        ];
        for (place, digit) in number.to_string().bytes().enumerate() {
            let dots = DIGITS[usize::from(digit - b'0')];
            for (y, x) in (0..5 * size).flat_map(|y| (0..3 * size).map(move |x| (y, x))) {
                let (row, column) = (top + y, left + place * 4 * size + x);
                let lit = dots >> (14 - (y / size) * 3 - x / size) & 1 == 1;
                if lit && row < self.height && column < self.width {
                    self.pixels[row * self.width + column] = colour;
                }
            }
        }
    }

    /// Writes a PNG, whole or not at all.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> anyhow::Result<()> {
        let cannot = || format!("cannot write {}", path.display());
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder).with_context(cannot)?;
        let temporary = tempfile::Builder::new().suffix(".png").tempfile_in(folder).with_context(cannot)?;
        self.encode(temporary.as_file()).with_context(cannot)?;
        let file = temporary.persist(path).map_err(|e| e.error).with_context(cannot)?;
        // Temporary files are private; a picture is not.
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            file.set_permissions(std::fs::Permissions::from_mode(0o644)).with_context(cannot)?;
        }
        Ok(())
    }

    fn encode(&self, file: &File) -> Result<(), png::EncodingError> {
        let mut encoder = png::Encoder::new(BufWriter::new(file), self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(self.pixels.as_flattened())?;
        writer.finish()
    }
}

/// What a heat map's colours stand for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    pub least: u32,
    pub median: u32,
    /// The brightest colour and all above it.
    pub upper: u32,
    pub greatest: u32,
    pub mean: f64,
}

/// Leaves dark and middle tones nearly as they are and rolls off towards 1 (the curve of Narkowicz 2015).
fn shoulder(x: f32) -> f32 {
    let x = x.max(0.0) * 0.8;
    (x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)).clamp(0.0, 1.0)
}

fn to_srgb(x: f32) -> u8 {
    let encoded = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0 + 0.5) as u8
}

/// Black, violet, red, orange, yellow, white: brightness grows evenly, also for the colour-blind and in
/// grey.
pub fn heat(x: f32) -> [u8; 3] {
    const STOPS: [[f32; 3]; 6] = [
        [0.0, 0.0, 4.0],
        [66.0, 10.0, 104.0],
        [147.0, 38.0, 103.0],
        [221.0, 81.0, 58.0],
        [252.0, 165.0, 10.0],
        [252.0, 255.0, 164.0],
    ];
    let place = x.clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
    let low = (place as usize).min(STOPS.len() - 2);
    std::array::from_fn(|k| {
        let (a, b) = (STOPS[low][k], STOPS[low + 1][k]);
        (a + (b - a) * (place - low as f32) + 0.5) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_stays_black_and_more_light_is_never_darker() {
        let sums: Vec<[f32; 4]> = (0..200).map(|i| [i as f32 * 0.1; 4]).collect();
        let picture = Picture::tone_mapped(&sums, 200, 2, 0.0);
        assert_eq!(picture.pixels[0], [0; 3]);
        assert!(picture.pixels.is_sorted());
        assert!(picture.pixels[199][0] > 240);
        // Twice the samples with twice the light are the same picture; a stop more is not.
        let doubled: Vec<_> = sums.iter().map(|p| p.map(|x| 2.0 * x)).collect();
        assert_eq!(Picture::tone_mapped(&doubled, 200, 4, 0.0).pixels, picture.pixels);
        assert!(Picture::tone_mapped(&sums, 200, 2, 1.0).pixels[20] > picture.pixels[20]);
    }

    #[test]
    fn a_heat_map_carries_its_scale() {
        let costs: Vec<u32> = (0..100 * 60).map(|i| i / 60).collect();
        let (picture, scale) = Picture::heat_map(&costs, 100);
        assert_eq!((scale.least, scale.greatest), (0, 99));
        assert!((scale.mean - 49.5).abs() < 1e-9);
        assert!(picture.height > 60, "the scale lies below");
        assert_eq!(picture.pixels.len(), picture.width * picture.height);
        assert_eq!(picture.pixels[0], heat(0.0));
        assert_eq!(picture.pixels[100 * 60 - 1], heat(1.0));
    }

    #[test]
    fn a_written_picture_reads_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/p.png");
        let picture = Picture { width: 2, height: 1, pixels: vec![[1, 2, 3], [250, 128, 0]] };
        picture.write(&path).unwrap();
        let file = std::io::BufReader::new(File::open(&path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        assert_eq!(bytes, [1, 2, 3, 250, 128, 0]);
        assert!(Picture { pixels: vec![], ..picture }.write(folder.path()).is_err());
    }
}
