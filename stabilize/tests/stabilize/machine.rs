//! A computer with a GPU that is none: a stand-in for NVML, and a folder for journals.

use nix::sys::signal::{SigHandler, Signal, signal};
use nvml_stand_in::{Fault, FaultKind, STATE_VARIABLE, Settings, State};
use record::Report;
use std::ffi::OsStr;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// One of them.
pub struct Machine {
    folder: TempDir,
}

impl Machine {
    /// A computer with the GPU of [`State::example`], whose setters work for everybody.
    pub fn new() -> Machine {
        let machine = Machine::without_library();
        nvml_stand_in::install(machine.folder.path());
        machine
    }

    /// The same with a library that lacks functions.
    pub fn without_functions(functions: &[&str]) -> Machine {
        let machine = Machine::without_library();
        nvml_stand_in::install_without(machine.folder.path(), functions);
        machine
    }

    /// A computer without a driver.
    pub fn without_library() -> Machine {
        let folder = tempfile::tempdir().unwrap();
        let state = State { root_only: false, ..State::example() };
        state.write(&folder.path().join("gpu.json")).unwrap();
        Machine { folder }
    }

    /// A path in the computer's own folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The GPUs.
    pub fn state(&self) -> State {
        State::read(&self.path("gpu.json")).unwrap()
    }

    /// Changes the GPUs.
    pub fn edit<T>(&self, change: impl FnOnce(&mut State) -> T) -> T {
        State::edit(&self.path("gpu.json"), change).unwrap()
    }

    /// Orders a fault.
    pub fn fault(&self, function: &str, kind: FaultKind) {
        self.edit(|state| state.faults.push(Fault::always(function, kind)));
    }

    /// What may be changed about the GPUs, and has to be put back.
    pub fn settings(&self) -> Vec<Settings> {
        self.state().gpus.iter().map(nvml_stand_in::Gpu::settings).collect()
    }

    /// Whether anybody tried to change anything.
    pub fn was_touched(&self) -> bool {
        self.state().calls.values().any(|&calls| calls > 0)
    }

    /// Another program on this computer.
    pub fn program(&self, program: impl AsRef<OsStr>) -> Command {
        let mut command = Command::new(program);
        command
            .env("LD_LIBRARY_PATH", self.folder.path())
            .env(STATE_VARIABLE, self.path("gpu.json"))
            .env("STABILIZE_STATE_DIR", self.path("state"))
            .env("STABILIZE_SYSFS", self.path("no-sysfs"))
            .env("DBUS_SESSION_BUS_ADDRESS", "unix:path=/no/bus")
            .env("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/no/bus")
            .env_remove("SUDO_UID")
            .stdin(Stdio::null());
        heeding(&mut command);
        command
    }

    /// stabilize with some words, in a hurry.
    pub fn stabilize(&self, words: &[&str]) -> Command {
        let mut command = self.program(env!("CARGO_BIN_EXE_stabilize"));
        // Clocks of the stand-in settle at once, unless they are told not to.
        if words.contains(&"--") {
            command.args(["--settle", "0.05"]);
        }
        command.args(words);
        command
    }

    /// Runs it to its end.
    pub fn run(&self, words: &[&str]) -> Ran {
        Ran::of(&mut self.stabilize(words))
    }

    /// Runs a command under it, and reads the report.
    pub fn report(&self, words: &[&str]) -> (Ran, Report) {
        let path = self.path("report.json");
        let ran = self.run(&[&["--report", path.to_str().unwrap()], words].concat());
        let report = Report::read(&path).unwrap_or_else(|error| panic!("{error}: {ran:?}"));
        (ran, report)
    }
}

/// Lets a program be told to end. Whoever runs tests in the background, from a script or under nohup, has them ignore
/// some signals, and programs would inherit that.
fn heeding(command: &mut Command) {
    let heed = || {
        for ending in [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP, Signal::SIGQUIT] {
            // SAFETY: the default is no handler, so nothing of ours runs when the signal comes.
            unsafe { signal(ending, SigHandler::SigDfl) }?;
        }
        Ok(())
    };
    // SAFETY: between fork and exec this makes system calls only.
    unsafe { command.pre_exec(heed) };
}

/// What came of a program.
#[derive(Debug)]
pub struct Ran {
    /// Its exit status, if it ended by itself.
    pub status: Option<i32>,
    /// Its standard output.
    pub out: String,
    /// Its standard error.
    pub err: String,
}

impl Ran {
    /// Runs a program to its end.
    pub fn of(command: &mut Command) -> Ran {
        let Output { status, stdout, stderr } = command.output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        Ran { status: status.code(), out: text(stdout), err: text(stderr) }
    }
}

/// Waits until something is so, and fails if it takes too long.
#[track_caller]
pub fn eventually(limit: Duration, what: &str, so: impl Fn() -> bool) {
    let started = Instant::now();
    while !so() {
        assert!(started.elapsed() < limit, "not within {limit:?}: {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Waits until a file is there.
#[track_caller]
pub fn appears(path: &Path) {
    eventually(Duration::from_secs(20), &format!("{} appears", path.display()), || path.exists());
}

/// A script that makes one file and waits for another. It ends with the computer, lest it outlive the tests.
pub fn waiting(ready: &Path, go: &Path) -> String {
    format!("touch {0}; while [ -e {0} ] && ! [ -e {1} ]; do sleep 0.01; done", ready.display(), go.display())
}
