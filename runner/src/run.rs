//! `runner run`: measures scenes and writes the record as it goes.

use crate::{
    args::{self, Global, Size},
    commands::print,
    describe, host,
    measure::{Measuring, Plan, Sampling, Watch},
    params::Params,
    progress::{bar, remark},
    session::{Session, interrupted, watch_for_interrupts},
    table,
    telemetry::Telemetry,
    variant::Variant,
};
use anyhow::Context;
use indicatif::ProgressBar;
use record::{Clock, ClockKind, Point, Record};
use std::{path::Path, time::Duration};
use tracer::{
    gpu::{DeviceKind, shaders},
    path,
};

/// Measures what the command line asks for.
///
/// # Errors
/// Anything that keeps a scene from being measured; what was measured before is in the record.
pub fn run(global: &Global, run: &args::Run) -> anyhow::Result<()> {
    let variants = Variant::select(&run.variant)?;
    let params: Vec<Params> =
        variants.iter().map(|&v| Params::with(v, &run.tuning.set)).collect::<anyhow::Result<_>>()?;
    watch_for_interrupts("sample")?;
    let session = Session::open(global)?;
    let telemetry = telemetry(&session);
    let defaults = Defaults::of(&session);
    let size = run.size.unwrap_or(defaults.size);
    let plan = Plan {
        size: (size.width, size.height),
        path: path::Params { depth: run.depth, seed: run.seed },
        builds: run.builds.unwrap_or(defaults.builds),
        warm_up: run.warm_up,
        busy_before_point: if defaults.cpu { Duration::ZERO } else { WARM_UP_TIME },
        busy_before_view: if defaults.cpu { Duration::ZERO } else { WARM_UP_VIEW_TIME },
        sampling: Sampling::exactly(run.samples.unwrap_or(if defaults.cpu { 3 } else { 15 })),
        clock: clock(&telemetry, run.locked_clock, LEAST_CLOCK),
        counting: true,
    };
    let mut record = begin(&session, &plan, run.host_name);
    record.parameters = params[0].by_name();

    let bar = bar(0, session.quiet);
    let mut writer = Writer { record, output: run.output.as_deref() };
    writer.write()?;
    let mut points_left = (run.scenes.len() * variants.len()) as u64;
    'scenes: for spec in &run.scenes {
        bar.set_message(format!("{spec}: loading"));
        let loaded = session.load(spec)?;
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
    Ok(())
}

/// What depends on the sort of device where nobody chose.
pub struct Defaults {
    /// Whether it is a driver that runs on the CPU.
    pub cpu: bool,
    /// Picture size.
    pub size: Size,
    /// Measured builds of each tree.
    pub builds: u32,
}

impl Defaults {
    /// Of the session's device.
    pub fn of(session: &Session) -> Self {
        if session.gpu.info().kind == DeviceKind::Cpu {
            Self { cpu: true, size: Size { width: 320, height: 180 }, builds: 3 }
        } else {
            Self { cpu: false, size: Size { width: 1920, height: 1080 }, builds: 10 }
        }
    }
}

/// A GPU lowers its clocks within a second of idling, while the host loads a scene or reads counters back,
/// and takes a while to raise them again.
const WARM_UP_TIME: Duration = Duration::from_millis(400);

/// Before a view, when it has been busy within the last second.
const WARM_UP_VIEW_TIME: Duration = Duration::from_millis(150);

/// Samples with a clock below this share of the locked or base clock do not count.
pub const LEAST_CLOCK: f64 = 0.95;

/// What the session's device says about itself.
pub fn telemetry(session: &Session) -> Telemetry {
    let info = session.gpu.info();
    Telemetry::open(info.vendor_id, describe::uuid_bytes(&info.uuid), info.pci.as_deref())
}

/// The clock that samples are held against: the one that the device is said to be locked to, or else its base
/// clock.
pub fn clock(telemetry: &Telemetry, locked_mhz: Option<u32>, least_share: f64) -> Option<Clock> {
    let of = |kind| move |mhz| Clock { kind, mhz, least_share };
    locked_mhz.map(of(ClockKind::Locked)).or_else(|| telemetry.base_clock().map(of(ClockKind::Base)))
}

/// A record of a run that begins now.
pub fn begin(session: &Session, plan: &Plan, host_name: bool) -> Record {
    let sampling = &plan.sampling;
    let run = record::Run {
        width: plan.size.0,
        height: plan.size.1,
        samples: sampling.most,
        warm_up: plan.warm_up,
        depth: plan.path.depth,
        seed: plan.path.seed.into(),
        stopping: (!sampling.is_exact()).then_some(record::Stopping {
            least: sampling.least,
            most: sampling.most,
            half_width: sampling.half_width,
            seconds: sampling.time.as_secs_f64(),
        }),
        clock: plan.clock.clone(),
    };
    let mut record =
        Record::new(host::tool(), host::gather(host_name), describe::device(session.gpu.info()), run);
    record.shaders = shaders::ALL.iter().map(|s| (s.name.to_owned(), s.sha256())).collect();
    record
}

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
