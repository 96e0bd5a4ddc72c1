//! `runner sweep`: measures every point of a config, in a fair order, into a journal that loses nothing.

mod estimate;
mod event;
pub mod journal;
mod merge;
mod scenes;

pub use merge::merge;

use crate::{
    args::{self, Global},
    commands::print,
    config::{Config, Setup},
    measure::{self, Defaults, Held, Measuring, Plan, Sampling, Watch},
    progress::{bar, remark},
    session::{Session, interrupted, watch_for_interrupts},
    shard, table,
    telemetry::Telemetry,
};
use anyhow::{Context, bail};
use estimate::{Speed, spoken};
use event::{Event, Events};
use indicatif::ProgressBar;
use journal::{Contents, Entry, Header, Journal};
use record::{Method, Point, Rays, Record};
use scenes::Scenes;
use std::{
    io::IsTerminal,
    path::Path,
    time::{Duration, Instant},
};
use tracer::{path, scene::SearchPath};

/// How long builds go on before those that are measured, on a GPU. It has just been busy with another point.
const BUSY: Duration = Duration::from_millis(100);

/// After so many points that could not be measured one after the other, the rest is not tried.
const HOPELESS: u32 = 3;

/// Measures a config, or says what that would be.
///
/// # Errors
/// The config is wrong, the folder holds another sweep, or a point could not be measured.
pub fn sweep(global: &Global, arguments: &args::Sweep) -> anyhow::Result<()> {
    let search = SearchPath::new(global.scene_dir.iter().cloned());
    let mut config = Config::load(&arguments.config, &arguments.include, &arguments.tuning.set, &search)?;
    config.restrict(&arguments.only)?;
    let points = config.points()?;
    let events = Events::new(arguments.json);
    watch_for_interrupts("point")?;
    let session = Session::open(global)?;
    let telemetry = measure::telemetry(&session);
    let defaults = Defaults::of(&session);
    let held = Held::of(&session);
    let clock = measure::clock(&telemetry, &held, arguments.locked_clock, config.samples.least_clock);
    let plan = plan(&config, &defaults, held, clock);

    let (points, unavailable): (Vec<Setup>, Vec<Setup>) =
        points.into_iter().partition(|setup| setup.variant.unavailable(session.gpu.info()).is_none());
    if let Some(why) = unavailable.first().and_then(|setup| setup.variant.unavailable(session.gpu.info())) {
        if points.is_empty() {
            return Err(why.into());
        }
        remark(session.quiet, format_args!("{} points are left out: {why}", unavailable.len()));
    }
    let (points, too_large) = fitting(&session, points);
    if !too_large.is_empty() {
        remark(
            session.quiet,
            format_args!(
                "{} points are left out, because the device has workgroups of at most {} invocations and {} bytes of \
                 shared memory; the first is {}",
                too_large.len(),
                session.gpu.info().max_workgroup_size,
                session.gpu.info().shared_memory_bytes,
                too_large[0]
            ),
        );
    }
    let Some(reference) = points.first() else { bail!("no point is left to measure") };
    let keys: Vec<String> = points.iter().map(Setup::key).collect();
    let mine = |key: &str| arguments.shard.is_none_or(|shard| shard.has(key));

    let mut record = measure::begin(&session, &plan, arguments.host_name);
    record.parameters = reference.params.by_name();
    record.sweep = Some(record::Sweep {
        title: config.title.clone(),
        axes: config.axis_names(),
        config: serde_json::to_value(config.experiment()?)?,
        order_seed: config.order.seed,
        points: points.len() as u64,
        shard: arguments.shard.map(|shard| shard.to_string()),
    });
    let header = Header::new(record, keys.clone());

    let mut todo: Vec<(&Setup, &String)> = points.iter().zip(&keys).filter(|(_, key)| mine(key)).collect();
    if arguments.plan {
        let there = match &arguments.output {
            Some(folder) if folder.join(journal::NAME).exists() => Some(Contents::read(folder)?),
            _ => None,
        };
        return show(&session, &telemetry, &plan, &defaults, &config, &todo, there.as_ref(), &events);
    }
    let Some(folder) = &arguments.output else {
        bail!("where to? -o DIR takes the journal and the record, and --plan only shows the points")
    };
    let (mut journal, was_there) = Journal::open(folder, header.clone())?;
    if journal.contents.torn > 0 {
        remark(
            session.quiet,
            format_args!(
                "the journal's last line was torn: {} bytes of a point that was not finished were dropped",
                journal.contents.torn
            ),
        );
    }
    if was_there {
        let differences = journal::differences(&journal.contents.header.record, &header.record);
        if !differences.is_empty() {
            bail!(
                "{} holds another sweep, which this one cannot go on with:\n  {}\nTake another -o, or remove the \
                 folder to begin anew.",
                folder.display(),
                differences.join("\n  ")
            );
        }
    }
    let all = todo.len();
    todo.retain(|(_, key)| !journal.contents.has(key));
    todo.sort_by_key(|(_, key)| shard::place(config.order.seed, key));
    if was_there {
        let left = if todo.is_empty() { "nothing is".to_owned() } else { format!("{} are", todo.len()) };
        remark(
            session.quiet,
            format_args!("{} of {all} points are there already, {left} left", all - todo.len()),
        );
    }
    events.tell(&Event::Begun { title: &config.title, points: all, left: todo.len() });

    let bar = bar(todo.len() as u64, session.quiet || arguments.json);
    let mut sweeping = Sweeping {
        session: &session,
        telemetry: &telemetry,
        plan: &plan,
        config: &config,
        scenes: Scenes::new(&session),
        events: &events,
        bar: &bar,
        journal: &mut journal,
        started: Instant::now(),
        done: 0,
        all: todo.len(),
    };
    let failed = sweeping.through(&todo, reference)?;
    bar.finish_and_clear();

    let record = journal.contents.record();
    if !record.results.is_empty() {
        record.write_atomic(folder.join("record.json")).context("the record cannot be written")?;
        if !arguments.json {
            print(&table::sweep(&record))?;
        }
        remark(session.quiet, format_args!("record: {}", folder.join("record.json").display()));
    }
    events.tell(&Event::Ended { points: record.results.len(), complete: record.finished.is_some() });
    session.finish()?;
    if interrupted() {
        remark(session.quiet, format_args!("interrupted; the same command goes on"));
        std::process::exit(130);
    }
    if !failed.is_empty() {
        bail!("{} points could not be measured: {}", failed.len(), journal::listed(&failed));
    }
    Ok(())
}

