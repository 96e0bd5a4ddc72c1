//! A picture as plain data: what is drawn, not how.

use super::theme::Look;

/// A picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Name of its file, without the ending.
    pub name: String,
    /// Its title.
    pub title: String,
    /// What else one must know to read it.
    pub note: String,
    /// What is in the legend, in its order.
    pub series: Vec<Series>,
    /// What it shows.
    pub body: Body,
}

/// One entry of a legend.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Its name.
    pub label: String,
    /// Its look.
    pub look: Look,
}

/// What a picture shows, in panels.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// Bars side by side.
    Bars(Vec<Bars>),
    /// Bars one after another.
    Stacks(Vec<Stacks>),
    /// Lines and places in a plane.
    Planes(Vec<Plane>),
}

/// Bars side by side in groups.
#[derive(Clone, Debug, PartialEq)]
pub struct Bars {
    /// What the bars are.
    pub title: String,
    /// What the axis is, with the unit.
    pub axis: String,
    /// Where bars begin.
    pub floor: f64,
    /// A line across, such as that of the reference, where it is not the floor.
    pub line: Option<f64>,
    /// The groups, from the left.
    pub groups: Vec<Group>,
}

/// Bars of one group, one a series; a gap where there is nothing to show.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Its name.
    pub label: String,
    /// Whether it sums up the others, and so stands apart.
    pub apart: bool,
    /// The bars.
    pub bars: Vec<Option<Value>>,
}

/// A value and how sure it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Value {
    /// The value.
    pub value: f64,
    /// The 95% confidence interval, where there is one.
    pub interval: Option<[f64; 2]>,
}

/// Level bars, each of several parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Stacks {
    /// What the bars are of.
    pub title: String,
    /// What the axis is, with the unit.
    pub axis: String,
    /// The bars, from the top.
    pub rows: Vec<Row>,
}

/// A bar of several parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Its name.
    pub label: String,
    /// The parts, one a series; a gap where it has none such.
    pub parts: Vec<Option<f64>>,
    /// The 95% confidence interval of the sum, where there is one.
    pub interval: Option<[f64; 2]>,
}

/// A plane with one or two axes upwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// What it shows.
    pub title: String,
    /// To the right.
    pub x: Axis,
    /// Upwards, written on the left.
    pub y: Axis,
    /// Upwards, written on the right, where there is a second one.
    pub right: Option<Axis>,
    /// What is in it, the lowermost first.
    pub curves: Vec<Curve>,
}

/// An axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// What it is, with the unit.
    pub title: String,
    /// How places follow from values.
    pub scale: Scale,
    /// Where the ticks are; anywhere if there are none.
    pub ticks: Vec<f64>,
    /// What is written at the ticks; their numbers if there is nothing.
    pub names: Vec<String>,
    /// Values that must be on it, whatever the data.
    pub includes: Vec<f64>,
}

/// How places follow from values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// In proportion.
    Linear,
    /// By the logarithm. A value of 0 stands one step before the least.
    Logarithmic,
}

/// A line with its places.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Which entry of the legend it is.
    pub series: usize,
    /// Whether it goes by the axis on the right.
    pub right: bool,
    /// The places, from the left.
    pub places: Vec<Place>,
    /// From where to where something reaches, at each x.
    pub band: Vec<(f64, [f64; 2])>,
}

/// A place in a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// To the right.
    pub x: f64,
    /// Upwards.
    pub y: Value,
}

impl Value {
    /// A value of which nobody knows how sure it is.
    pub fn bare(value: f64) -> Value {
        Value { value, interval: None }
    }
}

/// A text as a part of a file's name: small letters and digits, the rest becomes `-`.
pub fn slug(text: &str) -> String {
    let words: Vec<String> = text
        .split(|c: char| !c.is_alphanumeric())
        .filter(|word| !word.is_empty())
        .map(str::to_lowercase)
        .collect();
    words.join("-")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_are_plain() {
        assert_eq!(slug("Wide4 Quantized/CBTC"), "wide4-quantized-cbtc");
        assert_eq!(slug("../a_b"), "a-b");
        assert_eq!(slug("*"), "");
    }
}
