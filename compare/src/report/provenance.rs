//! Where a number of a point comes from: how many samples, and between what it lies.

use super::number::{count, grouped};
use crate::estimate::estimate;
use crate::figure::Figure;
use record::{Point, Rays};

/// In a sentence.
pub fn provenance(point: &Point, figure: Figure) -> String {
    match figure {
        Figure::Primary => rate(point, Rays::Primary),
        Figure::Secondary => rate(point, Rays::Secondary),
        Figure::Build | Figure::Total | Figure::Sampling => {
            let builds = format!("median of {}", count(point.build.repetitions.len(), "build"));
            let adapted: Vec<usize> = (point.views.iter())
                .filter_map(|view| Some(view.adaptation.as_ref()?.sampling_milliseconds.len()))
                .collect();
            match adapted.iter().sum() {
                0 => builds,
                repetitions => format!(
                    "{builds} of the binary tree, and the mean over {} of medians of sampling and final build, {} in all",
                    count(adapted.len(), "view"),
                    grouped(repetitions as u64)
                ),
            }
        }
        Figure::Nodes | Figure::Boxes | Figure::Triangles => match point.counters() {
            Some(counters) => {
                format!("counted over {} rays in a run of its own", grouped(counters.all().rays))
            }
            None => "not counted on every view".into(),
        },
        _ => match point.trees().len() {
            1 => "of the one tree".into(),
            trees => format!("mean over the trees of {}", count(trees, "view")),
        },
    }
}

fn rate(point: &Point, rays: Rays) -> String {
    let all: usize = point.views.iter().map(|view| view.samples.len()).sum();
    let counted: usize = point.views.iter().map(|view| view.counted().count()).sum();
    let samples = match all - counted {
        0 => format!("mean of {} over {}", count(all, "sample"), count(point.views.len(), "view")),
        left_out => format!(
            "mean of {} over {}; {left_out} left out",
            count(counted, "sample"),
            count(point.views.len(), "view")
        ),
    };
    match estimate(point, rays) {
        Some(estimate) => {
            let [low, high] = [-1.0, 1.0].map(|sign| estimate.mean + sign * estimate.half_width());
            format!("{samples}; 95% interval {} to {} MRps", precise(low), precise(high))
        }
        None => format!("{samples}; no interval, as a view has fewer than two"),
    }
}

/// A value with one digit more than tables show.
fn precise(value: f64) -> String {
    if value.abs() >= 99.95 { format!("{value:.1}") } else { format!("{value:.3}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::example;

    #[test]
    fn a_rate_names_its_samples_and_its_interval() {
        let record = example();
        let text = provenance(&record.results[0], Figure::Primary);
        assert!(text.starts_with("mean of 2 samples over 1 view; 1 left out; 95% interval 17"), "{text}");
        let text = provenance(&record.results[1], Figure::Secondary);
        assert_eq!(text, "mean of 1 sample over 1 view; no interval, as a view has fewer than two");
    }

    #[test]
    fn every_figure_comes_from_somewhere() {
        for point in &example().results {
            for figure in Figure::ALL {
                assert!(!provenance(point, figure).is_empty(), "{figure:?}");
            }
        }
    }
}
