//! `compare history`: how the rates of a record went from commit to commit.
//!
//! ```text
//!  git log --follow ─► version: the record in each commit
//!                  └─► course: each variant's rates, the change from one version to the next, change points
//!                          └─► terminal | JSON | plot
//! ```

mod course;
mod find;
mod plot;
mod terminal;
mod version;

pub use course::{Course, History, Step};
pub use version::{Commit, Version};

use crate::git::Git;
use crate::plot::Format;
use crate::select::Filter;
use crate::{Exit, output};
use anyhow::Context;
use clap::Args;
use std::path::PathBuf;

/// What `compare history` takes.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub struct Arguments {
    /// A record, or the journal of a sweep, under git; without it, the one that was committed last
    pub path: Option<PathBuf>,
    /// Print it for scripts
    #[arg(long)]
    pub json: bool,
    /// Draw it as well: SVG and PNG files in this folder, one of each for a variant
    #[arg(long, value_name = "FOLDER")]
    pub plot: Option<PathBuf>,
    /// Which points are followed.
    #[command(flatten)]
    pub filter: Filter,
}

const HELP: &str = "\
A rate is the geometric mean over the scenes that all versions have. Each version is compared
with the one before as `compare diff` does it. A change point is a version that is faster or
slower than the one before, or than the first one since the last change point, so that small
steps add up: it is marked with *. Versions that are not comparable, such as of another driver,
begin anew. Merges are left out; what they bring is in the commits that they join.

Examples:
  compare history out/record.json
  compare history --variant 'Wide4*' --json
  compare history --plot out/history";

/// `compare history`.
///
/// # Errors
/// There is no repository or no such record in it, or the output cannot be written.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let here = std::env::current_dir().context("cannot tell which folder this is")?;
    let git = Git::here()?;
    let path = match &arguments.path {
        Some(path) => here.join(path),
        None => find::newest(&git)?,
    };
    let versions = version::versions(&git, &path)?;
    let history = History::of(&versions, &arguments.filter)?;
    if arguments.json {
        output::print(&serde_json::to_string_pretty(&history)?)?;
    } else {
        output::print_coloured(&terminal::text(&history))?;
    }
    if let Some(folder) = &arguments.plot {
        crate::plot::write(&plot::charts(&history), folder, Format::Both)?;
    }
    Ok(Exit::Done)
}
