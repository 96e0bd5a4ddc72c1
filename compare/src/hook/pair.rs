//! The record that a commit brings, and the one before.

use crate::change::{Change, changes};
use crate::diff::{Named, commit_text};
use crate::git::{Blobs, Git, path};
use crate::load::{is_object, is_record, parse};
use record::{Record, Timestamp};
use serde::Deserialize;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// So many records are tried before giving up: to read one can take a second.
const TRIED: usize = 8;

/// What a commit's message gets.
#[derive(Debug, Default)]
pub struct Said {
    /// The text.
    pub text: Option<String>,
    /// For whoever writes the message.
    pub remarks: Vec<String>,
}

/// What there is to say of what the commit brings.
///
/// # Errors
/// Git fails.
pub fn said(git: &Git) -> anyhow::Result<Said> {
    let mut said = Said::default();
    let head = git.line(["rev-parse", "--verify", "--quiet", "HEAD^{commit}"])?;
    // Before the first commit there is nothing to compare with.
    let Some(head) = head else { return Ok(said) };
    let raw = git.output(["diff-index", "--cached", "--raw", "--no-abbrev", "-z", "-M", &head, "--"])?;
    let mut blobs = git.blobs();
    let mut brought = Vec::new();
    for change in changes(&raw) {
        let Some(id) = change.new.clone().filter(|_| change.new != change.old) else { continue };
        let Some(text) = blobs.get(&id, is_object)?.filter(|text| is_record(text)) else { continue };
        match parse(&text, &change.path) {
            Ok(record) => brought.push((change, record)),
            Err(error) => said.remarks.push(format!("compare: {:#}", anyhow::Error::new(error))),
        }
    }
    let Some(newest) = (0..brought.len()).max_by_key(|&at| when(&brought[at].1)) else { return Ok(said) };
    let (change, record) = brought.swap_remove(newest);
    let new = Named::new(&change.path, &record);
    match &change.old {
        Some(id) => replaced(&mut blobs, &change, id, new, &mut said)?,
        None => added(git, &mut blobs, &head, new, &mut said)?,
    }
    if !brought.is_empty() && said.text.is_some() {
        let others: Vec<String> =
            brought.iter().map(|(change, _)| change.path.display().to_string()).collect();
        said.remarks.push(format!(
            "compare: {} is the newest; nothing is said of {}",
            change.path.display(),
            others.join(", ")
        ));
    }
    Ok(said)
}

/// A record that another version of the same file was before.
fn replaced(blobs: &mut Blobs, change: &Change, id: &str, new: Named, said: &mut Said) -> anyhow::Result<()> {
    let path = in_head(&change.old_path);
    let Some(text) = blobs.get(id, |_| true)? else { return Ok(()) };
    match parse(&text, &path) {
        Ok(old) => {
            against(Named::new(&path, &old), new, said);
        }
        Err(error) => said.remarks.push(format!(
            "compare: nothing to compare {} with: {:#}",
            new.path.display(),
            anyhow::Error::new(error)
        )),
    }
    Ok(())
}

/// A record that was not there before: the newest earlier one of the same device that can be compared with it, first
/// of those in its folder, then of the others.
fn added(git: &Git, blobs: &mut Blobs, head: &str, new: Named, said: &mut Said) -> anyhow::Result<()> {
    let mut earlier = Vec::new();
    for (path, id) in likely(git, head, new.path)? {
        let Some(text) = blobs.get(&id, is_object)? else { continue };
        let Some(brief) = Brief::of(&text) else { continue };
        if brief.device.name == new.record.device.name && brief.started < new.record.started {
            earlier.push((path.parent() == new.path.parent(), brief.started, path, id));
        }
    }
    earlier.sort();
    let mut obstacles = Vec::new();
    for (_, _, path, id) in earlier.into_iter().rev().take(TRIED) {
        let Some(text) = blobs.get(&id, |_| true)? else { continue };
        let path = in_head(&path);
        let Ok(old) = parse(&text, &path) else { continue };
        let mut one = Said::default();
        match against(Named::new(&path, &old), new, &mut one) {
            Outcome::Told => {
                said.text = one.text;
                said.remarks.append(&mut one.remarks);
                return Ok(());
            }
            // Others may have measured the same scenes.
            Outcome::Unrelated => {}
            Outcome::Obstacles => obstacles.append(&mut one.remarks),
        }
    }
    if obstacles.is_empty() {
        obstacles.push(format!(
            "compare: HEAD has no earlier record of {} with the same scenes and variants as {}",
            new.record.device.name,
            new.path.display()
        ));
    }
    // The first one was the likeliest.
    said.remarks.extend(obstacles.into_iter().next());
    Ok(())
}

/// As git calls the version that HEAD has.
fn in_head(path: &Path) -> PathBuf {
    let mut name = OsString::from("HEAD:");
    name.push(path);
    name.into()
}

/// What came of comparing two records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    Told,
    Obstacles,
    Unrelated,
}

fn against(old: Named, new: Named, said: &mut Said) -> Outcome {
    let names = format!("{} against {}", new.path.display(), old.path.display());
    match commit_text(old, new) {
        Ok(Ok(text)) => {
            said.text = Some(text);
            said.remarks.push(format!("compare: {names}"));
            Outcome::Told
        }
        Ok(Err(obstacles)) => {
            said.remarks.push(format!("compare: {names} cannot be compared:\n  {}", obstacles.join("\n  ")));
            Outcome::Obstacles
        }
        Err(error) => {
            said.remarks.push(format!("compare: {error:#}"));
            Outcome::Unrelated
        }
    }
}

/// Paths and blobs of HEAD that may be records: those that are named like the new one, or as records usually are. To
/// open every file would take too long in a large repository.
fn likely(git: &Git, head: &str, new: &Path) -> anyhow::Result<Vec<(PathBuf, String)>> {
    let list = git.output(["ls-tree", "-r", "-z", "--full-tree", head])?;
    let entries = list.split(|&byte| byte == 0).filter_map(|line| {
        let tab = line.iter().position(|&byte| byte == b'\t')?;
        let mut meta = std::str::from_utf8(&line[..tab]).ok()?.split(' ');
        let (mode, _, id) = (meta.next()?, meta.next()?, meta.next()?);
        mode.starts_with("100").then(|| (path(&line[tab + 1..]), id.to_owned()))
    });
    let named = |path: &Path| {
        let extension = path.extension();
        extension == new.extension() || extension.is_some_and(|e| e == "json" || e == "jsonl")
    };
    Ok(entries.filter(|(path, _)| named(path)).collect())
}

/// Of a record what the choice depends on; the rest takes time to read.
#[derive(Deserialize)]
struct Brief {
    started: Timestamp,
    device: Device,
}

#[derive(Deserialize)]
struct Device {
    name: String,
}

impl Brief {
    /// Of a record or a journal; nothing of what is neither.
    fn of(text: &[u8]) -> Option<Brief> {
        #[derive(Deserialize)]
        struct Header {
            record: Brief,
        }
        if crate::journal::is_journal(text) {
            let first = text.split(|&byte| byte == b'\n').next()?;
            return serde_json::from_slice::<Header>(first).ok().map(|header| header.record);
        }
        serde_json::from_slice(text).ok()
    }
}

/// When a record was measured.
fn when(record: &Record) -> Timestamp {
    record.started
}
