//! All that the stand-in knows, and the file that holds it.

use crate::{COUNTERS, FUNCTIONS, Fault, FaultKind, Gpu};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// The environment variable with the path of the [`State`]. Without it there is no driver.
pub const STATE_VARIABLE: &str = "NVML_STAND_IN";

/// A machine's driver and GPUs. What is left out of the file is as in [`State::default`].
///
/// The file is never changed but replaced, by whoever holds the lock on `<file>.lock`. So it can be
/// read at any time, and a process that is killed leaves either the old state or the new one. All who
/// call functions that change something need the right to write in its folder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct State {
    /// Version of the driver. From 580.82 on, field values have other numbers.
    pub driver: String,
    /// The GPUs, in NVML's order.
    pub gpus: Vec<Gpu>,
    /// Calls that go wrong.
    pub faults: Vec<Fault>,
    /// How often each function that sets or resets something was called, by its name in C without
    /// `nvml`. Calls that failed count too.
    pub calls: BTreeMap<String, u64>,
    /// Whether only root may set and reset. Tests that run as anybody want `false`.
    pub root_only: bool,
}

impl Default for State {
    /// A driver without GPUs.
    fn default() -> State {
        State {
            driver: "580.65.06".into(),
            gpus: Vec::new(),
            faults: Vec::new(),
            calls: BTreeMap::new(),
            root_only: true,
        }
    }
}

impl State {
    /// A driver with one GPU, [`Gpu::default`].
    pub fn example() -> State {
        State { gpus: vec![Gpu::default()], ..State::default() }
    }

    /// Reads a state.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or holds no state.
    pub fn read(path: &Path) -> io::Result<State> {
        let state: State = serde_json::from_slice(&fs::read(path)?)?;
        state.check()?;
        Ok(state)
    }

    /// Makes this the state, whatever it was before.
    ///
    /// # Errors
    ///
    /// A name in the state is wrong, or the file cannot be written.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        let _lock = lock(path)?;
        self.replace(path)
    }

    /// Changes the state. Nobody else changes it meanwhile; those that want to wait.
    ///
    /// # Errors
    ///
    /// As for [`State::read`] and [`State::write`]. If it cannot be written it stays as it was.
    pub fn edit<T>(path: &Path, change: impl FnOnce(&mut State) -> T) -> io::Result<T> {
        let _lock = lock(path)?;
        let before = State::read(path)?;
        let mut state = before.clone();
        let result = change(&mut state);
        if state != before {
            state.replace(path)?;
        }
        Ok(result)
    }

    /// Whether field values have the numbers that they have had since driver 580.82.
    pub(crate) fn has_new_fields(&self) -> bool {
        let mut parts = self.driver.split('.').map(|part| part.parse().unwrap_or(0));
        (parts.next().unwrap_or(0), parts.next().unwrap_or(0)) >= (580_u32, 82_u32)
    }

    /// Puts the state into place, for one who holds the lock. Hence the new file needs no name of its
    /// own, and one that was left behind is overwritten.
    fn replace(&self, path: &Path) -> io::Result<()> {
        self.check()?;
        let new = beside(path, ".new");
        fs::write(&new, serde_json::to_vec(self)?)?;
        fs::rename(new, path)
    }

    /// Finds names that nothing will ever ask for: a test with a fault that never comes would pass.
    fn check(&self) -> io::Result<()> {
        let wrong = |what, name| {
            Err(io::Error::new(ErrorKind::InvalidData, format!("the stand-in has no {what} {name:?}")))
        };
        for fault in &self.faults {
            let known =
                FUNCTIONS.iter().any(|function| function.strip_prefix("nvml") == Some(&fault.function));
            if !known && fault.function != "*" {
                return wrong("function", &fault.function);
            }
        }
        let in_faults = self.faults.iter().filter_map(|fault| match &fault.kind {
            FaultKind::Throttle { counter, .. } => Some(counter),
            _ => None,
        });
        let in_gpus = self.gpus.iter().flat_map(|gpu| gpu.counters.keys().chain(&gpu.missing_counters));
        for counter in in_faults.chain(in_gpus) {
            if !COUNTERS.contains(&counter.as_str()) {
                return wrong("counter", counter);
            }
        }
        Ok(())
    }
}

fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(ending);
    name.into()
}

/// Waits for the right to replace the file. It ends with the value, or with the process.
fn lock(path: &Path) -> io::Result<File> {
    let path = beside(path, ".lock");
    let file = match OpenOptions::new().write(true).create(true).truncate(false).open(&path) {
        // Somebody else's file can be locked all the same.
        Err(error) if error.kind() == ErrorKind::PermissionDenied => File::open(&path)?,
        file => file?,
    };
    loop {
        match file.lock() {
            // A signal came, which is nothing unusual in what is tested here.
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            locked => return locked.map(|()| file),
        }
    }
}
