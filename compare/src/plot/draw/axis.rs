//! Where values are on an axis, and what is written beside it.

use crate::plot::chart::{Axis, Scale};

/// The part of an axis that is drawn, with its ticks.
#[derive(Clone, Debug, PartialEq)]
pub struct Range {
    scale: Scale,
    /// The ends, after the logarithm where the scale has one.
    ends: [f64; 2],
    /// Stands in for 0 where the scale has a logarithm.
    zero: f64,
    /// Values with what is written there.
    pub ticks: Vec<(f64, String)>,
}

impl Range {
    /// The part of a linear axis that has these values, with about so many ticks and ends on ticks.
    pub fn linear(values: impl IntoIterator<Item = f64>, count: usize) -> Range {
        Range::new(
            &Axis {
                title: String::new(),
                scale: Scale::Linear,
                ticks: Vec::new(),
                names: Vec::new(),
                includes: Vec::new(),
            },
            values,
            count,
            true,
        )
    }

    /// The part of an axis that has these values; `whole` if it is to end on ticks.
    pub fn new(axis: &Axis, values: impl IntoIterator<Item = f64>, count: usize, whole: bool) -> Range {
        let mut values: Vec<f64> =
            values.into_iter().chain(axis.includes.iter().copied()).filter(|v| v.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        let mut range = match axis.scale {
            Scale::Linear => linear(&values, &axis.ticks, count, whole),
            Scale::Logarithmic => logarithmic(&values, &axis.ticks),
        };
        for ((_, text), name) in range.ticks.iter_mut().zip(&axis.names) {
            text.clone_from(name);
        }
        range
    }

    /// Where a value is: 0 at the beginning, 1 at the end.
    pub fn share(&self, value: f64) -> f64 {
        let [from, to] = self.ends;
        let place = match self.scale {
            Scale::Linear => value,
            Scale::Logarithmic if value > 0.0 => value.ln(),
            Scale::Logarithmic => self.zero,
        };
        ((place - from) / (to - from)).clamp(-0.5, 1.5)
    }
}

fn linear(values: &[f64], ticks: &[f64], count: usize, whole: bool) -> Range {
    let (mut from, mut to) = match values {
        [] => (0.0, 1.0),
        [only] => (*only, *only),
        [first, .., last] => (*first, *last),
    };
    let size = from.abs().max(to.abs());
    if to - from <= size * 1e-9 {
        // Values that are all the same are in the middle, and what little they differ is not blown up.
        let around = if size > 0.0 { size * 0.02 } else { 0.5 };
        (from, to) = (from - around, to + around);
    }
    let step = step(to - from, count);
    if whole {
        from = (from / step + 1e-9).floor() * step;
        to = (to / step - 1e-9).ceil() * step;
    }
    let ticks = if ticks.is_empty() {
        steps(from, to, step).into_iter().map(|tick| (tick, written(tick, step))).collect()
    } else {
        ticks.iter().map(|&tick| (tick, short(tick))).collect()
    };
    Range { scale: Scale::Linear, ends: [from, to], zero: 0.0, ticks }
}

fn logarithmic(values: &[f64], ticks: &[f64]) -> Range {
    let positive: Vec<f64> = values.iter().copied().filter(|&value| value > 0.0).collect();
    let (least, most) = match positive[..] {
        [] => (1.0, 10.0),
        [only] => (only / 2.0, only * 2.0),
        [first, .., last] if last > first => (first, last),
        [first, ..] => (first / 2.0, first * 2.0),
    };
    let next = positive.iter().copied().find(|&value| value > least).unwrap_or(2.0 * least);
    let zero = least.ln() - (next / least).ln();
    let from = if values.first().is_some_and(|&first| first <= 0.0) { zero } else { least.ln() };
    let ticks = if ticks.is_empty() {
        let inside = |tick: &f64| (least * 0.999..=most * 1.001).contains(tick);
        let decades = (least.log10().floor() as i32)..=(most.log10().ceil() as i32);
        let at = |factors: &[f64]| -> Vec<f64> {
            let all = decades.clone().flat_map(|decade| factors.iter().map(move |f| f * 10f64.powi(decade)));
            all.filter(inside).collect()
        };
        let found = [&[1.0][..], &[1.0, 3.0], &[1.0, 2.0, 5.0], &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0]]
            .map(at)
            .into_iter()
            .find(|ticks| ticks.len() >= 4);
        // Where hardly a decade is to be seen, steps are as good as factors.
        found.unwrap_or_else(|| steps(least, most, step(most - least, 4)))
    } else {
        ticks.to_vec()
    };
    let ticks = ticks.into_iter().map(|tick| (tick, short(tick))).collect();
    Range { scale: Scale::Logarithmic, ends: [from, most.ln()], zero, ticks }
}

