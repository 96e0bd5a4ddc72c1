//! A record as it was in a commit.

use crate::change::change;
use crate::git::Git;
use crate::load::parse;
use anyhow::bail;
use record::Record;
use serde::Serialize;
use std::ffi::OsStr;
use std::path::Path;

/// Begins what the log says of a commit; in the raw list of changes there is no such character outside of names.
const MARK: u8 = 1;

/// A commit, in short.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Commit {
    /// Its hash.
    pub hash: String,
    /// When it was made, as ISO 8601 has it.
    pub date: String,
    /// The first line of its message.
    pub subject: String,
}

impl Commit {
    /// The beginning of its hash, which is enough for a reader.
    pub fn short(&self) -> &str {
        self.hash.get(..9).unwrap_or(&self.hash)
    }
}

/// What a commit made of the record.
#[derive(Debug)]
pub struct Version {
    /// The commit.
    pub commit: Commit,
    /// Where the record was.
    pub path: String,
    /// The record, or why it cannot be read.
    pub record: Result<Record, String>,
}

/// The versions of a record, the oldest first: one for each commit that changed its content, through renames.
///
/// # Errors
/// No commit has such a file.
pub fn versions(git: &Git, path: &Path) -> anyhow::Result<Vec<Version>> {
    let format = "--format=%x01%H%x01%cI%x01%s";
    let options = [
        "log",
        "--follow",
        "--no-show-signature",
        "--no-diff-merges",
        "--encoding=UTF-8",
        "--raw",
        "--no-abbrev",
        "-z",
        format,
        "--",
    ];
    // A name with * or : is a name.
    let arguments = ["--literal-pathspecs"].iter().chain(&options).map(OsStr::new).chain([path.as_os_str()]);
    let log = git.output(arguments)?;
    let mut blobs = git.blobs();
    let mut fields = log.split(|&byte| byte == 0);
    let (mut versions, mut commit): (Vec<Version>, Option<Commit>) = (Vec::new(), None);
    while let Some(field) = fields.next() {
        if let Some(found) = described(field) {
            commit = Some(found);
            continue;
        }
        let Some(change) = change(field, &mut fields) else { continue };
        // A new name alone is no measurement, and nor is being away.
        let Some(id) = change.new.filter(|new| change.old.as_ref() != Some(new)) else { continue };
        let Some(commit) = commit.take() else { continue };
        let record = match blobs.get(&id, |_| true)? {
            Some(text) => {
                parse(&text, &change.path).map_err(|error| format!("{:#}", anyhow::Error::new(error)))
            }
            None => Err("it is empty".into()),
        };
        versions.push(Version { commit, path: change.path.display().to_string(), record });
    }
    if versions.is_empty() {
        bail!("no commit has {}; `git log -- {0}` would show them", path.display());
    }
    versions.reverse();
    Ok(versions)
}

fn described(field: &[u8]) -> Option<Commit> {
    let at = field.iter().position(|&byte| byte != b'\n')?;
    let mut parts = field[at..].strip_prefix(&[MARK])?.splitn(3, |&byte| byte == MARK);
    let mut next = || parts.next().map(|part| String::from_utf8_lossy(part).into_owned());
    Some(Commit { hash: next()?, date: next()?, subject: next()? })
}
