//! How probable so large a change is if nothing has changed.
//!
//! If both sides are the same, a value might as well have been measured on the other one. So values change sides at
//! random, within each group, and p is the share of such exchanges whose ratio is as far from 1 as the measured one.
//! Nothing is assumed about how values are distributed, and the level is kept whatever their number.
//!
//! What is compared is the logarithm of the ratio over its deviation, computed anew for each exchange (as Welch's t
//! is): then p also holds where both sides have the same mean and scatter differently (Janssen 1997), such as when
//! one side was measured until it was precise.
//!
//! Means are compared even where the figure is a median. Any statistic keeps the level, and with medians so many
//! exchanges are equally extreme that ten values a side cannot pass Holm's correction; an outlier makes the test
//! miss a change, and never see one. Whoever calls a median changed should ask its interval too.

use super::deck::{Change, Deck};
use super::{Cell, Random};

/// A p-value is known well enough when so many exchanges were as extreme as what was measured (Besag and Clifford
/// 1991): then trying ends, which saves most of the time where nothing has changed.
const ENOUGH: usize = 50;

/// The p-values of some cells.
#[derive(Clone, Debug, PartialEq)]
pub struct PValues {
    /// That of each cell.
    pub cells: Vec<f64>,
    /// That of the mean over the cells.
    pub mean: f64,
}

/// How many exchanges to try for a table of so many tests: by Holm's correction the smallest p must be below 5% over
/// their number to be significant, and of n exchanges the smallest p there can be is 1 / (n + 1).
pub fn permutations(tests: usize) -> usize {
    (40 * tests).max(10_000)
}

/// How probable it is that the ratio of each cell, and the mean over the cells, differs so much from 1 by chance, in
/// either direction. At most `most` exchanges are tried. Nothing without cells.
pub fn p_values(cells: &[Cell], most: usize, random: &mut Random) -> Option<PValues> {
    if cells.is_empty() {
        return None;
    }
    // Of single values nobody knows how they scatter.
    let mut decks: Vec<Deck> = cells.iter().map(|cell| Deck::new(cell, cell.least() >= 2)).collect();
    let exact: Vec<Option<f64>> = decks.iter_mut().map(Deck::exact).collect();
    let measured: Vec<Change> = decks.iter().map(Deck::change).collect();
    let mut tallies: Vec<Tally> = measured.iter().map(|change| Tally::new(change.size())).collect();
    let mut mean = Tally::new(Change::mean(&measured).size());
    // The mean of one cell is that cell.
    let one = cells.len() == 1;
    for _ in 0..most {
        // The mean takes all cells; without it, those that are known well enough have a rest.
        let of_mean = mean.open() && !one;
        let (mut changes, mut idle) = (Change::NONE, !of_mean);
        for ((deck, tally), exact) in decks.iter_mut().zip(&mut tallies).zip(&exact) {
            if of_mean || exact.is_none() && tally.open() {
                idle = false;
                deck.exchange(random);
                let change = deck.change();
                tally.add(change.size());
                changes.add(change);
            }
        }
        if idle {
            break;
        }
        if of_mean {
            mean.add(changes.size());
        }
    }
    let cells: Vec<f64> =
        exact.iter().zip(&tallies).map(|(p, tally)| p.unwrap_or_else(|| tally.p())).collect();
    let mean = if one { cells[0] } else { mean.p() };
    Some(PValues { cells, mean })
}

/// How often exchanges were as extreme as what was measured.
struct Tally {
    measured: f64,
    extreme: usize,
    tried: usize,
}

impl Tally {
    fn new(measured: f64) -> Tally {
        // What is equal but for rounding is as extreme.
        Tally { measured: measured * (1.0 - 1e-9), extreme: 0, tried: 0 }
    }

    fn open(&self) -> bool {
        self.extreme < ENOUGH
    }

    fn add(&mut self, size: f64) {
        if self.open() {
            self.tried += 1;
            self.extreme += usize::from(size >= self.measured);
        }
    }

