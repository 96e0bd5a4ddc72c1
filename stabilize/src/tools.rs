//! What is not about a command: who holds the GPUs, putting back what was left, and what can be had here.

use crate::Exit;
use crate::gpu::{self, Domain, Gpu, Trouble};
use crate::hold::{RestoreTo, put_back, repair};
use crate::journal::{Contents, Holder, Journal};
use crate::screen::{self, Presence};
use crate::state::{self, Folder};
use crate::user::Invoker;
use anyhow::Context;
use nix::unistd::geteuid;
use std::fs::File;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// How long to wait for the buses at most.
const BUS_LIMIT: Duration = Duration::from_secs(2);

/// How long to wait for a watchdog that puts a GPU back.
const WATCHDOG_LIMIT: Duration = Duration::from_secs(5);

/// Prints which GPUs are held or were left changed, and what their clocks are. A journal that cannot be read, as
/// root's may be, is told, and hides nothing of the others.
///
/// # Errors
/// Nobody reads it.
pub fn status() -> anyhow::Result<Exit> {
    let mut out = io::stdout().lock();
    let (mut journals, mut unread) = (Vec::new(), Vec::new());
    // One that was killed before it changed anything holds nothing.
    let holds = |contents: &Contents| contents.holder.is_alive() || !contents.pending().is_empty();
    for folder in state::all() {
        let names = state::names(&folder).unwrap_or_else(|error| {
            unread.push(error);
            Vec::new()
        });
        for name in names {
            let path = folder.join(name);
            let read = || Contents::of(&File::open(&path)?);
            match read().with_context(|| format!("cannot read {}", path.display())) {
                Ok(contents) => journals.extend(contents.filter(holds)),
                Err(error) => unread.push(error),
            }
        }
    }
    let found = gpu::find();
    for why in &found.missing {
        writeln!(out, "{why}")?;
    }
    for why in &unread {
        writeln!(out, "{why:#}")?;
    }
    for (index, gpu) in found.gpus.iter().enumerate() {
        let identity = gpu.identity();
        writeln!(out, "GPU {index}: {} ({})", identity.name, identity.uuid)?;
        match journals.iter().position(|journal| journal.holder.gpu.uuid == identity.uuid) {
            Some(at) => tell(&mut out, &journals.remove(at))?,
            None if unread.is_empty() => writeln!(out, "  held by nobody")?,
            None => writeln!(out, "  who holds it is in a journal that cannot be read, if anyone does")?,
        }
        let clock = |domain| gpu.clock(domain).map_or_else(|why| why.to_string(), |mhz| format!("{mhz} MHz"));
        writeln!(
            out,
            "  graphics clock now {}, memory clock {}",
            clock(Domain::Graphics),
            clock(Domain::Memory)
        )?;
    }
    for journal in &journals {
        let gpu = &journal.holder.gpu;
        writeln!(out, "not there now: {} ({})", gpu.name, gpu.uuid)?;
        tell(&mut out, journal)?;
    }
    Ok(Exit::DONE)
}

fn tell(out: &mut impl Write, journal: &Contents) -> io::Result<()> {
    let Holder { process, user, since, command, .. } = &journal.holder;
    let alive = journal.holder.is_alive();
    let state = if alive { "held by" } else { "left by a stabilize that was killed:" };
    writeln!(out, "  {state} process {process} of {user}, since {since}: {}", command.join(" "))?;
    for (_, entry) in journal.pending().iter().rev() {
        writeln!(out, "  {}, then {}", entry.change, entry.undo)?;
    }
    if !alive && !journal.pending().is_empty() {
        writeln!(out, "  sudo stabilize restore puts it back")?;
    }
    Ok(())
}

/// Puts back what the journals say was left changed.
///
/// # Errors
/// A journal cannot be opened.
pub fn restore(to: Option<RestoreTo>) -> anyhow::Result<Exit> {
    let path = state::own()?;
    let mut out = io::stdout().lock();
    if state::names(&path)?.is_empty() {
        writeln!(out, "nothing to put back: there is no journal in {}", path.display())?;
        return Ok(Exit::DONE);
    }
    let found = gpu::find();
    let (mut failed, mut any) = (false, false);
    for file in Folder::open(&path)?.files()? {
        match lock(&file)? {
            Ok(mut journal) => {
                for restoration in repair(&found, &mut journal, to.unwrap_or_default()) {
                    any = true;
                    failed |= restoration.failed.is_some();
                    writeln!(out, "{}", put_back(&restoration))?;
                }
            }
            Err(Some(holder)) if holder.is_alive() => {
                any = true;
                let Holder { process, user, gpu, .. } = holder;
                writeln!(out, "{} is in use by stabilize {process} of {user}: left alone", gpu.name)?;
            }
            Err(_) => {
                any = true;
                failed = true;
                let limit = WATCHDOG_LIMIT.as_secs();
                writeln!(out, "a watchdog is still putting a GPU back after {limit} s; ask again")?;
            }
        }
    }
    if !any {
        writeln!(out, "nothing to put back")?;
    }
    Ok(if failed { Exit::FAILED } else { Exit::DONE })
}

