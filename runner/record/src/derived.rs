//! What follows from a record's fields. Rates are in MRps: million rays per second of the traversal
//! kernel alone. Within a sample, the rays of all bounces are divided by the time of all bounces; over
//! samples and views the rates are averaged, each sample and each view counting alike, as the thesis
//! does (Cezner 2025, section 6.2).

use crate::stats::{Estimate, median};
use crate::{
    Adaptation, Build, Count, Counters, Launch, Phase, Point, Repetition, Sample, Tree, Utilization, View,
};
use std::fmt;
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

/// Which rays a rate is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rays {
    /// Those from the camera.
    Primary,
    /// Those of all bounces.
    Secondary,
    /// Those of whole paths.
    All,
}

impl fmt::Display for Rays {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.pad(match self {
            Rays::Primary => "primary",
            Rays::Secondary => "secondary",
            Rays::All => "all",
        })
    }
}

/// The bounces that Ylitie et al. tell rates of (2017, table 9); 0 is the primary rays.
pub const BOUNCES: [usize; 4] = [0, 1, 4, 8];

/// Which of the launches of a bounce speaks for all of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Launches {
    /// The fastest, which the rest of the system has disturbed least (Ylitie et al. 2017, section 5).
    Best,
    /// The one in the middle, which neither a lucky nor a disturbed one moves.
    #[default]
    Median,
}

impl fmt::Display for Launches {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.pad(match self {
            Launches::Best => "best",
            Launches::Median => "median",
        })
    }
}

impl Sample {
    /// Million rays per second of one wavefront; depth 0 is the primary rays.
    pub fn mrps(&self, depth: usize) -> Option<f64> {
        self.depths.get(depth)?.mrps()
    }

    /// Million rays per second: rays over the summed time of their wavefronts.
    pub fn rate(&self, rays: Rays) -> Option<f64> {
        match rays {
            Rays::Primary => self.mrps(0),
            Rays::Secondary => mrps(self.depths.get(1..)?),
            Rays::All => mrps(&self.depths),
        }
    }
}

impl View {
    /// The samples that count.
    pub fn counted(&self) -> impl Iterator<Item = &Sample> {
        self.samples.iter().filter(|sample| sample.excluded.is_none())
    }

    /// Million rays per second of one wavefront, averaged over the samples that count.
    ///
    /// A sample whose paths had all ended before that depth has no rate there and is left out.
    pub fn mrps(&self, depth: usize) -> Option<f64> {
        mean(self.counted().map(|sample| sample.mrps(depth)).filter(Option::is_some))
    }

    /// Million rays per second of one bounce, in the launch that speaks for those that count.
    pub fn bounce(&self, bounce: usize, launches: Launches) -> Option<f64> {
        let rates: Vec<f64> = self.counted().filter_map(|sample| sample.mrps(bounce)).collect();
        match launches {
            Launches::Best => rates.into_iter().reduce(f64::max),
            Launches::Median => median(&rates),
        }
    }

    /// The rates of the samples that count and have such rays.
    pub fn rates(&self, rays: Rays) -> Vec<f64> {
        self.counted().filter_map(|sample| sample.rate(rays)).collect()
    }

    /// Million rays per second, averaged over the samples that count and have such rays.
    pub fn rate(&self, rays: Rays) -> Option<f64> {
        mean(self.rates(rays).into_iter().map(Some))
    }

