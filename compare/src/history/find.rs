//! Which record is meant where nobody names one.

use crate::change::changes;
use crate::git::Git;
use crate::load::{is_object, is_record};
use anyhow::bail;
use std::path::PathBuf;

/// Commits whose changes are looked at.
const COMMITS: &str = "--max-count=1000";

/// The record that was committed last and is there still; of several in one commit, the first by name.
///
/// # Errors
/// There is none among the last thousand commits.
pub fn newest(git: &Git) -> anyhow::Result<PathBuf> {
    let raw = git.output([
        "log",
        COMMITS,
        "--no-show-signature",
        "--no-renames",
        "--diff-filter=AM",
        "--raw",
        "--no-abbrev",
        "-z",
        "--format=",
    ])?;
    let mut blobs = git.blobs();
    for change in changes(&raw) {
        let Some(id) = change.new else { continue };
        if !git.top.join(&change.path).is_file() {
            continue;
        }
        if blobs.get(&id, is_object)?.is_some_and(|text| is_record(&text)) {
            return Ok(change.path);
        }
    }
    bail!("no record was committed here; name one: compare history PATH")
}
