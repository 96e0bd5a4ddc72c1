//! Signals, taken one at a time instead of interrupting anything.

use anyhow::Context;
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::signal::{SigHandler, SigSet, Signal, signal};
use nix::sys::signalfd::{SfdFlags, SignalFd};
use std::os::fd::AsFd;
use std::time::{Duration, Instant};

/// Those that ask for an end.
const ENDING: [Signal; 4] = [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP, Signal::SIGQUIT];

/// Those that are only passed on.
const OTHERS: [Signal; 2] = [Signal::SIGUSR1, Signal::SIGUSR2];

/// A signal that has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// Which one.
    pub signal: Signal,
    /// Whether the terminal sent it: then the command, which is in the same process group, has it too.
    pub from_terminal: bool,
}

impl Arrival {
    /// Whether it asks for an end.
    pub fn ends(self) -> bool {
        ENDING.contains(&self.signal)
    }
}

/// Somebody asked for an end while there was nothing yet to pass the signal on to.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("stopped by {0} before the command ran")]
pub struct Interrupted(pub Signal);

/// Signals of this process, held back for [`Signals::wait`].
pub struct Signals {
    descriptor: SignalFd,
    /// What was held back before, for the command to inherit.
    pub original: SigSet,
}

impl Signals {
    /// Holds them back from now on, in this thread and those that it starts. What is ignored stays ignored, so that
    /// `nohup` has its way.
    ///
    /// # Errors
    /// The system refuses.
    pub fn hold_back() -> anyhow::Result<Signals> {
        let ignored = ignored();
        let mut set = SigSet::empty();
        for signal in ENDING.into_iter().chain(OTHERS).filter(|&signal| !ignored(signal)) {
            set.add(signal);
        }
        set.add(Signal::SIGCHLD);
        // SAFETY: the default is no handler, so nothing of ours runs when the signal comes. Where it is ignored
        // instead, as some who start programs leave it, children end without telling how.
        unsafe { signal(Signal::SIGCHLD, SigHandler::SigDfl) }.context("cannot wait for processes")?;
        let original = SigSet::thread_get_mask().context("cannot read the signal mask")?;
        set.thread_block().context("cannot hold signals back")?;
        let descriptor = SignalFd::with_flags(&set, SfdFlags::SFD_CLOEXEC | SfdFlags::SFD_NONBLOCK)
            .context("cannot wait for signals")?;
        Ok(Signals { descriptor, original })
    }

    /// The next signal, or nothing when the time is over.
    ///
    /// # Errors
    /// The system refuses.
    pub fn wait(&self, limit: Option<Duration>) -> anyhow::Result<Option<Arrival>> {
        let deadline = limit.map(|limit| Instant::now() + limit);
        loop {
            if let Some(info) = self.descriptor.read_signal().context("cannot read a signal")? {
                let signal = Signal::try_from(info.ssi_signo as i32)?;
                // SI_USER is 0, and what else processes send is negative; what the kernel sends is positive.
                return Ok(Some(Arrival { signal, from_terminal: info.ssi_code > 0 }));
            }
            let timeout = match deadline {
                None => PollTimeout::NONE,
                Some(deadline) => {
                    let left = deadline.saturating_duration_since(Instant::now());
                    if left.is_zero() {
                        return Ok(None);
                    }
                    // Rounded up, lest it turn round and round within the last millisecond.
                    PollTimeout::try_from(left + Duration::from_millis(1)).unwrap_or(PollTimeout::MAX)
                }
            };
            let mut descriptors = [PollFd::new(self.descriptor.as_fd(), PollFlags::POLLIN)];
            match poll(&mut descriptors, timeout) {
                Ok(_) | Err(Errno::EINTR) => {}
                Err(error) => return Err(error).context("cannot wait for signals"),
            }
        }
    }

    /// Sleeps.
    ///
    /// # Errors
    /// Somebody asked for an end.
    pub fn pause(&self, time: Duration) -> anyhow::Result<()> {
        let deadline = Instant::now() + time;
        loop {
            match self.wait(Some(deadline.saturating_duration_since(Instant::now())))? {
                None => return Ok(()),
                Some(arrival) if arrival.ends() => return Err(Interrupted(arrival.signal).into()),
                Some(_) => {}
            }
        }
    }
}

/// Which signals this process ignores.
fn ignored() -> impl Fn(Signal) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status
        .lines()
        .find_map(|line| line.strip_prefix("SigIgn:"))
        .and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok())
        .unwrap_or(0);
    move |signal| mask >> (signal as i32 - 1) & 1 != 0
}
