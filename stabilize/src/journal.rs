//! What was in force before it was changed, kept so that it can be put back by whoever comes next.
//!
//! Each GPU has one file, which is its lock too. It is empty while nobody holds the GPU, and has a line of JSON
//! for the holder and then one for each change, written before the change is made:
//!
//! ```text
//! {"journal":1,"gpu":{"vendor":"nvidia","name":"…","uuid":"GPU-…",…},"index":0,"process":4711,…}
//! {"change":{"change":"persistence","on":true},"undo":{"change":"persistence","on":false}}
//! {"change":{"change":"lock","domain":"graphics","mhz":1980},"undo":{"change":"unlock","domain":"graphics"}}
//! {"undone":1}
//! ```
//!
//! The file lock belongs to the open file, which the watchdog inherits: it is free only when both have ended.

use crate::gpu::{Change, Identity};
use crate::state::Folder;
use anyhow::Context;
use record::Timestamp;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::io::{self, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::FileExt;

const FORMAT: u32 = 1;

/// Who holds a GPU.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Holder {
    journal: u32,
    /// The GPU.
    pub gpu: Identity,
    /// Its number.
    pub index: u32,
    /// The process.
    pub process: u32,
    /// When the process started, in clock ticks.
    pub process_started: u64,
    /// The user who started it.
    pub user: String,
    /// The command that it runs.
    pub command: Vec<String>,
    /// When it took the GPU.
    pub since: Timestamp,
}

/// A change and what takes it back.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Entry {
    /// The change.
    pub change: Change,
    /// What takes it back.
    pub undo: Change,
}

#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Line {
    Entry(Entry),
    Undone { undone: usize },
}

/// What a journal says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contents {
    /// Who wrote it.
    pub holder: Holder,
    /// All changes, in their order.
    pub entries: Vec<Entry>,
    undone: BTreeSet<usize>,
}

impl Contents {
    /// Changes that have not been taken back, with their numbers, the last one first.
    pub fn pending(&self) -> Vec<(usize, &Entry)> {
        self.entries.iter().enumerate().rev().filter(|(number, _)| !self.undone.contains(number)).collect()
    }

    /// What an open file says; nothing where it is empty, or ends before its first line does: then nothing had
    /// been changed.
    ///
    /// # Errors
    /// It cannot be read, or another version wrote it.
    pub fn of(file: &File) -> anyhow::Result<Option<Contents>> {
        let length = usize::try_from(file.metadata()?.len())?;
        let mut bytes = vec![0; length];
        file.read_exact_at(&mut bytes, 0)?;
        // What follows the last end of a line was being written when the power went; what it announces had not
        // been done.
        let mut lines = bytes.split(|&byte| byte == b'\n').collect::<Vec<_>>();
        lines.pop();
        let mut lines = lines.into_iter();
        let Some(first) = lines.next() else { return Ok(None) };
        let holder: Holder = serde_json::from_slice(first).context("the journal's first line is damaged")?;
        anyhow::ensure!(holder.journal == FORMAT, "the journal has format {}", holder.journal);
        let mut contents = Contents { holder, entries: Vec::new(), undone: BTreeSet::new() };
        for line in lines {
            match serde_json::from_slice(line).context("a line of the journal is damaged")? {
                Line::Entry(entry) => contents.entries.push(entry),
                Line::Undone { undone } => {
                    contents.undone.insert(undone);
                }
            }
        }
        Ok(Some(contents))
    }
}

impl Holder {
    /// This process, about to hold a GPU.
    pub fn this(gpu: &Identity, index: u32, user: &str, command: &[String]) -> Holder {
        let process = std::process::id();
        Holder {
            journal: FORMAT,
            gpu: gpu.clone(),
            index,
            process,
            process_started: record::process_started(process).unwrap_or_default(),
            user: user.into(),
            command: command.into(),
            since: Timestamp::now(),
        }
    }

    /// Whether it still runs.
    pub fn is_alive(&self) -> bool {
        record::process_started(self.process) == Some(self.process_started)
    }

    /// Whether this process runs under it.
    pub fn is_ancestor(&self) -> bool {
        let mut process = std::process::id();
        while let Some(parent) = parent(process) {
            if parent == self.process {
                return self.is_alive();
            }
            process = parent;
        }
        false
    }
}

fn parent(process: u32) -> Option<u32> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    stat.rsplit_once(')')?.1.split_whitespace().nth(1)?.parse().ok().filter(|&parent| parent > 0)
}

/// The journal of one GPU, locked by this process.
pub struct Journal {
    file: File,
}

impl Journal {
    /// Locks the journal of a GPU; where somebody else has, who that is, if it is known.
    ///
    /// # Errors
    /// It cannot be opened.
    pub fn lock(folder: &Folder, gpu: &Identity) -> anyhow::Result<Result<Journal, Option<Holder>>> {
        Journal::lock_file(folder.file(gpu)?)
    }

