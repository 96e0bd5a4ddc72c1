//! How many samples would tell.

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
    let (distance, level) = match goal {
        // The first step of Holm's correction, two-sided.
        Goal::Change { tests } => (change.abs(), 0.05 / tests.max(1) as f64 / 2.0),
        // Both ends of a 95% interval within the limit.
        Goal::NoneAbove(limit) => (limit - change.abs(), 0.025),
    };
    if distance <= 0.0 || now == 0 {
        return None;
    }
    let deviations = normal.inverse_cdf(1.0 - level) + normal.inverse_cdf(POWER);
    let needed = now as f64 * variance * (deviations / distance).powi(2);
    // With fewer, nothing is significant whatever is measured.
    (needed <= MOST).then(|| (needed.ceil() as usize).max(now + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_formula() {
        // A difference of half a deviation between two groups: (1.96 + 0.8416)² · 2 / 0.25 = 62.8 (Lehr: 16 / 0.25).
        let now = 10;
        let variance = 2.0 / now as f64;
        assert_eq!(samples(Goal::Change { tests: 1 }, 0.5, variance, now), Some(63));
        assert_eq!(samples(Goal::Change { tests: 1 }, -0.5, variance, now), Some(63));
        // Ten tests: 2.807 in place of 1.96.
        assert_eq!(samples(Goal::Change { tests: 10 }, 0.5, variance, now), Some(107));
        assert_eq!(samples(Goal::NoneAbove(0.75), 0.25, variance, now), Some(63));
    }

    #[test]
    fn what_no_number_tells_has_none() {
        assert_eq!(samples(Goal::Change { tests: 1 }, 0.0, 1.0, 10), None);
        assert_eq!(samples(Goal::NoneAbove(0.01), 0.02, 1.0, 10), None);
        assert_eq!(samples(Goal::Change { tests: 1 }, 1e-9, 1.0, 10), None);
        assert_eq!(
            samples(Goal::Change { tests: 1 }, 1.0, 1e-9, 3),
            Some(4),
            "more than there are, at any rate"
        );
    }
}
