//! The journal of a sweep: a file that grows by a line for each finished point, and loses none.
//!
//! ```text
//! {"journal":1,"record":{…no results…},"points":["sponza | Wide4 | collapse.c_t=1", …]}⏎
//! {"key":"sponza | Wide4 | collapse.c_t=3","point":{…}}⏎
//! {"key":null,"point":{…the reference point…}}⏎
//! {"key":"sponza | Wide4 | coll                                        torn: power was cut here
//! ```
//!
//! The first line says what is measured and on what; going on with something else is refused. Every line is
//! flushed to the disk before the next point begins. A line counts once its end is there, so a torn one can only
//! be the last; it is cut off when the journal is opened, and said so.

use crate::{config::Experiment, shard::Shard};
use anyhow::{Context, bail};
use record::{Parameters, Point, Record};
use serde::{Deserialize, Serialize};
use std::{
    fs::{self, File, OpenOptions, TryLockError},
    io::{Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

/// Its name in the folder of a sweep.
pub const NAME: &str = "journal.jsonl";

/// The number of the format that this version writes and reads.
const FORMAT: u32 = 1;

/// The first line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    journal: u32,
    /// The record of the sweep, without results.
    pub record: Record,
    /// The keys of all points of the experiment, those of other shards included, in the order of the config.
    pub points: Vec<String>,
}

/// Every further line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Which point of the experiment it is; nothing for a measurement of the reference point.
    pub key: Option<String>,
    /// What was measured.
    pub point: Point,
}

/// What a journal holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Contents {
    /// Of what.
    pub header: Header,
    /// In the order measured.
    pub entries: Vec<Entry>,
    /// Bytes of a torn last line.
    pub torn: u64,
}

/// A journal that is open for more, and closed to everybody else.
pub struct Journal {
    file: File,
    path: PathBuf,
    /// Bytes of whole lines.
    length: u64,
    /// What it holds.
    pub contents: Contents,
}

impl Header {
    /// Of a sweep over `points`.
    pub fn new(record: Record, points: Vec<String>) -> Self {
        Self { journal: FORMAT, record, points }
    }
}

impl Contents {
    /// Reads the journal in a folder.
    ///
    /// # Errors
    /// There is none, or it is damaged elsewhere than at its end.
    pub fn read(folder: &Path) -> anyhow::Result<Self> {
        let path = folder.join(NAME);
        let bytes = fs::read(&path)
            .with_context(|| format!("{} holds no sweep: cannot read {NAME}", folder.display()))?;
        match Self::parse(&bytes).with_context(|| path.display().to_string())?.0 {
            Some(contents) => Ok(contents),
            None => bail!("{} was cut off before its first line was whole", path.display()),
        }
    }

    /// What whole lines say, and how many bytes they have. Nothing where not even the first is whole.
    fn parse(bytes: &[u8]) -> anyhow::Result<(Option<Self>, u64)> {
        // What a power cut leaves of a last line can end in anything, but not in a line that can be read.
        let mut whole = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
        let mut lines: Vec<&[u8]> = bytes[..whole].split_inclusive(|&byte| byte == b'\n').collect();
        if let Some(last) = lines.last()
            && serde_json::from_slice::<serde::de::IgnoredAny>(last).is_err()
        {
            whole -= last.len();
            lines.pop();
        }
        let Some((first, rest)) = lines.split_first() else { return Ok((None, 0)) };
        let of_first = "line 1 is no beginning of a journal";
        #[derive(Deserialize)]
        struct Probe {
            journal: u32,
        }
        let Probe { journal } = serde_json::from_slice(first).context(of_first)?;
        if journal != FORMAT {
            bail!("it has format {journal}, and this version reads format {FORMAT}");
        }
        let header: Header = serde_json::from_slice(first).context(of_first)?;
        let mut entries = Vec::with_capacity(rest.len());
        for (index, line) in rest.iter().enumerate() {
            let entry: Entry = serde_json::from_slice(line).with_context(|| {
                format!("line {} is damaged; without it, measured points can be read", index + 2)
            })?;
            entries.push(entry);
        }
        Ok((Some(Self { header, entries, torn: (bytes.len() - whole) as u64 }), whole as u64))
    }

    /// Whether a point has been measured.
    pub fn has(&self, key: &str) -> bool {
        self.entries.iter().any(|entry| entry.key.as_deref() == Some(key))
    }

