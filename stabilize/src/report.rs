//! The report and its file.

use crate::user::{Invoker, acting};
use crate::voice::Voice;
use anyhow::Context;
use record::{Inhibition, Report, Stabilized, Timestamp, Tool, Verdict};
use std::path::{Path, PathBuf};
use std::{fs, io};
use tempfile::TempPath;

/// Why there is no verdict yet.
pub const RUNNING: &str = "the command is still running";

/// A report of a command that is about to start.
pub fn begin(
    command: Vec<String>,
    tolerance: f64,
    gpus: Vec<Stabilized>,
    awake: Vec<Inhibition>,
    voice: &Voice,
) -> Report {
    let process = std::process::id();
    Report {
        schema: record::SCHEMA,
        tool: Tool { name: "stabilize".into(), version: env!("CARGO_PKG_VERSION").into(), commit: None },
        process,
        process_started: record::process_started(process).unwrap_or_default(),
        command,
        started: Timestamp::now(),
        finished: None,
        status: None,
        left_behind: 0,
        tolerance,
        verdict: Verdict::Unknown { reason: RUNNING.into() },
        gpus,
        awake,
        remarks: voice.said.clone(),
    }
}

/// Where the report is: where the user wants it, or in a temporary file for the command to read.
pub struct ReportFile<'a> {
    path: PathBuf,
    /// Goes when this does.
    temporary: Option<TempPath>,
    /// As whom it is written.
    invoker: Option<&'a Invoker>,
}

impl<'a> ReportFile<'a> {
    /// Finds a place for it.
    ///
    /// # Errors
    /// There is none, or the user who called `sudo` cannot write there.
    pub fn new(path: Option<&Path>, invoker: Option<&'a Invoker>) -> anyhow::Result<ReportFile<'a>> {
        if let Some(path) = path {
            // The command may have another folder than this process.
            let path = std::path::absolute(path).context("cannot tell where the report goes")?;
            acting(invoker.map(|invoker| &invoker.rights), || usable(&path))?
                .with_context(|| cannot_write(&path))?;
            return Ok(ReportFile { path, temporary: None, invoker });
        }
        let mut builder = tempfile::Builder::new();
        builder.prefix("stabilize-").suffix(".json");
        let file = acting(invoker.map(|invoker| &invoker.rights), || builder.tempfile())?
            .context("cannot make a temporary file")?;
        let temporary = file.into_temp_path();
        Ok(ReportFile { path: temporary.to_path_buf(), temporary: Some(temporary), invoker })
    }

    /// Its absolute path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes it, with the rights of the user who called `sudo`: all of it or nothing.
    ///
    /// # Errors
    /// That user cannot write there.
    pub fn write(&self, report: &Report) -> anyhow::Result<()> {
        let mut json = serde_json::to_vec_pretty(report)?;
        json.push(b'\n');
        let write = || match self.temporary {
            // The command alone reads it, and only while nobody writes it: no need to wait for the disk.
            Some(_) => fs::write(&self.path, &json),
            None => record::replace(&self.path, |out| out.write_all(&json)),
        };
        acting(self.invoker.map(|invoker| &invoker.rights), write)?.with_context(|| cannot_write(&self.path))
    }
}

fn cannot_write(path: &Path) -> String {
    format!("cannot write the report to {}", path.display())
}

/// Whether a file can be put there, without leaving one.
fn usable(path: &Path) -> io::Result<()> {
    match fs::metadata(path) {
        // It would be replaced by a file, and if it is /dev/null, everybody would miss it.
        Ok(there) if !there.is_file() => return Err(io::Error::other("it is no file")),
        _ => {}
    }
    let folder = path.parent().unwrap_or(path);
    fs::create_dir_all(folder)?;
    tempfile::tempfile_in(folder).map(drop)
}

impl Drop for ReportFile<'_> {
    fn drop(&mut self) {
        if let Some(temporary) = self.temporary.take() {
            // One that stays behind does no harm.
            let _ = acting(self.invoker.map(|invoker| &invoker.rights), || temporary.close());
        }
    }
}
