use crate::{Fault, Problem, Record, SCHEMA};
use serde::Deserialize;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Why a record could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file could not be read.
    #[error("cannot read {path}", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file could not be written; what was there before is still there.
    #[error("cannot write {path}", path = path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file holds something else.
    #[error("{path} is no benchmark record{at}", path = path.display(), at = place(.at))]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where in it, such as `results[0].views[2].name`; empty where it holds nothing else.
        at: String,
        /// What is wrong, and in which line.
        source: serde_json::Error,
    },
    /// The file holds JSON without the number of a schema.
    #[error(
        "{path} is no benchmark record: it has no field \"schema\" with a number from 1 up",
        path = path.display()
    )]
    NoSchema {
        /// The file.
        path: PathBuf,
    },
    /// The record was written by a newer version.
    #[error(
        "{path} follows schema {found}, and this version knows schemas up to {SCHEMA}: \
         read it with the version that wrote it, or a newer one",
        path = path.display()
    )]
    Newer {
        /// The file.
        path: PathBuf,
        /// Number of its schema.
        found: u64,
    },
    /// The file is no roofline.
    #[error("{path} is not what `runner roofline -o` writes", path = path.display())]
    NoRoofline {
        /// The file.
        path: PathBuf,
        /// What is wrong, and in which line.
        source: serde_json::Error,
    },
    /// The roofline was written by a newer version.
    #[error(
        "{path} follows schema {found} of rooflines: read it with the version that wrote it, or measure anew",
        path = path.display()
    )]
    NewerRoofline {
        /// The file.
        path: PathBuf,
        /// Number of its schema.
        found: u32,
    },
    /// The record holds a number that JSON cannot express.
    #[error("not written to {path}: {problem}", path = path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// The number, and where it stands.
        problem: Problem,
    },
}

impl Record {
    /// Reads a record. Whether its numbers make sense is for [`Record::validate`] to say.
    ///
    /// # Errors
    /// The file cannot be read, or holds something else; the error says where in it.
    pub fn read(path: impl AsRef<Path>) -> Result<Record, Error> {
        let path = path.as_ref();
        let text = fs::read(path).map_err(|source| Error::Read { path: path.into(), source })?;
        Record::parse(&text, path)
    }

    /// Reads a record from text in JSON; errors call it `path`.
    ///
    /// # Errors
    /// The text is something else.
    pub fn parse(text: &[u8], path: &Path) -> Result<Record, Error> {
        match serde_json::from_slice::<Record>(text) {
            Ok(record) if record.schema == 0 => Err(Error::NoSchema { path: path.into() }),
            Ok(record) if record.schema > SCHEMA => {
                Err(Error::Newer { path: path.into(), found: record.schema.into() })
            }
            Ok(record) => Ok(record),
            Err(error) => Err(explained(error, text, path)),
        }
    }

    /// Writes the record so that a reader sees the old file or the new one, never a part: into a
    /// temporary file beside it, flushed to the disk, then renamed. Makes the folders that are
    /// missing.
    pub fn write_atomic(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = path.as_ref();
        if let Err(problems) = self.validate()
            && let Some(problem) = problems.into_iter().find(|problem| problem.fault == Fault::NotFinite)
        {
            return Err(Error::Unwritable { path: path.into(), problem });
        }
        replace(path, |out| {
            serde_json::to_writer_pretty(&mut *out, self)?;
            out.write_all(b"\n")
        })
        .map_err(|source| Error::Write { path: path.into(), source })
    }
}

/// Why text is no record. It is read once more for that: to know where one is costs time, and most files are sound.
fn explained(error: serde_json::Error, text: &[u8], path: &Path) -> Error {
    /// The one field that all schemas share.
    #[derive(Deserialize)]
    struct Probe {
        schema: Option<u64>,
    }

    match serde_json::from_slice(text) {
        Ok(Probe { schema: None | Some(0) }) => return Error::NoSchema { path: path.into() },
        Ok(Probe { schema: Some(found) }) if found > u64::from(SCHEMA) => {
            return Error::Newer { path: path.into(), found };
        }
        // Either no JSON at all, or another field is wrong.
        _ => {}
    }
    let mut reader = serde_json::Deserializer::from_slice(text);
    let (at, source) = match serde_path_to_error::deserialize::<_, Record>(&mut reader) {
        Err(error) => (error.path().to_string(), error.into_inner()),
        // Something follows what is a record by itself.
        Ok(_) => (String::new(), error),
    };
    Error::Malformed { path: path.into(), at: if at == "." { String::new() } else { at }, source }
}

fn place(at: &str) -> String {
    if at.is_empty() { String::new() } else { format!(": {at}") }
}

