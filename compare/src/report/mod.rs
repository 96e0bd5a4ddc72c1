//! `compare report`: records as one page of HTML that needs no other file and no network.
//!
//! ```text
//!   Record ─► Chapter ─► a file a part of the page: Markup ─► page: HTML
//! ```
//!
//! Every text of a record goes through [`maud`], which escapes it. Nothing is loaded: style, script, plots and
//! pictures are inside. The script only sorts and filters; without it everything is there all the same.

pub mod chapter;
pub mod number;
pub mod origin;
pub mod page;
pub mod picture;
pub mod plots;
pub mod points;
pub mod provenance;
pub mod samples;
pub mod scene;
pub mod slim;
pub mod standing;
pub mod summary;
pub mod trust;

use crate::load::load;
use crate::select::{Filter, REFERENCE, Selection};
use crate::{Exit, say};
use anyhow::Context;
use chapter::Chapter;
use record::Record;
use std::path::{Path, PathBuf};

/// What `compare report` takes.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Records; each becomes a section of the page.
    #[arg(required = true, value_name = "RECORD")]
    pub records: Vec<PathBuf>,
    /// The page; a file of the same name is replaced.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// The variant that others are relative to.
    #[arg(long, value_name = "VARIANT", default_value = REFERENCE)]
    pub reference: String,
    /// Which points.
    #[command(flatten)]
    pub filter: Filter,
}

/// A record, and where it lay.
#[derive(Clone, Debug)]
pub struct Source<'r> {
    /// What the page calls it: the name of its file.
    pub name: String,
    /// The folder of its file, where its pictures are looked for; none where it is in no file.
    pub folder: Option<PathBuf>,
    /// The record.
    pub record: &'r Record,
}

impl<'r> Source<'r> {
    /// A record that was read from a file.
    pub fn at(path: &Path, record: &'r Record) -> Source<'r> {
        let folder = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        Source { name: path.display().to_string(), folder: Some(folder), record }
    }
}

/// The page of some records, with what the filter admits of each.
///
/// # Errors
/// The filter admits nothing of one of them.
pub fn html(sources: &[Source], reference: &str, filter: &Filter) -> anyhow::Result<String> {
    let chapters: Vec<Chapter> = sources
        .iter()
        .enumerate()
        .map(|(index, source)| {
            let selection = Selection::filtered(source.record, filter)
                .with_context(|| format!("nothing to report of {}", source.name))?;
            Ok(Chapter::new(index + 1, source, selection, reference))
        })
        .collect::<anyhow::Result<_>>()?;
    Ok(page::page(&chapters))
}

/// `compare report`.
///
/// # Errors
/// A record cannot be read, the filter admits nothing of one, or the page cannot be written.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let records: Vec<Record> = arguments.records.iter().map(load).collect::<Result<_, _>>()?;
    let sources: Vec<Source> =
        arguments.records.iter().zip(&records).map(|(path, record)| Source::at(path, record)).collect();
    let html = html(&sources, &arguments.reference, &arguments.filter)?;
    let path = &arguments.output;
    record::replace(path, |out| out.write_all(html.as_bytes()))
        .with_context(|| format!("cannot write {}", path.display()))?;
    say(format_args!("wrote {}, {}", path.display(), number::bytes(html.len() as u64)));
    Ok(Exit::Done)
}
