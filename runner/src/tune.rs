//! `runner tune`: finds good workgroup sizes and a good traversal cost without measuring all combinations.
//!
//! Successive halving (Jamieson, Talwalkar 2016): every combination gets one sample a view; the better half gets
//! as many again as it has, and so on, until those that are left have as many samples as the full grid would give
//! each. Those that are far behind go at once, so samples are spent where the contenders are close.
//!
//! ```text
//! samples a view   1    2    4    8   16
//! combinations    54 → 27 → 14 →  7 →  6      185 of the 864 samples of the grid
//! ```
//!
//! A launch for primary rays depends on one workgroup size and one for secondary rays on the other, so one
//! measurement tries a size for both. What a combination is worth: the time of a path with its traversal cost,
//! relative to that with the best one, and the time of its primary rays (or of its secondary rays, whichever looks
//! better) relative to the best with the same traversal cost. Over several scenes, the smallest counts, as in
//! `runner best`.

use crate::{
    args::{self, Global},
    commands::print,
    measure::{self, Defaults, Measuring, Plan, Sampling, Unwatched},
    params::Params,
    progress::{bar, remark},
    session::{Loaded, Session, interrupted, watch_for_interrupts},
    size::Size,
    table::{self, table, thousands},
    telemetry::Telemetry,
    tuned::{self, Tuned},
    variant::Variant,
};
use anyhow::bail;
use record::{Method, Parameters, stats};
use std::time::Duration;
use tracer::path;

/// The workgroup sizes of the thesis, in subgroups (section 6.2.1).
const SUBGROUPS: [u32; 9] = [2, 4, 8, 12, 16, 20, 24, 28, 32];

/// The traversal costs of the thesis (section 6.3).
const COSTS: [f32; 6] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];

/// A combination that reaches less than this share of the best goes before its half does.
const FAR_BEHIND: f64 = 0.95;

/// Samples that a combination gets at a time. All contenders take turns, so that what happens to the device for a
/// while happens to all of them.
const TURN: u32 = 4;

/// So many are left at least: enough for the two sizes of the best traversal cost and of two rivals.
const FEWEST: usize = 6;

/// One combination.
struct Arm {
    subgroups: u32,
    cost: f32,
    params: Params,
    /// By scene and view: milliseconds of primary and of secondary rays in each sample that counts.
    times: Vec<Vec<Vec<[f64; 2]>>>,
}

/// Milliseconds of primary and of secondary rays of a path through every pixel.
type Times = [f64; 2];

/// A combination's subgroups and traversal cost, and what it took in each scene.
type Tried = (u32, f32, Vec<Times>);

/// What was found for a variant.
#[derive(Debug, PartialEq)]
struct Found {
    cost: f32,
    primary: u32,
    secondary: u32,
}

