//! Command line of compare: turns benchmark records into text, tables and pictures.

use clap::Parser;
use compare::{Cli, Exit, run, say};
use std::process::ExitCode;

fn main() -> ExitCode {
    run(&Cli::parse())
        .unwrap_or_else(|error| {
            say(format_args!("{error:#}"));
            Exit::Failed
        })
        .into()
}
