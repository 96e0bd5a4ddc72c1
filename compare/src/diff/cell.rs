//! From two points to the values that are compared.

use super::pair::Pair;
use crate::figure::Figure;
use crate::stats::{Cell, Group, Middle};
use record::{Build, Point, Rays, View};

/// The figures that are compared.
pub const FIGURES: [Figure; 3] = [Figure::Primary, Figure::Secondary, Figure::Total];

/// The values behind a figure, from the views that both points have; nothing where one side has no such values.
pub fn cell(figure: Figure, pair: &Pair) -> Option<Cell> {
    let (old, new) = (pair.old.point, pair.new.point);
    let cell = match figure {
        Figure::Primary => rates(Rays::Primary, old, new)?,
        Figure::Secondary => rates(Rays::Secondary, old, new)?,
        Figure::Total => builds(old, new)?,
        _ => return None,
    };
    let sound =
        |values: &[f64]| !values.is_empty() && values.iter().all(|value| value.is_normal() && *value > 0.0);
    cell.groups.iter().all(|group| sound(&group.old) && sound(&group.new)).then_some(cell)
}

/// The views that both points have.
pub fn common_views<'r>(old: &'r Point, new: &'r Point) -> Vec<(&'r View, &'r View)> {
    let other = |view: &View| new.views.iter().find(|other| other.name == view.name);
    old.views.iter().filter_map(|view| Some((view, other(view)?))).collect()
}

/// A rate is the mean over views of the mean over samples (see [`Point::rate`]).
fn rates(rays: Rays, old: &Point, new: &Point) -> Option<Cell> {
    let mut groups = Vec::new();
    for (old, new) in common_views(old, new) {
        let (before, after) = (old.rates(rays), new.rates(rays));
        // Paths from this view have no such rays, so it has no part in the mean.
        let silent = |view: &View, rates: &[f64]| rates.is_empty() && view.counted().next().is_some();
        if silent(old, &before) && silent(new, &after) {
            continue;
        }
        groups.push(Group { weight: 1.0, old: before, new: after });
    }
    share(&mut groups);
    (!groups.is_empty()).then_some(Cell { middle: Middle::Mean, groups })
}

/// The time before a picture's first ray is that of the build and, where the variant goes by view, the mean over
/// views of tracing sample rays and building again (see [`Figure::Total`]).
fn builds(old: &Point, new: &Point) -> Option<Cell> {
    let times = |build: &Build| build.repetitions.iter().map(|repetition| repetition.milliseconds).collect();
    let mut by_view = (Vec::new(), Vec::new());
    let common = common_views(old, new);
    for (old, new) in &common {
        let (old, new) = match (&old.adaptation, &new.adaptation) {
            (Some(old), Some(new)) => (old, new),
            (None, None) => continue,
            _ => return None,
        };
        let sampling = |a: &record::Adaptation| a.sampling_milliseconds.clone();
        by_view.0.push(Group { weight: 1.0, old: sampling(old), new: sampling(new) });
        by_view.1.push(Group { weight: 1.0, old: times(&old.build), new: times(&new.build) });
    }
    if !by_view.0.is_empty() && by_view.0.len() != common.len() {
        return None;
    }
    let mut groups = vec![Group { weight: 1.0, old: times(&old.build), new: times(&new.build) }];
    for mut views in [by_view.0, by_view.1] {
        share(&mut views);
        groups.append(&mut views);
    }
    Some(Cell { middle: Middle::Median, groups })
}

/// Lets groups count alike.
fn share(groups: &mut [Group]) {
    let weight = 1.0 / groups.len() as f64;
    groups.iter_mut().for_each(|group| group.weight = weight);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::select::Selection;
    use record::example;

    #[test]
    fn figures_are_those_of_the_record() {
        let record = example();
        let selection = Selection::new(&record);
        for entry in &selection.entries {
            for figure in FIGURES {
                let cell = cell(figure, &Pair { old: entry, new: entry }).unwrap();
                let expected = figure.of(entry.point).unwrap();
                for found in cell.figures() {
                    assert!((found - expected).abs() < 1e-9 * expected, "{figure:?} {found} {expected}");
                }
            }
        }
    }

    #[test]
    fn what_one_side_lacks_is_a_gap() {
        let old = example();
        let mut new = old.clone();
        for sample in &mut new.results[0].views[0].samples {
            sample.depths.truncate(1);
        }
        new.results[1].views[0].adaptation = None;
        let (old, new) = (Selection::new(&old), Selection::new(&new));
        let of =
            |index: usize, figure| cell(figure, &Pair { old: &old.entries[index], new: &new.entries[index] });
        assert!(of(0, Figure::Primary).is_some());
        assert_eq!(of(0, Figure::Secondary), None);
        assert_eq!(of(1, Figure::Total), None);
        let silent = |figure| cell(figure, &Pair { old: &new.entries[0], new: &new.entries[0] });
        assert_eq!(silent(Figure::Secondary), None);
    }
}