    /// The record that it amounts to: results in the order of the config.
    pub fn record(&self) -> Record {
        let mut record = self.header.record.clone();
        for entry in self.entries.iter().filter(|entry| entry.key.is_none()) {
            record.references.push(entry.point.clone());
        }
        for key in &self.header.points {
            let found = self.entries.iter().find(|entry| entry.key.as_ref() == Some(key));
            record.results.extend(found.map(|entry| entry.point.clone()));
        }
        if self.is_complete() {
            let ends =
                self.entries.iter().filter_map(|entry| Some(entry.point.measurement.as_ref()?.finished));
            record.finished = ends.max();
        }
        record
    }

    /// Whether all points of its share have been measured.
    fn is_complete(&self) -> bool {
        let shard = self.header.record.sweep.as_ref().and_then(|sweep| sweep.shard.as_deref());
        let shard: Option<Shard> = shard.and_then(|shard| shard.parse().ok());
        let mut own = self.header.points.iter().filter(|key| shard.is_none_or(|shard| shard.has(key)));
        own.all(|key| self.has(key))
    }
}

impl Journal {
    /// Opens the journal in a folder, or begins it there; `true` where it was there.
    ///
    /// # Errors
    /// It cannot be read or written, is damaged, or somebody else has it open.
    pub fn open(folder: &Path, header: Header) -> anyhow::Result<(Self, bool)> {
        let path = folder.join(NAME);
        let context = || format!("cannot keep a journal in {}", folder.display());
        fs::create_dir_all(folder).with_context(context)?;
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .with_context(context)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                bail!("{} is being written by another sweep; wait for it, or take another -o", path.display())
            }
            // Some network file systems have no locks; the scheduler keeps tasks apart there.
            Err(TryLockError::Error(_)) | Ok(()) => {}
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).with_context(context)?;
        let (found, whole) = Contents::parse(&bytes).with_context(|| path.display().to_string())?;
        let was_there = found.is_some();
        let torn = bytes.len() as u64 - whole;
        let contents = found.unwrap_or(Contents { header, entries: Vec::new(), torn });
        let mut journal = Self { file, path, length: whole, contents };
        journal.cut().with_context(context)?;
        if !was_there {
            journal.write(&serde_json::to_vec(&journal.contents.header)?)?;
            // The file's name reaches the disk with the folder. Where a folder cannot be opened, as on Windows,
            // there is nothing to be done.
            if let Ok(folder) = File::open(folder) {
                let _ = folder.sync_all();
            }
        }
        Ok((journal, was_there))
    }

    /// Adds a point, and returns once it is on the disk.
    ///
    /// # Errors
    /// It cannot be written; what was there before still is.
    pub fn append(&mut self, entry: Entry) -> anyhow::Result<()> {
        self.write(&serde_json::to_vec(&entry)?)?;
        self.contents.entries.push(entry);
        Ok(())
    }

    fn write(&mut self, json: &[u8]) -> anyhow::Result<()> {
        let line = [json, b"\n"].concat();
        let written = self.file.write_all(&line).and_then(|()| self.file.sync_data());
        if let Err(error) = written {
            // A full disk may have taken a part.
            let _ = self.cut();
            return Err(error).with_context(|| format!("cannot write to {}", self.path.display()));
        }
        self.length += line.len() as u64;
        Ok(())
    }

    /// Drops what follows the last whole line.
    fn cut(&mut self) -> std::io::Result<()> {
        self.file.set_len(self.length)?;
        self.file.seek(SeekFrom::End(0)).map(|_| ())
    }
}

/// In what two sweeps differ that must not if one is to go on with the other, in words; nothing where they agree.
pub fn differences(old: &Record, new: &Record) -> Vec<String> {
    let mut found = Vec::new();
    let mut compare = |what: &str, old: String, new: String| {
        if old != new {
            found.push(format!("{what} was {old}, now {new}"));
        }
    };
    let device = |r: &Record| format!("{} ({})", r.device.name, r.device.uuid);
    compare("the device", device(old), device(new));
    let driver = |r: &Record| {
        format!("{} {} ({})", r.device.driver.name, r.device.driver.info, r.device.driver.version)
    };
    compare("the driver", driver(old), driver(new));
    let shard = |r: &Record| {
        r.sweep.as_ref().and_then(|sweep| sweep.shard.clone()).unwrap_or_else(|| "all of it".into())
    };
    compare("the share of the sweep", shard(old), shard(new));
    found.extend(settings(old, new));
    let changed = changed_shaders(old, new);
    if !changed.is_empty() {
        found.push(format!("shaders have changed: {}", listed(&changed)));
    }
    found
}

