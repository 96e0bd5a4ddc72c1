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
    #[error("{path} is no benchmark record", path = path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
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
    pub fn read(path: impl AsRef<Path>) -> Result<Record, Error> {
        /// The one field that all schemas share.
        #[derive(Deserialize)]
        struct Probe {
            schema: Option<u64>,
        }

        let path = path.as_ref();
        let text = fs::read(path).map_err(|source| Error::Read { path: path.into(), source })?;
        let malformed = |source| Error::Malformed { path: path.into(), source };
        let probe: Probe = serde_json::from_slice(&text).map_err(malformed)?;
        match probe.schema {
            None | Some(0) => Err(Error::NoSchema { path: path.into() }),
            Some(found) if found > u64::from(SCHEMA) => Err(Error::Newer { path: path.into(), found }),
            Some(_) => serde_json::from_slice(&text).map_err(malformed),
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
        assert!(matches!(read("{\"schema\": 2}"), Error::Newer { found: 2, .. }));
        assert!(read("{\"schema\": 2}").to_string().contains("schema 2"));
        assert!(matches!(read("{}"), Error::NoSchema { .. }));
        assert!(matches!(read("{\"schema\": 0}"), Error::NoSchema { .. }));
        assert!(matches!(read("{\"schema\": 1}"), Error::Malformed { .. }));
        assert!(matches!(read("[]"), Error::Malformed { .. }));
        assert!(matches!(read("{\"schema\": 1, \"tool\""), Error::Malformed { .. }));
        let missing = Record::read(folder.path().join("none.json")).unwrap_err();
        assert!(matches!(missing, Error::Read { .. }));
    }
}
