//! A second process that takes everything back when the first one can no longer: it was killed.
//!
//! It has a session of its own, so that no terminal and no process group reaches it, ignores what can be ignored,
//! and sleeps until its end of a socket says that the other end is gone. If a farewell came before, it just ends.

use crate::gpu;
use crate::hold::{RestoreTo, put_back, repair};
use crate::journal::Journal;
use crate::voice::say;
use anyhow::{Context, ensure};
use nix::fcntl::{FcntlArg, FdFlag, fcntl};
use nix::sys::signal::SigSet;
use nix::sys::wait::waitpid;
use nix::unistd::{Pid, setsid};
use std::fs::OpenOptions;
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, AsRawFd, OwnedFd, RawFd};
use std::os::unix::net::UnixStream;
use std::process::{Command, Stdio};
use std::time::Duration;

/// The name under which the program calls itself for it.
pub const COMMAND: &str = "__watchdog";

const READY: u8 = b'r';
const FAREWELL: u8 = b'f';

/// The watchdog, as the process that it watches has it.
pub struct Watchdog {
    socket: UnixStream,
    process: Pid,
}

impl Watchdog {
    /// Starts one for some journals, and returns once it watches.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start<'a>(journals: impl Iterator<Item = &'a Journal>) -> anyhow::Result<Watchdog> {
        let start = || -> anyhow::Result<Watchdog> {
            let (mut socket, theirs) = UnixStream::pair()?;
            socket.set_read_timeout(Some(Duration::from_secs(5)))?;
            // Copies that survive the start of another program. No other is started meanwhile.
            let copies = journals
                .map(|journal| Ok(journal.as_fd().try_clone_to_owned()?))
                .collect::<anyhow::Result<Vec<OwnedFd>>>()?;
            for copy in &copies {
                fcntl(copy, FcntlArg::F_SETFD(FdFlag::empty()))?;
            }
            let child = Command::new("/proc/self/exe")
                .arg(COMMAND)
                .args(copies.iter().map(|copy| copy.as_raw_fd().to_string()))
                .stdin(Stdio::from(OwnedFd::from(theirs)))
                .stdout(Stdio::null())
                .current_dir("/")
                .spawn()?;
            let process = Pid::from_raw(child.id().cast_signed());
            let mut word = [0];
            socket.read_exact(&mut word)?;
            ensure!(word == [READY], "it says something else than that it is ready");
            Ok(Watchdog { socket, process })
        };
        start().context("the watchdog cannot be started")
    }

    /// Its process.
    pub fn process(&self) -> Pid {
        self.process
    }

    /// Lets it go: everything has been taken back.
    pub fn dismiss(mut self) {
        // If it has ended by itself, all the better.
        let _ = self.socket.write_all(&[FAREWELL]);
        drop(self.socket);
        let _ = waitpid(self.process, None);
    }
}

/// What the second process does. The arguments are the numbers of the open journals.
///
/// # Errors
/// It was called by somebody else.
pub fn watch(journals: &[RawFd]) -> anyhow::Result<()> {
    setsid().context("this is stabilize's own business, and works only when stabilize itself calls it")?;
    SigSet::all().thread_block()?;
    // The lock belongs to the files that were inherited, which stay open.
    let mut journals = journals
        .iter()
        .map(|number| {
            let path = format!("/proc/self/fd/{number}");
            Ok(Journal::inherited(OpenOptions::new().read(true).append(true).open(path)?))
        })
        .collect::<anyhow::Result<Vec<Journal>>>()?;
    let mut socket = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    // If nobody is there to hear it, nobody is there to be watched.
    let _ = socket.write_all(&[READY]);
    let mut word = [0];
    if socket.read_exact(&mut word).is_ok() && word == [FAREWELL] {
        return Ok(());
    }
    let found = gpu::find();
    for journal in &mut journals {
        for restoration in repair(&found, journal, RestoreTo::default()) {
            say(format_args!("killed; {}", put_back(&restoration)));
        }
    }
    Ok(())
}
