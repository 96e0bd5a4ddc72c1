//! Measures one point: builds its tree, traces samples from its views until they tell enough, and says in the
//! record's words what came of it.

mod held;
mod kernels;
mod ramp;
mod settle;
mod shots;
mod start;
mod stop;

pub use held::Held;
pub use kernels::Kernels;
pub use settle::mark as mark_warm_up;
pub use start::{Defaults, LAUNCHES, LEAST_CLOCK, begin, clock, depth, telemetry};
pub use stop::Sampling;

use crate::{
    describe,
    params::Params,
    session::{Loaded, Plant, Seedling, Session},
    telemetry::{Moment, Telemetry},
    variant::Variant,
};
use anyhow::Context;
use ramp::Ramp;
use record::{Adaptation, Build, Counters, Exclusion, Measurement, Method, Point, Stop, Timestamp};
use shots::{Shot, Shots};
use std::time::{Duration, Instant};
use stop::Verdict;
use tracer::{
    path::{self, Camera, PathTracer},
    traverse::{Structure, Tree},
};

/// What is the same for all points of a run.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Width and height of the picture.
    pub size: (u32, u32),
    /// What a sample is.
    pub method: Method,
    /// What a path is; how surfaces are shaded, a point's parameters say.
    pub path: path::Params,
    /// Measured builds of each tree.
    pub builds: u32,
    /// Samples traced from a view before those that are kept, so that no kernel is compiled while it is timed.
    pub warm_up: u32,
    /// Least time of builds before the first that is measured, and of samples before the first view.
    pub busy_before_point: Duration,
    /// The same before each further view.
    pub busy_before_view: Duration,
    /// How many samples are kept.
    pub sampling: Sampling,
    /// What a sample's clock is held against.
    pub clock: Option<record::Clock>,
    /// How its clocks are held still.
    pub held: Held,
    /// Whether to count what rays meet as well.
    pub counting: bool,
}

/// One scene with one variant and its parameters.
pub struct Measuring<'a> {
    /// The device.
    pub session: &'a Session,
    /// What the device says about itself.
    pub telemetry: &'a Telemetry,
    /// The scene.
    pub loaded: &'a Loaded,
    /// The variant.
    pub variant: Variant,
    /// Its parameters.
    pub params: &'a Params,
    /// What is the same for all points.
    pub plan: &'a Plan,
    /// Parameters that the record has for all points; a point keeps those in which it differs.
    pub common: &'a record::Parameters,
    /// How many points were measured before.
    pub position: u64,
}

/// Follows the measuring of a point.
pub trait Watch {
    /// Whether to stop before the next sample.
    fn interrupted(&self) -> bool;
    /// A view begins: which of how many, and its name.
    fn view(&mut self, _which: usize, _of: usize, _name: &str) {}
    /// A sample was traced.
    fn sample(&mut self) {}
    /// The samples of a view are there, those of later ones may be missing.
    ///
    /// # Errors
    /// What it came to cannot be kept.
    fn progress(&mut self, _point: &Point) -> anyhow::Result<()> {
        Ok(())
    }
}

/// Follows nothing, and never stops.
pub struct Unwatched;

impl Watch for Unwatched {
    fn interrupted(&self) -> bool {
        false
    }
}

