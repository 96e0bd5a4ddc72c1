//! The `git` command: no shell between, and whatever is listed ends in NUL, so that names may hold anything.

use anyhow::Context;
use std::ffi::OsStr;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

/// So many bytes of a blob tell whether the rest is wanted.
const BEGINNING: usize = 512;

/// A working tree.
#[derive(Clone, Debug)]
pub struct Git {
    /// Its topmost folder.
    pub top: PathBuf,
}

impl Git {
    /// The working tree that the current folder is in.
    ///
    /// # Errors
    /// There is no `git`, or no working tree here.
    pub fn here() -> anyhow::Result<Git> {
        Git::at(Path::new("."))
    }

    /// The working tree that a folder is in.
    ///
    /// # Errors
    /// There is no `git`, or no working tree there.
    pub fn at(folder: &Path) -> anyhow::Result<Git> {
        let mut found = Git { top: folder.into() }
            .output(["rev-parse", "--show-toplevel"])
            .context("this works in the working tree of a git repository")?;
        // One line: a name may end in blanks.
        if found.last() == Some(&b'\n') {
            found.pop();
        }
        Ok(Git { top: path(&found) })
    }

    /// What a command prints.
    ///
    /// # Errors
    /// There is no `git`, or the command failed; the error is what it said.
    pub fn output<S: AsRef<OsStr>>(&self, arguments: impl IntoIterator<Item = S>) -> anyhow::Result<Vec<u8>> {
        let output = self.ended(arguments)?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr);
            anyhow::bail!("git failed: {}", said.trim().trim_start_matches("fatal: "));
        }
        Ok(output.stdout)
    }

    /// The value of a setting, or of a ref: the first line, or nothing where the command says that there is none.
    ///
    /// # Errors
    /// There is no `git`.
    pub fn line<S: AsRef<OsStr>>(
        &self,
        arguments: impl IntoIterator<Item = S>,
    ) -> anyhow::Result<Option<String>> {
        let output = self.ended(arguments)?;
        let text = String::from_utf8_lossy(&output.stdout);
        Ok(text.lines().next().filter(|_| output.status.success()).map(String::from))
    }

    /// The content of a blob, or nothing where its beginning is not wanted.
    ///
    /// # Errors
    /// There is no such blob, or no `git`.
    pub fn blob(&self, id: &str, wanted: impl Fn(&[u8]) -> bool) -> anyhow::Result<Option<Vec<u8>>> {
        let mut child =
            self.command(["cat-file", "blob", id]).stdout(Stdio::piped()).spawn().map_err(explained)?;
        let read = read(&mut child, wanted);
        if !matches!(read, Ok(Some(_))) {
            // It may have more to say, which nobody wants to hear.
            let _ = child.kill();
        }
        let status = child.wait()?;
        match read? {
            Some(_) if !status.success() => anyhow::bail!("git has no blob {id}"),
            content => Ok(content),
        }
    }

    fn ended<S: AsRef<OsStr>>(&self, arguments: impl IntoIterator<Item = S>) -> anyhow::Result<Output> {
        self.command(arguments).output().map_err(explained)
    }

    fn command<S: AsRef<OsStr>>(&self, arguments: impl IntoIterator<Item = S>) -> Command {
        let mut command = Command::new("git");
        command.current_dir(&self.top).stdin(Stdio::null()).stderr(Stdio::piped()).args(arguments);
        command
    }
}

fn explained(error: std::io::Error) -> anyhow::Error {
    match error.kind() {
        ErrorKind::NotFound => anyhow::anyhow!("there is no `git` on PATH: install it"),
        _ => anyhow::Error::new(error).context("cannot run git"),
    }
}

fn read(child: &mut Child, wanted: impl Fn(&[u8]) -> bool) -> anyhow::Result<Option<Vec<u8>>> {
    let mut content = Vec::new();
    let Some(mut out) = child.stdout.take() else { return Ok(None) };
    out.by_ref().take(BEGINNING as u64).read_to_end(&mut content)?;
    // An empty one is a blob that does not exist, too: its end tells.
    if !content.is_empty() && !wanted(&content) {
        return Ok(None);
    }
    out.read_to_end(&mut content)?;
    Ok(Some(content))
}

/// A name in bytes, as git has it.
pub fn path(name: &[u8]) -> PathBuf {
    #[cfg(unix)]
    return PathBuf::from(<OsStr as std::os::unix::ffi::OsStrExt>::from_bytes(name));
    #[cfg(not(unix))]
    PathBuf::from(String::from_utf8_lossy(name).into_owned())
}
