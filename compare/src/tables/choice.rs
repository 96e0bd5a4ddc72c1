//! Which value of an axis is best, and what the others come to.
//!
//! The rule is that of `runner best`, which is the thesis's (Cezner 2025, section 6.2.1). In each scene, the rate
//! with a value is divided by the best rate that any value has there. The value with the largest minimum over the
//! scenes is chosen, and among those that are equal to three decimals the one with the largest mean. Where several
//! axes were crossed, a value is judged by the best that the others can make of it.

use super::Input;
use super::input::Shown;
use crate::select::{Entry, in_order, text};
use crate::unreliable::unreliable;
use record::{OF_SCENE, Rays, Value};
use std::collections::BTreeMap;

/// What the values of one axis come to, for one variant.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The values, numbers in their order.
    pub values: Vec<Tried>,
    /// The place of the best one.
    pub best: usize,
    /// The scenes that were compared.
    pub scenes: Vec<String>,
}

/// Which scenes choices are of, for a caption: those of most, and the variants that have others.
pub fn scenes(choices: &[(&str, Choice)]) -> String {
    let most = choices.iter().map(|(_, choice)| &choice.scenes).max_by_key(|scenes| scenes.len());
    let Some(most) = most else { return String::new() };
    let others = in_order(choices.iter().map(|(_, choice)| &choice.scenes).filter(|scenes| *scenes != most));
    let others = others.into_iter().map(|scenes| {
        let of = in_order(choices.iter().filter(|(_, choice)| choice.scenes == *scenes).map(|(of, _)| *of));
        format!("; of {} only {}", of.join(", "), scenes.join(", "))
    });
    format!("{}{}", most.join(", "), others.collect::<String>())
}

/// What a value comes to.
#[derive(Clone, Debug, PartialEq)]
pub struct Tried {
    /// The value.
    pub value: String,
    /// Its rates relative to those of the best value, over the scenes; nothing where not all scenes have it.
    pub relative: Option<Relative>,
}

/// Rates relative to those of the best value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relative {
    /// The smallest over the scenes.
    pub minimum: f64,
    /// The mean over the scenes.
    pub mean: f64,
}

/// The rays that an axis is for.
pub fn concerned(axis: &str, otherwise: Rays) -> Rays {
    if axis.starts_with("trace.primary_") {
        Rays::Primary
    } else if axis.starts_with("trace.secondary_") {
        Rays::Secondary
    } else {
        otherwise
    }
}

/// The axes that were varied for some variant: those that the sweep names, or all that differ.
pub fn axes(source: &Shown) -> Vec<String> {
    let named = source.all.record.sweep.as_ref().map(|sweep| &sweep.axes).filter(|axes| !axes.is_empty());
    let varied = in_order(source.entries().map(Entry::variant)).into_iter().flat_map(|v| source.all.axes(v));
    let varied: Vec<String> =
        in_order(varied).into_iter().filter(|name| !name.starts_with(OF_SCENE)).collect();
    match named {
        // In the sweep's order; one that has a single value is none.
        Some(named) => named.iter().filter(|axis| varied.contains(axis)).cloned().collect(),
        None => varied,
    }
}