impl Measuring<'_> {
    /// Measures the point; nothing where it was interrupted before a view was complete.
    ///
    /// # Errors
    /// The device failed, has too little memory, or a parameter is out of its range.
    pub fn measure(&self, views: &[usize], watch: &mut dyn Watch) -> anyhow::Result<Option<Point>> {
        let path = path::Params { shade: self.params.shade.clone(), ..self.plan.path.clone() };
        let plan = &Plan { path, ..self.plan.clone() };
        let scene = &self.loaded.scene;
        let (started, clock) = (Timestamp::now(), Instant::now());
        let throttled = self.telemetry.throttle_times();
        let mut repetitions = Vec::new();
        let warm_up = (plan.warm_up > 0).then_some(plan.busy_before_point);
        let plant =
            self.session.plant(self.loaded, self.variant, self.params, warm_up, plan.builds, |report| {
                repetitions.push(report);
            })?;
        let mut parameters = self.params.by_name();
        parameters.0.retain(|name, value| self.common.get(name) != Some(value));
        let mut point = Point {
            scene: describe::scene(scene),
            variant: self.variant.to_string(),
            parameters,
            adopted: self.loaded.given().map(|given| given.adopted.clone()),
            build: Build { repetitions },
            tree: plant.statistics().clone(),
            kernels: Vec::new(),
            views: Vec::new(),
            measurement: Some(Measurement {
                part: 0,
                position: self.position,
                started,
                finished: started,
                stopped: Stop::Interrupted,
                unreliable: false,
                verdict: None,
            }),
        };
        let tracer = PathTracer::new(&self.session.gpu, &self.loaded.device, plan.size, &plan.path, true)?;
        tracer.clear()?;
        let mut kernels: Option<Kernels> = None;
        let mut seen: Vec<record::View> = Vec::new();
        // The first round gives each view the fewest samples. Later ones add to them until the rates are known
        // well enough: they go over all views again, so that a slow change of the device meets all alike.
        let mut goal = plan.sampling.least;
        let stopped = 'rounds: loop {
            for (which, &view) in views.iter().enumerate() {
                let view = &scene.views[view];
                watch.view(which, views.len(), &view.name);
                let begun = Instant::now();
                let first = which == seen.len();
                let camera = Camera::new(view, plan.size.0, plan.size.1);
                let (tree, adaptation) = match &plant {
                    Plant::Planted(planted) => (planted.tree, None),
                    Plant::Seedling(seedling) if first => {
                        let (tree, adaptation) = self.adapt(seedling, &tracer, &camera)?;
                        (tree, Some(adaptation))
                    }
                    Plant::Seedling(seedling) => (seedling.grow(self.loaded, &tracer, &camera)?.tree, None),
                };
                // Trees of different views may need stacks of different size.
                let compiled = kernels.as_ref().is_some_and(|kernels| tree.stack <= kernels.stack());
                if !compiled {
                    kernels = Some(Kernels::new(self.session, &tree, self.variant, self.params)?);
                }
                let kernels = kernels.as_ref().expect("compiled above");
                let shots =
                    Shots::new(plan, (self.session, self.loaded), &tracer, kernels, &tree, (view, &camera))?;
                // Compiling the kernels has left it idle, and so has collecting rays.
                let (begun, least) = match plan.method {
                    _ if !compiled => (Instant::now(), plan.busy_before_point),
                    Method::Replay => (Instant::now(), plan.busy_before_view),
                    Method::Paths => (begun, plan.busy_before_view),
                };
                if first {
                    let before = self.telemetry.sample();
                    seen.push(record::View {
                        name: view.name.clone(),
                        adaptation,
                        samples: Vec::new(),
                        counters: None,
                        after: before.clone(),
                        before,
                        pictures: Vec::new(),
                    });
                }
                let own = &mut seen[which];
                let deadline = (!first).then_some(plan.sampling.time.saturating_sub(clock.elapsed()));
                let whole = self.samples(own, (begun, least), goal, deadline, &shots, watch)?;
                if first && !whole {
                    // What there is of it would be fewer samples than was asked for.
                    seen.pop();
                    break 'rounds Stop::Interrupted;
                }
                if first && plan.counting && kernels.count() {
                    own.counters =
                        Some(Counters { depths: self.counts(&tracer, kernels, &tree, &camera, own)? });
                    watch.sample();
                }
                point.kernels = kernels.recorded();
                point.views = seen.clone();
                watch.progress(&point)?;
                if watch.interrupted() {
                    break 'rounds Stop::Interrupted;
                }
            }
            match plan.sampling.judge(&point, clock.elapsed()) {
                Verdict::Stop(stop) => break stop,
                Verdict::Go { samples } => goal = samples,
            }
        };
        if point.views.is_empty() {
            return Ok(None);
        }
        let unreliable = plan.sampling.is_too_few(&point);
        let measurement = point.measurement.as_mut().expect("set above");
        measurement.finished = Timestamp::now();
        measurement.stopped = stopped;
        measurement.unreliable = unreliable;
        let milliseconds = 1e3 * clock.elapsed().as_secs_f64();
        measurement.verdict =
            Some(plan.held.judge(&throttled, &self.telemetry.throttle_times(), milliseconds));
        Ok(Some(point))
    }

    /// What the rays of the first sample met.
    fn counts(
        &self,
        tracer: &PathTracer<'_>,
        kernels: &Kernels,
        tree: &Tree,
        camera: &Camera,
        seen: &record::View,
    ) -> anyhow::Result<Vec<record::Count>> {
        if let Structure::List(_) = tree.structure {
            // That is known beforehand, and tracing them once more would take as long as the sample.
            let launches = seen.samples.first().map_or(&[][..], |sample| &sample.depths);
            let met = |rays: u64| record::Count {
                rays,
                triangles: rays * u64::from(tree.listed),
                ..record::Count::default()
            };
            return Ok(launches.iter().map(|launch| met(launch.rays)).collect());
        }
        let counts = tracer.count(&kernels.counting, tree, camera, 0)?;
        let subgroup_size = self.session.gpu.info().subgroup_size;
        let counts: Vec<_> = counts.iter().map(|count| describe::count(count, subgroup_size)).collect();
        if let (Some(sample), true) = (seen.samples.first(), kernels.hit()) {
            let timed: Vec<u64> = sample.depths.iter().map(|launch| launch.rays).collect();
            let counted: Vec<u64> = counts.iter().map(|count| count.rays).collect();
            check_same_rays(&timed, &counted).with_context(|| format!("view {}", seen.name))?;
        }
        Ok(counts)
    }

    /// Makes the tree of a view as often as trees are built, after warming up as long as that.
    fn adapt(
        &self,
        seedling: &Seedling,
        tracer: &PathTracer<'_>,
        camera: &Camera,
    ) -> anyhow::Result<(Tree, Adaptation)> {
        let plan = self.plan;
        let grow = || seedling.grow(self.loaded, tracer, camera);
        let started = Instant::now();
        let mut grown = grow()?;
        while plan.warm_up > 0 && started.elapsed() < plan.busy_before_view {
            grown = grow()?;
        }
        let mut sampling_milliseconds = Vec::new();
        let mut repetitions = Vec::new();
        for _ in 0..plan.builds {
            grown = grow()?;
            sampling_milliseconds.push(grown.sampling_milliseconds);
            repetitions.push(describe::repetition(&grown.build));
        }
        let tree = seedling.measure(&grown)?;
        Ok((grown.tree, Adaptation { sampling_milliseconds, build: Build { repetitions }, tree }))
    }

    /// Adds samples to a view until `goal` of them count, or there are as many as there may be, or `deadline`
    /// has passed. The device has been busy since `begun`, and is to be for at `least` so long before, and longer while
    /// its clock still rises. False where the user stopped it.
    fn samples(
        &self,
        view: &mut record::View,
        (begun, least): (Instant, Duration),
        goal: u32,
        deadline: Option<Duration>,
        shots: &Shots<'_>,
        watch: &mut dyn Watch,
    ) -> anyhow::Result<bool> {
        let plan = self.plan;
        let mut warmed = 0;
        while warmed < plan.warm_up || (plan.warm_up > 0 && begun.elapsed() < least) {
            shots.sample(u32::MAX - 1 - warmed)?;
            warmed += 1;
        }
        let mut ramp = Ramp::new(plan.clock.as_ref(), Instant::now());
        while plan.warm_up > 0
            && !watch.interrupted()
            && ramp.rises(self.telemetry.moment().sm_clock_mhz, Instant::now())
        {
            shots.work(Ramp::BETWEEN)?;
        }
        if view.samples.is_empty() {
            view.before = self.telemetry.sample();
        }
        let started = Instant::now();
        let enough = |view: &record::View| {
            view.counted().count() >= goal as usize || view.samples.len() >= plan.sampling.most as usize
        };
        while !enough(view) && deadline.is_none_or(|deadline| started.elapsed() < deadline) {
            if watch.interrupted() {
                return Ok(false);
            }
            let Shot { depths, frame_milliseconds } = shots.sample(view.samples.len() as u32)?;
            let moment = self.telemetry.moment();
            view.samples.push(record::Sample {
                depths,
                frame_milliseconds,
                sm_clock_mhz: moment.sm_clock_mhz,
                excluded: slowed(&moment, plan.clock.as_ref()),
            });
            watch.sample();
            if enough(view) {
                settle::mark(&mut view.samples);
            }
        }
        view.after = self.telemetry.sample();
        Ok(true)
    }
}