/// Tunes what the command line names.
///
/// # Errors
/// A scene or the device failed, or no sample counts.
pub fn tune(global: &Global, arguments: &args::Tune) -> anyhow::Result<()> {
    let mut variants = Variant::select(&arguments.variant)?;
    let first = variants[0];
    // The driver chooses for itself, and without a tree there is nothing to choose.
    variants.retain(|variant| variant.layout().is_some());
    if variants.is_empty() {
        bail!("there is nothing to tune about {first}: choose another variant");
    }
    for name in ["trace.primary_subgroups", "trace.secondary_subgroups", "collapse.c_t"] {
        if arguments
            .paths
            .tuning
            .set
            .iter()
            .any(|set| set.split('=').next().is_some_and(|n| n.trim() == name))
        {
            bail!("--set {name}: that is what is looked for");
        }
    }
    watch_for_interrupts("measurement")?;
    let session = Session::open(global)?;
    let telemetry = measure::telemetry(&session);
    let held = measure::Held::of(&session);
    let defaults = Defaults::of(&session);
    let size = arguments.paths.size.unwrap_or(defaults.size);
    let scenes =
        arguments.scenes.iter().map(|spec| session.load(spec)).collect::<anyhow::Result<Vec<_>>>()?;
    let plan = Plan {
        size: (size.width, size.height),
        method: Method::Paths,
        path: path::Params {
            depth: arguments.paths.depth.unwrap_or(measure::depth(Method::Paths)),
            seed: arguments.paths.seed,
            ..path::Params::default()
        },
        builds: 1,
        warm_up: 1,
        busy_before_point: if defaults.cpu { Duration::ZERO } else { Duration::from_millis(50) },
        busy_before_view: Duration::ZERO,
        sampling: Sampling::exactly(1),
        clock: measure::clock(&telemetry, &held, arguments.paths.locked_clock, measure::LEAST_CLOCK),
        held,
        counting: false,
    };
    let mut tuned = Vec::new();
    for &variant in &variants {
        let mut tuning = Tuning::new(&session, &telemetry, &scenes, variant, plan.clone(), arguments)?;
        let outcome = tuning.halve(|found, comment| {
            let mut sets: Vec<Tuned> = tuned.clone();
            sets.push(set(variant, found, comment));
            write(arguments, &session, size, &sets)
        });
        let (found, comment) = match outcome? {
            Some(found) => found,
            None => bail!("interrupted before every combination had a sample"),
        };
        print(&tuning.shown(&found, &comment))?;
        tuned.push(set(variant, &found, &comment));
        if interrupted() {
            break;
        }
    }
    if let Some(output) = &arguments.output {
        remark(session.quiet, format_args!("config: {}", output.display()));
    }
    session.finish()?;
    if interrupted() {
        std::process::exit(130);
    }
    Ok(())
}

fn set(variant: Variant, found: &Found, comment: &str) -> Tuned {
    let mut parameters = Parameters::default();
    parameters.set("collapse.c_t", f64::from(found.cost));
    parameters.set("trace.primary_subgroups", found.primary);
    parameters.set("trace.secondary_subgroups", found.secondary);
    Tuned { variant, comments: vec![comment.to_owned()], parameters }
}

fn write(arguments: &args::Tune, session: &Session, size: Size, sets: &[Tuned]) -> anyhow::Result<()> {
    let Some(output) = &arguments.output else { return Ok(()) };
    let info = session.gpu.info();
    let head = format!(
        "Good values on {}, driver {}, found by halving at {}x{} over {}.",
        info.name,
        info.driver_info,
        size.width,
        size.height,
        arguments.scenes.join(", ")
    );
    tuned::write(output, &head, sets)
}

/// The search for one variant.
struct Tuning<'a> {
    session: &'a Session,
    telemetry: &'a Telemetry,
    scenes: &'a [Loaded],
    views: Vec<Vec<usize>>,
    variant: Variant,
    plan: Plan,
    /// Samples of a view that the full grid would give each combination.
    samples: u32,
    arms: Vec<Arm>,
    /// Those that are still in the race.
    left: Vec<usize>,
    /// Samples traced, those that do not count included.
    spent: u64,
}

impl<'a> Tuning<'a> {
    fn new(
        session: &'a Session,
        telemetry: &'a Telemetry,
        scenes: &'a [Loaded],
        variant: Variant,
        plan: Plan,
        arguments: &args::Tune,
    ) -> anyhow::Result<Self> {
        let views: Vec<Vec<usize>> = scenes
            .iter()
            .map(|scene| scene.views(arguments.views.as_deref()))
            .collect::<anyhow::Result<_>>()?;
        let mut arms = Vec::new();
        for subgroups in SUBGROUPS {
            for cost in COSTS {
                let mut params = Params::with(variant, &arguments.paths.tuning.set)?;
                params.trace.primary_subgroups = subgroups;
                params.trace.secondary_subgroups = subgroups;
                params.collapse.traversal_cost = cost;
                if params.fits(variant, &session.gpu) {
                    let times = views.iter().map(|views| vec![Vec::new(); views.len()]).collect();
                    arms.push(Arm { subgroups, cost, params, times });
                }
            }
        }
        Ok(Self {
            session,
            telemetry,
            scenes,
            views,
            variant,
            plan,
            samples: arguments.samples,
            left: (0..arms.len()).collect(),
            arms,
            spent: 0,
        })
    }

