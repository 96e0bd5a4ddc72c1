//! How one variant compares with another, on each scene and over all.

use super::chart::Value;
use crate::diff::cell::{self, FIGURES};
use crate::figure::Figure;
use crate::select::{Entry, Selection, geometric_mean, ratio};
use crate::stats::{Cell, Random, intervals_of_samples};
use record::{OF_SCENE, Point};

/// An old point and a new one.
pub type Pair<'r> = [&'r Point; 2];

/// Ratios of new to old; a gap where one of them is not known.
#[derive(Clone, Debug, PartialEq)]
pub struct Ratios {
    /// One a pair.
    pub each: Vec<Option<Value>>,
    /// Their geometric mean; nothing if there is a gap among them.
    pub mean: Option<Value>,
}

/// The ratios of a figure, with intervals where it is a rate or a time and there are samples enough.
pub fn ratios(pairs: &[Option<Pair>], figure: Figure) -> Ratios {
    let cells: Vec<Option<Cell>> =
        pairs.iter().map(|pair| pair.and_then(|[old, new]| cell::of_variants(figure, old, new))).collect();
    let values: Vec<Option<f64>> = if FIGURES.contains(&figure) {
        // Of the views that both points have, as the interval is.
        cells.iter().map(|cell| Some(cell.as_ref()?.log_ratio().exp())).collect()
    } else {
        let ratio = |[old, new]: Pair| ratio(figure.of(new)?, figure.of(old)?);
        pairs.iter().map(|pair| pair.and_then(ratio)).collect()
    };
    let known: Vec<Cell> = cells.iter().flatten().cloned().collect();
    // The same pictures from the same record, whenever they are drawn.
    let (found, of_mean) = intervals_of_samples(&known, &mut Random::named("plot"));
    let mut found = found.into_iter();
    let each: Vec<Option<Value>> = values
        .iter()
        .zip(&cells)
        .map(|(value, cell)| {
            let interval = cell.as_ref().and_then(|_| found.next()).flatten();
            value.map(|value| Value { value, interval: interval.map(|i| [i.low, i.high]) })
        })
        .collect();
    let all: Option<Vec<f64>> = values.into_iter().collect();
    let of_mean = of_mean.filter(|_| cells.iter().all(Option::is_some)).map(|i| [i.low, i.high]);
    let mean = all.and_then(geometric_mean).map(|value| Value { value, interval: of_mean });
    Ratios { each, mean }
}

/// The milliseconds until a picture's first ray, with how sure they are.
pub fn total(point: &Point) -> Option<Value> {
    let interval = cell::total(point)
        .and_then(|cell| intervals_of_samples(&[cell], &mut Random::named("plot")).1)
        .map(|interval| [interval.low, interval.high]);
    Some(Value { value: Figure::Total.of(point)?, interval })
}

/// The point of a variant that has no more than one on each scene: of a variant that was measured with several
/// values of a parameter none stands for it.
pub fn only<'s, 'r>(selection: &'s Selection<'r>, scene: &str, variant: &str) -> Option<&'s Entry<'r>> {
    match selection.passes(variant)[..] {
        [pass] => selection.entry(scene, variant, pass),
        _ => None,
    }
}

/// On each scene the points of two variants, where both are there.
pub fn pairs<'r>(selection: &Selection<'r>, old: &str, new: &str) -> Vec<Option<Pair<'r>>> {
    let pair = |scene: &&str| Some([only(selection, scene, old)?.point, only(selection, scene, new)?.point]);
    selection.scenes().iter().map(pair).collect()
}

/// The variants whose points on a scene differ in nothing but the scene's size or make, in order.
pub fn unvaried<'s>(selection: &'s Selection) -> Vec<&'s str> {
    let only_scene = |variant: &&str| selection.axes(variant).iter().all(|name| name.starts_with(OF_SCENE));
    selection.variants().into_iter().filter(only_scene).collect()
}

