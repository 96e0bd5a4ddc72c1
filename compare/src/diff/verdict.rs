//! What comes of a change.

use crate::figure::{Better, Figure};
use crate::stats::{Goal, Interval, samples};
use serde::Serialize;

/// Chance explains what is at least so probable.
pub const SIGNIFICANT: f64 = 0.05;

/// What comes of a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Faster by at least the threshold, and chance is a poor explanation.
    Faster,
    /// Slower by at least the threshold, and chance is a poor explanation.
    Slower,
    /// If there is a change at all, it is below the threshold.
    Same,
    /// Neither is sure.
    Unclear,
}

impl Verdict {
    /// As a word.
    pub fn word(self) -> &'static str {
        match self {
            Verdict::Faster => "faster",
            Verdict::Slower => "slower",
            Verdict::Same => "same",
            Verdict::Unclear => "unclear",
        }
    }
}

/// What a verdict is made of.
#[derive(Clone, Copy, Debug)]
pub struct Evidence {
    /// What is compared.
    pub figure: Figure,
    /// New over old.
    pub ratio: f64,
    /// The interval of the ratio.
    pub interval: Option<Interval>,
    /// The p-value after Holm's correction.
    pub p: Option<f64>,
    /// The variance of the ratio's logarithm.
    pub variance: Option<f64>,
    /// Samples that each view has, at least.
    pub samples: usize,
}

impl Evidence {
    /// Whether chance is a poor explanation. The interval is asked too, because of builds the test compares means,
    /// and what is printed are medians.
    pub fn significant(&self) -> bool {
        let leaves_out_none = |interval: &Interval| interval.low > 1.0 || interval.high < 1.0;
        self.p.is_some_and(|p| p < SIGNIFICANT) && self.interval.as_ref().is_some_and(leaves_out_none)
    }

    /// The verdict where changes below `threshold` are as good as none, and about how many samples a view it would
    /// take to have another one than [`Verdict::Unclear`].
    pub fn verdict(&self, threshold: f64, tests: usize) -> (Verdict, Option<usize>) {
        let beyond = (self.ratio - 1.0).abs() >= threshold;
        if self.significant() && beyond {
            let faster = (self.ratio > 1.0) == (self.figure.better() == Better::High);
            return (if faster { Verdict::Faster } else { Verdict::Slower }, None);
        }
        let within =
            |interval: &Interval| interval.low >= 1.0 - threshold && interval.high <= 1.0 + threshold;
        if self.interval.as_ref().is_some_and(within) {
            return (Verdict::Same, None);
        }
        let goal = if beyond { Goal::Change { tests } } else { Goal::NoneAbove((1.0 + threshold).ln()) };
        let needed =
            self.variance.and_then(|variance| samples(goal, self.ratio.ln(), variance, self.samples));
        (Verdict::Unclear, needed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evidence(figure: Figure, ratio: f64, half_width: f64, p: f64) -> Evidence {
        let interval = Some(Interval { low: ratio - half_width, high: ratio + half_width });
        let variance = Some((half_width / 2.0).powi(2));
        Evidence { figure, ratio, interval, p: Some(p), variance, samples: 10 }
    }

    fn verdict(evidence: Evidence) -> Verdict {
        evidence.verdict(0.01, 10).0
    }

    #[test]
    fn less_time_is_faster_and_so_is_a_higher_rate() {
        assert_eq!(verdict(evidence(Figure::Primary, 1.05, 0.01, 0.001)), Verdict::Faster);
        assert_eq!(verdict(evidence(Figure::Primary, 0.95, 0.01, 0.001)), Verdict::Slower);
        assert_eq!(verdict(evidence(Figure::Total, 1.05, 0.01, 0.001)), Verdict::Slower);
        assert_eq!(verdict(evidence(Figure::Total, 0.95, 0.01, 0.001)), Verdict::Faster);
    }

    #[test]
    fn a_small_change_is_the_same_however_sure_it_is() {
        assert_eq!(verdict(evidence(Figure::Primary, 1.005, 0.001, 0.001)), Verdict::Same);
        assert_eq!(verdict(evidence(Figure::Primary, 1.001, 0.003, 0.5)), Verdict::Same);
        assert_eq!(verdict(evidence(Figure::Primary, 1.008, 0.005, 0.001)), Verdict::Unclear);
    }

    #[test]
    fn what_is_unclear_says_how_many_samples_would_tell() {
        let (verdict, more) = evidence(Figure::Primary, 1.05, 0.08, 0.6).verdict(0.01, 10);
        assert_eq!((verdict, more), (Verdict::Unclear, Some(90)));
        let (verdict, less) = evidence(Figure::Primary, 1.001, 0.02, 0.9).verdict(0.01, 10);
        assert_eq!((verdict, less), (Verdict::Unclear, Some(98)));
        let nobody = Evidence { interval: None, p: None, ..evidence(Figure::Primary, 2.0, 0.1, 0.0) };
        assert_eq!(nobody.verdict(0.01, 10), (Verdict::Unclear, Some(11)));
        assert!(!nobody.significant());
    }

    #[test]
    fn a_median_whose_interval_has_no_change_in_it_is_not_significant() {
        assert!(!evidence(Figure::Total, 1.02, 0.03, 0.001).significant());
    }
}
