//! From a file, a record or the journal of a sweep, to a record that makes sense.

use crate::journal;
use record::{Problem, Record};
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::path::{Path, PathBuf};
use std::{fmt, fs};

/// So many problems of one record are told; the first one usually explains the others.
const TOLD: usize = 5;

/// Why a record could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// It cannot be read, or is no record.
    #[error(transparent)]
    Read(#[from] record::Error),
    /// It is the journal of a sweep, and damaged.
    #[error("cannot read the sweep in {path}", path = path.display())]
    Journal {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: journal::Problem,
    },
    /// It is a record, and some of it cannot be.
    #[error("{path} does not make sense{}", told(.problems), path = path.display())]
    Senseless {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        problems: Vec<Problem>,
    },
}

/// Reads a record and checks it: whoever gets it need not think of times of zero or of two points that are one.
///
/// # Errors
/// The file cannot be read, holds no record or one of a newer schema, or what it says cannot be. The error names
/// the file and the place in it.
pub fn load(path: impl AsRef<Path>) -> Result<Record, LoadError> {
    let path = path.as_ref();
    let text = fs::read(path).map_err(|source| record::Error::Read { path: path.into(), source })?;
    parse(&text, path)
}

/// The same of text that was read already; errors call it `path`.
///
/// # Errors
/// As [`load`].
pub fn parse(text: &[u8], path: &Path) -> Result<Record, LoadError> {
    let record = if journal::is_journal(text) {
        journal::parse(text).map_err(|source| LoadError::Journal { path: path.into(), source })?
    } else {
        Record::parse(text, path)?
    };
    match record.validate() {
        Ok(()) => Ok(record),
        Err(problems) => Err(LoadError::Senseless { path: path.into(), problems }),
    }
}

/// Whether text is meant to be a record or a journal, be it a broken one.
pub fn is_record(text: &[u8]) -> bool {
    #[derive(Deserialize)]
    struct Probe {
        schema: Option<u64>,
        results: Option<IgnoredAny>,
    }
    let begins = || {
        let mut text = text;
        for token in [&b"{"[..], b"\"schema\"", b":"] {
            let Some(rest) = text.trim_ascii_start().strip_prefix(token) else { return false };
            text = rest;
        }
        text.trim_ascii_start().first().is_some_and(u8::is_ascii_digit)
    };
    if !is_object(text) {
        return false;
    }
    journal::is_journal(text)
        || match serde_json::from_slice(text) {
            Ok(Probe { schema, results }) => schema.is_some() && results.is_some(),
            // What cannot be read as JSON is a record if it begins like one.
            Err(_) => begins(),
        }
}

/// Whether this is the beginning of an object in JSON, as records and journals are.
pub fn is_object(text: &[u8]) -> bool {
    text.trim_ascii_start().starts_with(b"{")
}

fn told(problems: &[Problem]) -> impl fmt::Display {
    let mut text = String::new();
    for problem in problems.iter().take(TOLD) {
        text += &format!("\n  {problem}");
    }
    if problems.len() > TOLD {
        text += &format!("\n  and {} more", problems.len() - TOLD);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_tells_what_is_a_record() {
        let text = serde_json::to_string_pretty(&record::example()).unwrap();
        let sorted = serde_json::to_string(&serde_json::to_value(record::example()).unwrap()).unwrap();
        let conflict = text.replacen("\"tool\"", "<<<<<<< ours\n  \"tool\"", 1);
        for record in [&text, &sorted, &text[..300], &conflict, "{\"journal\":1,"] {
            assert!(is_record(record.as_bytes()), "{record}");
        }
        let report = serde_json::to_string(&record::example_report()).unwrap();
        for other in
            [&report, "", "{}", "{\"schema\": \"https", "{\"schema\": 1}", "fn main() {}", "[1]", "[1, []]"]
        {
            assert!(!is_record(other.as_bytes()), "{other}");
        }
    }
}
