//! Command line of stabilize.

#[expect(dead_code, reason = "called as soon as there is something to lock for")]
mod gpu;
#[expect(dead_code, reason = "no command calls it yet")]
mod screen;

use clap::{CommandFactory, Parser};
use std::ffi::OsString;
use std::process::ExitCode;

/// Not built yet: will lock the GPU's clocks while a command runs.
///
/// THIS TOOL IS NOT BUILT YET. It changes nothing and runs nothing.
///
/// It will lock the clocks of the GPU and its memory, keep the screen awake, run CMD, put everything
/// back however CMD ends, and say whether the run can be trusted: whether the GPU was slowed down by
/// heat or power meanwhile.
#[derive(Parser)]
#[command(
    version,
    override_usage = "stabilize [OPTIONS] -- CMD…",
    after_help = "Exit code: 125, because CMD was not run."
)]
struct Arguments {
    /// The command to run, with its arguments.
    #[arg(value_name = "CMD", trailing_var_arg = true, allow_hyphen_values = true)]
    command: Vec<OsString>,
}

/// As in `env`, `nice` and `timeout`: the wrapper itself failed, and the command was not run.
const NOT_RUN: u8 = 125;

fn main() -> ExitCode {
    match Arguments::try_parse() {
        Err(other) if other.use_stderr() => {
            eprint!("{other}");
        }
        Err(help_or_version) => {
            // A reader that has gone away is no failure.
            let _ = help_or_version.print();
            return ExitCode::SUCCESS;
        }
        Ok(arguments) => {
            eprint!("{}", Arguments::command().render_long_help());
            if !arguments.command.is_empty() {
                eprintln!("\nDid not run {:?}.", arguments.command);
            }
        }
    }
    ExitCode::from(NOT_RUN)
}
