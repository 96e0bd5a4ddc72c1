//! What follows from a record's fields. Rates are in MRps: million rays per second of the traversal
//! kernel alone. Within a sample, the rays of all bounces are divided by the time of all bounces; over
//! samples and views the rates are averaged, each sample and each view counting alike, as the thesis
//! does (Cezner 2025, section 6.2).

use crate::{Adaptation, Build, Count, Counters, Launch, Phase, Point, Repetition, Sample, Tree, View};
use std::iter::Sum;
use std::ops::Add;

/// The mean, or nothing when there is nothing to average or one of the values is missing.
pub fn mean(values: impl IntoIterator<Item = Option<f64>>) -> Option<f64> {
    let values: Vec<f64> = values.into_iter().collect::<Option<_>>()?;
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Million rays per second over some launches together; nothing when there were no rays or no time.
fn mrps(launches: &[Launch]) -> Option<f64> {
    let rays: u64 = launches.iter().map(|launch| launch.rays).sum();
    let milliseconds: f64 = launches.iter().map(|launch| launch.milliseconds).sum();
    (rays > 0 && milliseconds > 0.0).then(|| rays as f64 / (milliseconds * 1e3))
}

impl Launch {
    /// Million rays per second.
    pub fn mrps(&self) -> Option<f64> {
        mrps(std::slice::from_ref(self))
    }
}

impl Sample {
    /// Million rays per second of one wavefront; depth 0 is the primary rays.
    pub fn mrps(&self, depth: usize) -> Option<f64> {
        self.depths.get(depth)?.mrps()
    }

    /// Million primary rays per second.
    pub fn primary_mrps(&self) -> Option<f64> {
        self.mrps(0)
    }

    /// Million secondary rays per second: the rays of all bounces over their summed time.
    pub fn secondary_mrps(&self) -> Option<f64> {
        mrps(self.depths.get(1..)?)
    }
}

impl View {
    /// Million rays per second of one wavefront, averaged over the samples.
    ///
    /// A sample whose paths had all ended before that depth has no rate there and is left out.
    pub fn mrps(&self, depth: usize) -> Option<f64> {
        mean(self.samples.iter().map(|sample| sample.mrps(depth)).filter(Option::is_some))
    }

    /// Million primary rays per second, averaged over the samples.
    pub fn primary_mrps(&self) -> Option<f64> {
        mean(self.samples.iter().map(Sample::primary_mrps))
    }

    /// Million secondary rays per second, averaged over the samples.
    pub fn secondary_mrps(&self) -> Option<f64> {
        mean(self.samples.iter().map(Sample::secondary_mrps).filter(Option::is_some))
    }

    /// Whether the device was being slowed down before or after the view; unknown where it did not
    /// say.
    pub fn throttled(&self) -> Option<bool> {
        match (self.before.throttled(), self.after.throttled()) {
            (Some(true), _) | (_, Some(true)) => Some(true),
            (Some(false), Some(false)) => Some(false),
            _ => None,
        }
    }
}

impl Point {
    /// Million rays per second of one wavefront, averaged over the views that had such rays.
    pub fn mrps(&self, depth: usize) -> Option<f64> {
        mean(self.views.iter().map(|view| view.mrps(depth)).filter(Option::is_some))
    }

    /// Million primary rays per second, averaged over the views.
    pub fn primary_mrps(&self) -> Option<f64> {
        mean(self.views.iter().map(View::primary_mrps))
    }

    /// Million secondary rays per second, averaged over the views that had any.
    pub fn secondary_mrps(&self) -> Option<f64> {
        mean(self.views.iter().map(View::secondary_mrps).filter(Option::is_some))
    }

    /// The counters of all views together; nothing when one of them was not counted.
    pub fn counters(&self) -> Option<Counters> {
        let counters: Vec<_> = self.views.iter().map(|view| view.counters.as_ref()).collect::<Option<_>>()?;
        let deepest = counters.iter().map(|counters| counters.depths.len()).max()?;
        let at = |depth| counters.iter().filter_map(|counters| counters.depths.get(depth)).sum();
        Some(Counters { depths: (0..deepest).map(at).collect() })
    }
}

impl Point {
    /// Milliseconds of all builds that a picture from one view takes, as a median over repetitions: of a
    /// variant that goes by view the first and the final one, the latter averaged over the views.
    pub fn build_milliseconds(&self) -> Option<f64> {
        let first = self.build.median_milliseconds()?;
        if self.adaptations().next().is_none() {
            return Some(first);
        }
        Some(first + mean(self.adaptations().map(|a| a.build.median_milliseconds()))?)
    }

    /// Milliseconds of tracing the sample rays of one view: a median over repetitions, averaged over the
    /// views. Nothing where the variant does not go by view.
    pub fn sampling_milliseconds(&self) -> Option<f64> {
        mean(self.adaptations().map(|a| median(&a.sampling_milliseconds)))
    }

    /// The trees that were traced: the one for all views, or those of the views.
    pub fn trees(&self) -> Vec<&Tree> {
        let own: Vec<&Tree> = self.adaptations().map(|a| &a.tree).collect();
        if own.is_empty() { vec![&self.tree] } else { own }
    }

    /// A figure of the tree that was traced, averaged over the views where each has its own.
    pub fn of_trees(&self, figure: impl Fn(&Tree) -> f64) -> f64 {
        let trees = self.trees();
        trees.iter().map(|tree| figure(tree)).sum::<f64>() / trees.len() as f64
    }

    fn adaptations(&self) -> impl Iterator<Item = &Adaptation> {
        self.views.iter().filter_map(|view| view.adaptation.as_ref())
    }
}

/// The value in the middle, which one outlier does not move; nothing of nothing.
fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => None,
        count if count % 2 == 1 => Some(sorted[middle]),
        _ => Some((sorted[middle - 1] + sorted[middle]) / 2.0),
    }
}