/// The multiples of a step from one value to another.
fn steps(from: f64, to: f64, step: f64) -> Vec<f64> {
    let first = (from / step - 1e-9).ceil() as i64;
    let last = (to / step + 1e-9).floor() as i64;
    (first..=last).map(|n| n as f64 * step).collect()
}

/// 1, 2 or 5 with zeros: about so many of them are in the span.
fn step(span: f64, count: usize) -> f64 {
    let raw = span / count.max(1) as f64;
    let decade = 10f64.powf(raw.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .map(|factor| factor * decade)
        .into_iter()
        .find(|step| *step >= raw * 0.999)
        .unwrap_or(raw)
}

/// A tick's number with as many decimals as its step has.
fn written(tick: f64, step: f64) -> String {
    let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    let tick = if tick.abs() < step / 2.0 { 0.0 } else { tick };
    if tick.abs() >= 1e4 { short(tick) } else { minus(format!("{tick:.decimals$}")) }
}

/// A number with as few letters as tell it: thousands are k, millions M.
pub fn short(number: f64) -> String {
    for (size, letter) in [(1e9, "G"), (1e6, "M"), (1e4, "k")] {
        if number.abs() >= size {
            let unit = if letter == "k" { 1e3 } else { size };
            return format!("{}{letter}", plain(number / unit));
        }
    }
    plain(number)
}

/// Three digits that count, and no zeros at the end.
fn plain(number: f64) -> String {
    let magnitude = if number == 0.0 { 0.0 } else { number.abs().log10().floor() };
    let decimals = (2.0 - magnitude).clamp(0.0, 9.0) as usize;
    let text = format!("{number:.decimals$}");
    minus(if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text })
}

/// A sign as it is printed, in place of a hyphen.
fn minus(text: String) -> String {
    text.replacen('-', "\u{2212}", 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(range: &Range) -> Vec<&str> {
        range.ticks.iter().map(|(_, text)| text.as_str()).collect()
    }

    fn axis(scale: Scale, ticks: &[f64]) -> Axis {
        Axis { title: String::new(), scale, ticks: ticks.to_vec(), names: Vec::new(), includes: Vec::new() }
    }

    #[test]
    fn ticks_are_round_numbers() {
        assert_eq!(texts(&Range::linear([0.0, 1.74], 4)), ["0.0", "0.5", "1.0", "1.5", "2.0"]);
        assert_eq!(texts(&Range::linear([-12.0, 31.0], 4)), ["−20", "0", "20", "40"]);
        assert_eq!(texts(&Range::linear([0.0, 30_000.0], 3)), ["0", "10k", "20k", "30k"]);
    }

    #[test]
    fn odd_values_have_an_axis_too() {
        for values in [&[][..], &[0.0], &[3.0, 3.0], &[f64::NAN, f64::INFINITY], &[-1.0, 0.0]] {
            for scale in [Scale::Linear, Scale::Logarithmic] {
                let range = Range::new(&axis(scale, &[]), values.iter().copied(), 4, true);
                assert!(range.ticks.len() >= 2, "{values:?} {range:?}");
                assert!(range.share(0.0).is_finite() && range.share(f64::MAX).is_finite(), "{values:?}");
            }
        }
    }

    #[test]
    fn a_logarithm_has_a_place_for_zero() {
        let values = [0.0, 1.0, 2.0, 4.0, 8.0];
        let range = Range::new(&axis(Scale::Logarithmic, &values), values, 4, false);
        let places: Vec<f64> = values.iter().map(|&value| range.share(value)).collect();
        assert!(
            places.iter().zip([0.0, 0.25, 0.5, 0.75, 1.0]).all(|(a, b)| (a - b).abs() < 1e-9),
            "{places:?}"
        );
        assert_eq!(texts(&range), ["0", "1", "2", "4", "8"]);
        let decades = Range::new(&axis(Scale::Logarithmic, &[]), [1e3, 2e7], 4, false);
        assert_eq!(texts(&decades), ["1000", "10k", "100k", "1M", "10M"]);
    }
}
