//! Command line of compare.

use clap::{CommandFactory, Parser};
use std::ffi::OsString;
use std::process::ExitCode;

/// Not built yet: will turn benchmark records into text, tables and charts.
///
/// THIS TOOL IS NOT BUILT YET. It reads nothing and writes nothing.
///
/// It will compare two benchmark records and word the difference as a commit message (`diff`), and
/// turn records into Markdown, CSV or LaTeX (`table`) and into charts (`plot`).
#[derive(Parser)]
#[command(
    version,
    override_usage = "compare diff | table | plot …",
    after_help = "Exit code: 1, because nothing was compared."
)]
struct Arguments {
    /// What will be the view and the records.
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    anything: Vec<OsString>,
}

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
        Ok(_) => {
            eprint!("{}", Arguments::command().render_long_help());
        }
    }
    ExitCode::FAILURE
}
