//! `compare hook`: git's hook that adds what changed to the message of each commit that brings a record.
//!
//! ```text
//!  git commit ─► script ─► the former hook, if there was one
//!                      └─► compare hook run: occasion: is this a commit that shall have a text?
//!                                            pair: the newest record it brings, and the one before
//!                                            diff::commit_text ─► message: before comments and scissors
//! ```

mod install;
mod message;
mod occasion;
mod pair;
mod run;
mod script;

use crate::Exit;
use crate::git::Git;
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// What `compare hook` takes.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub action: Action,
}

const HELP: &str = "\
The hook looks for records and journals of sweeps among what a commit adds or changes, by their
content. It takes the newest and compares it with the one that it replaces: the version in HEAD of
the same path, or of an added one the newest earlier record of the same device, first of the same
folder, then of any other. It leaves merges, amends, squashes, fixups, rebases, cherry-picks and
reverts alone, and never makes a commit fail.

A former prepare-commit-msg hook runs first, and `uninstall` puts it back.";

/// What there is to do with the hook.
#[derive(Debug, Subcommand)]
pub enum Action {
    /// Put the hook into the repository that the current folder is in
    Install {
        /// Do so even if core.hooksPath makes this one folder serve several repositories
        #[arg(long)]
        shared: bool,
    },
    /// Take the hook away, and put back what was there before
    Uninstall,
    /// What the hook runs
    #[command(hide = true)]
    Run {
        /// The file with the message
        message: PathBuf,
        /// Where the message comes from
        source: Option<String>,
        /// The commit that it comes from
        commit: Option<String>,
    },
}

/// `compare hook`.
///
/// # Errors
/// There is no repository here, or its hooks cannot be changed. What the hook itself runs has none.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    match &arguments.action {
        Action::Install { shared } => install::install(&Git::here()?, *shared)?,
        Action::Uninstall => install::uninstall(&Git::here()?)?,
        Action::Run { message, source, .. } => run::run(message, source.as_deref()),
    }
    Ok(Exit::Done)
}