/// What is the same for all points.
fn plan(config: &Config, defaults: &Defaults, held: Held, clock: Option<record::Clock>) -> Plan {
    let samples = &config.samples;
    let (least, most) = match config.method {
        Method::Replay => (measure::LAUNCHES, measure::LAUNCHES),
        Method::Paths if defaults.cpu => (3, 12),
        Method::Paths => (5, 60),
    };
    let least = samples.least.unwrap_or(least.min(samples.most.unwrap_or(least)));
    let size = config.size.unwrap_or(defaults.size);
    Plan {
        size: (size.width, size.height),
        method: config.method,
        path: path::Params { depth: config.depth(), seed: config.seed, ..path::Params::default() },
        builds: config.builds.unwrap_or(defaults.builds),
        warm_up: config.warm_up,
        busy_before_point: if defaults.cpu { Duration::ZERO } else { BUSY },
        // While rays are collected the GPU waits for the host.
        busy_before_view: if defaults.cpu || config.method == Method::Paths { Duration::ZERO } else { BUSY },
        sampling: Sampling {
            least,
            most: samples.most.unwrap_or(most.max(least)),
            half_width: samples.half_width,
            time: samples.time,
        },
        clock,
        held,
        counting: true,
    }
}

/// The points whose workgroups the device has room for, and the keys of the others.
fn fitting(session: &Session, points: Vec<Setup>) -> (Vec<Setup>, Vec<String>) {
    let (fit, large): (Vec<Setup>, Vec<Setup>) =
        points.into_iter().partition(|setup| setup.params.fits(setup.variant, &session.gpu));
    (fit, large.iter().map(Setup::key).collect())
}

