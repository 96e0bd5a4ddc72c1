//! Runs a command with clocks that hold still.

use crate::args::{DEFAULT_GPU, Options};
use crate::clocks::{self, Locking, Wanted};
use crate::command::{self, Event, Running};
use crate::gpu::{self, Domain, Found, Gpu, Identity};
use crate::hands::Hands;
use crate::hold::put_back;
use crate::report::{self, ReportFile};
use crate::screen::Screen;
use crate::signals::Signals;
use crate::user::Invoker;
use crate::voice::Voice;
use crate::{Exit, plan};
use anyhow::bail;
use record::{Policy, Report, Stabilized, State, Timestamp, Verdict};
use std::io;
use std::time::{Duration, Instant};

/// How long to wait for the buses at most.
const BUS_LIMIT: Duration = Duration::from_millis(500);

/// Most readings of a timeline. When there are more, every second one is dropped, so that a run of any length
/// takes little memory.
const TIMELINE: usize = 8192;

/// Runs the command.
///
/// # Errors
/// stabilize itself failed; everything has been put back.
pub fn run(options: &Options) -> anyhow::Result<Exit> {
    let signals = Signals::hold_back()?;
    let invoker = Invoker::find()?;
    let found = gpu::find();
    let chosen = chosen(&found, &options.gpu)?;
    let command: Vec<String> =
        options.command.iter().map(|word| word.to_string_lossy().into_owned()).collect();
    if options.dry_run {
        plan::print(options, &found, &chosen, invoker.as_ref(), &command)?;
        return Ok(Exit::DONE);
    }
    let mut voice = Voice::new(options.quiet);
    remark_on_choice(options, &found, &chosen, &mut voice)?;
    // Now, so that nothing has been changed where there is no place for it.
    let file = ReportFile::new(options.report.as_deref(), invoker.as_ref())?;
    let screen = (!options.may_sleep && !options.observe).then(|| {
        Screen::awake(
            invoker.as_ref().map(|invoker| &invoker.rights),
            &format!("running {}", command[0]),
            BUS_LIMIT,
        )
    });
    let awake = screen.as_ref().map(Screen::outcomes).unwrap_or_default().to_vec();
    for inhibition in &awake {
        if let Some(why) = &inhibition.refusal {
            voice.say(format!("{} not kept off: {why}", inhibition.what));
        }
    }
    if let Some(celsius) = options.wait_below {
        wait_for_cool(&chosen, celsius, options, &signals, &mut voice)?;
    }
    let to_hold = if options.observe { &[][..] } else { &chosen };
    let mut hands = Hands::take(options, to_hold, &command, invoker.as_ref(), &signals, &mut voice)?;
    let policies = lock(options, &chosen, &mut hands, &signals)?;
    tell(options, &chosen, &policies, &mut voice)?;

    let gpus =
        chosen.iter().zip(&policies).map(|(&(index, gpu), policy)| begin(index, gpu, policy)).collect();
    let mut report = report::begin(command, options.tolerance, gpus, awake, &voice);
    file.write(&report)?;
    // From here on what CMD leaves behind is ours to see.
    let _ = nix::sys::prctl::set_child_subreaper(true);
    let begun = Instant::now();
    let as_user = invoker.as_ref().filter(|_| !options.as_root);
    let started = command::start(&signals, options, as_user, Some(file.path()), hands.watchdog());
    let exit = match started {
        Ok(mut running) => {
            let status = follow(&mut running, &mut hands, &mut report, &chosen, options, &mut voice)?;
            report.status = Some(status);
            report.left_behind = running.left_behind().len() as u32;
            Exit::of(status)
        }
        Err(error) => {
            voice.insist(format!("cannot run {:?}: {error}", options.command[0]));
            match error.kind() {
                io::ErrorKind::NotFound => Exit::NOT_FOUND,
                _ => Exit::CANNOT_RUN,
            }
        }
    };
    report.finished = Some(Timestamp::now());
    let milliseconds = 1e3 * begun.elapsed().as_secs_f64();
    for (own, &(_, gpu)) in report.gpus.iter_mut().zip(&chosen) {
        conclude(own, gpu, milliseconds, options.tolerance);
    }
    let mut lost = false;
    for (index, restoration) in hands.give_back() {
        if restoration.failed.is_some() {
            lost = true;
            voice.insist(format!("GPU {index}: {}", put_back(&restoration)));
        }
        let own = report.gpus.iter_mut().find(|own| own.index == index).expect("only these are held");
        own.restored.push(restoration);
    }
    drop(screen);
    if report.left_behind > 0 {
        voice.say(format!(
            "{} processes that the command started still run, with free clocks",
            report.left_behind
        ));
    }
    report.verdict = match report.status {
        None => Verdict::Unknown { reason: "the command did not run".into() },
        Some(_) => Verdict::worst(report.gpus.iter().map(|gpu| gpu.verdict.clone()))
            .unwrap_or_else(|| Verdict::Unknown { reason: "there is no GPU to ask".into() }),
    };
    if report.status.is_some() {
        voice.say(report.verdict.to_string());
    }
    report.remarks = voice.said;
    file.write(&report)?;
    Ok(if lost {
        Exit::FAILED
    } else if options.fail_on_throttle && report.status == Some(0) && !report.verdict.is_trusted() {
        Exit::NOT_TRUSTED
    } else {
        exit
    })
}

