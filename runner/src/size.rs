//! The size of a picture.

use std::str::FromStr;

/// Width and height of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    pub width: u32,
    pub height: u32,
}

impl FromStr for Size {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text:?} is no picture size; write WIDTHxHEIGHT, such as 1920x1080");
        let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
        let size = Self {
            width: width.trim().parse().map_err(|_| wrong())?,
            height: height.trim().parse().map_err(|_| wrong())?,
        };
        // Pixels along the Z-order curve are numbered with 16 bits an axis.
        if (1..=32768).contains(&size.width) && (1..=32768).contains(&size.height) {
            Ok(size)
        } else {
            Err(format!("{text:?}: each side must be between 1 and 32768 pixels"))
        }
    }
}
