//! The GPUs that a run holds, and the watchdog that would put them back.

use crate::args::Options;
use crate::gpu::Gpu;
use crate::hold::{Held, RestoreTo, put_back, restore};
use crate::journal::{Holder, Journal};
use crate::signals::Signals;
use crate::state::{self, Folder};
use crate::user::{self, Invoker};
use crate::voice::{Voice, say};
use crate::watchdog::Watchdog;
use anyhow::bail;
use nix::unistd::Pid;
use record::Restoration;
use std::time::{Duration, Instant};

/// All that has to be put back.
#[derive(Default)]
pub struct Hands<'a> {
    /// GPUs by their numbers, or why they are not held.
    held: Vec<(u32, Result<Held<'a>, String>)>,
    watchdog: Option<Watchdog>,
}

impl<'a> Hands<'a> {
    /// Takes GPUs, and starts the watchdog. Nothing has been changed yet, except that what others left behind has
    /// been put back.
    ///
    /// # Errors
    /// Somebody else holds one, or asked for an end.
    pub fn take(
        options: &Options,
        chosen: &[(u32, &'a dyn Gpu)],
        command: &[String],
        invoker: Option<&Invoker>,
        signals: &Signals,
        voice: &mut Voice,
    ) -> anyhow::Result<Hands<'a>> {
        let mut hands = Hands::default();
        if chosen.is_empty() {
            return Ok(hands);
        }
        let folder = match state::own().and_then(|path| Folder::make(&path)) {
            Ok(folder) => folder,
            Err(error) => {
                hands.held.extend(chosen.iter().map(|&(index, _)| (index, Err(format!("{error:#}")))));
                return Ok(hands);
            }
        };
        let user = user::name(invoker);
        for &(index, gpu) in chosen {
            let Some(journal) = take(&folder, index, gpu, options, voice, signals)? else { continue };
            let begun = journal.and_then(|mut journal| {
                stale(gpu, &mut journal, voice)?;
                journal.begin(&Holder::this(gpu.identity(), index, &user, command))?;
                Ok(Held::new(gpu, journal, options.restore_to.unwrap_or_default()))
            });
            hands.held.push((index, begun.map_err(|error| format!("{error:#}"))));
        }
        if let Err(error) = hands.guard() {
            // Nothing is locked that could stay locked.
            hands.held.iter_mut().for_each(|(_, held)| *held = Err(format!("{error:#}")));
        }
        Ok(hands)
    }

    /// The hold of one GPU, or why there is none; nothing where nobody tried.
    pub fn of(&mut self, index: u32) -> Option<Result<&mut Held<'a>, &str>> {
        let (_, held) = self.held.iter_mut().find(|(held, _)| *held == index)?;
        Some(held.as_mut().map_err(|why| why.as_str()))
    }

    /// Starts a watchdog; also another one where the first was killed.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn guard(&mut self) -> anyhow::Result<()> {
        self.watchdog = None;
        let held = || self.held.iter().filter_map(|(_, held)| held.as_ref().ok());
        if held().next().is_some() {
            // Whoever kills one may kill the next before it is ready.
            let mut tries = 0;
            let started = loop {
                tries += 1;
                match Watchdog::start(held().map(Held::journal)) {
                    Err(_) if tries < 5 => {}
                    started => break started?,
                }
            };
            self.watchdog = Some(started);
        }
        Ok(())
    }

    /// The watchdog's process.
    pub fn watchdog(&self) -> Option<Pid> {
        self.watchdog.as_ref().map(Watchdog::process)
    }

    /// Puts everything back, and says what came of it, with the GPU's number. The GPUs are free then.
    pub fn give_back(&mut self) -> Vec<(u32, Restoration)> {
        let mut restored = Vec::new();
        let held = std::mem::take(&mut self.held);
        for (index, held) in held {
            if let Ok(mut held) = held {
                restored.extend(held.restore().into_iter().map(|restoration| (index, restoration)));
            }
        }
        if let Some(watchdog) = self.watchdog.take() {
            watchdog.dismiss();
        }
        restored
    }
}

impl Drop for Hands<'_> {
    /// On every way out that is not the usual one, a panic included.
    fn drop(&mut self) {
        for (index, restoration) in self.give_back() {
            if restoration.failed.is_some() {
                say(format_args!("GPU {index}: {}", put_back(&restoration)));
            }
        }
    }
}

/// Locks the journal of a GPU, or says why there can be none; nothing where a stabilize around this one holds it
/// already.
fn take(
    folder: &Folder,
    index: u32,
    gpu: &dyn Gpu,
    options: &Options,
    voice: &mut Voice,
    signals: &Signals,
) -> anyhow::Result<Option<anyhow::Result<Journal>>> {
    let started = Instant::now();
    loop {
        let holder = match Journal::lock(folder, gpu.identity()) {
            Ok(Ok(journal)) => return Ok(Some(Ok(journal))),
            Ok(Err(holder)) => holder,
            // Clocks stay free without a journal, which is no reason not to run the command.
            Err(error) => return Ok(Some(Err(error))),
        };
        if holder.as_ref().is_some_and(Holder::is_ancestor) {
            voice.say(format!("GPU {index} is held by the stabilize that runs this one"));
            return Ok(None);
        }
        if started.elapsed() >= options.queue {
            let who = holder.map_or_else(
                || "another stabilize".into(),
                |holder| {
                    let Holder { process, user, since, command, .. } = holder;
                    format!("stabilize {process} of {user}, since {since}, for {}", command.join(" "))
                },
            );
            bail!("GPU {index} is held by {who}; --queue SECONDS waits for it");
        }
        signals.pause(Duration::from_millis(50).min(options.queue))?;
    }
}

/// Puts back what a journal says that somebody left behind.
fn stale(gpu: &dyn Gpu, journal: &mut Journal, voice: &mut Voice) -> anyhow::Result<()> {
    if journal.contents()?.is_none_or(|contents| contents.pending().is_empty()) {
        return Ok(());
    }
    for restoration in restore(gpu, journal, RestoreTo::default()) {
        voice.say(format!("left behind by a stabilize that was killed; {}", put_back(&restoration)));
        if let Some(why) = restoration.failed {
            bail!("{} is still to be done: {why}", restoration.what);
        }
    }
    Ok(())
}
