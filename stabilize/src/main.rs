//! Command line of stabilize: runs a command with the GPU's clocks held still, and puts everything back.

mod args;
mod clocks;
mod command;
mod gpu;
mod hands;
mod hold;
mod journal;
mod plan;
mod report;
mod run;
mod screen;
mod signals;
mod state;
mod tools;
mod user;
mod voice;
mod watchdog;

use args::{Cli, Tool};
use clap::{CommandFactory, Parser};
use signals::Interrupted;
use std::process::ExitCode;
use voice::say;

/// How the program ends; `--help` lists the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exit(u8);

impl Exit {
    const DONE: Exit = Exit(0);
    const NOT_TRUSTED: Exit = Exit(124);
    const FAILED: Exit = Exit(125);
    const CANNOT_RUN: Exit = Exit(126);
    const NOT_FOUND: Exit = Exit(127);

    /// As the command did.
    fn of(status: i32) -> Exit {
        Exit(u8::try_from(status & 0xff).expect("eight bits are left"))
    }
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // A reader that has gone away is no failure.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { Exit::FAILED.0 } else { 0 });
        }
    };
    let done = match safe() {
        Ok(()) => dispatch(&cli),
        Err(error) => Err(error),
    };
    let exit = done.unwrap_or_else(|error| {
        say(format_args!("{error:#}"));
        match error.downcast_ref() {
            Some(Interrupted(signal)) => Exit::of(128 + *signal as i32),
            None => Exit::FAILED,
        }
    });
    ExitCode::from(exit.0)
}

fn dispatch(cli: &Cli) -> anyhow::Result<Exit> {
    match &cli.tool {
        None => run::run(&cli.options),
        Some(Tool::Status) => tools::status(),
        Some(Tool::Restore { restore_to }) => tools::restore(*restore_to),
        Some(Tool::Doctor) => tools::doctor(),
        Some(Tool::Watchdog { journals }) => watchdog::watch(journals).map(|()| Exit::DONE),
        Some(Tool::Completions { shell }) => {
            clap_complete::generate(*shell, &mut Cli::command(), "stabilize", &mut std::io::stdout());
            Ok(Exit::DONE)
        }
        Some(Tool::Man) => {
            clap_mangen::Man::new(Cli::command()).render(&mut std::io::stdout())?;
            Ok(Exit::DONE)
        }
    }
}

/// A program with the set-user-ID bit trusts the environment of whoever starts it; this one must not be such.
fn safe() -> anyhow::Result<()> {
    let same = nix::unistd::getuid() == nix::unistd::geteuid();
    anyhow::ensure!(same, "this program must not have the set-user-ID bit; start it through sudo");
    Ok(())
}