    /// Samples of the full grid.
    fn grid(&self) -> u64 {
        let views: usize = self.views.iter().map(Vec::len).sum();
        (self.arms.len() * views) as u64 * u64::from(self.samples)
    }

    /// Halves until few are left. `each` sees the best so far after every round; nothing where the first was
    /// interrupted.
    fn halve(
        &mut self,
        mut each: impl FnMut(&Found, &str) -> anyhow::Result<()>,
    ) -> anyhow::Result<Option<(Found, String)>> {
        let mut samples = 1.min(self.samples);
        let mut had = 0;
        let mut best = None;
        loop {
            let turns = (samples - had).div_ceil(TURN);
            let bar =
                bar((self.left.len() * self.scenes.len()) as u64 * u64::from(turns), self.session.quiet);
            let variant = self.variant;
            bar.set_message(format!("{variant}: {} combinations, {samples} samples a view", self.left.len()));
            for turn in 0..turns {
                for scene in 0..self.scenes.len() {
                    for arm in self.left.clone() {
                        self.measure(arm, scene, TURN.min(samples - had - turn * TURN))?;
                        bar.inc(1);
                        if interrupted() {
                            bar.finish_and_clear();
                            return Ok(best);
                        }
                    }
                }
            }
            bar.finish_and_clear();
            had = samples;
            let arms: Vec<Tried> = (self.left.iter())
                .map(|&arm| {
                    let arm = &self.arms[arm];
                    (arm.subgroups, arm.cost, arm.times.iter().map(|views| averaged(views)).collect())
                })
                .collect();
            let found = choose(&arms);
            let last = samples >= self.samples;
            let comment = format!(
                "{} of the grid's {} samples{}",
                thousands(self.spent),
                thousands(self.grid()),
                if last { "" } else { "; not finished" }
            );
            remark(
                self.session.quiet,
                format_args!(
                    "{variant}: {} combinations with {samples} samples a view; so far c_t {}, {} and {} subgroups",
                    self.left.len(),
                    found.cost,
                    found.primary,
                    found.secondary
                ),
            );
            each(&found, &comment)?;
            best = Some((found, comment));
            if last {
                return Ok(best);
            }
            let mut ranked: Vec<(usize, f64)> = self.left.iter().copied().zip(worth(&arms)).collect();
            ranked.sort_by(|(_, a), (_, b)| b.total_cmp(a));
            ranked.truncate(self.left.len().div_ceil(2).max(FEWEST));
            let near = ranked.iter().filter(|(_, worth)| *worth >= FAR_BEHIND).count();
            ranked.truncate(near.max(FEWEST));
            self.left = ranked.into_iter().map(|(arm, _)| arm).collect();
            // Not in the order of their rank, which a slow change of the device would follow.
            self.left.sort_unstable();
            samples = (2 * samples).min(self.samples);
        }
    }

