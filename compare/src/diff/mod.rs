//! `compare diff`: what changed from one record to another, and how sure that is.
//!
//! ```text
//!  two records ─► obstacles: may they be compared?
//!             └─► pair: points of the same scene, variant and pass ─► cell: their samples, view by view
//!                                                                        └─► judge: intervals, p, verdicts ─► Comparison
//!  Comparison ─► commit | terminal | markdown | JSON
//! ```

pub mod cell;
pub mod commit;
mod comparison;
mod judge;
pub mod markdown;
pub mod obstacle;
pub mod pair;
mod percent;
mod remark;
pub mod terminal;
mod verdict;

pub use comparison::{Change, Comparison, Line, Section, Side, label, shown};
use pair::Pairs;
pub use percent::Percent;
pub use verdict::{Thresholds, Verdict};

use crate::load::load;
use crate::select::{Filter, Selection};
use crate::{Exit, output, say};
use clap::{Args, ValueEnum};
use record::Record;
use std::path::{Path, PathBuf};

/// What `compare diff` takes.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub struct Arguments {
    /// The record from before
    pub old: PathBuf,
    /// The record from after
    pub new: PathBuf,
    /// How to say it
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Changes of rates below this are as good as none
    #[arg(long, value_name = "PERCENT", default_value_t = Percent(Thresholds::default().rates))]
    pub threshold: Percent,
    /// Changes of build times below this are as good as none, and by chance: runs differ more than their builds do
    #[arg(long, value_name = "PERCENT", default_value_t = Percent(Thresholds::default().builds))]
    pub build_threshold: Percent,
    /// Compare records of different devices, drivers, clocks, methods or sizes too, and mark the output
    #[arg(long)]
    pub anyway: bool,
    /// End with status 3 if something is significantly slower by more than this; build times below
    /// --build-threshold never are
    #[arg(long, value_name = "PERCENT")]
    pub fail_on_regression: Option<Percent>,
    /// Which points are compared.
    #[command(flatten)]
    pub filter: Filter,
}

const HELP: &str = "\
Verdicts:
  faster, slower  by the threshold at least, and chance is a poor explanation: p < 5% after Holm's
                  correction over the whole table, and the 95% interval leaves out no change
  same            the 95% interval lies within the threshold
  unclear         neither: more samples would tell, and the output says about how many
A change inside the noise is printed as ~. A ? follows one of which nobody can tell, because there
are too few samples.

Exit status: 0 done, 1 failed (or the records are not comparable), 2 usage, 3 a regression beyond
--fail-on-regression. Improvements never fail.

Examples:
  compare diff old.json new.json
  compare diff old.json new.json --format commit
  compare diff old.json new.json --variant 'Wide4*' --threshold 0.5% --fail-on-regression 2%";

/// How a comparison is said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Text for the message of a commit
    Commit,
    /// A table in colours
    #[default]
    Terminal,
    /// A table in Markdown
    Markdown,
    /// Everything, for scripts
    Json,
}

/// `compare diff`.
///
/// # Errors
/// A record cannot be read, the two are not comparable, or the output cannot be written.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let (old, new) = rayon::join(|| load(&arguments.old), || load(&arguments.new));
    let (old, new) = (old?, new?);
    let sides = (Named::new(&arguments.old, &old), Named::new(&arguments.new, &new));
    let thresholds = Thresholds { rates: arguments.threshold.0, builds: arguments.build_threshold.0 };
    let comparison = compare(sides.0, sides.1, &arguments.filter, thresholds)?;
    if !comparison.obstacles.is_empty() && !arguments.anyway {
        let obstacles = comparison.obstacles.join("\n  ");
        anyhow::bail!("not comparable:\n  {obstacles}\nWith --anyway they are compared all the same.");
    }
    match arguments.format {
        Format::Commit => output::print(&commit::text(&comparison))?,
        Format::Terminal => output::print_coloured(&terminal::text(&comparison))?,
        Format::Markdown => output::print(&markdown::text(&comparison))?,
        Format::Json => output::print(&serde_json::to_string_pretty(&comparison)?)?,
    }
    let Some(Percent(allowed)) = arguments.fail_on_regression else { return Ok(Exit::Done) };
    match comparison.undecided(allowed) {
        0 => {}
        count => say(format_args!(
            "too few samples to tell of {count} changes whether they are slower by more than {}",
            Percent(allowed)
        )),
    }
    let regressions = comparison.regressions(allowed);
    if regressions.is_empty() {
        return Ok(Exit::Done);
    }
    say(format_args!("slower by more than {}:\n  {}", Percent(allowed), regressions.join("\n  ")));
    Ok(Exit::Regression)
}

/// A record and what to call it.
#[derive(Clone, Copy, Debug)]
pub struct Named<'r> {
    /// Its file.
    pub path: &'r Path,
    /// The record.
    pub record: &'r Record,
}

impl<'r> Named<'r> {
    /// A record by the name of its file.
    pub fn new(path: &'r Path, record: &'r Record) -> Named<'r> {
        Named { path, record }
    }
}

/// The text for a commit's message, of two records that make sense, or why they may not be compared.
///
/// # Errors
/// They have no point in common.
pub fn commit_text(old: Named, new: Named) -> anyhow::Result<Result<String, Vec<String>>> {
    paired(old, new, &Filter::default(), Thresholds::default(), |comparison, pairs| {
        match comparison.obstacles.is_empty() {
            true => Ok(commit::text(&comparison.judged(pairs))),
            false => Err(comparison.obstacles),
        }
    })
}

/// Compares two records that make sense. Whether they may be compared stands in the result's `obstacles`.
///
/// # Errors
/// They have no point in common that the filter admits.
pub fn compare(
    old: Named,
    new: Named,
    filter: &Filter,
    thresholds: Thresholds,
) -> anyhow::Result<Comparison> {
    paired(old, new, filter, thresholds, Comparison::judged)
}

/// What `then` makes of a comparison that has no sections yet.
fn paired<T>(
    old: Named,
    new: Named,
    filter: &Filter,
    thresholds: Thresholds,
    then: impl FnOnce(Comparison, &Pairs) -> T,
) -> anyhow::Result<T> {
    let selections = (Selection::filtered(old.record, filter)?, Selection::filtered(new.record, filter)?);
    let pairs = pair::pairs(&selections.0, &selections.1);
    anyhow::ensure!(
        !pairs.pairs.is_empty(),
        "{} and {} have no point in common: no scene with the same variant and parameters",
        old.path.display(),
        new.path.display()
    );
    let comparison = Comparison {
        old: Side::of(old),
        new: Side::of(new),
        thresholds,
        obstacles: obstacle::obstacles(old.record, new.record, &pairs),
        remarks: remark::remarks(old.record, new.record, &pairs),
        tests: 0,
        sections: Vec::new(),
    };
    Ok(then(comparison, &pairs))
}