/// Why a sample that ended at this moment does not count, if it does not.
pub fn slowed(moment: &Moment, clock: Option<&record::Clock>) -> Option<Exclusion> {
    if moment.throttled == Some(true) {
        return Some(Exclusion::Throttled);
    }
    let (clock, mhz) = (clock?, moment.sm_clock_mhz?);
    (f64::from(mhz) < clock.least_share * f64::from(clock.mhz)).then_some(Exclusion::LowClock)
}

/// Fails where the kernel that counts has met other rays, bounce by bounce, than the one that was timed with them: whoever
/// misses what it should hit has fewer bounces. That is how a kernel shows which a driver has compiled to something else.
/// Each is compiled by itself and may round differently, so that few rays more or less mean nothing.
fn check_same_rays(timed: &[u64], counted: &[u64]) -> anyhow::Result<()> {
    for bounce in 0..timed.len().max(counted.len()) {
        let [timed, counted] = [timed, counted].map(|rays| rays.get(bounce).copied().unwrap_or(0));
        anyhow::ensure!(
            timed.abs_diff(counted) <= 16 + timed / 100,
            "in bounce {bounce}, {timed} rays were timed, and the kernel that counts what they meet has traced {counted}: one \
             of the two misses triangles, so neither number would mean anything. Run `runner validate` with this variant and \
             these parameters to see which, update the driver, or leave them out"
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kernel_that_misses_what_it_should_hit_is_noticed() {
        assert!(check_same_rays(&[2_073_600, 1_998_123, 7], &[2_073_600, 1_998_125, 9]).is_ok());
        assert!(check_same_rays(&[], &[]).is_ok());
        let few = check_same_rays(&[2_073_600, 2_043_319], &[2_073_600, 284_039]).unwrap_err().to_string();
        assert!(few.contains("bounce 1, 2043319 rays") && few.contains("284039"), "{few}");
        assert!(check_same_rays(&[900, 450], &[900]).is_err());
        assert!(check_same_rays(&[900], &[900, 450]).is_err());
    }

    #[test]
    fn throttling_and_low_clocks_exclude_a_sample() {
        let clock = record::Clock { kind: record::ClockKind::Base, mhz: 2000, least_share: 0.95 };
        let at = |mhz, throttled| Moment { sm_clock_mhz: mhz, throttled };
        assert_eq!(slowed(&at(Some(1900), Some(false)), Some(&clock)), None);
        assert_eq!(slowed(&at(Some(1899), Some(false)), Some(&clock)), Some(Exclusion::LowClock));
        assert_eq!(slowed(&at(Some(2100), Some(true)), Some(&clock)), Some(Exclusion::Throttled));
        assert_eq!(slowed(&at(Some(300), None), None), None);
        assert_eq!(slowed(&at(None, None), Some(&clock)), None);
    }
}