    /// The same for an open file.
    ///
    /// # Errors
    /// The file system has no locks.
    pub fn lock_file(file: File) -> anyhow::Result<Result<Journal, Option<Holder>>> {
        match file.try_lock() {
            Ok(()) => Ok(Ok(Journal { file })),
            Err(TryLockError::WouldBlock) => {
                Ok(Err(Contents::of(&file).ok().flatten().map(|contents| contents.holder)))
            }
            Err(TryLockError::Error(error)) => Err(error).context("cannot lock the journal"),
        }
    }

    /// A journal that another process has locked and handed over.
    pub fn inherited(file: File) -> Journal {
        Journal { file }
    }

    /// What it says.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn contents(&self) -> anyhow::Result<Option<Contents>> {
        Contents::of(&self.file)
    }

    /// Begins it anew.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn begin(&mut self, holder: &Holder) -> io::Result<()> {
        self.clear()?;
        self.write(holder)
    }

    /// Announces a change. Only when this has returned may it be made.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn announce(&mut self, entry: &Entry) -> io::Result<()> {
        self.write(entry)
    }

    /// Notes that a change has been taken back, or was never made.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn undone(&mut self, number: usize) -> io::Result<()> {
        self.write(&Line::Undone { undone: number })
    }

    /// Empties it: nothing is left to be put back.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn clear(&mut self) -> io::Result<()> {
        self.file.set_len(0)
    }

    fn write(&mut self, line: &impl Serialize) -> io::Result<()> {
        let mut bytes = serde_json::to_vec(line)?;
        bytes.push(b'\n');
        self.file.write_all(&bytes)?;
        self.file.sync_data()
    }
}

impl AsFd for Journal {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.file.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{Domain, Vendor};

    fn gpu() -> Identity {
        let (name, uuid) = ("GPU".into(), "GPU-1".into());
        Identity { vendor: Vendor::Nvidia, name, uuid, pci: None, driver: "1".into() }
    }

    fn entries() -> [Entry; 2] {
        let domain = Domain::Graphics;
        [
            Entry { change: Change::Persistence { on: true }, undo: Change::Persistence { on: false } },
            Entry { change: Change::Lock { domain, mhz: 1500 }, undo: Change::Unlock { domain } },
        ]
    }

    fn written(folder: &Folder) -> Journal {
        let mut journal = Journal::lock(folder, &gpu()).unwrap().ok().unwrap();
        journal.begin(&Holder::this(&gpu(), 0, "me", &["true".into()])).unwrap();
        entries().iter().for_each(|entry| journal.announce(entry).unwrap());
        journal
    }

    #[test]
    fn what_is_pending_comes_back_last_first() {
        let folder = tempfile::tempdir().unwrap();
        let folder = Folder::open(folder.path()).unwrap();
        let mut journal = written(&folder);
        let pending = |journal: &Journal| -> Vec<Entry> {
            let contents = journal.contents().unwrap().unwrap();
            contents.pending().into_iter().map(|(_, entry)| entry.clone()).collect()
        };
        let [first, second] = entries();
        assert_eq!(pending(&journal), [second, first.clone()]);
        journal.undone(1).unwrap();
        assert_eq!(pending(&journal), [first]);
        journal.clear().unwrap();
        assert_eq!(journal.contents().unwrap(), None);
    }

    #[test]
    fn it_has_one_holder_at_a_time() {
        let path = tempfile::tempdir().unwrap();
        let folder = Folder::open(path.path()).unwrap();
        let journal = written(&folder);
        let holder = Journal::lock(&folder, &gpu()).unwrap().err().unwrap().unwrap();
        assert!(holder.is_alive() && holder.process == std::process::id() && !holder.is_ancestor());
        drop(journal);
        assert!(Journal::lock(&folder, &gpu()).unwrap().is_ok());
    }

    /// The power may be cut after any byte.
    #[test]
    fn a_cut_anywhere_loses_no_announced_change() {
        let path = tempfile::tempdir().unwrap();
        let folder = Folder::open(path.path()).unwrap();
        let journal = written(&folder);
        let all = std::fs::read(path.path().join("GPU-1.journal")).unwrap();
        let ends: Vec<usize> = (0..all.len()).filter(|&i| all[i] == b'\n').map(|i| i + 1).collect();
        assert_eq!(ends.len(), 3);
        for length in 0..=all.len() {
            journal.file.set_len(0).unwrap();
            (&journal.file).write_all(&all[..length]).unwrap();
            let whole = ends.iter().filter(|&&end| end <= length).count();
            let found = journal.contents().unwrap();
            assert_eq!(found.as_ref().map(|contents| contents.entries.len() + 1).unwrap_or(0), whole);
        }
    }
}
