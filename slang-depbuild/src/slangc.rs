//! Where the compiler is.

use std::env;
use std::ffi::OsStr;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The Slang compiler of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slangc(PathBuf);

/// There is none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Missing {
    /// What was named and is not there.
    named: Option<PathBuf>,
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.named {
            Some(path) => write!(f, "no slangc: {} is not a program; ", path.display())?,
            None => f.write_str("no slangc: it is neither on PATH nor where scripts/setup puts it; ")?,
        }
        f.write_str(
            "run scripts/setup, install the Vulkan SDK, or unpack a release of Slang and set SLANGC=…/bin/slangc",
        )
    }
}

impl std::error::Error for Missing {}

impl Slangc {
    /// `$SLANGC`; else the one on `PATH`; else the newest that `scripts/setup` has put into
    /// `$XDG_DATA_HOME/broadleaf/slang-*/bin` (`~/.local/share` where that is not set).
    ///
    /// # Errors
    /// It is nowhere, or `$SLANGC` is something else.
    pub fn find() -> Result<Self, Missing> {
        if let Some(named) = var("SLANGC") {
            return Self::at(named);
        }
        on_path("slangc").or_else(set_up).map(Self).ok_or(Missing { named: None })
    }

    /// The given one.
    ///
    /// # Errors
    /// It is not a program.
    pub fn at(path: impl Into<PathBuf>) -> Result<Self, Missing> {
        let path = path.into();
        // A bare name is one on PATH, as anywhere else.
        let bare = path.components().count() == 1 && !path.is_absolute();
        let found = if bare && !is_program(&path) { on_path(&path) } else { Some(path.clone()) };
        let found = found.filter(|found| is_program(found)).and_then(|found| std::path::absolute(found).ok());
        found.map(Self).ok_or(Missing { named: Some(path) })
    }

    /// The program's file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// What it calls its version, such as `2026.14.1`.
    ///
    /// # Errors
    /// It does not run.
    pub fn version(&self) -> std::io::Result<String> {
        let output = Command::new(&self.0).arg("-version").output()?;
        let text = [output.stdout, output.stderr].concat();
        let text = String::from_utf8_lossy(&text).trim().to_owned();
        if output.status.success() && !text.is_empty() {
            Ok(text)
        } else {
            Err(std::io::Error::other(format!("{}: {}: {text}", self.0.display(), output.status)))
        }
    }

    /// Another program, as it may lie beside the compiler in an SDK.
    pub(crate) fn companion(&self, name: &str) -> Option<PathBuf> {
        on_path(name).or_else(|| {
            let beside = self.0.with_file_name(name).with_extension(env::consts::EXE_EXTENSION);
            is_program(&beside).then_some(beside)
        })
    }
}

/// An environment variable, unless it is empty.
fn var(name: &str) -> Option<PathBuf> {
    env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from)
}

fn on_path(name: impl AsRef<Path>) -> Option<PathBuf> {
    let file = name.as_ref().with_extension(env::consts::EXE_EXTENSION);
    let found =
        env::split_paths(&env::var_os("PATH")?).map(|folder| folder.join(&file)).find(|f| is_program(f));
    found.and_then(|found| std::path::absolute(found).ok())
}

/// What `scripts/setup` has fetched.
fn set_up() -> Option<PathBuf> {
    let data = var("XDG_DATA_HOME").or_else(|| Some(var("HOME")?.join(".local/share")))?;
    let mut found: Vec<(Vec<u64>, PathBuf)> = fs::read_dir(data.join("broadleaf"))
        .ok()?
        .flatten()
        .filter_map(|entry| {
            let version = version_of(&entry.file_name())?;
            let program = entry.path().join("bin").join("slangc").with_extension(env::consts::EXE_EXTENSION);
            is_program(&program).then_some((version, program))
        })
        .collect();
    found.sort();
    found.pop().map(|(_, program)| program)
}

/// The numbers in `slang-2026.14.1`.
fn version_of(folder: &OsStr) -> Option<Vec<u64>> {
    folder.to_str()?.strip_prefix("slang-")?.split('.').map(|part| part.parse().ok()).collect()
}

fn is_program(path: &Path) -> bool {
    let Ok(found) = fs::metadata(path) else { return false };
    #[cfg(unix)]
    let executable = std::os::unix::fs::PermissionsExt::mode(&found.permissions()) & 0o111 != 0;
    #[cfg(not(unix))]
    let executable = true;
    found.is_file() && executable
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_ordered_by_their_numbers() {
        let version = |name: &str| version_of(OsStr::new(name));
        assert!(version("slang-2026.14.1") > version("slang-2026.9"));
        assert_eq!(version("slang-"), None);
        assert_eq!(version("slang-new"), None);
        assert_eq!(version("scenes"), None);
    }

    #[test]
    fn what_is_missing_is_said_in_one_line_with_the_way_out() {
        let named = Slangc::at("/nowhere/slangc").unwrap_err().to_string();
        assert!(
            named.starts_with("no slangc: /nowhere/slangc is not a program; run scripts/setup"),
            "{named}"
        );
        let unnamed = Missing { named: None }.to_string();
        for line in [named, unnamed] {
            assert!(
                !line.contains('\n') && line.contains("Vulkan SDK") && line.contains("SLANGC="),
                "{line}"
            );
        }
    }
}
