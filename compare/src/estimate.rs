//! How sure a point's rate is.

use crate::stats::blocks;
use record::stats::Estimate;
use record::{Point, Rays};

/// A point's rate (see [`Point::estimate`]), whose neighbouring samples need not be independent: see [`blocks`].
pub fn estimate(point: &Point, rays: Rays) -> Option<Estimate> {
    let independent = point.estimate(rays)?;
    // A view without such rays has no part in the mean.
    let views = point.views.iter().map(|view| view.rates(rays)).filter(|rates| !rates.is_empty());
    let of_views: Vec<Estimate> =
        blocks::alone(views.collect()).iter().map(|blocks| Estimate::of(blocks)).collect::<Option<_>>()?;
    Some(Estimate { mean: independent.mean, ..Estimate::average(&of_views)? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::{Launch, Sample, example};

    /// A view of primary rays only.
    fn point(rates: impl Iterator<Item = f64>) -> Point {
        let mut point = example().results.swap_remove(0);
        let sample = |mrps: f64| Sample {
            depths: vec![Launch { rays: 1_000_000, milliseconds: 1e3 / mrps }],
            ..Sample::default()
        };
        point.views[0].samples = rates.map(sample).collect();
        point
    }

    #[test]
    fn few_independent_samples_are_taken_as_they_are() {
        let point = point([100.0, 103.0, 101.0, 102.0, 100.5].into_iter());
        assert_eq!(estimate(&point, Rays::Primary), point.estimate(Rays::Primary));
        assert_eq!(estimate(&point, Rays::Secondary), None);
    }

    #[test]
    fn a_rate_that_wanders_is_less_sure() {
        let point = point((0..30).map(|at| 100.0 + (f64::from(at) / 4.0).sin()));
        let [blind, seeing] =
            [point.estimate(Rays::Primary), estimate(&point, Rays::Primary)].map(Option::unwrap);
        assert_eq!(seeing.mean, blind.mean);
        assert!(seeing.half_width() > 2.0 * blind.half_width(), "{seeing:?}, {blind:?}");
    }
}
