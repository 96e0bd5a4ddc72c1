//! `runner view`: a window in which the path tracer runs, and a chart of what it does.
//!
//! ```text
//! keys ─► Action ┐
//! camera: Held ──┼─► window: Looker ─► Shot ─► stage: Stage ─► Picture ─► draw, chart ─► Presenter
//! mouse ─────────┘                               └► Sample ─► chart: History, benchmark: Benchmark
//! ```
//!
//! A picture begins anew where the [`stage::Shot`] differs from that of the last sample; nobody has to say so.

mod benchmark;
mod camera;
mod chart;
mod draw;
mod keys;
mod stage;
mod window;

use crate::{
    args::{Global, Heatmap, Tuning},
    commands::print,
    measure::Defaults,
    params::Params,
    progress::remark,
    session::{Session, interrupted, watch_for_interrupts},
    size::Size,
    table,
    variant::Variant,
};
use anyhow::{Context, bail};
use benchmark::{Benchmark, Limit};
use clap::Args;
use stage::{Builds, Stage};
use std::path::{Path, PathBuf};
use tracer::path;
use window::Looker;
use winit::{error::EventLoopError, event_loop::EventLoop};

/// What `--help` ends with.
pub fn help() -> String {
    format!(
        "{}\n\nExamples:\n  runner view city\n  runner view sponza --variant 'Wide8*' --view 2\n  \
         runner view cornell --benchmark 10 -o out/cornell.json\n\n\
         On Linux it needs X11 or, on a Wayland desktop, its XWayland. Without a display: `xvfb-run -a runner view …`, \
         or `runner render`.",
        keys::listed()
    )
}

/// What `view` shows.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The scene
    #[arg(value_name = "SCENE")]
    scene: String,
    /// View to begin with, by number or name
    #[arg(long, default_value = "0")]
    view: String,
    /// Variants that the key T goes through; `*` stands for anything, `all` for every variant
    #[arg(long, value_name = "NAME", default_value = "all")]
    variant: Vec<String>,
    /// Size of the picture at first; it follows the window. 1280x720 on a GPU and 320x180 on a CPU driver when left out
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Pixels of the window along each side of a pixel of the picture; 1 on a GPU and 3 on a CPU driver when left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=16))]
    zoom: Option<u32>,
    /// Most rays in a path, the primary ray included
    #[arg(long, value_name = "D", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=64))]
    depth: u32,
    /// Brightness: doubles with every whole step
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_negative_numbers = true)]
    exposure: f32,
    /// Begin with what the primary ray of each pixel cost
    #[arg(long, value_enum)]
    heatmap: Option<Heatmap>,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 0)]
    seed: u32,
    /// Keep what the chart shows as a record: for so many seconds, or frames (such as 200f), or until the window is
    /// closed. Size and depth stay as they are then; samples of a camera that was moved get a view called `moved`
    #[arg(long, value_name = "SECONDS|Nf", num_args = 0..=1, default_missing_value = "")]
    benchmark: Option<Limit>,
    /// Where the record goes
    #[arg(short, long, value_name = "FILE.json", requires = "benchmark")]
    output: Option<PathBuf>,
    /// Where the key S puts pictures
    #[arg(long, value_name = "DIR", default_value = "out")]
    pictures: PathBuf,
    #[command(flatten)]
    tuning: Tuning,
}

