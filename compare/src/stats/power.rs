//! How many samples would tell.

use super::ways;
use statrs::distribution::{ContinuousCDF, Normal};

/// How probable it shall be that so many samples do tell.
const POWER: f64 = 0.8;

/// More samples than this are not worth naming.
const MOST: f64 = 100_000.0;

/// What shall be told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// That there is a change, significant among so many tests.
    Change {
        /// The tests of the table.
        tests: usize,
        /// The groups whose samples change sides, such as views.
        groups: usize,
    },
    /// That there is none larger than this logarithm of a ratio.
    NoneAbove(f64),
}

/// About how many samples of each view and side would reach the goal in four of five attempts, if the true change is
/// the one that was measured and samples go on to scatter as these. Nothing where no reasonable number would.
///
/// `change` is the logarithm of the ratio, `variance` its variance with `now` samples, which falls with their number.
/// The normal distribution stands for Student's t (Lehr's and like formulas; Chow, Shao and Wang 2008, section 3.2):
/// it is a plan, not a verdict.
pub fn samples(goal: Goal, change: f64, variance: f64, now: usize) -> Option<usize> {
    let normal = Normal::standard();
    let (distance, level, fewest) = match goal {
        // The first step of Holm's correction, two-sided.
        Goal::Change { tests, groups } => {
            let level = 0.05 / tests.max(1) as f64;
            (change.abs(), level / 2.0, fewest(level, groups))
        }
        // Both ends of a 95% interval within the limit.
        Goal::NoneAbove(limit) => (limit - change.abs(), 0.025, 0),
    };
    if distance <= 0.0 || now == 0 {
        return None;
    }
    let deviations = normal.inverse_cdf(1.0 - level) + normal.inverse_cdf(POWER);
    let needed = now as f64 * variance * (deviations / distance).powi(2);
    (needed <= MOST).then(|| (needed.ceil() as usize).max(now + 1).max(fewest))
}

/// With fewer samples than this of each group and side, no exchange of them has a p below the level, whatever is
/// measured.
fn fewest(level: f64, groups: usize) -> usize {
    let least_p = |each: usize| 2.0 / ways(each, each).powi(groups.max(1) as i32);
    (1..).find(|&each| least_p(each) < level).unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_formula() {
        // A difference of half a deviation between two groups: (1.96 + 0.8416)² · 2 / 0.25 = 62.8 (Lehr: 16 / 0.25).
        let now = 10;
        let variance = 2.0 / now as f64;
        assert_eq!(samples(Goal::Change { tests: 1, groups: 9 }, 0.5, variance, now), Some(63));
        assert_eq!(samples(Goal::Change { tests: 1, groups: 9 }, -0.5, variance, now), Some(63));
        // Ten tests: 2.807 in place of 1.96.
        assert_eq!(samples(Goal::Change { tests: 10, groups: 9 }, 0.5, variance, now), Some(107));
        assert_eq!(samples(Goal::NoneAbove(0.75), 0.25, variance, now), Some(63));
    }

    #[test]
    fn what_no_number_tells_has_none() {
        assert_eq!(samples(Goal::Change { tests: 1, groups: 9 }, 0.0, 1.0, 10), None);
        assert_eq!(samples(Goal::NoneAbove(0.01), 0.02, 1.0, 10), None);
        assert_eq!(samples(Goal::Change { tests: 1, groups: 9 }, 1e-9, 1.0, 10), None);
        assert_eq!(
            samples(Goal::Change { tests: 1, groups: 9 }, 1.0, 1e-9, 3),
            Some(4),
            "more than there are, at any rate"
        );
    }

    #[test]
    fn with_fewer_nothing_could_be_significant() {
        // Of one view, 2 / C(2n, n) is below 5% from 4 samples on, and below 5% / 75 from 7 on; of eight, from 2.
        let needed = |tests, groups| samples(Goal::Change { tests, groups }, 1.0, 1e-9, 1);
        assert_eq!((needed(1, 1), needed(75, 1), needed(75, 8)), (Some(4), Some(7), Some(2)));
    }
}
