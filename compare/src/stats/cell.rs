//! One figure of one point on two sides.

use record::stats::median;

/// What a group's values are condensed to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Middle {
    /// Their mean: rates.
    Mean,
    /// Their median: build times, of which now and then one is far off.
    Median,
}

impl Middle {
    /// Of these values, of which there is at least one.
    pub fn of(self, values: &[f64]) -> f64 {
        match self {
            Middle::Mean => values.iter().sum::<f64>() / values.len() as f64,
            Middle::Median => median(values).unwrap_or(f64::NAN),
        }
    }

    /// The same of values whose order may be changed, which saves a copy.
    pub fn of_shuffled(self, values: &mut [f64]) -> f64 {
        if self == Middle::Mean {
            return self.of(values);
        }
        values.sort_unstable_by(f64::total_cmp);
        let (low, high) = ((values.len() - 1) / 2, values.len() / 2);
        (values[low] + values[high]) / 2.0
    }
}

/// Values that were measured alike on both sides, such as the rates of one view's samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// How much it counts in the figure.
    pub weight: f64,
    /// The values of the old side; at least one.
    pub old: Vec<f64>,
    /// The values of the new side; at least one.
    pub new: Vec<f64>,
}

impl Group {
    /// Values that only the new side has; on the old one there is this in their place, as often, so that neighbours
    /// can be joined.
    pub fn against(constant: f64, weight: f64, new: Vec<f64>) -> Group {
        Group { weight, old: vec![constant; new.len()], new }
    }

    /// The same with its sides exchanged.
    pub fn exchanged(self) -> Group {
        Group { weight: self.weight, old: self.new, new: self.old }
    }
}

/// A figure on both sides: the weighted sum of its groups' middles. All values are positive, but for the constants of
/// [`Group::against`].
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// The middle.
    pub middle: Middle,
    /// The groups.
    pub groups: Vec<Group>,
}

impl Cell {
    /// The old figure and the new one.
    pub fn figures(&self) -> [f64; 2] {
        let figure = |values: fn(&Group) -> &[f64]| {
            self.groups.iter().map(|group| group.weight * self.middle.of(values(group))).sum()
        };
        [figure(|group| &group.old), figure(|group| &group.new)]
    }

    /// The logarithm of new over old. Logarithms make gain and loss alike, and their mean over scenes is that of
    /// the geometric mean.
    pub fn log_ratio(&self) -> f64 {
        let [old, new] = self.figures();
        (new / old).ln()
    }

    /// The fewest values that a group has on a side.
    pub fn least(&self) -> usize {
        self.groups.iter().map(|group| group.old.len().min(group.new.len())).min().unwrap_or(0)
    }

    /// Each group and side's share of the variance of [`Cell::log_ratio`], with its degrees of freedom: to first
    /// order, what each adds to the variance of the figure over the figure's square. Nothing where one has fewer
    /// than two values.
    pub fn variances(&self) -> Option<Vec<(f64, f64)>> {
        let [old, new] = self.figures();
        let sides = self
            .groups
            .iter()
            .flat_map(|group| [(group.weight / old, &group.old), (group.weight / new, &group.new)]);
        sides
            .map(|(weight, values)| {
                let freedom = values.len() as f64 - 1.0;
                (freedom > 0.0).then(|| (weight * weight * variance(values) / (freedom + 1.0), freedom))
            })
            .collect()
    }

    /// The variance of [`Cell::log_ratio`].
    pub fn variance(&self) -> Option<f64> {
        Some(self.variances()?.iter().map(|(variance, _)| variance).sum())
    }
}

/// The smallest p that exchanging the values of groups between sides can give: that of the most extreme of all ways
/// to deal them, and of its mirror image where both sides have as many.
pub fn least_p<'g>(groups: impl Iterator<Item = &'g Group> + Clone) -> f64 {
    let ways: f64 = groups.clone().map(|group| ways(group.old.len(), group.new.len())).product();
    let mirrored = groups.clone().all(|group| group.old.len() == group.new.len());
    (if mirrored { 2.0 } else { 1.0 } / ways).min(1.0)
}

/// In how many ways values can be dealt to two sides that get so many.
pub fn ways(old: usize, new: usize) -> f64 {
    let (few, all) = (old.min(new), (old + new) as f64);
    (0..few).fold(1.0, |ways, taken| ways * (all - taken as f64) / (taken as f64 + 1.0))
}

/// The variance of values, of which there are at least two.
fn variance(values: &[f64]) -> f64 {
    let mean = Middle::Mean.of(values);
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    squares / (values.len() as f64 - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_median_is_the_same_in_any_order() {
        for values in [&[3.0][..], &[3.0, 1.0], &[2.0, 5.0, 1.0], &[4.0, 1.0, 3.0, 2.0]] {
            assert_eq!(Middle::Median.of_shuffled(&mut values.to_vec()), Middle::Median.of(values));
            assert_eq!(Middle::Mean.of_shuffled(&mut values.to_vec()), Middle::Mean.of(values));
        }
    }

    #[test]
    fn a_figure_is_the_weighted_sum_of_its_groups() {
        let group = |old: &[f64], new: &[f64]| Group { weight: 0.5, old: old.to_vec(), new: new.to_vec() };
        let mut cell = Cell {
            middle: Middle::Mean,
            groups: vec![group(&[1.0, 3.0], &[2.0, 2.0, 8.0]), group(&[6.0, 6.0], &[12.0, 12.0])],
        };
        assert_eq!((cell.figures(), cell.least()), ([4.0, 8.0], 2));
        assert_eq!(cell.log_ratio(), 2f64.ln());
        // Of the old side 2 / 2 samples · (0.5 / 4)², of the new one 12 / 3 · (0.5 / 8)².
        assert_eq!(cell.variances().unwrap()[..2], [(1.0 / 64.0, 1.0), (4.0 / 256.0, 2.0)]);
        assert_eq!(cell.variance(), Some(1.0 / 32.0));
        // 10 ways for the first group and 6 for the second.
        assert_eq!(least_p(cell.groups.iter()), 1.0 / 60.0);
        cell.middle = Middle::Median;
        assert_eq!(cell.figures(), [4.0, 7.0]);
        cell.groups[1].old.pop();
        assert_eq!(cell.variance(), None);
    }
}