/// The best value of an axis for a variant; nothing where fewer than two values can be compared. What had to be left
/// out is remarked.
pub fn choice(input: &Input, source: &Shown, variant: &str, axis: &str, rays: Rays) -> Option<Choice> {
    // By value and scene, in order of appearance.
    let mut rates: Vec<(String, Value, BTreeMap<String, f64>)> = Vec::new();
    // By scene and place of the value: of how many points too few samples count, and how many there are.
    let mut counts: BTreeMap<(String, usize), (usize, usize)> = BTreeMap::new();
    for entry in source.entries().filter(|entry| entry.variant() == variant) {
        let Some(value) = entry.parameters.get(axis) else { continue };
        let at = rates.iter().position(|(known, ..)| *known == text(value)).unwrap_or_else(|| {
            rates.push((text(value), value.clone(), BTreeMap::new()));
            rates.len() - 1
        });
        let count = counts.entry((source.place(entry).to_owned(), at)).or_default();
        count.1 += 1;
        match entry.point.rate(rays).filter(|_| !unreliable(entry.point)) {
            None => count.0 += 1,
            Some(rate) => {
                let best = rates[at].2.entry(source.place(entry).to_owned()).or_insert(rate);
                *best = best.max(rate);
            }
        }
    }
    if rates.len() < 2 {
        return None;
    }
    weak(input, variant, axis, &rates, &counts);
    rates.sort_by(|(_, a, _), (_, b, _)| match (number(a), number(b)) {
        (Some(a), Some(b)) => a.total_cmp(&b),
        (a, b) => b.is_some().cmp(&a.is_some()),
    });
    let rates: Vec<(String, BTreeMap<String, f64>)> =
        rates.into_iter().map(|(value, _, of)| (value, of)).collect();
    let (scenes, whole, left_out) = comparable(&rates);
    for what in left_out {
        input.remark(format!("{what}, {variant}: left out for {axis}, because not all was measured"));
    }
    let best = best(&rates, &scenes, &whole)?;
    let of_best = &rates[best].1;
    let relative = |at: usize| {
        let all: Vec<f64> = scenes.iter().map(|&scene| rates[at].1[scene] / of_best[scene]).collect();
        Relative { minimum: minimum(&all), mean: mean(&all) }
    };
    let values = (rates.iter().enumerate())
        .map(|(at, (value, _))| Tried {
            value: value.clone(),
            relative: whole.contains(&at).then(|| relative(at)),
        })
        .collect();
    let scenes = scenes.into_iter().cloned().collect();
    Some(Choice { values, best, scenes })
}

/// Remarks of which points too few samples count: the values that are left out with them, scene by scene, and how many
/// points of the others do not count.
fn weak(
    input: &Input,
    variant: &str,
    axis: &str,
    rates: &[(String, Value, BTreeMap<String, f64>)],
    counts: &BTreeMap<(String, usize), (usize, usize)>,
) {
    for scene in in_order(counts.keys().map(|(scene, _)| scene)) {
        let own = counts.iter().filter(|((of, _), _)| of == scene);
        let gone = own.clone().filter(|(_, (weak, all))| weak == all);
        let gone: Vec<&str> = gone.map(|((_, at), _)| rates[*at].0.as_str()).collect();
        if !gone.is_empty() {
            input.remark(format!(
                "{scene}, {variant}, {axis}={}: left out, because too few samples count",
                gone.join(", ")
            ));
        }
        let kept = own.filter(|(_, (weak, all))| weak < all);
        let (weak, all) = kept.fold((0, 0), |sum, (_, count)| (sum.0 + count.0, sum.1 + count.1));
        if weak > 0 {
            input.remark(format!(
                "{scene}, {variant}: {weak} of {all} points do not count for {axis}, because too few samples count"
            ));
        }
    }
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => number.as_f64(),
        _ => None,
    }
}

/// The scenes and the places of the values that are compared, and what is left out: scenes that lack a value or,
/// where that would leave none, values that a scene lacks.
fn comparable(rates: &[(String, BTreeMap<String, f64>)]) -> (Vec<&String>, Vec<usize>, Vec<String>) {
    let mut scenes: Vec<&String> = rates.iter().flat_map(|(_, of)| of.keys()).collect();
    scenes.sort_unstable();
    scenes.dedup();
    let all: Vec<usize> = (0..rates.len()).collect();
    let (whole, part): (Vec<&String>, Vec<&String>) =
        scenes.iter().partition(|scene| rates.iter().all(|(_, of)| of.contains_key(**scene)));
    if !whole.is_empty() {
        return (whole, all, part.into_iter().cloned().collect());
    }
    let (kept, dropped): (Vec<usize>, Vec<usize>) =
        all.into_iter().partition(|&at| scenes.iter().all(|scene| rates[at].1.contains_key(*scene)));
    (scenes, kept, dropped.into_iter().map(|at| rates[at].0.clone()).collect())
}

