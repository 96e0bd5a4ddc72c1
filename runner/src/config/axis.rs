//! Axes: parameters that are varied, and how their values meet.

use super::{
    document::{AxisEntry, RangeEntry},
    source::Mistakes,
    value,
    when::When,
};
use record::Value;
use serde_json::json;
use toml::Spanned;

/// A range gives at most so many values; more would be a slip of the step.
const MOST_VALUES: usize = 1000;

/// A parameter that is varied.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Its dotted name.
    pub parameter: String,
    /// At least one.
    pub values: Vec<Value>,
    /// Axes with the same word walk together, and have equally many values.
    pub zip: Option<String>,
    /// Where it is varied.
    pub when: When,
}

impl Axis {
    /// Reads an entry; what is wrong with it is noted.
    pub fn read(entry: &Spanned<AxisEntry>, mistakes: &mut Mistakes) -> Self {
        let span = entry.span();
        let entry = entry.get_ref();
        let parameter = entry.parameter.get_ref().clone();
        let listed = match (&entry.values, &entry.range) {
            (Some(values), None) => {
                values.get_ref().iter().map(|value| (value.span(), value.get_ref().clone())).collect()
            }
            (None, Some(range)) => match expand(range.get_ref()) {
                Ok(values) => values.into_iter().map(|value| (range.span(), value)).collect(),
                Err(message) => {
                    mistakes.add(range.span(), message);
                    Vec::new()
                }
            },
            (Some(_), Some(range)) => {
                mistakes.add(range.span(), "an axis has either `values` or `range`, not both");
                Vec::new()
            }
            (None, None) => {
                mistakes.add(span, format_args!("the axis {parameter} needs `values` or `range`"));
                Vec::new()
            }
        };
        let mut values = Vec::new();
        for (span, value) in listed {
            match value::of(&parameter, &value) {
                Ok(value) => values.push(value),
                Err(error) => mistakes.add(span, error),
            }
        }
        let zip = entry.zip.as_ref().map(|zip| zip.get_ref().clone());
        Self { parameter, values, zip, when: When::read(entry.when.as_ref(), mistakes) }
    }
}

/// The values of a range.
fn expand(range: &RangeEntry) -> Result<Vec<serde_json::Value>, String> {
    let &RangeEntry { from, to, step, factor } = range;
    if !(from.is_finite() && to.is_finite()) {
        return Err("both ends are finite numbers".into());
    }
    if from > to {
        return Err(format!("`from` ({from}) is more than `to` ({to})"));
    }
    // A little more, so that rounding loses no last value.
    let slack = 1e-9;
    let (steps, at): (f64, Box<dyn Fn(f64) -> f64>) = match (step, factor) {
        (Some(step), None) if step > 0.0 => {
            ((to - from) / step * (1.0 + slack), Box::new(move |i| from + i * step))
        }
        (None, Some(factor)) if factor > 1.0 && from > 0.0 => {
            ((to / from).ln() / factor.ln() + slack, Box::new(move |i| from * factor.powf(i)))
        }
        (Some(step), None) => return Err(format!("`step` is more than 0, not {step}")),
        (None, Some(factor)) if factor > 1.0 => {
            return Err(format!("`from` is more than 0 where there is a `factor`, not {from}"));
        }
        (None, Some(factor)) => return Err(format!("`factor` is more than 1, not {factor}")),
        (Some(_), Some(_)) => return Err("a range has either `step` or `factor`, not both".into()),
        (None, None) => return Err("a range needs `step` or `factor`".into()),
    };
    if steps >= MOST_VALUES as f64 {
        return Err(format!("the range has more than {MOST_VALUES} values"));
    }
    let number = |i: u32| {
        let value = at(f64::from(i));
        // Powers are not exact.
        let whole = value.round();
        let near = (value - whole).abs() <= slack * value.abs() && whole.abs() < 1e15;
        if near { json!(whole as i64) } else { json!(value) }
    };
    Ok((0..=steps as u32).map(number).collect())
}

/// Axes that walk together, in an order in which every axis comes after those that its condition is about.
///
/// # Errors
/// The number of an axis that waits for itself.
pub fn groups(axes: &[Axis]) -> Result<Vec<Vec<usize>>, usize> {
    let mut waiting: Vec<Vec<usize>> = Vec::new();
    for (index, axis) in axes.iter().enumerate() {
        let together = waiting.iter_mut().find(|group| axis.zip.is_some() && axes[group[0]].zip == axis.zip);
        match together {
            Some(group) => group.push(index),
            None => waiting.push(vec![index]),
        }
    }
    let mut ordered = Vec::new();
    while !waiting.is_empty() {
        let waits_for = |axis: &Axis, parameter: &String| axis.when.axes.contains_key(parameter);
        let free = |group: &Vec<usize>| {
            let mut others = waiting.iter().flatten();
            !others.any(|&other| group.iter().any(|&i| waits_for(&axes[i], &axes[other].parameter)))
        };
        match waiting.iter().position(free) {
            Some(next) => ordered.push(waiting.remove(next)),
            None => return Err(waiting[0][0]),
        }
    }
    Ok(ordered)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range(from: f64, to: f64, step: Option<f64>, factor: Option<f64>) -> Result<String, String> {
        let values = expand(&RangeEntry { from, to, step, factor })?;
        Ok(values.iter().map(ToString::to_string).collect::<Vec<_>>().join(" "))
    }

    #[test]
    fn ranges_hold_both_ends() {
        assert_eq!(range(0.0, 64.0, Some(16.0), None).unwrap(), "0 16 32 48 64");
        assert_eq!(range(0.0, 7.0, Some(3.0), None).unwrap(), "0 3 6");
        assert_eq!(range(5.0, 5.0, Some(3.0), None).unwrap(), "5");
        assert_eq!(range(0.5, 0.75, Some(0.125), None).unwrap(), "0.5 0.625 0.75");
        assert_eq!(range(0.0, 0.3, Some(0.1), None).unwrap().split(' ').count(), 4);
        assert_eq!(range(1.0, 4096.0, None, Some(4.0)).unwrap(), "1 4 16 64 256 1024 4096");
        assert_eq!(range(1.0, 1000.0, None, Some(10.0)).unwrap(), "1 10 100 1000");
        assert_eq!(range(1.0, 999.0, None, Some(10.0)).unwrap(), "1 10 100");
        assert!(range(0.0, 1e9, Some(1.0), None).is_err());
        assert!(range(f64::NAN, 1.0, Some(1.0), None).is_err());
        assert!(range(0.0, f64::INFINITY, Some(1.0), None).is_err());
    }

    #[test]
    fn an_axis_comes_after_those_that_its_condition_is_about() {
        let axis = |name: &str, zip: Option<&str>, after: &[&str]| Axis {
            parameter: name.into(),
            values: vec![1u32.into()],
            zip: zip.map(str::to_owned),
            when: When {
                axes: after.iter().map(|name| (String::from(*name), vec![1u32.into()])).collect(),
                ..When::default()
            },
        };
        let axes = [
            axis("a", None, &["c"]),
            axis("b", Some("z"), &[]),
            axis("c", None, &[]),
            axis("d", Some("z"), &[]),
        ];
        assert_eq!(groups(&axes), Ok(vec![vec![1, 3], vec![2], vec![0]]));
        assert_eq!(groups(&[axis("a", None, &["b"]), axis("b", None, &["a"])]), Err(0));
        assert_eq!(groups(&[axis("a", None, &["a"])]), Err(0));
    }
}