/// Says if there is nothing to stabilize, or more than was asked for.
fn remark_on_choice(
    options: &Options,
    found: &Found,
    chosen: &[(u32, &dyn Gpu)],
    voice: &mut Voice,
) -> anyhow::Result<()> {
    if chosen.is_empty() {
        let why = format!("no GPU whose clocks can be read or locked: {}", found.missing.join("; "));
        if options.strict {
            bail!("{why}. Without --strict, the command runs all the same");
        }
        voice.say(why);
    } else if chosen.len() < found.gpus.len() && !options.observe && options.gpu == DEFAULT_GPU {
        let (index, gpu) = chosen[0];
        voice.say(format!(
            "only GPU {index} ({}) is stabilized, of {}; --gpu chooses",
            gpu.identity().name,
            found.gpus.len()
        ));
    }
    Ok(())
}

/// The GPUs that the command line means, with their numbers.
fn chosen<'a>(found: &'a Found, which: &str) -> anyhow::Result<Vec<(u32, &'a dyn Gpu)>> {
    let all = || (0..).zip(found.gpus.iter().map(AsRef::as_ref));
    if which == "all" || found.gpus.is_empty() {
        return Ok(all().collect());
    }
    let matching: Vec<_> = all()
        .filter(|(index, gpu)| {
            let uuid = &gpu.identity().uuid;
            which == index.to_string() || which == uuid || uuid.strip_prefix("GPU-") == Some(which)
        })
        .collect();
    if matching.is_empty() {
        let known: Vec<String> = all()
            .map(|(index, gpu)| format!("{index} ({}, {})", gpu.identity().name, gpu.identity().uuid))
            .collect();
        bail!("there is no GPU {which}; there is {}", known.join(", "));
    }
    Ok(matching)
}

fn state_of(gpu: &dyn Gpu) -> State {
    State { reading: gpu.reading(), throttled: gpu.throttle_times() }
}

/// Waits until all GPUs are cooler than that.
fn wait_for_cool(
    chosen: &[(u32, &dyn Gpu)],
    celsius: u32,
    options: &Options,
    signals: &Signals,
    voice: &mut Voice,
) -> anyhow::Result<()> {
    let started = Instant::now();
    for (index, gpu) in chosen {
        loop {
            let reading = gpu.reading();
            let Some(now) = reading.reading().and_then(|reading| reading.temperature_celsius) else {
                voice.say(format!(
                    "GPU {index} does not tell its temperature, so nobody waits for it to cool"
                ));
                break;
            };
            if now < celsius {
                break;
            }
            if started.elapsed() >= options.wait_limit {
                let text =
                    format!("GPU {index} is at {now} °C after {:.0} s", started.elapsed().as_secs_f64());
                if options.strict {
                    bail!("{text}, not below {celsius} °C; --wait-limit waits longer");
                }
                voice.say(format!("{text}, not below {celsius} °C; going on"));
                break;
            }
            signals.pause(Duration::from_millis(500).min(options.wait_limit))?;
        }
    }
    Ok(())
}

/// Locks the clocks of all GPUs as far as it goes.
fn lock(
    options: &Options,
    chosen: &[(u32, &dyn Gpu)],
    hands: &mut Hands,
    signals: &Signals,
) -> anyhow::Result<Vec<Policy>> {
    let (graphics, memory, settle) = (options.graphics_clock, options.memory_clock, options.settle);
    let locking = Locking { graphics, memory, settle, signals };
    chosen
        .iter()
        .map(|&(index, gpu)| match hands.of(index) {
            Some(Ok(held)) => locking.apply(held),
            Some(Err(why)) => Ok(clocks::free(gpu, graphics, memory, Some(why))),
            None => Ok(clocks::free(gpu, Wanted::Keep, Wanted::Keep, None)),
        })
        .collect()
}