/// In what the settings of two sweeps differ: the experiment, with what the command line made of it, the size and
/// number of samples where they follow from the device, and the clock that samples are held against.
pub fn settings(old: &Record, new: &Record) -> Vec<String> {
    let experiment = |r: &Record| {
        let config = r.sweep.as_ref().map(|sweep| sweep.config.clone()).unwrap_or_default();
        serde_json::from_value::<Experiment>(config)
    };
    let mut found = match (experiment(old), experiment(new)) {
        (Ok(old), Ok(new)) => new.changes_since(&old).unwrap_or_default().lines().map(String::from).collect(),
        _ => vec!["the config was written by another version".to_owned()],
    };
    let flat = |run: &record::Run| {
        let mut all = Parameters::default();
        all.add("run", run).map(|()| all.0).unwrap_or_default()
    };
    // What the clocks deliver may differ a little each time they are locked.
    let unheld = |run: &record::Run| record::Run { policy: None, ..run.clone() };
    let (was, is) = (flat(&unheld(&old.run)), flat(&unheld(&new.run)));
    let policy = |r: &Record| r.run.policy.as_ref().map_or("free".to_owned(), ToString::to_string);
    if policy(old) != policy(new) {
        found.push(format!("stabilize held clocks differently: {}, now {}", policy(old), policy(new)));
    }
    let mut names: Vec<&String> = was.keys().chain(is.keys()).collect();
    names.sort();
    names.dedup();
    // Where the config has changed, this follows from it.
    if found.is_empty() {
        let shown =
            |value: Option<&record::Value>| value.map_or_else(|| "absent".into(), ToString::to_string);
        let differ = names.into_iter().filter(|name| was.get(*name) != is.get(*name));
        found.extend(
            differ.map(|name| format!("{name} was {}, now {}", shown(was.get(name)), shown(is.get(name)))),
        );
    }
    found
}

/// Names of the shaders in which two records differ.
pub fn changed_shaders(old: &Record, new: &Record) -> Vec<String> {
    let mut names: Vec<String> = old.shaders.keys().chain(new.shaders.keys()).cloned().collect();
    names.sort();
    names.dedup();
    names.retain(|name| old.shaders.get(name) != new.shaders.get(name));
    names
}

