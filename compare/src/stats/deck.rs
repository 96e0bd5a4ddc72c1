//! Values that change sides.

use super::{Cell, Middle, Random, ways};

/// Up to so many ways to exchange, all of them are tried, and p is exact.
const EXACT: f64 = 20_000.0;

/// A logarithm of a ratio and its variance; of several cells, sums of both.
#[derive(Clone, Copy)]
pub struct Change {
    log_ratio: f64,
    variance: f64,
}

impl Change {
    /// No change at all.
    pub const NONE: Change = Change { log_ratio: 0.0, variance: 0.0 };

    /// Adds another one.
    pub fn add(&mut self, other: Change) {
        self.log_ratio += other.log_ratio;
        self.variance += other.variance;
    }

    /// The sum of all, which is as extreme as their mean.
    pub fn mean(changes: &[Change]) -> Change {
        changes.iter().fold(Change::NONE, |mut sum, change| {
            sum.add(*change);
            sum
        })
    }

    /// How far from no change it is, in deviations.
    pub fn size(self) -> f64 {
        if self.log_ratio == 0.0 { 0.0 } else { self.log_ratio.abs() / self.variance.sqrt() }
    }
}

/// The values of a cell, to be dealt anew.
pub struct Deck {
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
    /// A cell's values as they were measured; `studentized` if changes shall be told in deviations.
    pub fn new(cell: &Cell, studentized: bool) -> Deck {
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
    pub fn exchange(&mut self, random: &mut Random) {
        for pile in &mut self.groups {
            for place in 0..pile.few {
                let other = place + random.below(pile.values.len() - place);
                pile.values.swap(place, other);
            }
        }
    }

    /// The change as the values lie.
    pub fn change(&self) -> Change {
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
    pub fn exact(&mut self) -> Option<f64> {
        let all: f64 = self.groups.iter().map(|pile| ways(pile.few, pile.values.len() - pile.few)).product();
        if all > EXACT {
            return None;
        }
        let measured = self.change().size() * (1.0 - 1e-9);
        let mut extreme = 0;
        self.each(0, &mut |deck| extreme += u32::from(deck.change().size() >= measured));
        Some(f64::from(extreme) / all)
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