/// The place of the best of those values that are compared; nothing where there are fewer than two, or no scene.
fn best(rates: &[(String, BTreeMap<String, f64>)], scenes: &[&String], whole: &[usize]) -> Option<usize> {
    if scenes.is_empty() || whole.len() < 2 {
        return None;
    }
    let fastest =
        |scene: &String| whole.iter().map(|&at| rates[at].1[scene]).fold(f64::MIN_POSITIVE, f64::max);
    let rank = |at: usize| {
        let relative: Vec<f64> = scenes.iter().map(|&scene| rates[at].1[scene] / fastest(scene)).collect();
        ((1e3 * minimum(&relative)).round(), mean(&relative))
    };
    whole.iter().copied().reduce(|best, at| {
        let (own, other) = (rank(at), rank(best));
        let better = own.0.total_cmp(&other.0).then(own.1.total_cmp(&other.1)).is_gt();
        if better { at } else { best }
    })
}

fn minimum(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::super::sample::{AXIS, record, sweep};
    use super::*;
    use crate::select::Filter;

    fn one(points: &[(&str, u32, f64)]) -> (Choice, Vec<String>) {
        let records = [sweep(points)];
        let input = Input::new(&records, &Filter::default(), None).unwrap();
        let choice = choice(&input, &input.sources[0], "Binary", AXIS, Rays::Secondary).unwrap();
        (choice, input.remarks.take())
    }

    /// Thesis table 8, the row of Binary: 32×32 has the largest minimum although 32×28 has the larger mean.
    #[test]
    fn the_largest_minimum_wins_and_others_are_relative_to_it() {
        let (choice, _) = one(&[
            ("a", 32, 100.0),
            ("b", 32, 100.0),
            ("a", 28, 97.0),
            ("b", 28, 103.0),
            ("a", 2, 80.0),
            ("b", 2, 90.0),
        ]);
        assert_eq!(
            choice.values.iter().map(|tried| tried.value.as_str()).collect::<Vec<_>>(),
            ["2", "28", "32"]
        );
        assert_eq!(choice.best, 2);
        let relative: Vec<(f64, f64)> =
            choice.values.iter().map(|t| t.relative.unwrap()).map(|r| (r.minimum, r.mean)).collect();
        for (found, expected) in relative.iter().zip([(0.8, 0.85), (0.97, 1.0), (1.0, 1.0)]) {
            assert!((found.0 - expected.0).abs() < 1e-9 && (found.1 - expected.1).abs() < 1e-9, "{found:?}");
        }
    }

    #[test]
    fn the_mean_breaks_ties_to_three_decimals() {
        let (choice, _) = one(&[("a", 2, 99.98), ("b", 2, 100.0), ("a", 4, 100.0), ("b", 4, 99.97)]);
        assert_eq!(choice.best, 0, "minima are 0.9998 and 0.9997, means 0.9999 and 0.99985");
    }

    #[test]
    fn scenes_without_a_value_are_left_out_and_named() {
        let (choice, remarks) = one(&[("a", 2, 100.0), ("a", 4, 90.0), ("b", 2, 10.0)]);
        assert_eq!(choice.best, 0);
        assert_eq!(remarks, [format!("b, Binary: left out for {AXIS}, because not all was measured")]);
    }

    #[test]
    fn where_no_scene_has_all_values_the_others_are_gaps() {
        let (choice, remarks) = one(&[
            ("a", 2, 100.0),
            ("a", 4, 90.0),
            ("a", 8, 120.0),
            ("b", 2, 100.0),
            ("b", 4, 90.0),
            ("b", 16, 120.0),
        ]);
        let known: Vec<bool> = choice.values.iter().map(|tried| tried.relative.is_some()).collect();
        assert_eq!((known, choice.best, remarks.len()), (vec![true, true, false, false], 0, 2));
    }

    #[test]
    fn what_was_not_varied_is_no_choice() {
        let records = [record()];
        let input = Input::new(&records, &Filter::default(), None).unwrap();
        assert_eq!(choice(&input, &input.sources[0], "Binary", AXIS, Rays::All), None);
        assert!(axes(&input.sources[0]).is_empty());
    }
}