/// Prints the points that are to be measured, and how long that will take.
#[expect(clippy::too_many_arguments, reason = "all that a sweep knows before it begins")]
fn show(
    session: &Session,
    telemetry: &Telemetry,
    plan: &Plan,
    defaults: &Defaults,
    config: &Config,
    todo: &[(&Setup, &String)],
    there: Option<&Contents>,
    events: &Events,
) -> anyhow::Result<()> {
    let speed = Speed::of(session, telemetry, plan, defaults.cpu)?;
    let axes = config.axis_names();
    let mut header = vec!["", "scene", "variant"];
    header.extend(axes.iter().map(String::as_str));
    let mut rows = table::table(&header);
    let (mut total, mut unknown) = ([0.0; 2], Vec::new());
    let mut left = 0_usize;
    for (setup, key) in todo {
        let measured = there.is_some_and(|contents| contents.has(key));
        events.tell(&Event::planned(key, setup, measured));
        let mut row = vec![
            if measured { "there" } else { "" }.to_owned(),
            setup.scene.clone(),
            setup.variant.to_string(),
        ];
        row.extend(axes.iter().map(|axis| setup.axes.get(axis).map_or("–".into(), ToString::to_string)));
        rows.add_row(row);
        if measured {
            continue;
        }
        left += 1;
        let triangles = estimate::triangles(&setup.scene).unwrap_or_else(|| {
            if !unknown.contains(&setup.scene) {
                unknown.push(setup.scene.clone());
            }
            0
        });
        let views = config.view_count().unwrap_or(8);
        let seconds = speed.seconds(plan, triangles, views, setup.variant.by_view);
        total = [total[0] + seconds[0], total[1] + seconds[1]];
    }
    if config.order.reference_every > 0 && left > 0 {
        let share = 1.0 + 1.0 / f64::from(config.order.reference_every) + 2.0 / left as f64;
        total = total.map(|seconds| seconds * share);
    }
    events.tell(&Event::Estimated { points: left, least_seconds: total[0], most_seconds: total[1] });
    if events.are_told() {
        return Ok(());
    }
    table::align(&mut rows, &[0, 1, 2]);
    let span = match total.map(spoken) {
        [least, most] if least == most => format!("about {least}"),
        [least, most] => format!("about {least} to {most}, as the rates scatter"),
    };
    let mut text = format!("{}\n\n{}: {left} points to measure, {span}", table::shown(&rows), config.title);
    text += &format!(
        "\nBy the speed of a small scene on {}; real scenes may take a few times as long.",
        session.gpu.info().name
    );
    if !unknown.is_empty() {
        text += &format!(
            "\nNot counted, because only loading tells their size: builds of {}.",
            unknown.join(", ")
        );
    }
    print(&text)
}

/// A sweep under way.
struct Sweeping<'a> {
    session: &'a Session,
    telemetry: &'a Telemetry,
    plan: &'a Plan,
    config: &'a Config,
    scenes: Scenes<'a>,
    events: &'a Events,
    bar: &'a ProgressBar,
    journal: &'a mut Journal,
    started: Instant,
    /// Points measured since then, and points that were to be.
    done: usize,
    all: usize,
}

