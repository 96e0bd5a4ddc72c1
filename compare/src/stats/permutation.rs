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

use super::{Cell, Middle, Random};

/// Up to so many ways to exchange, all of them are tried, and p is exact.
const EXACT: usize = 20_000;

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
    let studentized = cells.iter().all(|cell| cell.least() >= 2);
    let mut decks: Vec<Deck> = cells.iter().map(|cell| Deck::new(cell, studentized)).collect();
    let exact: Vec<Option<f64>> = decks.iter_mut().map(Deck::exact).collect();
    let measured: Vec<Change> = decks.iter_mut().map(Deck::change).collect();
    let mut tallies: Vec<Tally> = measured.iter().map(|change| Tally::new(change.size())).collect();
    let mut mean = Tally::new(Change::mean(&measured).size());
    // The mean of one cell is that cell.
    let one = cells.len() == 1;
    for _ in 0..most {
        let open = |(tally, exact): (&Tally, &Option<f64>)| exact.is_none() && tally.open();
        if !(tallies.iter().zip(&exact).any(open) || mean.open() && !one) {
            break;
        }
        let mut changes = Change::NONE;
        for (deck, tally) in decks.iter_mut().zip(&mut tallies) {
            deck.exchange(random);
            let change = deck.change();
            tally.add(change.size());
            changes.add(change);
        }
        mean.add(changes.size());
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

/// A logarithm of a ratio and its variance; of several cells, sums of both.
#[derive(Clone, Copy)]
struct Change {
    log_ratio: f64,
    variance: f64,
}

impl Change {
    const NONE: Change = Change { log_ratio: 0.0, variance: 0.0 };

    fn add(&mut self, other: Change) {
        self.log_ratio += other.log_ratio;
        self.variance += other.variance;
    }

    /// The sum of all, which is as extreme as their mean.
    fn mean(changes: &[Change]) -> Change {
        changes.iter().fold(Change::NONE, |mut sum, change| {
            sum.add(*change);
            sum
        })
    }

    /// How far from no change it is, in deviations.
    fn size(self) -> f64 {
        if self.log_ratio == 0.0 { 0.0 } else { self.log_ratio.abs() / self.variance.sqrt() }
    }
}

/// The values of a cell, to be dealt anew.
struct Deck {
    studentized: bool,
    groups: Vec<Pile>,
}

/// The values of a group and both sides. The first `few` are those of the side that has fewer.
struct Pile {
    weight: f64,
    /// Values less `center`, so that sums of squares keep their digits.
    values: Vec<f64>,
    center: f64,
    few: usize,
    few_are_new: bool,
    sum: f64,
    squares: f64,
}

impl Deck {
    fn new(cell: &Cell, studentized: bool) -> Deck {
        let groups = cell.groups.iter().map(|group| {
            let few_are_new = group.new.len() <= group.old.len();
            let (few, many) = if few_are_new { (&group.new, &group.old) } else { (&group.old, &group.new) };
            let all: Vec<f64> = few.iter().chain(many).copied().collect();
            let center = Middle::Mean.of(&all);
            let values: Vec<f64> = all.iter().map(|value| value - center).collect();
            Pile {
                weight: group.weight,
                center,
                few: few.len(),
                few_are_new,
                sum: values.iter().sum(),
                squares: values.iter().map(|value| value * value).sum(),
                values,
            }
        });
        Deck { studentized, groups: groups.collect() }
    }

    /// Deals the values to both sides at random.
    fn exchange(&mut self, random: &mut Random) {
        for pile in &mut self.groups {
            for place in 0..pile.few {
                let other = place + random.below(pile.values.len() - place);
                pile.values.swap(place, other);
            }
        }
    }

    /// The change as the values lie.
    fn change(&mut self) -> Change {
        let (mut old, mut new, mut old_variance, mut new_variance) = (0.0, 0.0, 0.0, 0.0);
        for pile in &self.groups {
            let [few, many] = pile.means();
            let (its_new, its_old) = if pile.few_are_new { (few, many) } else { (many, few) };
            old += pile.weight * (pile.center + its_old.0);
            new += pile.weight * (pile.center + its_new.0);
            old_variance += pile.weight * pile.weight * its_old.1;
            new_variance += pile.weight * pile.weight * its_new.1;
        }
        let variance =
            if self.studentized { old_variance / (old * old) + new_variance / (new * new) } else { 1.0 };
        Change { log_ratio: (new / old).ln(), variance }
    }

    /// The exact p of this cell alone, where there are few ways to exchange.
    fn exact(&mut self) -> Option<f64> {
        let ways = |pile: &Pile| binomial(pile.values.len(), pile.few);
        let all = self
            .groups
            .iter()
            .try_fold(1usize, |all, pile| Some(all * ways(pile)?).filter(|&all| all <= EXACT))?;
        let measured = self.change().size() * (1.0 - 1e-9);
        let mut extreme = 0;
        self.each(0, &mut |deck| extreme += usize::from(deck.change().size() >= measured));
        Some(extreme as f64 / all as f64)
    }

    /// Calls `visit` with every way to deal the piles from `pile` on, and puts them back.
    fn each(&mut self, pile: usize, visit: &mut impl FnMut(&mut Deck)) {
        if pile == self.groups.len() {
            return visit(self);
        }
        let values = self.groups[pile].values.clone();
        let few = self.groups[pile].few;
        let mut chosen: Vec<usize> = (0..few).collect();
        loop {
            let mut is_chosen = vec![false; values.len()];
            chosen.iter().for_each(|&index| is_chosen[index] = true);
            let side =
                |wanted: bool| values.iter().zip(is_chosen.clone()).filter(move |(_, is)| *is == wanted);
            let dealt: Vec<f64> = side(true).chain(side(false)).map(|(value, _)| *value).collect();
            self.groups[pile].values = dealt;
            self.each(pile + 1, visit);
            // The next choice: the last index that can still move up does, and those behind it follow.
            let Some(at) = (0..few).rev().find(|&at| chosen[at] < values.len() - few + at) else { break };
            let next = chosen[at] + 1;
            (at..few).for_each(|index| chosen[index] = next + index - at);
        }
        self.groups[pile].values = values;
    }
}

impl Pile {
    /// Of both sides, the mean and its variance.
    fn means(&self) -> [(f64, f64); 2] {
        let (few, many) = (self.few as f64, (self.values.len() - self.few) as f64);
        let (mut sum, mut squares) = (0.0, 0.0);
        for value in &self.values[..self.few] {
            sum += value;
            squares += value * value;
        }
        [(sum, squares, few), (self.sum - sum, self.squares - squares, many)].map(|(sum, squares, n)| {
            let mean = sum / n;
            // Rounding can leave a little below nothing.
            let variance = (squares - sum * mean).max(0.0) / (n - 1.0) / n;
            (mean, variance)
        })
    }
}

/// In how many ways some can be chosen of `all`; nothing where they are more than anybody will try.
fn binomial(all: usize, some: usize) -> Option<usize> {
    let ways = (0..some.min(all - some)).try_fold(1u64, |ways, taken| {
        Some(ways * (all - taken) as u64 / (taken as u64 + 1)).filter(|&ways| ways <= EXACT as u64)
    })?;
    usize::try_from(ways).ok()
}

#[cfg(test)]
mod tests {
    use super::super::Group;
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