/// The first few, and how many there are.
pub fn listed(names: &[String]) -> String {
    const SHOWN: usize = 5;
    let shown = names[..names.len().min(SHOWN)].join(", ");
    if names.len() > SHOWN { format!("{shown} and {} more", names.len() - SHOWN) } else { shown }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Header {
        let mut record = record::example();
        record.results.clear();
        record.references.clear();
        record.finished = None;
        Header::new(record, vec!["b".into(), "a".into(), "c".into()])
    }

    fn entry(key: Option<&str>) -> Entry {
        Entry { key: key.map(String::from), point: record::example().results[0].clone() }
    }

    #[test]
    fn what_was_appended_is_there_again_in_the_order_of_the_config() {
        let folder = tempfile::tempdir().unwrap();
        let (mut journal, was_there) = Journal::open(folder.path(), header()).unwrap();
        assert!(!was_there);
        let mut second = entry(Some("b"));
        second.point.variant = "Wide4".into();
        for entry in [entry(Some("a")), entry(None), second] {
            journal.append(entry).unwrap();
        }
        let contents = Contents::read(folder.path()).unwrap();
        assert_eq!(contents, journal.contents);
        drop(journal);
        let (journal, was_there) = Journal::open(folder.path(), header()).unwrap();
        assert!(was_there && journal.contents == contents);
        assert!(contents.has("a") && contents.has("b") && !contents.has("c"));
        let record = contents.record();
        assert_eq!(record.validate(), Ok(()));
        let variants: Vec<_> = record.results.iter().map(|point| point.variant.as_str()).collect();
        assert_eq!(variants, ["Wide4", "Binary"]);
        assert_eq!((record.references.len(), record.finished), (1, None));
        let mut journal = journal;
        journal.append(entry(Some("c"))).unwrap();
        assert!(journal.contents.record().finished.is_some());
    }

    /// The power may be cut after any byte. What follows the last whole line may then be part of a line, or
    /// nothing but zeros where the file was made longer before it was filled.
    #[test]
    fn a_cut_after_any_byte_loses_no_whole_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(NAME);
        let (mut journal, _) = Journal::open(folder.path(), header()).unwrap();
        journal.append(entry(Some("a"))).unwrap();
        journal.append(entry(Some("b"))).unwrap();
        drop(journal);
        let all = fs::read(&path).unwrap();
        let ends: Vec<usize> = (0..all.len()).filter(|&i| all[i] == b'\n').map(|i| i + 1).collect();
        assert_eq!(ends.len(), 3);
        let around = |end: usize| end.saturating_sub(3)..(end + 4);
        let steps = (0..all.len()).step_by(97).chain(ends.iter().flat_map(|&end| around(end)));
        for length in steps.filter(|&length| length <= all.len()) {
            for tail in [&b""[..], &[0; 300], b"\0\n"] {
                // Cut and filled up to less than a line: a whole line is never followed by less than itself.
                fs::write(&path, [&all[..length], tail].concat()).unwrap();
                let whole = ends.iter().filter(|&&end| end <= length).count();
                let (mut journal, was_there) = Journal::open(folder.path(), header()).unwrap();
                assert_eq!(was_there, whole > 0, "{length}");
                assert_eq!(journal.contents.entries.len(), whole.saturating_sub(1), "{length}");
                let kept = if whole > 0 { ends[whole - 1] } else { 0 };
                assert_eq!(journal.contents.torn as usize, length + tail.len() - kept, "{length}");
                journal.append(entry(Some("c"))).unwrap();
                drop(journal);
                let contents = Contents::read(folder.path()).unwrap();
                assert_eq!((contents.torn, contents.entries.len()), (0, whole.max(1)));
            }
        }
    }

    #[test]
    fn damage_elsewhere_is_refused_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(NAME);
        let (mut journal, _) = Journal::open(folder.path(), header()).unwrap();
        journal.append(entry(Some("a"))).unwrap();
        journal.append(entry(Some("b"))).unwrap();
        drop(journal);
        let text = fs::read_to_string(&path).unwrap();
        let mut lines: Vec<&str> = text.lines().collect();
        lines[1] = "{\"key\":\"a\"}";
        fs::write(&path, lines.join("\n") + "\n").unwrap();
        let error = format!("{:#}", Journal::open(folder.path(), header()).err().unwrap());
        assert!(error.contains("line 2"), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap().lines().count(), 3, "nothing is thrown away");
        fs::write(&path, "{\"journal\":2}\n").unwrap();
        assert!(format!("{:#}", Contents::read(folder.path()).unwrap_err()).contains("format 2"));
        fs::write(&path, "[1]\n").unwrap();
        assert!(Contents::read(folder.path()).is_err());
        assert!(Contents::read(&folder.path().join("gone")).is_err());
    }

    #[test]
    fn one_sweep_writes_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let (journal, _) = Journal::open(folder.path(), header()).unwrap();
        let error = Journal::open(folder.path(), header()).err().unwrap().to_string();
        assert!(error.contains("another sweep"), "{error}");
        drop(journal);
        Journal::open(folder.path(), header()).unwrap();
    }

    #[test]
    fn a_sweep_that_differs_is_told_in_words() {
        let old = header().record;
        assert_eq!(differences(&old, &old), Vec::<String>::new());
        let told = |change: &dyn Fn(&mut Record)| {
            let mut new = old.clone();
            change(&mut new);
            differences(&old, &new).join("; ")
        };
        assert!(
            told(&|r| r.device.driver.version = "1.2".into())
                .contains("driver was NVIDIA 570.124 (570.124.0), now")
        );
        assert!(told(&|r| r.device.uuid = "0".into()).contains("the device was"));
        assert!(told(&|r| r.shaders.values_mut().next().unwrap().clear()).contains("traverse/binary"));
        let depth = |r: &mut Record| r.sweep.as_mut().unwrap().config["settings"]["depth"] = 2.into();
        assert!(told(&depth).contains("depth was 3, now 2"), "{}", told(&depth));
        assert!(told(&|r| r.sweep.as_mut().unwrap().shard = None).contains("was 1/1, now all of it"));
        assert!(told(&|r| r.run.clock = None).contains("run.clock.mhz was 2835, now absent"));
    }
}