    fn measure(&mut self, arm: usize, scene: usize, samples: u32) -> anyhow::Result<()> {
        let common = Parameters::default();
        // Samples that do not count are made up for.
        let sampling = Sampling {
            least: samples,
            most: 2 * samples + 4,
            half_width: f64::INFINITY,
            time: Duration::MAX,
        };
        let plan = Plan { sampling, ..self.plan.clone() };
        let measuring = Measuring {
            session: self.session,
            telemetry: self.telemetry,
            loaded: &self.scenes[scene],
            variant: self.variant,
            params: &self.arms[arm].params,
            plan: &plan,
            common: &common,
            position: 0,
        };
        let point = measuring.measure(&self.views[scene], &mut Unwatched)?.expect("nobody stops it half-way");
        for (view, into) in point.views.iter().zip(&mut self.arms[arm].times[scene]) {
            self.spent += view.samples.len() as u64;
            for sample in view.counted() {
                let all: f64 = sample.depths.iter().map(|launch| launch.milliseconds).sum();
                let primary = sample.depths.first().map_or(0.0, |launch| launch.milliseconds);
                into.push([primary, all - primary]);
            }
            if into.is_empty() {
                bail!("{}, {}: no sample counts; is the GPU throttled?", point.scene.name, view.name);
            }
        }
        Ok(())
    }

    fn shown(&self, found: &Found, comment: &str) -> String {
        let mut rows = table(&["c_t", "subgroups", "samples", "primary ms", "±", "secondary ms", "±"]);
        let views: usize = self.views.iter().map(Vec::len).sum();
        for arm in self.left.iter().map(|&arm| &self.arms[arm]) {
            let mut row =
                vec![arm.cost.to_string(), arm.subgroups.to_string(), (samples_of(arm) / views).to_string()];
            for kind in 0..2 {
                let views = arm.times.iter().flatten();
                let of = |times: &Vec<Times>| times.iter().map(|time| time[kind]).collect::<Vec<_>>();
                let means: Option<Vec<_>> =
                    views.clone().map(|times| stats::Estimate::of(&of(times))).collect();
                let all: Vec<Vec<Times>> = views.cloned().collect();
                row.push(format!("{:.3}", averaged(&all)[kind]));
                let width = means.and_then(|means| stats::Estimate::average(&means));
                row.push(width.map_or("–".into(), |e| format!("{:.1}%", 100.0 * e.relative_half_width())));
            }
            rows.add_row(row);
        }
        table::align(&mut rows, &[]);
        format!(
            "{}: c_t {}, {} subgroups a workgroup for primary and {} for secondary rays; {comment}\n\nWhat was left at the \
             end, milliseconds of a path through every pixel, medians averaged over views:\n{}",
            self.variant,
            found.cost,
            found.primary,
            found.secondary,
            table::shown(&rows)
        )
    }
}

fn samples_of(arm: &Arm) -> usize {
    arm.times.iter().flatten().map(Vec::len).sum()
}

/// The mean over views of the medians over samples: one slow sample of few would move a mean.
fn averaged(views: &[Vec<Times>]) -> Times {
    let of = |kind: usize| {
        let median = |view: &Vec<Times>| {
            let times: Vec<f64> = view.iter().map(|time| time[kind]).collect();
            stats::median(&times).expect("every view has a sample that counts")
        };
        views.iter().map(median).sum::<f64>() / views.len() as f64
    };
    [of(0), of(1)]
}

/// The smallest time of a kind in a scene, among the combinations with a traversal cost.
fn fastest(arms: &[Tried], cost: f32, scene: usize, kind: usize) -> f64 {
    let own = arms.iter().filter(|(_, of, _)| *of == cost);
    own.map(|(.., times)| times[scene][kind]).fold(f64::INFINITY, f64::min)
}

/// What a traversal cost is worth, with the best sizes for it: its smallest relative rate over the scenes, and the
/// mean of the same.
fn worth_of_cost(arms: &[Tried], cost: f32) -> (f64, f64) {
    let path = |cost: f32, scene: usize| fastest(arms, cost, scene, 0) + fastest(arms, cost, scene, 1);
    let relative = |scene: usize| {
        let best = arms.iter().map(|(_, cost, _)| path(*cost, scene)).fold(f64::INFINITY, f64::min);
        best / path(cost, scene)
    };
    least_and_mean((0..arms[0].2.len()).map(relative))
}