impl Build {
    /// Milliseconds of the whole build, averaged over the repetitions.
    pub fn mean_milliseconds(&self) -> Option<f64> {
        mean(self.repetitions.iter().map(|repetition| Some(repetition.milliseconds)))
    }

    /// Milliseconds of the whole build in the middle of the repetitions, which one slow repetition
    /// does not move.
    pub fn median_milliseconds(&self) -> Option<f64> {
        let times: Vec<f64> = self.repetitions.iter().map(|repetition| repetition.milliseconds).collect();
        median(&times)
    }

    /// Each phase and its milliseconds averaged over the repetitions, in the order in which they ran.
    pub fn mean_phases(&self) -> Vec<(&str, f64)> {
        let Some(first) = self.repetitions.first() else {
            return Vec::new();
        };
        let time =
            |phase: &Phase| mean(self.repetitions.iter().map(|repetition| repetition.phase(&phase.name)));
        first.phases.iter().filter_map(|phase| Some((phase.name.as_str(), time(phase)?))).collect()
    }
}

impl Repetition {
    /// Milliseconds of one phase.
    pub fn phase(&self, name: &str) -> Option<f64> {
        self.phases.iter().find(|phase| phase.name == name).map(|phase| phase.milliseconds)
    }
}

/// What one ray met, on average.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerRay {
    /// Nodes visited.
    pub nodes: f64,
    /// Boxes tested.
    pub boxes: f64,
    /// Triangles tested.
    pub triangles: f64,
}

impl Counters {
    /// Totals of the primary rays.
    pub fn primary(&self) -> Count {
        self.depths.iter().take(1).sum()
    }

    /// Totals of the rays of all bounces.
    pub fn secondary(&self) -> Count {
        self.depths.iter().skip(1).sum()
    }

    /// Totals of all rays.
    pub fn all(&self) -> Count {
        self.depths.iter().sum()
    }
}

impl Count {
    /// What one ray met, on average; nothing when there were no rays.
    pub fn per_ray(&self) -> Option<PerRay> {
        let share = |total: u64| total as f64 / self.rays as f64;
        (self.rays > 0).then(|| PerRay {
            nodes: share(self.nodes),
            boxes: share(self.boxes),
            triangles: share(self.triangles),
        })
    }
}

impl Add for Count {
    type Output = Count;

    fn add(self, other: Count) -> Count {
        Count {
            rays: self.rays + other.rays,
            nodes: self.nodes + other.nodes,
            boxes: self.boxes + other.boxes,
            triangles: self.triangles + other.triangles,
        }
    }
}