impl Sweeping<'_> {
    /// Measures points in the given order, and the reference point between them. Returns the keys of those that
    /// could not be measured.
    fn through(&mut self, todo: &[(&Setup, &String)], reference: &Setup) -> anyhow::Result<Vec<String>> {
        let mut every = self.config.order.reference_every as usize;
        let mut failed = Vec::new();
        let mut in_a_row = 0;
        for (index, (setup, key)) in todo.iter().enumerate() {
            if every > 0 && index % every == 0 && !self.reference(reference) {
                every = 0;
            }
            if interrupted() {
                return Ok(failed);
            }
            match self.point(setup, Some(key)) {
                Ok(()) => in_a_row = 0,
                Err(error) => {
                    let message = format!("{error:#}");
                    self.events.tell(&Event::Failed { key, error: &message });
                    self.bar.suspend(|| eprintln!("runner: {key}: {message}"));
                    failed.push((*key).clone());
                    in_a_row += 1;
                    if in_a_row == HOPELESS {
                        bail!("{HOPELESS} points in a row could not be measured; the rest was not tried");
                    }
                }
            }
            self.bar.inc(1);
            if interrupted() {
                return Ok(failed);
            }
        }
        if every > 0 && !todo.is_empty() {
            self.reference(reference);
        }
        Ok(failed)
    }

    /// Measures the reference point; false, after saying why, where that is impossible. The others are worth
    /// having all the same.
    fn reference(&mut self, reference: &Setup) -> bool {
        let measured = self.point(reference, None);
        if let Err(error) = &measured {
            let key = reference.key();
            let message = format!("{error:#}");
            self.events.tell(&Event::Failed { key: &key, error: &message });
            self.bar.suspend(|| {
                eprintln!("runner: no drift can be told without the reference point {key}: {message}")
            });
        }
        measured.is_ok()
    }

    /// Measures a point, or without a key the reference point, and puts it into the journal.
    fn point(&mut self, setup: &Setup, key: Option<&str>) -> anyhow::Result<()> {
        let title = setup.key();
        self.bar.set_message(format!("{title}: building"));
        self.events.tell(&Event::Started { key: &title, reference: key.is_none() });
        let loaded = self.scenes.get(&setup.scene)?;
        let views = loaded.views(self.config.views.as_deref())?;
        let contents = &self.journal.contents;
        let measuring = Measuring {
            session: self.session,
            telemetry: self.telemetry,
            loaded: &loaded,
            variant: setup.variant,
            params: &setup.params,
            plan: self.plan,
            common: &contents.header.record.parameters,
            position: contents.entries.len() as u64,
        };
        let started = Instant::now();
        let mut following = Following {
            title: &title,
            view: String::new(),
            estimate: String::new(),
            bar: self.bar,
            events: self.events,
        };
        let point = measuring.measure(&views, &mut following)?.expect("a point is never stopped half-way");
        let took = started.elapsed();
        self.journal.append(Entry { key: key.map(String::from), point: point.clone() })?;
        if key.is_some() {
            self.done += 1;
        }
        self.events.tell(&Event::finished(&title, key.is_none(), &point));
        if !std::io::stderr().is_terminal() && !self.events.are_told() {
            let place =
                if key.is_some() { format!("{}/{}", self.done, self.all) } else { "reference".into() };
            let left = match (self.done, self.all - self.done) {
                (0, _) | (_, 0) => String::new(),
                (done, left) => {
                    let a_point = self.started.elapsed().as_secs_f64() / done as f64;
                    format!("; about {} left", spoken(a_point * left as f64))
                }
            };
            remark(
                self.session.quiet,
                format_args!("{place} {title}: {}, {:.1} s{left}", told(&point), took.as_secs_f64()),
            );
        }
        Ok(())
    }
}

/// Rates of a point and how sure they are.
fn told(point: &Point) -> String {
    let rate = |rays: Rays, unit: &str| {
        let rate = point.rate(rays)?;
        let width = point.estimate(rays).map(|e| format!(" ± {:.1}%", 100.0 * e.relative_half_width()));
        Some(format!("{}{} {unit}", table::number(Some(rate)), width.unwrap_or_default()))
    };
    let rates: Vec<String> =
        [rate(Rays::Primary, "pMRps"), rate(Rays::Secondary, "sMRps")].into_iter().flatten().collect();
    let unreliable = point.measurement.as_ref().is_some_and(|measurement| measurement.unreliable);
    let rates = if rates.is_empty() { "no sample counts".to_owned() } else { rates.join(", ") };
    if unreliable { format!("{rates}, unreliable") } else { rates }
}

/// Shows how far a point has come.
struct Following<'a> {
    title: &'a str,
    view: String,
    estimate: String,
    bar: &'a ProgressBar,
    events: &'a Events,
}

impl Following<'_> {
    fn show(&self) {
        self.bar.set_message(format!("{}: {}{}", self.title, self.view, self.estimate));
    }
}

impl Watch for Following<'_> {
    fn interrupted(&self) -> bool {
        // The running point is brought to its end.
        false
    }

    fn view(&mut self, which: usize, of: usize, name: &str) {
        self.view = format!("view {} of {of}, {name}", which + 1);
        self.show();
    }

    fn progress(&mut self, point: &Point) -> anyhow::Result<()> {
        self.estimate = format!("; so far {}", told(point));
        self.events.tell(&Event::Progress {
            key: self.title,
            views: point.views.len(),
            rates: event::rates(point),
        });
        self.show();
        Ok(())
    }
}

/// Where a sweep or a run left its record: a file, or the folder of a sweep.
///
/// # Errors
/// It cannot be read.
pub fn read(path: &Path) -> anyhow::Result<Record> {
    if path.is_dir() {
        return Ok(Contents::read(path)?.record());
    }
    Ok(Record::read(path)?)
}
