//! `compare latex` and `compare markdown`.

use super::{Input, Kind, latex, markdown};
use crate::{Exit, load::load, output::print, roofline, say, select::Filter};
use record::{Launches, Rays, Record};
use std::path::PathBuf;

/// What both commands take.
#[derive(Clone, Debug, clap::Args)]
pub struct Arguments {
    /// Records that `runner` wrote; several where a table needs several
    #[arg(value_name = "RECORD", required = true)]
    pub records: Vec<PathBuf>,
    /// Which table
    #[arg(long, value_enum)]
    pub table: Kind,
    /// Which points.
    #[command(flatten)]
    pub filter: Filter,
    /// The variant that values are relative to [default: Binary, or what is in the first row of bounces and memory]
    #[arg(long, value_name = "VARIANT")]
    pub relative_to: Option<String>,
    /// Which rays decide what is best, where the axis does not say
    #[arg(long, value_enum, default_value_t = RaysArgument::All)]
    pub rays: RaysArgument,
    /// In roofline, what the device can do at best, as `runner roofline -o FILE` has measured it
    #[arg(long, value_name = "FILE")]
    pub roofline: Option<PathBuf>,
    /// In bounces, rates of the fastest launch of each view instead of the median one
    #[arg(long)]
    pub best: bool,
}

/// What `compare latex` takes.
#[derive(Clone, Debug, clap::Args)]
pub struct LatexArguments {
    /// What to make.
    #[command(flatten)]
    pub common: Arguments,
    /// A whole document that pdflatex compiles, instead of a part for one
    #[arg(long)]
    pub standalone: bool,
}

/// Rays, as the command line names them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum RaysArgument {
    /// Those from the camera
    Primary,
    /// Those of all bounces
    Secondary,
    /// Those of whole paths
    All,
}

impl From<RaysArgument> for Rays {
    fn from(rays: RaysArgument) -> Rays {
        match rays {
            RaysArgument::Primary => Rays::Primary,
            RaysArgument::Secondary => Rays::Secondary,
            RaysArgument::All => Rays::All,
        }
    }
}

/// `compare latex`.
///
/// # Errors
/// A record cannot be read, or does not have what the table takes.
pub fn latex(arguments: &LatexArguments) -> anyhow::Result<Exit> {
    written(&arguments.common, |tables| match arguments.standalone {
        true => latex::document(tables),
        false => latex::fragment(tables),
    })
}

/// `compare markdown`.
///
/// # Errors
/// A record cannot be read, or does not have what the table takes.
pub fn markdown(arguments: &Arguments) -> anyhow::Result<Exit> {
    written(arguments, markdown::page)
}

fn written(arguments: &Arguments, write: impl Fn(&[super::Table]) -> String) -> anyhow::Result<Exit> {
    let records: Vec<Record> = arguments.records.iter().map(load).collect::<Result<_, _>>()?;
    let mut input = Input::new(&records, &arguments.filter, arguments.relative_to.as_deref())?;
    input.rays = arguments.rays.into();
    input.launches = if arguments.best { Launches::Best } else { Launches::Median };
    input.roofline = arguments.roofline.as_ref().map(|path| roofline::load(path, &records)).transpose()?;
    let tables = arguments.table.tables(&input)?;
    for remark in input.remarks.borrow().iter() {
        say(remark);
    }
    print(&write(&tables))?;
    Ok(Exit::Done)
}
