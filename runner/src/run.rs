//! `runner run`: measures scenes and writes the record as it goes.

use crate::{
    args::{self, Global},
    commands::print,
    measure::{
        Defaults, Held, LAUNCHES, LEAST_CLOCK, Measuring, Plan, Sampling, Watch, begin, clock, depth,
        telemetry,
    },
    params::Params,
    progress::{bar, remark},
    session::{Session, interrupted, watch_for_interrupts},
    table,
    variant::Variant,
};
use anyhow::Context;
use indicatif::ProgressBar;
use record::{Method, Point, Record};
use std::{path::Path, time::Duration};
use tracer::path;

/// Measures what the command line asks for.
///
/// # Errors
/// Anything that keeps a scene from being measured; what was measured before is in the record.
pub fn run(global: &Global, run: &args::Run) -> anyhow::Result<()> {
    let variants = Variant::select(&run.variant)?;
    if let Some(path) = &run.bvh {
        anyhow::ensure!(
            run.scenes.len() == 1,
            "--bvh {}: a tree is of one scene, and there are {}; run them one by one",
            path.display(),
            run.scenes.len()
        );
        if let Some(own) = variants.iter().find(|variant| variant.layout().is_none()) {
            anyhow::bail!(
                "--bvh {}: {own} is not made from a binary tree; name others with --variant, such as 'Wide*'",
                path.display()
            );
        }
        let of_tree = run.paths.tuning.set.iter().find(|assignment| Params::is_of_binary_tree(assignment));
        if let Some(assignment) = of_tree {
            anyhow::bail!(
                "--set {assignment}: the binary tree is the one in {}, built already; leave one of the two out, or \
                 give this to `runner bvh precompute`",
                path.display()
            );
        }
    }
    // Mistakes are told before a device is opened.
    for &variant in &variants {
        Params::with(variant, &run.paths.tuning.set)?;
    }
    watch_for_interrupts("sample")?;
    let session = Session::open(global)?;
    let available = session.available(variants, &run.variant)?;
    let variants = &available.there;
    let mut params: Vec<Params> =
        variants.iter().map(|&v| Params::with(v, &run.paths.tuning.set)).collect::<anyhow::Result<_>>()?;
    let telemetry = telemetry(&session);
    let held = Held::of(&session);
    let defaults = Defaults::of(&session);
    let size = run.paths.size.unwrap_or(defaults.size);
    let method = run.method.into();
    let samples = match method {
        Method::Replay => LAUNCHES,
        Method::Paths if defaults.cpu => 3,
        Method::Paths => 15,
    };
    let plan = Plan {
        size: (size.width, size.height),
        method,
        path: path::Params {
            depth: run.paths.depth.unwrap_or(depth(method)),
            seed: run.paths.seed,
            ..path::Params::default()
        },
        builds: run.builds.unwrap_or(defaults.builds),
        warm_up: run.warm_up,
        busy_before_point: if defaults.cpu { Duration::ZERO } else { WARM_UP_TIME },
        busy_before_view: if defaults.cpu { Duration::ZERO } else { WARM_UP_VIEW_TIME },
        sampling: Sampling::exactly(run.samples.unwrap_or(samples)),
        clock: clock(&telemetry, &held, run.paths.locked_clock, LEAST_CLOCK),
        held,
        counting: true,
    };
    // The tree says by which parameters it was built, so it is read before they are written down.
    let mut given = None;
    if let Some(path) = &run.bvh {
        let mut loaded = session.load(&run.scenes[0])?;
        let recipe = loaded.give(path, session.quiet)?.recipe.clone();
        params.iter_mut().for_each(|params| params.adopt(&recipe));
        given = Some(loaded);
    }
    let mut record = begin(&session, &plan, run.host_name);
    record.parameters = params[0].by_name();
    record.left_out.clone_from(&available.missed);

    let bar = bar(0, session.quiet);
    let mut writer = Writer { record, output: run.output.as_deref() };
    writer.write()?;
    let mut points_left = (run.scenes.len() * variants.len()) as u64;
    'scenes: for spec in &run.scenes {
        bar.set_message(format!("{spec}: loading"));
        let loaded = given.take().map_or_else(|| session.load(spec), Ok)?;
        let views = loaded.views(run.views.as_deref())?;
        for (&variant, params) in variants.iter().zip(&params) {
            // The time left is an estimate: the scenes to come are taken to have as many views as this one.
            let steps = views.len() as u64 * u64::from(plan.sampling.most + 1);
            bar.set_length(bar.position() + points_left * steps);
            points_left -= 1;
            let title = format!("{}, {variant}", loaded.scene.name);
            bar.set_message(format!("{title}: building"));
            let common = writer.record.parameters.clone();
            let position = writer.record.results.len() as u64;
            let measuring = Measuring {
                session: &session,
                telemetry: &telemetry,
                loaded: &loaded,
                variant,
                params,
                plan: &plan,
                common: &common,
                position,
            };
            let mut following = Following { title, bar: &bar, writer: &mut writer, place: position as usize };
            if let Some(point) = measuring.measure(&views, &mut following)? {
                following.progress(&point)?;
            }
            if interrupted() {
                break 'scenes;
            }
        }
    }
    bar.finish_and_clear();
    if !interrupted() {
        writer.record.finished = Some(record::Timestamp::now());
        writer.write()?;
    }
    print(&table::summary(&writer.record))?;
    if let Some(output) = &run.output {
        remark(session.quiet, format_args!("record: {}", output.display()));
    }
    session.finish()?;
    if interrupted() {
        std::process::exit(130);
    }
    available.finish(&session.gpu)
}

/// A GPU lowers its clocks within a second of idling, while the host loads a scene or reads counters back,
/// and takes a while to raise them again.
const WARM_UP_TIME: Duration = Duration::from_millis(400);

/// Before a view, when it has been busy within the last second.
const WARM_UP_VIEW_TIME: Duration = Duration::from_millis(150);

/// The record and the file that follows it.
struct Writer<'a> {
    record: Record,
    output: Option<&'a Path>,
}

impl Writer<'_> {
    fn write(&self) -> anyhow::Result<()> {
        match self.output {
            Some(path) => self.record.write_atomic(path).context("the record cannot be written"),
            None => Ok(()),
        }
    }
}

/// Writes the record after each view.
struct Following<'a, 'w> {
    title: String,
    bar: &'a ProgressBar,
    writer: &'a mut Writer<'w>,
    /// Of the point among the results.
    place: usize,
}

impl Watch for Following<'_, '_> {
    fn interrupted(&self) -> bool {
        interrupted()
    }

    fn view(&mut self, which: usize, of: usize, name: &str) {
        self.bar.set_message(format!("{}, view {} of {of}: {name}", self.title, which + 1));
    }

    fn sample(&mut self) {
        self.bar.inc(1);
    }

    fn progress(&mut self, point: &Point) -> anyhow::Result<()> {
        self.writer.record.results.truncate(self.place);
        self.writer.record.results.push(point.clone());
        self.writer.write()
    }
}
