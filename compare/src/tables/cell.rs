//! One cell of a table.

use std::fmt;

/// What stands for a value that the record does not have.
pub const GAP: &str = "–";

/// A value, what it is relative to another, and whether it stands out.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// The value.
    pub content: Content,
    /// The value as a multiple of a reference; stands in parentheses after it.
    pub relative: Option<f64>,
    /// Whether it stands out.
    pub emphasis: Emphasis,
}

/// What a cell holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// Nothing, because there is nothing to say: not a gap.
    Nothing,
    /// A value that the record does not have.
    Gap,
    /// Words.
    Text(String),
    /// A number, and how many digits after the point are shown.
    Number(f64, usize),
    /// Two numbers that are added, such as the times of two stages, with so many digits after the point.
    Sum(f64, f64, usize),
}

/// How a cell stands out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Emphasis {
    /// It does not.
    #[default]
    Plain,
    /// The best, or what was chosen.
    Best,
    /// One to look at, because it is bad.
    Poor,
}

impl Cell {
    /// Nothing.
    pub fn nothing() -> Cell {
        Content::Nothing.into()
    }

    /// Words.
    pub fn text(text: impl fmt::Display) -> Cell {
        Content::Text(text.to_string()).into()
    }

    /// A number with so many digits after the point, or a gap.
    pub fn number(value: Option<f64>, decimals: usize) -> Cell {
        value.map_or(Content::Gap, |value| Content::Number(value, decimals)).into()
    }

    /// The same with what it is relative to another.
    pub fn relative(self, relative: Option<f64>) -> Cell {
        Cell { relative, ..self }
    }

    /// The same, standing out.
    pub fn with(self, emphasis: Emphasis) -> Cell {
        Cell { emphasis, ..self }
    }

    /// The same, standing out if that is so.
    pub fn with_if(self, condition: bool, emphasis: Emphasis) -> Cell {
        if condition { self.with(emphasis) } else { self }
    }
}

impl From<Content> for Cell {
    fn from(content: Content) -> Cell {
        Cell { content, relative: None, emphasis: Emphasis::Plain }
    }
}

impl fmt::Display for Cell {
    /// Without markup.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.content {
            Content::Nothing => {}
            Content::Gap => out.write_str(GAP)?,
            Content::Text(text) => out.write_str(text)?,
            Content::Number(value, decimals) => write!(out, "{value:.decimals$}")?,
            Content::Sum(first, second, decimals) => write!(out, "{first:.decimals$} + {second:.decimals$}")?,
        }
        match self.relative {
            Some(relative) => write!(out, " ({relative:.2})"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_print_as_the_thesis_prints_them() {
        let sum = Cell::from(Content::Sum(2.2, 12.6, 1)).relative(Some(1.2749));
        let cells = [sum, Cell::number(Some(1772.4), 0), Cell::number(None, 1), Cell::nothing()];
        assert_eq!(cells.map(|cell| cell.to_string()), ["2.2 + 12.6 (1.27)", "1772", "–", ""]);
    }
}
