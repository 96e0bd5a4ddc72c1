//! The `git` command: no shell between, and whatever is listed ends in NUL, so that names may hold anything.

use anyhow::Context;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Output, Stdio};

/// So many bytes of a blob tell whether the rest is wanted.
const BEGINNING: u64 = 512;

/// Up to so many bytes of an unwanted blob are read and dropped.
const SKIPPED: u64 = 1 << 20;

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

    /// For reading blobs.
    pub fn blobs(&self) -> Blobs<'_> {
        Blobs { git: self, reader: None }
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

/// Reads blobs, all by one process of git: to start one for each takes longer than to read it.
pub struct Blobs<'g> {
    git: &'g Git,
    reader: Option<Reader>,
}

/// A `git cat-file --batch`, which ends with what it is told.
struct Reader {
    child: Child,
    ask: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Drop for Reader {
    fn drop(&mut self) {
        // It has no more to say that anybody wants to hear.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Blobs<'_> {
    /// The content of a blob, or nothing where its beginning is not wanted.
    ///
    /// # Errors
    /// There is no such blob, or no `git`.
    pub fn get(&mut self, id: &str, wanted: impl Fn(&[u8]) -> bool) -> anyhow::Result<Option<Vec<u8>>> {
        let mut reader = match self.reader.take() {
            Some(reader) => reader,
            None => Reader::start(self.git)?,
        };
        writeln!(reader.ask, "{id}").context("git has ended early")?;
        // `<id> blob <size>`, the content, and an empty line.
        let mut head = String::new();
        reader.answers.read_line(&mut head)?;
        let size = head.trim_end().rsplit_once(" blob ").and_then(|(_, size)| size.parse::<u64>().ok());
        let size = size.with_context(|| format!("git has no blob {id}"))?;
        let mut content = Vec::new();
        let begins = size.min(BEGINNING);
        reader.answers.by_ref().take(begins).read_to_end(&mut content)?;
        if !content.is_empty() && !wanted(&content) {
            // To skip little is quicker than to start anew.
            if size <= SKIPPED {
                std::io::copy(&mut reader.answers.by_ref().take(size - begins + 1), &mut std::io::sink())?;
                self.reader = Some(reader);
            }
            return Ok(None);
        }
        reader.answers.by_ref().take(size - begins).read_to_end(&mut content)?;
        anyhow::ensure!(content.len() as u64 == size, "git ended in the middle of blob {id}");
        reader.answers.read_exact(&mut [0])?;
        self.reader = Some(reader);
        Ok(Some(content))
    }
}

impl Reader {
    fn start(git: &Git) -> anyhow::Result<Reader> {
        let mut command = git.command(["cat-file", "--batch"]);
        // What it says to stderr comes in its answers too, and nobody would empty a pipe.
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().map_err(explained)?;
        let (ask, answers) = (child.stdin.take(), child.stdout.take());
        let (ask, answers) = ask.zip(answers).context("git has no input or output")?;
        Ok(Reader { child, ask, answers: BufReader::new(answers) })
    }
}

/// A name in bytes, as git has it.
pub fn path(name: &[u8]) -> PathBuf {
    #[cfg(unix)]
    return PathBuf::from(<OsStr as std::os::unix::ffi::OsStrExt>::from_bytes(name));
    #[cfg(not(unix))]
    PathBuf::from(String::from_utf8_lossy(name).into_owned())
}
