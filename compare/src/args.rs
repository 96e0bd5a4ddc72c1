//! The command line. What a command takes is defined in the command's own module.

use crate::{diff, history, hook};
use clap::{Parser, Subcommand};

/// Turns benchmark records into text, tables and pictures.
///
/// RECORD is a file that `runner` wrote. What was asked for goes to stdout, remarks go to stderr.
///
/// Exit status: 0 done, 1 failed, 2 usage, 3 a regression beyond what `diff --fail-on-regression` allows.
#[derive(Debug, Parser)]
#[command(
    version,
    subcommand_required = true,
    arg_required_else_help = true,
    args_override_self = true,
    after_help = EXAMPLES
)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

const EXAMPLES: &str = "\
Examples:
  compare diff old.json new.json
  compare diff old.json new.json --format commit
  compare csv record.json --relative-to Binary > record.csv
  compare latex record.json --table scene --scene 'bistro*' --standalone > tables.tex
  compare markdown sweep.json --table workgroup
  compare plot record.json -o out/plots --only overall --only scenes
  compare report record.json -o out/report.html
  compare hook install
  compare completions bash > ~/.local/share/bash-completion/completions/compare
  compare man | man -l -";

/// What there is to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Say what changed from one record to another, and how sure that is.
    Diff(diff::Arguments),
    /// Write values as CSV, for spreadsheets, pandas and R.
    Csv(crate::csv::Arguments),
    /// Write tables as LaTeX.
    Latex(crate::tables::command::LatexArguments),
    /// Write tables as Markdown.
    Markdown(crate::tables::command::Arguments),
    /// Draw what is in records: variants against each other, sweeps, builds, samples.
    Plot(crate::plot::Arguments),
    /// Write a page of HTML with all that is in records, which needs no other file and no network.
    Report(crate::report::Arguments),
    /// Say how the rates of a record went from commit to commit.
    History(history::Arguments),
    /// Have git add what changed to the message of each commit that brings a record.
    Hook(hook::Arguments),
    /// Print a script that completes this command line in a shell.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Print the manual page of this program, or of one of its commands.
    Man {
        /// The command.
        command: Option<String>,
    },
}
