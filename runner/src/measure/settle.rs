//! Warm-up is detected: the first samples of a view that do not look like the rest are marked, and do not count.
//!
//! The rule. Each sample has a time a ray, over all depths. The later half of the samples that are not excluded
//! already is taken to be settled. Its band is its median ± the larger of three deviations (1.4826 times the
//! median distance from the median) and 0.5% of the median. From the first sample on, those outside the band are
//! left out, up to the first one inside, and never more than half of all. Fewer than four samples say nothing.
//!
//! ```text
//! time   ×
//!          ×                          dropped: the first two
//!            ×     ×           ×      ┐ band
//!              ×  ×   ×  ×  ×     ×   ┘
//!                      └ later half ┘
//! ```
//!
//! A slow clock excludes a sample by itself; what is left to find here is what NVML does not show, such as cold
//! caches, memory that is moved, or clocks that rise between two readings.

use record::{Exclusion, Sample, stats};

const FEWEST: usize = 4;
const DEVIATIONS: f64 = 3.0;
const LEAST_BAND: f64 = 0.005;

/// Marks the samples of the warm-up, and unmarks those that turn out not to be.
pub fn mark(samples: &mut [Sample]) {
    let warm_up = Some(Exclusion::WarmUp);
    let candidates: Vec<usize> =
        (0..samples.len()).filter(|&i| samples[i].excluded.is_none_or(|e| Some(e) == warm_up)).collect();
    let times: Vec<f64> = candidates.iter().map(|&i| time_a_ray(&samples[i])).collect();
    let dropped = warming(&times);
    for (place, &i) in candidates.iter().enumerate() {
        samples[i].excluded = if place < dropped { warm_up } else { None };
    }
}

/// How many of the first values are not like the later half.
fn warming(values: &[f64]) -> usize {
    if values.len() < FEWEST {
        return 0;
    }
    let settled = &values[values.len() / 2..];
    let (Some(middle), Some(deviation)) = (stats::median(settled), stats::deviation(settled)) else {
        return 0;
    };
    let band = (DEVIATIONS * deviation).max(LEAST_BAND * middle);
    let outside = values.iter().take_while(|value| (*value - middle).abs() > band).count();
    outside.min(values.len() / 2)
}

fn time_a_ray(sample: &Sample) -> f64 {
    let rays: u64 = sample.depths.iter().map(|launch| launch.rays).sum();
    let milliseconds: f64 = sample.depths.iter().map(|launch| launch.milliseconds).sum();
    milliseconds / rays.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::Launch;

    fn samples(times: &[f64]) -> Vec<Sample> {
        times
            .iter()
            .map(|&milliseconds| Sample {
                depths: vec![Launch { rays: 1000, milliseconds }],
                ..Sample::default()
            })
            .collect()
    }

    #[track_caller]
    fn dropped(times: &[f64]) -> usize {
        let mut samples = samples(times);
        mark(&mut samples);
        let count = samples.iter().filter(|s| s.excluded == Some(Exclusion::WarmUp)).count();
        assert!(samples[..count].iter().all(|s| s.excluded.is_some()), "only the first can be warm-up");
        count
    }

    #[test]
    fn a_rising_clock_is_left_out() {
        assert_eq!(dropped(&[2.0, 1.6, 1.3, 1.1, 1.01, 1.0, 1.01, 0.99, 1.0, 1.01, 0.99, 1.0]), 4);
        assert_eq!(dropped(&[1.5, 1.0, 1.0, 1.0]), 1);
        // A warm device that becomes slower is not settled at its beginning either.
        assert_eq!(dropped(&[0.8, 0.9, 1.0, 1.0, 1.0, 1.0]), 2);
    }

    #[test]
    fn noise_is_kept() {
        assert_eq!(dropped(&[1.004, 1.0, 1.0, 1.0, 1.0]), 0, "within 0.5%");
        assert_eq!(dropped(&[1.02, 0.98, 1.01, 0.99, 1.02, 0.98, 1.01, 0.99]), 0);
        // One slow sample later on is an outlier, not a warm-up.
        assert_eq!(dropped(&[1.0, 1.5, 1.0, 1.0, 1.0, 1.0]), 0);
    }

    #[test]
    fn half_of_the_samples_stays_and_few_say_nothing() {
        assert_eq!(dropped(&[8.0, 7.0, 6.0, 5.0, 1.0, 1.0]), 3);
        assert_eq!(dropped(&[9.0, 1.0, 1.0]), 0);
        assert_eq!(dropped(&[]), 0);
    }

    #[test]
    fn further_samples_can_tell_that_the_first_were_alright() {
        let mut all = samples(&[2.0, 1.0, 1.0, 1.0]);
        mark(&mut all);
        assert_eq!(all[0].excluded, Some(Exclusion::WarmUp));
        all.extend(samples(&[2.0, 1.9, 2.1, 2.0, 2.0, 1.95, 2.05, 2.0]));
        mark(&mut all);
        assert_eq!(all[0].excluded, None);
    }

    #[test]
    fn what_is_excluded_already_neither_counts_nor_changes() {
        let mut all = samples(&[9.0, 1.5, 1.0, 1.0, 1.0, 1.0]);
        all[0].excluded = Some(Exclusion::Throttled);
        mark(&mut all);
        assert_eq!(all[0].excluded, Some(Exclusion::Throttled));
        assert_eq!(all[1].excluded, Some(Exclusion::WarmUp));
        assert!(all[2..].iter().all(|s| s.excluded.is_none()));
    }
}