/// What is known of a GPU before the command starts.
fn begin(index: u32, gpu: &dyn Gpu, policy: &Policy) -> Stabilized {
    let Identity { name, uuid, pci, driver, .. } = gpu.identity().clone();
    Stabilized {
        index,
        name,
        uuid,
        pci,
        driver,
        policy: policy.clone(),
        before: state_of(gpu),
        after: None,
        throttling: Vec::new(),
        verdict: Verdict::Unknown { reason: report::RUNNING.into() },
        restored: Vec::new(),
        timeline: Vec::new(),
    }
}

/// Says what could not be locked, and what would help.
fn tell(
    options: &Options,
    chosen: &[(u32, &dyn Gpu)],
    policies: &[Policy],
    voice: &mut Voice,
) -> anyhow::Result<()> {
    let mut refused = false;
    for (&(index, _), policy) in chosen.iter().zip(policies) {
        for (domain, hold) in [(Domain::Graphics, &policy.graphics), (Domain::Memory, &policy.memory)] {
            let Some(remark) = &hold.remark else { continue };
            match hold.locked_mhz {
                None => voice.say(format!("{domain} of GPU {index} not locked: {remark}")),
                Some(mhz) => voice.say(format!("{domain} of GPU {index} locked to {mhz} MHz, but {remark}")),
            }
            // A memory clock that cannot be locked is no news: `auto` asks for what can be had.
            refused |= (hold.locked_mhz.is_none()
                && (domain, hold.asked.as_str()) != (Domain::Memory, "auto"))
                || hold.delivered_mhz.zip(hold.locked_mhz).is_some_and(|(is, to)| !clocks::within(is, to));
        }
    }
    if policies.iter().any(clocks::lacks_rights) {
        voice.say(format!("to lock clocks: {}", plan::with_sudo()));
    }
    if refused && options.strict {
        bail!("the command was not run, because of --strict");
    }
    Ok(())
}

/// Waits for the command's end, and reads the timeline meanwhile.
fn follow(
    running: &mut Running,
    hands: &mut Hands,
    report: &mut Report,
    chosen: &[(u32, &dyn Gpu)],
    options: &Options,
    voice: &mut Voice,
) -> anyhow::Result<i32> {
    let mut period = options.timeline.map(|hertz| Duration::from_secs_f64(1.0 / hertz));
    let mut next = Instant::now();
    let mut ended = None;
    loop {
        if let Some(status) = ended
            && (!options.wait_all || running.left_behind().is_empty())
        {
            return Ok(status);
        }
        let limit = match (ended, period) {
            (Some(_), _) => Some(Duration::from_millis(20)),
            (None, Some(_)) => Some(next.saturating_duration_since(Instant::now())),
            (None, None) => None,
        };
        match running.wait(limit)? {
            Event::Ended(status) => ended = Some(status),
            Event::WatchdogEnded => {
                if let Err(error) = hands.guard() {
                    voice.say(format!("the watchdog was killed, and there is no other: {error:#}"));
                }
                running.watchdog_is(hands.watchdog());
            }
            Event::Nothing => {}
        }
        if let Some(time) = period
            && Instant::now() >= next
        {
            next += time;
            for (own, (_, gpu)) in report.gpus.iter_mut().zip(chosen) {
                own.timeline.push(gpu.reading());
            }
            if report.gpus.iter().any(|gpu| gpu.timeline.len() >= TIMELINE) {
                for own in &mut report.gpus {
                    let mut keep = false;
                    own.timeline.retain(|_| {
                        keep = !keep;
                        keep
                    });
                }
                period = Some(time * 2);
            }
        }
    }
}

/// What the GPU says after the command, and what that means.
fn conclude(own: &mut Stabilized, gpu: &dyn Gpu, milliseconds: f64, tolerance: f64) {
    let after = state_of(gpu);
    let before = &own.before.throttled;
    own.verdict = before.judge(&after.throttled, milliseconds, tolerance);
    own.throttling = before.until(&after.throttled, milliseconds).unwrap_or_default();
    for (domain, hold) in [(Domain::Graphics, &own.policy.graphics), (Domain::Memory, &own.policy.memory)] {
        let (Some(delivered), true) = (hold.delivered_mhz, hold.locked_mhz.is_some()) else { continue };
        let is = gpu.clock(domain);
        if is.as_ref().is_ok_and(|&is| clocks::within(is, delivered)) {
            continue;
        }
        let now = is.map_or_else(|trouble| trouble.to_string(), |mhz| format!("{mhz} MHz"));
        let lost = format!("the {domain}, locked at {delivered} MHz, was no longer so at the end ({now})");
        let reason = match &own.verdict {
            Verdict::Throttled { .. } => continue,
            Verdict::Trusted => lost,
            // Where nothing is counted, this is all that is known.
            Verdict::Unknown { reason } => format!("{reason}; {lost}"),
        };
        own.verdict = Verdict::Unknown { reason };
    }
    own.after = Some(after);
}
