//! Reads benchmark records and says what is in them: differences, tables, pictures. There is no Vulkan in here.
//!
//! Data flows one way. [`load`] makes a [`record::Record`] of a file, or an error that says where it is wrong.
//! [`select`] orders its points by scene, variant and pass; [`figure`] has every value that a point can be asked
//! for, by name; [`stats`] says how sure a change is. Each view ([`diff`] is one) takes these and writes one kind of
//! output.

pub mod args;
pub mod change;
pub mod csv;
pub mod diff;
pub mod estimate;
pub mod figure;
pub mod git;
pub mod help;
pub mod history;
pub mod hook;
pub mod journal;
pub mod load;
pub mod output;
pub mod plot;
pub mod report;
pub mod roofline;
pub mod select;
pub mod stats;
pub mod tables;
pub mod unreliable;

pub use args::{Cli, Command};

use std::fmt;
use std::process::ExitCode;

/// How the program ends; `--help` lists the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// All is well.
    Done = 0,
    /// Something went wrong; stderr says what.
    Failed = 1,
    /// The command line was wrong.
    Usage = 2,
    /// Something became slower by more than was allowed.
    Regression = 3,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> ExitCode {
        ExitCode::from(exit as u8)
    }
}

/// Does what the command line asks for.
///
/// # Errors
/// A record cannot be read, or the output cannot be written.
pub fn run(cli: &Cli) -> anyhow::Result<Exit> {
    match &cli.command {
        Command::Diff(arguments) => diff::run(arguments),
        Command::Csv(arguments) => csv::run(arguments),
        Command::Latex(arguments) => tables::command::latex(arguments),
        Command::Markdown(arguments) => tables::command::markdown(arguments),
        Command::History(arguments) => history::run(arguments),
        Command::Hook(arguments) => hook::run(arguments),
        Command::Completions { shell } => help::completions(*shell),
        Command::Plot(arguments) => plot::run(arguments),
        Command::Report(arguments) => report::run(arguments),
        Command::Man { command } => help::man(command.as_deref()),
    }
}

/// Tells the user something on stderr; that nobody can hear it is no reason to end.
pub fn say(text: impl fmt::Display) {
    use std::io::Write;
    let _ = writeln!(std::io::stderr(), "compare: {text}");
}