/// Locks a journal, or says who holds it. Where only a watchdog does, it is waited for: what it leaves is left for us.
fn lock(file: &File) -> anyhow::Result<Result<Journal, Option<Holder>>> {
    let started = Instant::now();
    loop {
        match Journal::lock_file(file.try_clone()?)? {
            Err(Some(holder)) if holder.is_alive() => return Ok(Err(Some(holder))),
            Err(_) if started.elapsed() < WATCHDOG_LIMIT => std::thread::sleep(Duration::from_millis(10)),
            result => return Ok(result),
        }
    }
}

/// Prints what can be locked, what cannot and why, and what to do about it.
///
/// # Errors
/// Nobody reads it.
pub fn doctor() -> anyhow::Result<Exit> {
    let mut out = io::stdout().lock();
    let root = geteuid().is_root();
    let invoker = Invoker::find()?;
    let who = match (&invoker, root) {
        (Some(invoker), _) => format!("root, for {}", invoker.name),
        (None, true) => "root".into(),
        (None, false) => "an ordinary user".into(),
    };
    writeln!(out, "running as {who}")?;
    let found = gpu::find();
    for why in &found.missing {
        writeln!(out, "GPU: {why}")?;
    }
    if found.gpus.is_empty() {
        writeln!(
            out,
            "  fix: install the driver of your NVIDIA or AMD GPU; in a container, pass the GPU through"
        )?;
        writeln!(
            out,
            "       (for NVIDIA with NVIDIA_DRIVER_CAPABILITIES=all). Without one, commands run all the same"
        )?;
    }
    for (index, gpu) in found.gpus.iter().enumerate() {
        examine(&mut out, index, gpu.as_ref())?;
    }
    // It is made when it is needed.
    let usable = |path: &PathBuf| !path.exists() || Folder::open(path).is_ok();
    match state::own() {
        Ok(path) if usable(&path) => writeln!(out, "journals: in {}", path.display())?,
        Ok(path) => {
            writeln!(out, "journals: {} is somebody else's, or others may write to it", path.display())?;
            writeln!(out, "  fix: make that folder yours alone, or set STABILIZE_STATE_DIR to one that is")?;
        }
        Err(error) => {
            writeln!(out, "journals: {error:#}; set STABILIZE_STATE_DIR to a folder of yours")?;
        }
    }
    for reach in screen::probe(invoker.as_ref().map(|invoker| &invoker.rights), BUS_LIMIT) {
        let found = match reach.presence {
            Ok(Presence::Running) => "runs".into(),
            Ok(Presence::Startable) => "is started when it is asked".into(),
            Ok(Presence::Missing) => "is not there, so nobody keeps it off".into(),
            Err(why) => why,
        };
        writeln!(out, "{}: {} on the {}: {found}", reach.what, reach.service, reach.bus)?;
    }
    Ok(Exit::DONE)
}

fn examine(out: &mut impl Write, index: usize, gpu: &dyn Gpu) -> io::Result<()> {
    let identity = gpu.identity();
    writeln!(out, "GPU {index}: {} ({}, driver {})", identity.name, identity.uuid, identity.driver)?;
    if let Ok(Some(on)) = gpu.persistence() {
        writeln!(out, "  persistence mode: {}", if on { "on" } else { "off" })?;
    }
    let mut lacks_rights = false;
    for domain in [Domain::Graphics, Domain::Memory] {
        let mhz = |answer: Result<u32, Trouble>| {
            answer.map_or_else(|why| why.to_string(), |mhz| format!("{mhz} MHz"))
        };
        let steps = gpu.steps(domain).map_or(0, |steps| steps.len());
        let base = gpu.base(domain).map_or_else(|_| "not told".into(), |mhz| format!("{mhz} MHz"));
        writeln!(
            out,
            "  {domain}: now {}, highest {}, base {base}, {steps} steps",
            mhz(gpu.clock(domain)),
            mhz(gpu.highest(domain))
        )?;
        match gpu.obstacle(domain) {
            None => writeln!(out, "    can be locked, as far as can be told without trying")?,
            Some(trouble) => {
                lacks_rights |= trouble == Trouble::NoPermission;
                writeln!(out, "    cannot be locked: {trouble}")?;
            }
        }
    }
    if lacks_rights {
        let program =
            std::env::current_exe().map_or_else(|_| "stabilize".into(), |path| path.display().to_string());
        writeln!(out, "    fix: sudo {program} -- CMD")?;
    }
    let counted: Vec<String> = gpu.throttle_times().0.keys().map(ToString::to_string).collect();
    if counted.is_empty() {
        writeln!(out, "  throttling: the driver does not count it, so no run can be trusted or doubted")
    } else {
        writeln!(out, "  throttling: counted for {}", counted.join(", "))
    }
}
