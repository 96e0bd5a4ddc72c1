//! How one variant compares with another, on each scene and over all.

use super::chart::Value;
use crate::figure::Figure;
use crate::select::{Entry, Selection, geometric_mean, ratio};
use crate::stats::{Cell, Group, Middle, Random, intervals};
use record::{Build, OF_SCENE, Point, Rays};

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
        pairs.iter().map(|pair| pair.and_then(|[old, new]| cell(old, new, figure))).collect();
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

/// The milliseconds until a picture's first ray, with how sure they are.
pub fn total(point: &Point) -> Option<Value> {
    let mut groups = builds(point, |weight, new| Group { weight, old: vec![0.0; 2], new });
    groups.first_mut()?.old = vec![1.0; 2];
    // The ratio to a millisecond.
    let cell = [Cell { middle: Middle::Median, groups }];
    let interval = sound(&cell[0]).then(|| intervals(&cell, &mut Random::named("plot")).1).flatten();
    Some(Value { value: Figure::Total.of(point)?, interval: interval.map(|i| [i.low, i.high]) })
}

fn cell(old: &Point, new: &Point, figure: Figure) -> Option<Cell> {
    let cell = match figure {
        Figure::Primary => rates(old, new, Rays::Primary),
        Figure::Secondary => rates(old, new, Rays::Secondary),
        // What one side has and the other has not, such as sampling, is 0 there: a figure is the sum.
        Figure::Total => {
            let mut groups = builds(old, |weight, old| Group { weight, old, new: vec![0.0; 2] });
            groups.extend(builds(new, |weight, new| Group { weight, old: vec![0.0; 2], new }));
            Some(Cell { middle: Middle::Median, groups })
        }
        _ => None,
    };
    cell.filter(sound)
}

/// Whether statistics can be made of it: there are values, and they make two positive figures.
fn sound(cell: &Cell) -> bool {
    cell.least() > 0 && cell.figures().iter().all(|figure| figure.is_finite() && *figure > 0.0)
}

/// The times of all builds of a point and of its sampling, as groups.
fn builds(point: &Point, group: impl Fn(f64, Vec<f64>) -> Group) -> Vec<Group> {
    let times = |build: &Build| build.repetitions.iter().map(|repetition| repetition.milliseconds).collect();
    let adaptations: Vec<_> = point.views.iter().filter_map(|view| view.adaptation.as_ref()).collect();
    let share = 1.0 / adaptations.len().max(1) as f64;
    let mut groups = vec![group(1.0, times(&point.build))];
    for adaptation in adaptations {
        groups.push(group(share, times(&adaptation.build)));
        groups.push(group(share, adaptation.sampling_milliseconds.clone()));
    }
    groups
}

/// The rates of two points by view; nothing where they have different views, or only one has such rays.
fn rates(old: &Point, new: &Point, rays: Rays) -> Option<Cell> {
    if old.views.len() != new.views.len() {
        return None;
    }
    let mut groups = Vec::new();
    for view in &old.views {
        let same = new.views.iter().find(|other| other.name == view.name)?;
        let group = Group { weight: 1.0, old: view.rates(rays), new: same.rates(rays) };
        match (group.old.is_empty(), group.new.is_empty()) {
            // The view has no such rays, and no part in the mean.
            (true, true) => {}
            (false, false) => groups.push(group),
            _ => return None,
        }
    }
    let share = 1.0 / groups.len() as f64;
    groups.iter_mut().for_each(|group| group.weight = share);
    Some(Cell { middle: Middle::Mean, groups })
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
