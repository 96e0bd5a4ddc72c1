//! From two points to the values that are compared.

use super::pair::Pair;
use crate::figure::Figure;
use crate::stats::{Cell, Group, Middle};
use record::{Build, Point, Rays, View};

/// The figures that are compared.
pub const FIGURES: [Figure; 3] = [Figure::Primary, Figure::Secondary, Figure::Total];

/// The values behind a figure, from the views that both points have; nothing where one side has no such values.
pub fn cell(figure: Figure, pair: &Pair) -> Option<Cell> {
    of_points(figure, pair.old.point, pair.new.point)
}

/// The same of two points of any variants. A variant that goes by view samples and builds again, which takes no time
/// where another one does not.
pub fn of_variants(figure: Figure, old: &Point, new: &Point) -> Option<Cell> {
    if figure != Figure::Total || old.variant == new.variant {
        return of_points(figure, old, new);
    }
    match (goes_by_view(old), goes_by_view(new)) {
        (false, true) => builds_against(old, new),
        (true, false) => {
            let Cell { middle, groups } = builds_against(new, old)?;
            Some(Cell { middle, groups: groups.into_iter().map(Group::exchanged).collect() })
        }
        _ => of_points(figure, old, new),
    }
}

fn of_points(figure: Figure, old: &Point, new: &Point) -> Option<Cell> {
    let cell = match figure {
        Figure::Primary => rates(Rays::Primary, old, new)?,
        Figure::Secondary => rates(Rays::Secondary, old, new)?,
        Figure::Total => builds(old, new)?,
        _ => return None,
    };
    cell.groups.iter().all(|group| sound(&group.old) && sound(&group.new)).then_some(cell)
}

/// Whether statistics can be made of values.
fn sound(values: &[f64]) -> bool {
    !values.is_empty() && values.iter().all(|value| value.is_normal() && *value > 0.0)
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
    let by_any = [old, new].iter().any(|point| goes_by_view(point));
    if by_any && (common.is_empty() || by_view.0.len() != common.len()) {
        return None;
    }
    let mut groups = vec![Group { weight: 1.0, old: times(&old.build), new: times(&new.build) }];
    for mut views in [by_view.0, by_view.1] {
        share(&mut views);
        groups.append(&mut views);
    }
    Some(Cell { middle: Middle::Median, groups })
}

/// The same where only the new point goes by view.
fn builds_against(old: &Point, new: &Point) -> Option<Cell> {
    let first = Group { weight: 1.0, old: times(&old.build), new: times(&new.build) };
    let by_view = by_view(new)?;
    let known = sound(&first.old) && sound(&first.new) && by_view.iter().all(|(_, values)| sound(values));
    let more = by_view.into_iter().map(|(weight, values)| Group::against(0.0, weight, values));
    known.then(|| Cell { middle: Middle::Median, groups: std::iter::once(first).chain(more).collect() })
}

/// The time before a picture's first ray of one point, against a millisecond.
pub fn total(point: &Point) -> Option<Cell> {
    let by_view = by_view(point)?;
    let first = times(&point.build);
    let known = sound(&first) && by_view.iter().all(|(_, values)| sound(values));
    let more = by_view.into_iter().map(|(weight, values)| Group::against(0.0, weight, values));
    let groups = std::iter::once(Group::against(1.0, 1.0, first)).chain(more).collect();
    known.then_some(Cell { middle: Middle::Median, groups })
}

/// Whether a point's tree goes by view.
fn goes_by_view(point: &Point) -> bool {
    point.views.iter().any(|view| view.adaptation.is_some())
}

/// What a point's views take each, sampling and build, with how much that counts; nothing where only some do.
fn by_view(point: &Point) -> Option<Vec<(f64, Vec<f64>)>> {
    let adaptations: Vec<_> = point.views.iter().filter_map(|view| view.adaptation.as_ref()).collect();
    let share = 1.0 / adaptations.len() as f64;
    let each = |a: &record::Adaptation| [(share, a.sampling_milliseconds.clone()), (share, times(&a.build))];
    (adaptations.is_empty() || adaptations.len() == point.views.len())
        .then(|| adaptations.into_iter().flat_map(each).collect())
}

/// The milliseconds of each repetition.
fn times(build: &Build) -> Vec<f64> {
    build.repetitions.iter().map(|repetition| repetition.milliseconds).collect()
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
    fn what_only_one_variant_does_takes_the_other_no_time() {
        let record = example();
        let [binary, by_view] = &record.results[..] else { panic!() };
        for (old, new) in [(binary, by_view), (by_view, binary)] {
            let found = of_variants(Figure::Total, old, new).unwrap().figures();
            let expected = [old, new].map(|point| Figure::Total.of(point).unwrap());
            for (found, expected) in found.into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-9, "{found}, {expected}");
            }
        }
        let mut lacking = by_view.clone();
        lacking.views[0].adaptation = None;
        assert_eq!(
            of_variants(Figure::Total, by_view, &lacking),
            None,
            "one variant goes by view or does not"
        );
        lacking.views[0].name = "another".into();
        assert_eq!(of_variants(Figure::Total, by_view, &lacking), None, "no view in common");
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