    /// Whether no sample counts, or the paths of one go on to such rays.
    fn concerns(&self, rays: Rays) -> bool {
        self.counted().next().is_none() || !self.rates(rays).is_empty()
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

    /// Million rays per second of one bounce, in the launch of each view that speaks for the others, averaged over
    /// the views that had such rays; nothing where a view has no sample that counts.
    pub fn bounce(&self, bounce: usize, launches: Launches) -> Option<f64> {
        let concerned =
            |view: &&View| view.counted().next().is_none() || view.bounce(bounce, launches).is_some();
        mean(self.views.iter().filter(concerned).map(|view| view.bounce(bounce, launches)))
    }

    /// Million rays per second, averaged over the views that had such rays; nothing where a view has no sample
    /// that counts.
    pub fn rate(&self, rays: Rays) -> Option<f64> {
        mean(self.views.iter().filter(|view| view.concerns(rays)).map(|view| view.rate(rays)))
    }

    /// The same with how sure it is. Views are chosen, not drawn, so only the scatter of samples within a view
    /// counts. Nothing where a view has fewer than two samples that count.
    pub fn estimate(&self, rays: Rays) -> Option<Estimate> {
        let views = self.views.iter().filter(|view| view.concerns(rays));
        let means: Vec<Estimate> =
            views.map(|view| Estimate::of(&view.rates(rays))).collect::<Option<_>>()?;
        Estimate::average(&means)
    }

    /// Million primary rays per second.
    pub fn primary_mrps(&self) -> Option<f64> {
        self.rate(Rays::Primary)
    }

    /// Million secondary rays per second.
    pub fn secondary_mrps(&self) -> Option<f64> {
        self.rate(Rays::Secondary)
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

    /// Million triangles of the scene a second that all builds take in, of [`Point::build_milliseconds`].
    pub fn build_mtris(&self) -> Option<f64> {
        let milliseconds = self.build_milliseconds().filter(|&ms| ms > 0.0)?;
        Some(self.scene.triangles as f64 / milliseconds * 1e-3)
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

    /// A figure of the tree that was traced, averaged over the views where each has its own; nothing where it is not
    /// known of one.
    pub fn of_trees(&self, figure: impl Fn(&Tree) -> Option<f64>) -> Option<f64> {
        mean(self.trees().into_iter().map(figure))
    }

    fn adaptations(&self) -> impl Iterator<Item = &Adaptation> {
        self.views.iter().filter_map(|view| view.adaptation.as_ref())
    }
}

impl Point {
    /// Bytes of nodes and of triangles that a ray of a wavefront asks for, whichever cache they come from.
    pub fn bytes_per_ray(&self, met: &Count) -> Option<[f64; 2]> {
        let cost = met.per_ray()?;
        let node = self.of_trees(Tree::bytes_per_node)?;
        let triangle = self.of_trees(|tree| {
            // Where triangles were split, they are stored once for each leaf that refers to them.
            let references = tree.references()?;
            let stored = if references > 0.0 { references } else { self.scene.triangles as f64 };
            Some(tree.triangle_bytes? as f64 / stored.max(1.0))
        })?;
        Some([cost.nodes * node, cost.triangles * triangle])
    }
}

impl Tree {
    /// Bytes from one node to the next.
    pub fn bytes_per_node(&self) -> Option<f64> {
        Some(self.node_bytes? as f64 / self.nodes?.max(1) as f64)
    }

    /// Triangles in all leaves together; those that were split count once for each leaf.
    pub fn references(&self) -> Option<f64> {
        Some(self.leaves? as f64 * self.average_triangles_per_leaf?)
    }

    /// Bytes of nodes and triangles together.
    pub fn all_bytes(&self) -> Option<u64> {
        self.bytes.or_else(|| Some(self.node_bytes? + self.triangle_bytes?))
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

    /// Launches of a build: the last one's, because the first may not know how many it takes.
    pub fn launches(&self) -> Option<u32> {
        self.repetitions.last()?.launches
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

impl Utilization {
    /// The share of a subgroup's lanes that took part in a step that visits nodes, on average; nothing without such
    /// steps.
    pub fn of_nodes(&self) -> Option<f64> {
        self.share(self.node_steps, self.node_lanes)
    }

    /// The same of steps that test triangles.
    pub fn of_triangles(&self) -> Option<f64> {
        self.share(self.triangle_steps, self.triangle_lanes)
    }

    /// The same of steps that fetch rays.
    pub fn of_fetches(&self) -> Option<f64> {
        self.share(self.fetches, self.fetch_lanes)
    }

    fn share(&self, steps: u64, lanes: u64) -> Option<f64> {
        (steps > 0).then(|| lanes as f64 / (steps as f64 * f64::from(self.subgroup_size)))
    }

    /// Of both together; nothing where subgroups differ in size.
    fn and(self, other: Utilization) -> Option<Utilization> {
        (self.subgroup_size == other.subgroup_size).then(|| Utilization {
            subgroup_size: self.subgroup_size,
            node_steps: self.node_steps + other.node_steps,
            node_lanes: self.node_lanes + other.node_lanes,
            triangle_steps: self.triangle_steps + other.triangle_steps,
            triangle_lanes: self.triangle_lanes + other.triangle_lanes,
            fetches: self.fetches + other.fetches,
            fetch_lanes: self.fetch_lanes + other.fetch_lanes,
        })
    }
}

impl Add for Count {
    type Output = Count;

    /// The utilization is known where it is for all rays.
    fn add(self, other: Count) -> Count {
        Count {
            utilization: match (self.rays, other.rays) {
                (0, _) => other.utilization,
                (_, 0) => self.utilization,
                _ => self.utilization.zip(other.utilization).and_then(|(own, its)| own.and(its)),
            },
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
    use crate::{Timestamp, example};
    use std::time::{Duration, UNIX_EPOCH};

    fn sample(launches: &[(u64, f64)]) -> Sample {
        Sample {
            depths: launches.iter().map(|&(rays, milliseconds)| Launch { rays, milliseconds }).collect(),
            ..Sample::default()
        }
    }

    #[test]
    fn rates_are_rays_over_the_time_of_the_traversal() {
        let sample = sample(&[(2_000_000, 1.0), (1_000_000, 2.0), (500_000, 3.0)]);
        assert_eq!(sample.rate(Rays::Primary), Some(2000.0));
        // 1.5 million rays in 5 ms; the mean of the two rates, 333.3, would be wrong.
        assert_eq!(sample.rate(Rays::Secondary), Some(300.0));
        assert_eq!(sample.mrps(1), Some(500.0));
        assert_eq!(sample.mrps(3), None);
    }

    #[test]
    fn without_rays_there_is_no_rate() {
        assert_eq!(sample(&[]).rate(Rays::Primary), None);
        assert_eq!(sample(&[]).rate(Rays::Secondary), None);
        assert_eq!(sample(&[(10, 1.0)]).rate(Rays::Secondary), None);
        assert_eq!(sample(&[(10, 1.0), (0, 0.0)]).rate(Rays::Secondary), None);
        assert_eq!(sample(&[(10, 0.0)]).rate(Rays::Primary), None);
    }

    #[test]
    fn samples_and_views_count_alike() {
        let mut point = example().results[0].clone();
        let mut one = point.views[0].clone();
        one.samples =
            vec![sample(&[(1_000_000, 1.0), (1_000_000, 2.0)]), sample(&[(1_000_000, 2.0), (0, 0.0)])];
        let mut two = one.clone();
        two.samples = vec![sample(&[(1_000_000, 4.0), (1_000_000, 10.0)])];
        assert_eq!(one.rate(Rays::Primary), Some(750.0));
        assert_eq!(one.rate(Rays::Secondary), Some(500.0));
        assert_eq!(one.mrps(1), Some(500.0));
        point.views = vec![one, two];
        assert_eq!(point.primary_mrps(), Some(500.0));
        assert_eq!(point.secondary_mrps(), Some(300.0));
        assert_eq!(point.mrps(1), Some(300.0));
    }

    #[test]
    fn the_best_or_the_middle_launch_speaks_for_a_bounce() {
        let mut point = example().results[0].clone();
        let mut view = point.views[0].clone();
        let launch = |milliseconds| sample(&[(1_000_000, 1.0), (1_000_000, milliseconds)]);
        let disturbed = Sample { excluded: Some(crate::Exclusion::Throttled), ..launch(0.5) };
        view.samples = vec![launch(10.0), launch(1.0), disturbed, launch(2.0)];
        let mut short = view.clone();
        short.samples = vec![sample(&[(1_000_000, 2.0)])];
        point.views = vec![view.clone(), short];
        assert_eq!(point.bounce(0, Launches::Best), Some(750.0));
        assert_eq!(point.bounce(1, Launches::Best), Some(1000.0), "of the view that has the bounce");
        assert_eq!(point.bounce(1, Launches::Median), Some(500.0));
        assert_eq!(point.bounce(2, Launches::Median), None);
        view.samples.retain(|sample| sample.excluded.is_some());
        point.views[1] = view;
        assert_eq!(point.bounce(1, Launches::Best), None, "a view without a sample is not passed over");
    }

    #[test]
    fn bytes_are_those_of_nodes_and_of_stored_triangles() {
        let mut point = example().results[0].clone();
        point.views.iter_mut().for_each(|view| view.adaptation = None);
        (point.tree.nodes, point.tree.node_bytes) = (Some(10), Some(800));
        (point.tree.leaves, point.tree.average_triangles_per_leaf) = (Some(50), Some(2.0));
        (point.tree.triangle_bytes, point.scene.triangles) = (Some(4800), 60);
        let met = Count { rays: 2, nodes: 6, boxes: 0, triangles: 8, utilization: None };
        assert_eq!(
            point.bytes_per_ray(&met),
            Some([240.0, 192.0]),
            "3 nodes of 80 and 4 triangles of 48 bytes"
        );
        // As in records whose writers did not know.
        point.tree.average_triangles_per_leaf = Some(0.0);
        assert_eq!(point.bytes_per_ray(&met), Some([240.0, 320.0]));
        assert_eq!(point.bytes_per_ray(&Count::default()), None);
    }

    #[test]
    fn what_is_excluded_does_not_count() {
        let mut point = example().results[0].clone();
        let launch = |milliseconds| sample(&[(1_000_000, milliseconds), (1_000_000, 2.0 * milliseconds)]);
        let cold = Sample { excluded: Some(crate::Exclusion::WarmUp), ..launch(9.0) };
        let mut view = point.views[0].clone();
        view.samples = vec![cold.clone(), launch(1.0), launch(1.25)];
        point.views = vec![view.clone(), view.clone()];
        assert_eq!(point.rate(Rays::Primary), Some(900.0));
        assert_eq!(point.rate(Rays::Secondary), Some(450.0));
        assert_eq!(view.rate(Rays::All), Some((2e6 / 3.0 + 2e6 / 3.75) / 2.0 / 1e3));
        let estimate = point.estimate(Rays::Primary).unwrap();
        assert_eq!(estimate.mean, 900.0);
        // Each view scatters by 100 around its mean: variance 20000 / 2 samples, / 2 views.
        assert!((estimate.variance - 5000.0).abs() < 1e-6, "{estimate:?}");
        point.views[1].samples.truncate(1);
        assert_eq!(point.rate(Rays::Secondary), None, "a view without a sample is not passed over");
        assert_eq!(point.estimate(Rays::Primary), None);
    }

    #[test]
    fn a_drift_of_the_reference_point_shows() {
        let mut record = example();
        let point = record.results[0].clone();
        let at = |seconds: u64, rate: f64| {
            let mut point = point.clone();
            point.views[0].samples = vec![sample(&[(1_000_000, 1e3 / rate), (1_000_000, 2e3 / rate)])];
            let time = Timestamp::from(UNIX_EPOCH + Duration::from_secs(seconds));
            point.measurement = Some(crate::Measurement {
                part: 0,
                position: seconds,
                started: time,
                finished: time,
                stopped: crate::Stop::Precise,
                unreliable: false,
                verdict: None,
            });
            point
        };
        // Measured in this order of time, whatever their order in the record.
        record.references = vec![at(50, 95.0), at(10, 100.0), at(40, 96.0), at(20, 99.0), at(30, 98.0)];
        let drifts = record.drifts();
        assert_eq!(drifts.len(), 2);
        assert_eq!(drifts[0].correlation.coefficient, -1.0);
        assert!(drifts[0].significant() && (drifts[0].change - 0.95).abs() < 1e-9, "{drifts:?}");
        record.references.truncate(3);
        assert_eq!(record.drifts(), []);
    }

    #[test]
    fn counters_are_totals_over_views_and_depths() {
        let count = |rays, nodes| Count {
            rays,
            nodes,
            boxes: 2 * nodes,
            triangles: nodes / 2,
            utilization: Some(Utilization {
                subgroup_size: 8,
                node_steps: nodes / 4,
                node_lanes: nodes,
                triangle_steps: nodes / 4,
                triangle_lanes: nodes / 2,
                fetches: rays,
                fetch_lanes: rays,
            }),
        };
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
        let all = counters.all().utilization.unwrap();
        assert_eq!([all.of_nodes(), all.of_triangles(), all.of_fetches()], [0.5, 0.25, 0.125].map(Some));
        assert_eq!(Utilization { triangle_steps: 0, triangle_lanes: 0, ..all }.of_triangles(), None);

        // Of some rays it is not that of all, nor where a step has another number of lanes.
        let mut unknown = counters.clone();
        unknown.depths[1].utilization = None;
        assert_eq!((unknown.all().utilization, unknown.all().nodes), (None, 180));
        assert!(unknown.primary().utilization.is_some());
        let mut other = counters;
        other.depths[1].utilization.as_mut().unwrap().subgroup_size = 32;
        assert_eq!(other.all().utilization, None);

        point.views[1].counters = None;
        assert_eq!(point.counters(), None);
    }

    #[test]
    fn build_times_are_averaged_by_phase() {
        let repetition = |sort, ploc| Repetition {
            launches: None,
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
