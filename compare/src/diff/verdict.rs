//! What comes of a change.

use crate::figure::{Better, Figure};
use crate::stats::{Goal, Interval, samples};
use serde::Serialize;

/// Chance explains what is at least so probable.
pub const SIGNIFICANT: f64 = 0.05;

/// Changes below these shares are as good as none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Thresholds {
    /// Of rates.
    pub rates: f64,
    /// Of the time of builds. It stands for chance, too: all builds of a run share where its memory lies, so that two
    /// runs of one program differ by more than their builds do. Two runs on an H100 differed by up to 2.4%, and by
    /// 4.2% where sample rays are traced; their rates by 0.4% (reports/h100: first.json,
    /// again.json).
    pub builds: f64,
}

impl Default for Thresholds {
    fn default() -> Thresholds {
        Thresholds { rates: 0.01, builds: 0.05 }
    }
}

impl Thresholds {
    fn of(&self, figure: Figure) -> f64 {
        if figure == Figure::Total { self.builds } else { self.rates }
    }
}

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
    /// The groups whose samples change sides in the test, such as views.
    pub groups: usize,
    /// The smallest p that so many samples can have.
    pub least_p: f64,
}

impl Evidence {
    /// Whether chance is a poor explanation. The interval is asked too, because of builds the test compares means,
    /// and what is printed are medians. So is the threshold of builds: below it, runs differ by chance.
    pub fn significant(&self, thresholds: Thresholds) -> bool {
        let leaves_out_none = |interval: &Interval| interval.low > 1.0 || interval.high < 1.0;
        self.p.is_some_and(|p| p < SIGNIFICANT)
            && self.interval.as_ref().is_some_and(leaves_out_none)
            && (self.figure != Figure::Total || self.beyond(thresholds))
    }

    /// Whether there are too few samples to tell: none, or so few that nothing could be significant among so many
    /// tests, however large it is.
    pub fn too_few(&self, tests: usize) -> bool {
        let possible = self.least_p * (tests.max(1) as f64) < SIGNIFICANT;
        self.interval.is_none() || self.p.is_none_or(|p| p >= SIGNIFICANT && !possible)
    }

    fn beyond(&self, thresholds: Thresholds) -> bool {
        (self.ratio - 1.0).abs() >= thresholds.of(self.figure)
    }

    /// The verdict, and about how many samples a view it would take to have another one than [`Verdict::Unclear`].
    pub fn verdict(&self, thresholds: Thresholds, tests: usize) -> (Verdict, Option<usize>) {
        let (threshold, beyond) = (thresholds.of(self.figure), self.beyond(thresholds));
        if self.significant(thresholds) && beyond {
            let faster = (self.ratio > 1.0) == (self.figure.better() == Better::High);
            return (if faster { Verdict::Faster } else { Verdict::Slower }, None);
        }
        let within =
            |interval: &Interval| interval.low >= 1.0 - threshold && interval.high <= 1.0 + threshold;
        if self.interval.as_ref().is_some_and(within) {
            return (Verdict::Same, None);
        }
        let goal = if beyond {
            Goal::Change { tests, groups: self.groups }
        } else {
            Goal::NoneAbove((1.0 + threshold).ln())
        };
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
        Evidence { figure, ratio, interval, p: Some(p), variance, samples: 10, groups: 4, least_p: 1e-9 }
    }

    fn verdict(evidence: Evidence) -> Verdict {
        evidence.verdict(Thresholds::default(), 10).0
    }

    #[test]
    fn less_time_is_faster_and_so_is_a_higher_rate() {
        assert_eq!(verdict(evidence(Figure::Primary, 1.05, 0.01, 0.001)), Verdict::Faster);
        assert_eq!(verdict(evidence(Figure::Primary, 0.95, 0.01, 0.001)), Verdict::Slower);
        assert_eq!(verdict(evidence(Figure::Total, 1.06, 0.01, 0.001)), Verdict::Slower);
        assert_eq!(verdict(evidence(Figure::Total, 0.94, 0.01, 0.001)), Verdict::Faster);
    }

    #[test]
    fn a_small_change_is_the_same_however_sure_it_is() {
        assert_eq!(verdict(evidence(Figure::Primary, 1.005, 0.001, 0.001)), Verdict::Same);
        assert_eq!(verdict(evidence(Figure::Primary, 1.001, 0.003, 0.5)), Verdict::Same);
        assert_eq!(verdict(evidence(Figure::Primary, 1.008, 0.005, 0.001)), Verdict::Unclear);
    }

    #[test]
    fn what_is_unclear_says_how_many_samples_would_tell() {
        let (verdict, more) = evidence(Figure::Primary, 1.05, 0.08, 0.6).verdict(Thresholds::default(), 10);
        assert_eq!((verdict, more), (Verdict::Unclear, Some(90)));
        let (verdict, less) = evidence(Figure::Primary, 1.001, 0.02, 0.9).verdict(Thresholds::default(), 10);
        assert_eq!((verdict, less), (Verdict::Unclear, Some(98)));
        let nobody = Evidence { interval: None, p: None, ..evidence(Figure::Primary, 2.0, 0.1, 0.0) };
        assert_eq!(nobody.verdict(Thresholds::default(), 10), (Verdict::Unclear, Some(11)));
        assert!(!nobody.significant(Thresholds::default()));
    }

    #[test]
    fn a_median_whose_interval_has_no_change_in_it_is_not_significant() {
        assert!(!evidence(Figure::Total, 1.06, 0.07, 0.001).significant(Thresholds::default()));
    }

    #[test]
    fn what_runs_differ_by_is_no_change_of_builds() {
        let change = evidence(Figure::Total, 1.03, 0.005, 0.001);
        assert!(!change.significant(Thresholds::default()));
        assert_eq!(verdict(change), Verdict::Same);
        let fine = Thresholds { builds: 0.02, ..Thresholds::default() };
        assert!(change.significant(fine));
        assert_eq!(change.verdict(fine, 10).0, Verdict::Slower);
    }
}