/// The variants that have one point on each scene, in order.
pub fn settled<'s>(selection: &'s Selection) -> Vec<&'s str> {
    selection.variants().into_iter().filter(|variant| selection.passes(variant).len() == 1).collect()
}

/// The points of some variants and of the reference.
pub fn of_variants<'s, 'r>(
    selection: &'s Selection<'r>,
    variants: &'s [&str],
    reference: &'s str,
) -> impl Iterator<Item = &'r Point> + 's {
    let is = move |entry: &&Entry| entry.variant() == reference || variants.contains(&entry.variant());
    selection.entries.iter().filter(is).map(|entry| entry.point)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diff::pair::Pair as Compared;
    use crate::stats::intervals;
    use record::{Launch, Record, Sample, example};

    /// Rates of a view by the number of the sample.
    fn view(point: &mut Point, name: &str, rate: impl Fn(u32) -> f64) {
        let mut view = point.views[0].clone();
        let launch = |mrps: f64| Launch { rays: 1_000_000, milliseconds: 1e3 / mrps };
        let sample = |at| Sample { depths: vec![launch(rate(at)); 2], ..Sample::default() };
        (view.name, view.samples) = (name.into(), (0..20).map(sample).collect());
        point.views.push(view);
    }

    fn record(views: &[(&str, f64)], phase: f64) -> Record {
        let mut record = example();
        record.results.truncate(1);
        for (name, rate) in views {
            view(&mut record.results[0], name, |at| rate + (f64::from(at) / 3.0 + phase).sin());
        }
        record.results[0].views.remove(0);
        record
    }

    #[test]
    fn neighbours_that_resemble_each_other_widen_intervals() {
        let (old, new) = (record(&[("east", 100.0)], 0.0), record(&[("east", 100.0)], 1.0));
        let pair: Pair = [&old.results[0], &new.results[0]];
        let [low, high] = ratios(&[Some(pair)], Figure::Primary).each[0].unwrap().interval.unwrap();
        let cell = cell::of_variants(Figure::Primary, pair[0], pair[1]).unwrap();
        let blind = intervals(&[cell], &mut Random::named("plot")).1.unwrap();
        assert!(high - low > 1.3 * (blind.high - blind.low), "[{low}, {high}], {blind:?}");
    }

    #[test]
    fn repetitions_that_resemble_each_other_widen_the_interval_of_a_build() {
        let mut point = example().results.swap_remove(0);
        let repetition = point.build.repetitions[0].clone();
        let noise = |at: usize| 1.0 + 0.1 * (at * 7 % 11) as f64;
        let mut width = |times: Vec<f64>| {
            point.build.repetitions = times
                .iter()
                .map(|&milliseconds| record::Repetition { milliseconds, ..repetition.clone() })
                .collect();
            let [low, high] = total(&point).unwrap().interval.unwrap();
            high - low
        };
        let twice = width((0..40).map(|at| noise(at / 2)).collect());
        let once = width((0..40).map(noise).collect());
        assert!(twice > 1.1 * once, "{twice}, {once}");
    }

    /// As `compare diff` does: what differs between views is no change.
    #[test]
    fn only_views_that_both_have_are_compared() {
        let old = record(&[("east", 100.0), ("west", 900.0)], 0.0);
        let new = record(&[("east", 110.0)], 0.0);
        let drawn = ratios(&[Some([&old.results[0], &new.results[0]])], Figure::Primary).each[0].unwrap();
        let selections = [&old, &new].map(Selection::new);
        let pair = Compared { old: &selections[0].entries[0], new: &selections[1].entries[0] };
        let told = cell::cell(Figure::Primary, &pair).unwrap().log_ratio().exp();
        assert_eq!(drawn.value, told);
        assert!((told - 1.1).abs() < 1e-3 && drawn.interval.is_some_and(|[low, _]| low > 1.05), "{drawn:?}");
        let other = record(&[("north", 110.0)], 0.0);
        assert_eq!(ratios(&[Some([&old.results[0], &other.results[0]])], Figure::Primary).each, [None]);
    }
}
