//! The command that is run: in the same process group and terminal, with the environment and the signals that it
//! would have without anybody in between.

use crate::args::Options;
use crate::signals::{Arrival, Signals};
use crate::user::{Invoker, Rights};
use anyhow::Context;
use nix::errno::Errno;
use nix::sys::signal::{SigmaskHow, Signal, kill, pthread_sigmask};
use nix::sys::wait::{WaitPidFlag, WaitStatus, waitpid};
use nix::unistd::{Pid, setgroups, setresgid, setresuid};
use std::io;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// The command while it runs.
pub struct Running<'a> {
    signals: &'a Signals,
    process: Pid,
    /// What its processes are not: ours.
    watchdog: Option<Pid>,
    /// When it is killed, once somebody asked for an end.
    kill_after: Option<Duration>,
    kill_at: Option<Instant>,
    status: Option<i32>,
}

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The command has ended, with this exit status.
    Ended(i32),
    /// The watchdog has ended, which nobody told it to.
    WatchdogEnded,
    /// Nothing, for as long as the caller would wait.
    Nothing,
}

/// Starts it, as the user who called `sudo` where there is one. `report` is the path of the report.
///
/// # Errors
/// It cannot be run; of kind [`io::ErrorKind::NotFound`] where there is no such program.
pub fn start<'a>(
    signals: &'a Signals,
    options: &Options,
    invoker: Option<&Invoker>,
    report: Option<&Path>,
    watchdog: Option<Pid>,
) -> io::Result<Running<'a>> {
    let mut child = Command::new(&options.command[0]);
    child.args(&options.command[1..]);
    if let Some(report) = report {
        child.env(record::REPORT_VARIABLE, report);
    }
    for (name, value) in invoker.into_iter().flat_map(Invoker::environment) {
        match value {
            Some(value) => child.env(name, value),
            None => child.env_remove(name),
        };
    }
    let mask = signals.original;
    let rights = invoker.map(|invoker| invoker.rights.clone());
    let prepare = move || -> io::Result<()> {
        if let Some(Rights { uid, gid, groups }) = &rights {
            setgroups(groups)?;
            setresgid(*gid, *gid, *gid)?;
            setresuid(*uid, *uid, *uid)?;
        }
        pthread_sigmask(SigmaskHow::SIG_SETMASK, Some(&mask), None)?;
        Ok(())
    };
    // SAFETY: between fork and exec this only makes system calls, which need no lock and no memory of the heap.
    unsafe { child.pre_exec(prepare) };
    let process = Pid::from_raw(child.spawn()?.id().cast_signed());
    Ok(Running { signals, process, watchdog, kill_after: options.kill_after, kill_at: None, status: None })
}

impl Running<'_> {
    /// Waits for something to happen, and passes signals on meanwhile.
    ///
    /// # Errors
    /// The system refuses.
    pub fn wait(&mut self, limit: Option<Duration>) -> anyhow::Result<Event> {
        let deadline = limit.map(|limit| Instant::now() + limit);
        loop {
            if let Some(event) = self.reap()? {
                return Ok(event);
            }
            let now = Instant::now();
            if self.kill_at.is_some_and(|at| now >= at) {
                self.kill_at = None;
                self.pass(Signal::SIGKILL);
            }
            if deadline.is_some_and(|deadline| now >= deadline) {
                return Ok(Event::Nothing);
            }
            let next = deadline.into_iter().chain(self.kill_at).min();
            match self.signals.wait(next.map(|next| next.saturating_duration_since(now)))? {
                Some(arrival) if arrival.signal != Signal::SIGCHLD => self.signalled(arrival),
                _ => {}
            }
        }
    }

    /// How many processes it has left behind, apart from the watchdog.
    pub fn left_behind(&self) -> Vec<Pid> {
        let own = std::process::id();
        let children = std::fs::read_to_string(format!("/proc/self/task/{own}/children")).unwrap_or_default();
        let children = children.split_whitespace().filter_map(|pid| pid.parse().ok()).map(Pid::from_raw);
        children.filter(|&child| Some(child) != self.watchdog && child != self.process).collect()
    }

    /// From now on this is the watchdog.
    pub fn watchdog_is(&mut self, watchdog: Option<Pid>) {
        self.watchdog = watchdog;
    }

    fn signalled(&mut self, arrival: Arrival) {
        if !arrival.from_terminal {
            self.pass(arrival.signal);
        }
        if arrival.ends() && self.kill_at.is_none() {
            self.kill_at = self.kill_after.map(|after| Instant::now() + after);
        }
    }

    /// Sends a signal to the command, or when that has ended to what it left behind.
    fn pass(&self, signal: Signal) {
        let receivers = if self.status.is_none() { vec![self.process] } else { self.left_behind() };
        for receiver in receivers {
            // One that has just ended hears nothing.
            let _ = kill(receiver, signal);
        }
    }

    /// Takes note of a child that has ended.
    fn reap(&mut self) -> anyhow::Result<Option<Event>> {
        loop {
            let (process, status) = match waitpid(None::<Pid>, Some(WaitPidFlag::WNOHANG)) {
                Ok(WaitStatus::Exited(process, status)) => (process, status),
                Ok(WaitStatus::Signaled(process, signal, _)) => (process, 128 + signal as i32),
                Ok(WaitStatus::StillAlive) | Err(Errno::ECHILD) => return Ok(None),
                Ok(_) | Err(Errno::EINTR) => continue,
                Err(error) => return Err(error).context("cannot wait for the command"),
            };
            if process == self.process {
                self.status = Some(status);
                return Ok(Some(Event::Ended(status)));
            }
            if Some(process) == self.watchdog {
                self.watchdog = None;
                return Ok(Some(Event::WatchdogEnded));
            }
        }
    }
}
