//! When a point has enough samples.

use record::{Point, Rays, Stop, stats::Estimate};
use std::time::Duration;

/// How many samples a point gets.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampling {
    /// Fewest samples of a view that count.
    pub least: u32,
    /// Most samples of a view, those that do not count included.
    pub most: u32,
    /// Half the width of the 95% confidence interval of both rates, as a share of the mean, that is enough.
    pub half_width: f64,
    /// How long a point may take; the fewest samples are always taken.
    pub time: Duration,
}

/// Whether to go on.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// No.
    Stop(Stop),
    /// Until each view has so many samples that count.
    Go {
        /// Of a view.
        samples: u32,
    },
}

impl Sampling {
    /// Exactly so many.
    pub fn exactly(samples: u32) -> Self {
        Self { least: samples, most: samples, half_width: f64::INFINITY, time: Duration::MAX }
    }

    /// Whether the number of samples is given.
    pub fn is_exact(&self) -> bool {
        self.least == self.most
    }

    /// Whether too few samples of a view count for the rates to be believed: fewer than the fewest or, where their
    /// number is given and none can be added, fewer than half.
    pub fn is_too_few(&self, point: &Point) -> bool {
        let needed = if self.is_exact() { self.least.div_ceil(2) } else { self.least };
        point.views.iter().any(|view| view.counted().count() < needed as usize)
    }

    /// Judges a point all of whose views have been measured, after the time that it has taken.
    ///
    /// The half-width falls with the square root of the samples, so that says how many are needed. As the
    /// scatter is not known well from a few, each round doubles them at most.
    pub fn judge(&self, point: &Point, taken: Duration) -> Verdict {
        if self.is_exact() {
            return Verdict::Stop(Stop::Samples);
        }
        let concerned =
            [Rays::Primary, Rays::Secondary].into_iter().filter(|&rays| point.rate(rays).is_some());
        // Unknown, where a view has fewer than two samples that count, is as wide as can be.
        let widest = concerned
            .map(|rays| point.estimate(rays).as_ref().map_or(f64::INFINITY, Estimate::relative_half_width))
            .fold(0.0, f64::max);
        let counted = point.views.iter().map(|view| view.counted().count() as u32);
        let least = counted.clone().min().unwrap_or(0);
        if widest <= self.half_width && least >= self.least {
            return Verdict::Stop(Stop::Precise);
        }
        if point.views.iter().all(|view| view.samples.len() >= self.most as usize) {
            return Verdict::Stop(Stop::Samples);
        }
        if taken >= self.time {
            return Verdict::Stop(Stop::Time);
        }
        let wanted = f64::from(least) * (widest / self.half_width).powi(2);
        let more = self.least.max(least + 1);
        let samples = (wanted.ceil() as u32).clamp(more, more.max(2 * least));
        Verdict::Go { samples: samples.min(self.most) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::{Exclusion, Launch, Sample, example};

    fn point(views: &[&[f64]]) -> Point {
        let mut point = example().results[0].clone();
        let view = point.views[0].clone();
        point.views = views
            .iter()
            .map(|times| {
                let mut view = view.clone();
                let depths = |&milliseconds: &f64| vec![Launch { rays: 1_000_000, milliseconds }; 2];
                view.samples =
                    times.iter().map(|time| Sample { depths: depths(time), ..Sample::default() }).collect();
                view
            })
            .collect();
        point
    }

    const SAMPLING: Sampling =
        Sampling { least: 3, most: 20, half_width: 0.01, time: Duration::from_secs(60) };
    const EARLY: Duration = Duration::from_secs(1);

    #[test]
    fn precision_stops_and_scatter_goes_on() {
        let steady = [1.0, 1.001, 0.999, 1.0];
        assert_eq!(SAMPLING.judge(&point(&[&steady, &steady]), EARLY), Verdict::Stop(Stop::Precise));
        // Half-width about 8% of the mean: 64 times as many are needed, twice as many come next.
        let wild = [1.0, 1.1, 1.0, 1.1];
        assert_eq!(SAMPLING.judge(&point(&[&wild, &wild]), EARLY), Verdict::Go { samples: 8 });
        let mild = [1.0, 1.01, 1.0, 1.01, 1.0, 1.01];
        let Verdict::Go { samples } =
            (Sampling { half_width: 0.005, ..SAMPLING }).judge(&point(&[&mild]), EARLY)
        else {
            panic!("0.57% is more than 0.5%");
        };
        assert!((7..=9).contains(&samples), "{samples}");
    }

    #[test]
    fn more_views_tell_the_mean_better() {
        let times = [1.0, 1.012, 1.0, 1.012];
        assert!(matches!(SAMPLING.judge(&point(&[&times]), EARLY), Verdict::Go { .. }));
        assert_eq!(SAMPLING.judge(&point(&[&times[..]; 8]), EARLY), Verdict::Stop(Stop::Precise));
    }

    #[test]
    fn caps_stop() {
        let wild: Vec<f64> = (0..20).map(|i| 1.0 + 0.2 * f64::from(i % 2)).collect();
        assert_eq!(SAMPLING.judge(&point(&[&wild]), EARLY), Verdict::Stop(Stop::Samples));
        let late = Duration::from_secs(61);
        assert_eq!(SAMPLING.judge(&point(&[&wild[..4]]), late), Verdict::Stop(Stop::Time));
        assert_eq!(Sampling::exactly(4).judge(&point(&[&wild[..4]]), late), Verdict::Stop(Stop::Samples));
    }

    #[test]
    fn with_too_few_samples_that_count_a_point_is_unreliable() {
        let mut one = point(&[&[1.0; 5], &[1.0; 5]]);
        assert!(!SAMPLING.is_too_few(&one) && !Sampling::exactly(5).is_too_few(&one));
        for sample in &mut one.views[1].samples[..2] {
            sample.excluded = Some(Exclusion::WarmUp);
        }
        assert!(!SAMPLING.is_too_few(&one) && !Sampling::exactly(5).is_too_few(&one));
        one.views[1].samples[2].excluded = Some(Exclusion::LowClock);
        assert!(SAMPLING.is_too_few(&one) && Sampling::exactly(5).is_too_few(&one));
    }

    #[test]
    fn samples_that_do_not_count_are_made_up_for() {
        let mut one = point(&[&[1.0; 4]]);
        for sample in &mut one.views[0].samples[..2] {
            sample.excluded = Some(Exclusion::Throttled);
        }
        assert_eq!(SAMPLING.judge(&one, EARLY), Verdict::Go { samples: 3 });
        for sample in &mut one.views[0].samples {
            sample.excluded = Some(Exclusion::Throttled);
        }
        assert_eq!(SAMPLING.judge(&one, EARLY), Verdict::Go { samples: 3 });
        one.views[0].samples = vec![one.views[0].samples[0].clone(); 20];
        assert_eq!(SAMPLING.judge(&one, EARLY), Verdict::Stop(Stop::Samples));
    }
}