    /// What was measured is one way to exchange among the others (Phipson and Smyth 2010), so p is never 0.
    fn p(&self) -> f64 {
        (self.extreme + 1) as f64 / (self.tried + 1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Group, Middle, least_p};
    use super::*;

    fn cell(groups: &[(&[f64], &[f64])]) -> Cell {
        let weight = 1.0 / groups.len() as f64;
        let group = |&(old, new): &(&[f64], &[f64])| Group { weight, old: old.to_vec(), new: new.to_vec() };
        Cell { middle: Middle::Mean, groups: groups.iter().map(group).collect() }
    }

    fn p(cells: &[Cell]) -> PValues {
        p_values(cells, 20_000, &mut Random::named("p")).unwrap()
    }

    #[test]
    fn three_samples_a_side_can_show_nothing() {
        let found = p(&[cell(&[(&[10.0, 10.1, 10.2], &[20.0, 20.1, 20.2])])]);
        assert_eq!(found.cells, [2.0 / 20.0]);
        assert_eq!(found.mean, 0.1);
    }

    #[test]
    fn the_smallest_p_is_reached() {
        for (old, new) in
            [(&[10.0, 10.1, 10.2][..], &[20.0, 20.1, 20.2][..]), (&[1.0, 1.1], &[2.0, 2.1, 2.2])]
        {
            let cell = cell(&[(old, new), (old, new)]);
            let least = least_p(cell.groups.iter());
            assert!((p(std::slice::from_ref(&cell)).cells[0] - least).abs() < 1e-12, "{least}");
        }
    }

    #[test]
    fn a_single_sample_elsewhere_changes_no_other_p() {
        let scattered = cell(&[(&[10.0, 10.3, 10.1, 10.2], &[10.9, 13.0, 9.0, 12.0])]);
        let single = cell(&[(&[10.0], &[11.0]), (&[10.0], &[11.0])]);
        assert_eq!(p(&[scattered.clone(), single]).cells[0], p(&[scattered]).cells[0]);
    }

    #[test]
    fn with_several_views_they_can() {
        let view: (&[f64], &[f64]) = (&[10.0, 10.1, 10.2], &[20.0, 20.1, 20.2]);
        assert_eq!(p(&[cell(&[view; 3])]).cells, [2.0 / 8000.0]);
        // 20^4 ways are too many to try all, so that a share of them is.
        let tried = p(&[cell(&[view; 4])]).cells[0];
        assert!(tried < 3.0 / 20_000.0, "{tried}");
    }

    #[test]
    fn the_same_on_both_sides_is_no_change() {
        let view: (&[f64], &[f64]) = (&[10.0, 10.1, 10.2, 10.4], &[10.2, 10.0, 10.1, 10.4]);
        assert_eq!(p(&[cell(&[view; 4]), cell(&[view])]), PValues { cells: vec![1.0, 1.0], mean: 1.0 });
        let constant: (&[f64], &[f64]) = (&[10.0; 3], &[10.0; 3]);
        assert_eq!(p(&[cell(&[constant])]).cells, [1.0]);
    }

    #[test]
    fn many_small_changes_of_one_sign_show_in_their_mean() {
        let up: (&[f64], &[f64]) = (&[10.0, 10.3, 10.1, 10.2], &[10.2, 10.4, 10.15, 10.35]);
        let found = p(&vec![cell(&[up, up]); 6]);
        assert!(found.cells.iter().all(|&p| p > 0.01), "{found:?}");
        assert!(found.mean < 0.001, "{found:?}");
    }

    #[test]
    fn sampling_agrees_with_trying_all() {
        let cell =
            cell(&[(&[10.0, 10.3, 10.1, 10.9, 10.2], &[10.4, 10.6, 10.3, 10.5]), (&[5.0, 5.1], &[5.1, 5.2])]);
        let exact = p(std::slice::from_ref(&cell)).cells[0];
        let mut deck = Deck::new(&cell, true);
        let measured = deck.change().size() * (1.0 - 1e-9);
        let mut random = Random::named("sampling");
        let tried = 200_000;
        let extreme = (0..tried).filter(|_| {
            deck.exchange(&mut random);
            deck.change().size() >= measured
        });
        let sampled = extreme.count() as f64 / f64::from(tried);
        assert!((sampled - exact).abs() < 0.005, "{sampled} {exact}");
    }

    #[test]
    fn one_sample_a_view_changes_sides_too() {
        let view: (&[f64], &[f64]) = (&[10.0], &[11.0]);
        assert_eq!(p(&[cell(&[view; 4])]).cells, [2.0 / 16.0]);
    }
}
