//! Command line of runner: builds BVHs, traces rays, measures both, and writes a benchmark record.

mod args;
mod best;
mod bvh;
mod commands;
mod config;
mod construct;
mod describe;
mod host;
mod measure;
mod params;
mod picture;
mod progress;
mod rayfile;
mod resources;
mod roofline;
mod run;
mod session;
mod shard;
mod size;
mod sweep;
mod table;
mod telemetry;
mod tune;
mod tuned;
mod validate;
mod variant;
mod view;

use args::{BvhCommand, Cli, Command, ConfigCommand, SceneCommand};
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = Cli::read();
    let result = match &cli.command {
        Command::Devices { json } => commands::devices(*json),
        Command::Scenes { json } => commands::scenes(&cli.global, *json),
        Command::Run(run) => run::run(&cli.global, run),
        Command::Scene(SceneCommand::Construct(arguments)) => construct::construct(&cli.global, arguments),
        Command::Bvh(BvhCommand::Precompute(arguments)) => bvh::precompute(&cli.global, arguments),
        Command::Sweep(arguments) => sweep::sweep(&cli.global, arguments),
        Command::Merge(arguments) => sweep::merge(&cli.global, arguments),
        Command::Best(arguments) => best::best(&cli.global, arguments),
        Command::Tune(arguments) => tune::tune(&cli.global, arguments),
        Command::Render(render) => commands::render(&cli.global, render),
        Command::View(arguments) => view::view(&cli.global, arguments),
        Command::Rays(rays) => commands::rays(&cli.global, rays),
        Command::Trace(trace) => commands::trace(&cli.global, trace),
        Command::Variants { json, tuning } => commands::variants(&cli.global, tuning, *json),
        Command::Validate(validate) => validate::validate(&cli.global, validate),
        Command::Resources { variant, tuning, json } => {
            resources::resources(&cli.global, variant, tuning, *json)
        }
        Command::Roofline(arguments) => roofline::roofline(&cli.global, arguments),
        Command::Schema => commands::schema(),
        Command::Config(ConfigCommand::Schema) => commands::config_schema(),
        Command::Completions { shell } => commands::completions(*shell),
        Command::Man { command } => commands::man(command.as_deref()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("runner: {error:#}");
            let unavailable = |cause: &(dyn std::error::Error + 'static)| {
                matches!(cause.downcast_ref(), Some(tracer::Error::NoRayTracing { .. }))
            };
            if error.chain().any(unavailable) { ExitCode::from(args::UNAVAILABLE) } else { ExitCode::FAILURE }
        }
    }
}