/// Opens the window, and stays until it is closed.
///
/// # Errors
/// There is no display, or anything that keeps the scene from being shown.
pub fn view(global: &Global, arguments: &Arguments) -> anyhow::Result<()> {
    let variants = Variant::select(&arguments.variant)?;
    // Mistakes are told before a window is opened.
    for &variant in &variants {
        Params::with(variant, &arguments.tuning.set)?;
    }
    let shade = Params::with(variants[0], &arguments.tuning.set)?.shade;
    let integrator = shade.integrator;
    let events = match keys_can_be_read().and_then(|()| EventLoop::new().map_err(|e| why_no_window(&e))) {
        Ok(events) => events,
        Err(why) => bail!(
            "no window can be opened: {why}. Log in to a desktop, let `ssh -X` bring its windows to yours, or try \
             `xvfb-run -a`; without a window there are `runner render {0} -o out/picture.png` for pictures and \
             `runner run {0}` for numbers",
            arguments.scene
        ),
    };
    watch_for_interrupts("frame")?;
    let session = Session::open_for_display(global, &events)?;
    let available = session.available(variants, &arguments.variant)?;
    let loaded = session.load(&arguments.scene)?;
    let first = loaded.views(Some(&arguments.view))?[0];

    let cpu = Defaults::of(&session).cpu;
    let size = arguments.size.unwrap_or(match cpu {
        true => Size { width: 320, height: 180 },
        false => Size { width: 1280, height: 720 },
    });
    let size = (size.width, size.height);
    let path = path::Params { depth: arguments.depth, seed: arguments.seed, shade };
    let builds = match arguments.benchmark {
        Some(_) => Builds { kept: Defaults::of(&session).builds, warm_up: true },
        None => Builds { kept: 1, warm_up: false },
    };
    let stage =
        Stage::new((&session, &loaded), available.there[0], &arguments.tuning.set, (size, &path), builds)?;
    remark(session.quiet, format_args!("{}", keys::listed()));
    let mut looker = Looker::new(
        window::Setting {
            quiet: session.quiet,
            spec: &arguments.scene,
            search: session.search(),
            // The first folder that is searched is where a user has asked for it.
            own_scenes: global.scene_dir.first().map_or(Path::new("scenes"), PathBuf::as_path),
            pictures: &arguments.pictures,
            zoom: arguments.zoom.unwrap_or(if cpu { 3 } else { 1 }),
            diagonal: diagonal(&loaded.scene),
        },
        stage,
        (loaded.scene.name.clone(), loaded.scene.views.clone(), first),
        available.there.clone(),
        (size, arguments.depth, arguments.exposure),
        (integrator, arguments.heatmap),
        arguments.benchmark.map(|limit| Benchmark::new(&session, limit, size, &path)),
    );
    if looker.is_blind() {
        bail!("the driver does not tell what rays meet in its tree: take another --variant for --heatmap");
    }
    events.run_app(&mut looker).context("the window failed")?;
    if let Some(record) = looker.finish()? {
        print(&table::summary(&record))?;
        if let Some(output) = &arguments.output {
            record.write_atomic(output).context("the record cannot be written")?;
            remark(session.quiet, format_args!("record: {}", output.display()));
        }
    }
    session.finish()?;
    if interrupted() {
        std::process::exit(130);
    }
    available.finish(&session.gpu)
}

/// Whether the libraries are there by which keys are read.
#[cfg(target_os = "linux")]
fn keys_can_be_read() -> Result<(), String> {
    match (xkbcommon_dl::xkbcommon_option(), xkbcommon_dl::x11::xkbcommon_x11_option()) {
        (Some(_), Some(_)) => Ok(()),
        _ => Err("libxkbcommon-x11 is missing (Debian and Ubuntu: apt install libxkbcommon-x11-0)".into()),
    }
}

#[cfg(not(target_os = "linux"))]
fn keys_can_be_read() -> Result<(), String> {
    Ok(())
}

/// What keeps windows from being opened, without the place in the library that has found out.
fn why_no_window(error: &EventLoopError) -> String {
    let set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    if cfg!(target_os = "linux") && !set("DISPLAY") {
        return "DISPLAY is not set".into();
    }
    let text = error.to_string();
    let reason = text.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": "));
    reason.map_or(text.as_str(), |(_, reason)| reason).trim_end_matches('.').into()
}

/// How large a scene is: from corner to corner of the box around it.
fn diagonal(scene: &tracer::scene::Scene) -> f32 {
    let (low, high) = scene.bounds();
    (glam::Vec3::from_array(high) - glam::Vec3::from_array(low)).length()
}
