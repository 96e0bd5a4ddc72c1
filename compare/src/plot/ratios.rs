//! How one variant compares with another, on each scene and over all.

use super::chart::Value;
use crate::figure::Figure;
use crate::select::{Entry, Selection, geometric_mean, ratio};
use crate::stats::{Cell, Group, Middle, Random, intervals};
use record::{Point, Rays, View};

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

/// The ratios of a figure, with intervals where it is a rate and there are samples enough.
pub fn ratios(pairs: &[Option<Pair>], figure: Figure) -> Ratios {
    let values: Vec<Option<f64>> = pairs
        .iter()
        .map(|pair| pair.and_then(|[old, new]| ratio(figure.of(new)?, figure.of(old)?)))
        .collect();
    let cells: Vec<Option<Cell>> =
        pairs.iter().map(|pair| pair.and_then(|[old, new]| cell(old, new, rays(figure)?))).collect();
    let known: Vec<Cell> = cells.iter().flatten().cloned().collect();
    // The same pictures from the same record, whenever they are drawn.
    let (found, of_mean) = intervals(&known, &mut Random::named("plot"));
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

fn rays(figure: Figure) -> Option<Rays> {
    match figure {
        Figure::Primary => Some(Rays::Primary),
        Figure::Secondary => Some(Rays::Secondary),
        _ => None,
    }
}

/// The rates of two points by view; nothing where they have different views, or a view has no such rays.
fn cell(old: &Point, new: &Point, rays: Rays) -> Option<Cell> {
    let weight = 1.0 / old.views.len() as f64;
    let group = |view: &View| {
        let same = new.views.iter().find(|other| other.name == view.name)?;
        let group = Group { weight, old: view.rates(rays), new: same.rates(rays) };
        (!group.old.is_empty() && !group.new.is_empty()).then_some(group)
    };
    let groups: Vec<Group> = old.views.iter().map(group).collect::<Option<_>>()?;
    (!groups.is_empty() && old.views.len() == new.views.len())
        .then_some(Cell { middle: Middle::Mean, groups })
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

/// The variants that have one point on each scene, in order.
pub fn settled<'s>(selection: &'s Selection) -> Vec<&'s str> {
    selection.variants().into_iter().filter(|variant| selection.passes(variant).len() == 1).collect()
}