impl<'a> Sum<&'a Count> for Count {
    fn sum<I: Iterator<Item = &'a Count>>(counts: I) -> Count {
        counts.fold(Count::default(), |sum, count| sum + *count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::example;

    fn sample(launches: &[(u64, f64)]) -> Sample {
        Sample {
            depths: launches.iter().map(|&(rays, milliseconds)| Launch { rays, milliseconds }).collect(),
        }
    }

    #[test]
    fn rates_are_rays_over_the_time_of_the_traversal() {
        let sample = sample(&[(2_000_000, 1.0), (1_000_000, 2.0), (500_000, 3.0)]);
        assert_eq!(sample.primary_mrps(), Some(2000.0));
        // 1.5 million rays in 5 ms; the mean of the two rates, 333.3, would be wrong.
        assert_eq!(sample.secondary_mrps(), Some(300.0));
        assert_eq!(sample.mrps(1), Some(500.0));
        assert_eq!(sample.mrps(3), None);
    }

    #[test]
    fn without_rays_there_is_no_rate() {
        assert_eq!(sample(&[]).primary_mrps(), None);
        assert_eq!(sample(&[]).secondary_mrps(), None);
        assert_eq!(sample(&[(10, 1.0)]).secondary_mrps(), None);
        assert_eq!(sample(&[(10, 1.0), (0, 0.0)]).secondary_mrps(), None);
        assert_eq!(sample(&[(10, 0.0)]).primary_mrps(), None);
    }

    #[test]
    fn samples_and_views_count_alike() {
        let mut point = example().results[0].clone();
        let mut one = point.views[0].clone();
        one.samples =
            vec![sample(&[(1_000_000, 1.0), (1_000_000, 2.0)]), sample(&[(1_000_000, 2.0), (0, 0.0)])];
        let mut two = one.clone();
        two.samples = vec![sample(&[(1_000_000, 4.0), (1_000_000, 10.0)])];
        assert_eq!(one.primary_mrps(), Some(750.0));
        assert_eq!(one.secondary_mrps(), Some(500.0));
        assert_eq!(one.mrps(1), Some(500.0));
        point.views = vec![one, two];
        assert_eq!(point.primary_mrps(), Some(500.0));
        assert_eq!(point.secondary_mrps(), Some(300.0));
        assert_eq!(point.mrps(1), Some(300.0));
    }

    #[test]
    fn counters_are_totals_over_views_and_depths() {
        let count = |rays, nodes| Count { rays, nodes, boxes: 2 * nodes, triangles: nodes / 2 };
        let mut point = example().results[0].clone();
        point.views.truncate(1);
        point.views[0].counters = Some(Counters { depths: vec![count(4, 40), count(2, 60)] });
        let mut other = point.views[0].clone();
        other.counters = Some(Counters { depths: vec![count(4, 80)] });
        point.views.push(other);
        let counters = point.counters().unwrap();
        assert_eq!(counters.primary(), count(8, 120));
        assert_eq!(counters.secondary(), count(2, 60));
        let all = counters.all().per_ray().unwrap();
        assert_eq!((all.nodes, all.boxes, all.triangles), (18.0, 36.0, 9.0));
        assert_eq!(Count::default().per_ray(), None);

        point.views[1].counters = None;
        assert_eq!(point.counters(), None);
    }

    #[test]
    fn build_times_are_averaged_by_phase() {
        let repetition = |sort, ploc| Repetition {
            milliseconds: sort + ploc + 1.0,
            phases: vec![
                Phase { name: "sort".into(), milliseconds: sort },
                Phase { name: "ploc".into(), milliseconds: ploc },
            ],
        };
        let mut build =
            Build { repetitions: vec![repetition(1.0, 2.0), repetition(3.0, 5.0), repetition(2.0, 2.0)] };
        assert_eq!(build.mean_phases(), [("sort", 2.0), ("ploc", 3.0)]);
        assert_eq!(build.mean_milliseconds(), Some(6.0));
        assert_eq!(build.median_milliseconds(), Some(5.0));
        build.repetitions.pop();
        assert_eq!(build.median_milliseconds(), Some(6.5));
        assert_eq!(Build::default().median_milliseconds(), None);
        assert_eq!(Build::default().mean_milliseconds(), None);
    }

    #[test]
    fn a_view_is_throttled_if_either_end_was() {
        let view = example().results[0].views[0].clone();
        assert_eq!(view.throttled(), Some(false));
        let mut slow = view.clone();
        if let crate::Telemetry::Available(reading) = &mut slow.after {
            reading.throttle_reasons = Some([crate::ThrottleReason::SoftwarePowerCap].into());
        }
        assert_eq!(slow.throttled(), Some(true));
        slow.after = crate::Telemetry::unavailable("gone");
        assert_eq!(slow.throttled(), None);
    }
}