/// Replaces a file by what `fill` writes, all of it or nothing: into a temporary file beside it, flushed to the
/// disk, then renamed. Makes the folders that are missing.
///
/// # Errors
/// The system refused; what was there before still is.
pub fn replace(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    fs::create_dir_all(folder)?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(".record-").suffix(".tmp");
    // A temporary file is its owner's alone by default; a record is as public as any other file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let temporary = builder.tempfile_in(folder)?;
    let mut out = BufWriter::new(&temporary);
    fill(&mut out)?;
    out.flush()?;
    drop(out);
    temporary.as_file().sync_all()?;
    temporary.persist(path).map_err(|error| error.error)?;
    // The rename itself reaches the disk with the folder. Where a folder cannot be opened, as on
    // Windows, the file is complete all the same.
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::example;
    use tempfile::tempdir;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn what_is_written_is_read_back() {
        let folder = tempdir().unwrap();
        let path = folder.path().join("new/folders/record.json");
        let mut record = example();
        // Among these are numbers whose last bit serde_json's quicker parser loses.
        let sample = record.results[0].views[0].samples[0].clone();
        record.results[0].views[0].samples = (1..1000)
            .map(|number| {
                let mut sample = sample.clone();
                sample.depths[0].milliseconds = (0.1 + f64::from(number)) / 7e5;
                sample
            })
            .collect();
        record.write_atomic(&path).unwrap();
        assert_eq!(Record::read(&path).unwrap(), record);
        assert_eq!(names(path.parent().unwrap()), ["record.json"]);
    }

    #[test]
    fn a_growing_record_replaces_the_file() {
        let folder = tempdir().unwrap();
        let path = folder.path().join("record.json");
        let mut record = example();
        let point = record.results.pop().unwrap();
        record.write_atomic(&path).unwrap();
        assert_eq!(Record::read(&path).unwrap().results.len(), 1);
        record.results.push(point);
        record.write_atomic(&path).unwrap();
        assert_eq!(Record::read(&path).unwrap(), record);
    }

    #[test]
    fn a_bad_number_leaves_the_old_file() {
        let folder = tempdir().unwrap();
        let path = folder.path().join("record.json");
        let good = example();
        good.write_atomic(&path).unwrap();
        let mut bad = good.clone();
        bad.results[0].views[0].samples[0].depths[0].milliseconds = f64::NAN;
        let error = bad.write_atomic(&path).unwrap_err();
        assert!(matches!(error, Error::Unwritable { .. }), "{error}");
        assert!(error.to_string().contains("results[0].views[0].samples[0]"), "{error}");
        assert_eq!(Record::read(&path).unwrap(), good);
    }

    #[test]
    fn an_interrupted_write_leaves_the_old_file_and_no_other() {
        let folder = tempdir().unwrap();
        let path = folder.path().join("record.json");
        fs::write(&path, "old").unwrap();
        let error = replace(&path, |out| {
            out.write_all(b"half")?;
            Err(io::Error::other("disk full"))
        });
        assert_eq!(error.unwrap_err().to_string(), "disk full");
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(folder.path()), ["record.json"]);
    }

    #[test]
    fn a_folder_in_the_way_is_an_error() {
        let folder = tempdir().unwrap();
        let path = folder.path().join("record.json");
        fs::create_dir(&path).unwrap();
        let error = example().write_atomic(&path).unwrap_err();
        assert!(error.to_string().starts_with("cannot write "), "{error}");
        assert_eq!(names(folder.path()), ["record.json"]);
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_what_the_umask_lets_them() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempdir().unwrap();
        let plain = folder.path().join("plain");
        fs::write(&plain, "").unwrap();
        let path = folder.path().join("record.json");
        example().write_atomic(&path).unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&path), mode(&plain));
    }

    #[test]
    fn other_files_are_named_for_what_they_are() {
        let folder = tempdir().unwrap();
        let path = folder.path().join("record.json");
        let read = |text: &str| {
            fs::write(&path, text).unwrap();
            Record::read(&path).unwrap_err()
        };
        assert!(matches!(read("{\"schema\": 3}"), Error::Newer { found: 3, .. }));
        assert!(read("{\"schema\": 3}").to_string().contains("schema 3"));
        assert!(matches!(read("{}"), Error::NoSchema { .. }));
        assert!(matches!(read("{\"schema\": 0}"), Error::NoSchema { .. }));
        assert!(matches!(read("{\"schema\": 1}"), Error::Malformed { .. }));
        assert!(matches!(read("[]"), Error::Malformed { .. }));
        assert!(matches!(read("{\"schema\": 1, \"tool\""), Error::Malformed { .. }));
        assert!(matches!(read(""), Error::Malformed { .. }));
        let missing = Record::read(folder.path().join("none.json")).unwrap_err();
        assert!(matches!(missing, Error::Read { .. }));
    }

    #[test]
    fn what_is_malformed_is_named_by_its_place() {
        let text = serde_json::to_string(&example()).unwrap();
        let told = |text: &str| {
            let Err(Error::Malformed { at, source, .. }) = Record::parse(text.as_bytes(), Path::new("x"))
            else {
                panic!("{text} is no malformed record");
            };
            (at, source.to_string())
        };
        let launch = "\"rays\":229881,\"milliseconds\":0.769";
        assert!(text.contains(launch));
        let at = "results[0].views[0].samples[2].depths[1]";
        for (field, wrong, what) in [
            ("rays", "\"rays\":-1,\"milliseconds\":0.769", "invalid value: integer `-1`"),
            ("rays", "\"rays\":\"many\",\"milliseconds\":0.769", "invalid type: string"),
            ("milliseconds", "\"rays\":229881,\"milliseconds\":null", "invalid type: null"),
            ("milliseconds", "\"rays\":229881,\"milliseconds\":NaN", "expected value"),
            ("milliseconds", "\"rays\":229881,\"milliseconds\":1e999", "number out of range"),
        ] {
            let (found, why) = told(&text.replacen(launch, wrong, 1));
            assert!(found.ends_with(&format!("{at}.{field}")), "{found}");
            assert!(why.contains(what), "{why}");
        }
        let (found, why) = told(&text[..text.len() / 2]);
        assert!(found.starts_with("results[") || found.starts_with("references["), "{found}");
        assert!(why.contains("EOF"), "{why}");
        let (found, why) = told(&(text + "]"));
        assert_eq!(found, "");
        assert!(why.contains("trailing characters"), "{why}");
        let error = Record::parse(b"{\"schema\":1,\"tool\":7}", Path::new("x")).unwrap_err();
        assert_eq!(error.to_string(), "x is no benchmark record: tool");
    }
}
