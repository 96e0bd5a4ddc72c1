//! From a file to a record that makes sense.

use record::{Problem, Record};
use std::fmt;
use std::path::{Path, PathBuf};

/// So many problems of one record are told; the first one usually explains the others.
const TOLD: usize = 5;

/// Why a record could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// It cannot be read, or is no record.
    #[error(transparent)]
    Read(#[from] record::Error),
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
    let record = Record::read(path)?;
    match record.validate() {
        Ok(()) => Ok(record),
        Err(problems) => Err(LoadError::Senseless { path: path.into(), problems }),
    }
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