/// What a combination's size is worth for one kind of rays, among those with the same traversal cost.
fn worth_of_size(arms: &[Tried], arm: &Tried, kind: usize) -> (f64, f64) {
    let relative = |scene: usize| fastest(arms, arm.1, scene, kind) / arm.2[scene][kind];
    least_and_mean((0..arm.2.len()).map(relative))
}

fn least_and_mean(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let count = values.clone().count() as f64;
    (values.clone().fold(f64::INFINITY, f64::min), values.sum::<f64>() / count)
}

/// What each combination is worth, at most 1.
fn worth(arms: &[Tried]) -> Vec<f64> {
    let of = |arm: &Tried| {
        let size = worth_of_size(arms, arm, 0).0.max(worth_of_size(arms, arm, 1).0);
        worth_of_cost(arms, arm.1).0 * size
    };
    arms.iter().map(of).collect()
}

/// The best traversal cost and the best sizes for it; the mean decides between equal minima.
fn choose(arms: &[Tried]) -> Found {
    let greater = |a: &(f64, f64), b: &(f64, f64)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1));
    let cost = arms.iter().map(|(_, cost, _)| *cost);
    let cost = cost
        .max_by(|a, b| greater(&worth_of_cost(arms, *a), &worth_of_cost(arms, *b)))
        .expect("there are combinations");
    let size = |kind: usize| {
        let own = arms.iter().filter(|(_, of, _)| *of == cost);
        let best = own
            .max_by(|a, b| greater(&worth_of_size(arms, a, kind), &worth_of_size(arms, b, kind)))
            .expect("the cost is that of a combination");
        best.0
    };
    Found { cost, primary: size(0), secondary: size(1) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times that a model of a device gives: primary rays like 8 subgroups and secondary ones 20, c_t 3 is best.
    fn model(subgroups: u32, cost: f32, scene: usize) -> Times {
        let off = |best: u32| 1.0 + 0.01 * f64::from(subgroups.abs_diff(best));
        let of_cost = 1.0 + 0.02 * f64::from((cost - 3.0).abs());
        let scale = (scene + 1) as f64;
        [scale * off(8) * of_cost, 4.0 * scale * off(20) * of_cost]
    }

    fn all() -> Vec<Tried> {
        let each = |subgroups| {
            COSTS.map(|cost| (subgroups, cost, (0..2).map(|scene| model(subgroups, cost, scene)).collect()))
        };
        SUBGROUPS.into_iter().flat_map(each).collect()
    }

    #[test]
    fn the_best_of_the_grid_is_chosen() {
        assert_eq!(choose(&all()), Found { cost: 3.0, primary: 8, secondary: 20 });
    }

    #[test]
    fn what_is_best_for_either_kind_of_rays_is_worth_most() {
        let all = all();
        let mut ranked: Vec<(f64, u32, f32)> =
            worth(&all).into_iter().zip(&all).map(|(worth, arm)| (worth, arm.0, arm.1)).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        assert_eq!((ranked[0].0, ranked[1].0), (1.0, 1.0));
        let mut first = [ranked[0].1, ranked[1].1];
        first.sort_unstable();
        assert_eq!((first, ranked[0].2, ranked[1].2), ([8, 20], 3.0, 3.0));
        assert!(ranked[53].0 < 0.95);
    }

    #[test]
    fn a_scene_where_a_size_is_bad_counts_against_it() {
        let arms = [
            (2, 2.0, vec![[1.0, 10.0], [1.0, 12.0]]),
            (4, 2.0, vec![[1.0, 10.5], [1.0, 10.0]]),
            (8, 2.0, vec![[0.9, 10.9], [0.9, 10.9]]),
        ];
        assert_eq!(choose(&arms), Found { cost: 2.0, primary: 8, secondary: 4 });
    }

    #[test]
    fn views_count_alike() {
        let views = [vec![[1.0, 2.0], [3.0, 2.0], [2.0, 9.0]], vec![[6.0, 4.0]]];
        assert_eq!(averaged(&views), [4.0, 3.0]);
    }
}
