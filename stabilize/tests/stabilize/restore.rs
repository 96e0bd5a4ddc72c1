//! Everything goes back, however it ends.

use crate::machine::{Machine, appears, eventually, waiting};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use nvml_stand_in::FaultKind;
use record::Report;
use std::cell::Cell;
use std::fs;
use std::hash::{BuildHasher, RandomState};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// How soon a GPU must be back after its stabilize was killed.
const SOON: Duration = Duration::from_secs(2);

/// A share of one, by chance.
fn chance() -> f64 {
    RandomState::new().hash_one(0) as f64 / u64::MAX as f64
}

fn pid(child: &Child) -> Pid {
    Pid::from_raw(child.id().cast_signed())
}

/// The watchdog of a stabilize, if there is one now.
fn watchdog_now(child: &Child) -> Option<Pid> {
    let children = fs::read_to_string(format!("/proc/{0}/task/{0}/children", child.id())).ok()?;
    children.split_whitespace().find_map(|pid| {
        let words = fs::read_to_string(format!("/proc/{pid}/cmdline")).ok()?;
        words.contains("__watchdog").then(|| Pid::from_raw(pid.parse().unwrap()))
    })
}

/// The watchdog of a stabilize.
fn watchdog(child: &Child) -> Pid {
    let found = Cell::new(None);
    eventually(Duration::from_secs(20), "there is a watchdog", || {
        found.set(watchdog_now(child));
        found.get().is_some()
    });
    found.get().unwrap()
}

/// A stabilize whose command runs until a file is there, and which has locked everything.
fn running(machine: &Machine) -> Child {
    let (ready, go) = (machine.path("ready"), machine.path("go"));
    let _ = fs::remove_file(&ready);
    let mut command = machine.stabilize(&["-q", "--", "sh", "-c", &waiting(&ready, &go)]);
    let child = command.stderr(Stdio::null()).spawn().unwrap();
    appears(&ready);
    child
}

/// Kills a stabilize together with its watchdog, so that nobody is left to put anything back.
fn kill_both(child: &mut Child) {
    let dog = watchdog(child);
    // Otherwise it starts another.
    kill(pid(child), Signal::SIGSTOP).unwrap();
    kill(dog, Signal::SIGKILL).unwrap();
    kill(pid(child), Signal::SIGKILL).unwrap();
    child.wait().unwrap();
    // It holds the GPU until it has ended, and whoever inherits it may be slow to clear it away.
    eventually(SOON, "the watchdog has ended", || {
        let stat = fs::read_to_string(format!("/proc/{dog}/stat")).unwrap_or_default();
        stat.rsplit_once(") ").is_none_or(|(_, rest)| rest.starts_with(['Z', 'X']))
    });
}

#[test]
fn killed_two_hundred_times_at_any_moment_it_is_back_within_two_seconds() {
    const THREADS: usize = 4;
    const KILLS: usize = 50;
    let killing = || {
        let machine = Machine::new();
        let first = machine.settings();
        // Long enough to be hit in each of its phases.
        let words = ["-q", "--settle", "0.1", "--", "sleep", "0.03"];
        let started = Instant::now();
        assert_eq!(machine.run(&words).status, Some(0));
        let whole = started.elapsed();
        let mut hit = 0;
        for _ in 0..KILLS {
            let mut child = machine.stabilize(&words).stderr(Stdio::null()).spawn().unwrap();
            let after = whole.mul_f64(1.1 * chance());
            std::thread::sleep(after);
            kill(pid(&child), Signal::SIGKILL).unwrap();
            child.wait().unwrap();
            hit += usize::from(machine.settings() != first);
            eventually(SOON, &format!("killed after {after:?}, all is as before"), || {
                machine.settings() == first
            });
            // The watchdog may still have to say so.
            eventually(SOON, "the GPU is free", || machine.run(&["status"]).out.contains("held by nobody"));
        }
        hit
    };
    let hit: usize = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS).map(|_| scope.spawn(killing)).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).sum()
    });
    // Otherwise there was nothing to put back.
    assert!(hit >= THREADS * KILLS / 10, "only {hit} of them were killed while something was changed");
}

#[test]
fn killed_with_its_watchdog_it_is_put_back_by_restore() {
    let machine = Machine::new();
    let first = machine.settings();
    let mut child = running(&machine);
    let held = machine.settings();
    assert_ne!(held, first);
    kill_both(&mut child);
    std::thread::sleep(Duration::from_millis(50));
    assert_eq!(machine.settings(), held);
    let status = machine.run(&["status"]).out;
    assert!(status.contains("left by a stabilize that was killed: process"), "{status}");
    assert!(status.contains("stabilize restore"), "{status}");
    let ran = machine.run(&["restore"]);
    assert_eq!(ran.status, Some(0));
    for what in ["graphics clock unlocked", "memory clock unlocked", "persistence mode off"] {
        assert!(ran.out.contains(&format!("put back: {what}")), "{ran:?}");
    }
    assert_eq!(machine.settings(), first);
    let again = machine.run(&["restore"]);
    assert!(again.status == Some(0) && again.out == "nothing to put back\n", "{again:?}");
}

#[test]
fn killed_with_its_watchdog_it_is_put_back_by_the_next_one() {
    let machine = Machine::new();
    let first = machine.settings();
    kill_both(&mut running(&machine));
    let (ran, report) = machine.report(&["--", "true"]);
    assert!(
        ran.err.contains("left behind by a stabilize that was killed; put back: graphics clock"),
        "{ran:?}"
    );
    assert_eq!(report.gpus[0].policy.graphics.locked_mhz, Some(1890));
    assert_eq!(machine.settings(), first);
}

#[test]
fn clocks_can_be_restored_to_what_somebody_else_had_locked() {
    let machine = Machine::new();
    let own = |state: &mut nvml_stand_in::State| {
        state.gpus[0].locked_graphics = Some((1200, 1200));
        state.gpus[0].locked_memory = Some((1593, 1593));
    };
    machine.edit(own);
    let first = machine.settings();
    assert_eq!(machine.run(&["--restore-to", "1200,1593", "--", "true"]).status, Some(0));
    assert_eq!(machine.settings(), first);
    let mut child = {
        let script = format!("touch {}; sleep 0.5", machine.path("ready").display());
        machine
            .stabilize(&["-q", "--restore-to", "1200,1593", "--", "sh", "-c", &script])
            .stderr(Stdio::null())
            .spawn()
            .unwrap()
    };
    appears(&machine.path("ready"));
    kill(pid(&child), Signal::SIGKILL).unwrap();
    child.wait().unwrap();
    eventually(SOON, "the other's lock is back", || machine.settings() == first);
    // The watchdog holds the GPU until it has ended.
    eventually(SOON, "the GPU is free", || machine.run(&["status"]).out.contains("held by nobody"));
    // Whoever did not say so at the beginning can say so at the end.
    kill_both(&mut running(&machine));
    assert_eq!(machine.run(&["restore", "--restore-to", "1200,1593"]).status, Some(0));
    assert_eq!(machine.settings(), first);
}

#[test]
fn a_watchdog_that_is_killed_has_a_successor() {
    let machine = Machine::new();
    let first = machine.settings();
    let mut child = running(&machine);
    for _ in 0..3 {
        let dog = watchdog(&child);
        kill(dog, Signal::SIGKILL).unwrap();
        eventually(SOON, "there is another watchdog", || watchdog_now(&child).is_some_and(|now| now != dog));
    }
    kill(pid(&child), Signal::SIGKILL).unwrap();
    child.wait().unwrap();
    eventually(SOON, "all is as before", || machine.settings() == first);
}

#[test]
fn the_watchdog_outlives_what_can_be_heeded() {
    let machine = Machine::new();
    let first = machine.settings();
    let mut child = running(&machine);
    let dog = watchdog(&child);
    for signal in [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP, Signal::SIGQUIT, Signal::SIGUSR1] {
        kill(dog, signal).unwrap();
    }
    std::thread::sleep(Duration::from_millis(50));
    assert_eq!(watchdog(&child), dog);
    let stat = |pid: Pid| fs::read_to_string(format!("/proc/{pid}/stat")).unwrap();
    let session =
        |pid: Pid| stat(pid).rsplit_once(')').unwrap().1.split_whitespace().nth(3).unwrap().to_owned();
    assert_ne!(session(dog), session(pid(&child)));
    kill(pid(&child), Signal::SIGKILL).unwrap();
    child.wait().unwrap();
    eventually(SOON, "all is as before", || machine.settings() == first);
}

#[test]
fn a_slow_driver_is_waited_for() {
    let machine = Machine::new();
    let first = machine.settings();
    machine.fault("DeviceSetGpuLockedClocks", FaultKind::Slow { milliseconds: 300 });
    let mut child = machine.stabilize(&["-q", "--", "true"]).stderr(Stdio::null()).spawn().unwrap();
    eventually(Duration::from_secs(20), "the clock is being locked", || {
        machine.settings()[0].locked_graphics.is_some()
    });
    kill(pid(&child), Signal::SIGKILL).unwrap();
    child.wait().unwrap();
    eventually(SOON, "all is as before", || machine.settings() == first);
}

/// Whoever asks for it right after the death of a stabilize is told when all is back, not that it will be.
#[test]
fn restore_waits_for_the_watchdog() {
    let machine = Machine::new();
    let first = machine.settings();
    let child = &mut running(&machine);
    machine.fault("DeviceResetGpuLockedClocks", FaultKind::Slow { milliseconds: 300 });
    kill(pid(child), Signal::SIGKILL).unwrap();
    child.wait().unwrap();
    let ran = machine.run(&["restore"]);
    assert_eq!((ran.status, machine.settings()), (Some(0), first), "{ran:?}");
}

#[test]
fn what_cannot_be_put_back_is_named_and_can_be_put_back_later() {
    let machine = Machine::new();
    let first = machine.settings();
    machine.fault("DeviceResetGpuLockedClocks", FaultKind::Error(nvml_stand_in::ErrorCode::GpuIsLost));
    let (ran, report) = machine.report(&["--", "sh", "-c", "exit 3"]);
    assert_eq!(ran.status, Some(125));
    assert!(ran.err.contains("GPU 0: NOT put back: graphics clock unlocked: the GPU is lost"), "{ran:?}");
    let failed: Vec<_> =
        report.gpus[0].restored.iter().filter(|restoration| restoration.failed.is_some()).collect();
    assert!(failed.len() == 1 && failed[0].what == "graphics clock unlocked", "{failed:?}");
    assert_eq!(report.status, Some(3));
    assert_eq!(machine.run(&["restore"]).status, Some(125));
    machine.edit(|state| state.faults.clear());
    assert_eq!(machine.run(&["restore"]).status, Some(0));
    assert_eq!(machine.settings(), first);
}

#[test]
fn a_killed_one_leaves_a_report_that_says_so() {
    let machine = Machine::new();
    let path = machine.path("report.json");
    let words = ["-q", "--report", path.to_str().unwrap(), "--", "sleep", "0.5"];
    let mut child = machine.stabilize(&words).stderr(Stdio::null()).spawn().unwrap();
    appears(&path);
    assert!(Report::read(&path).unwrap().is_current());
    kill(pid(&child), Signal::SIGKILL).unwrap();
    child.wait().unwrap();
    let report = Report::read(&path).unwrap();
    assert!(!report.is_current() && report.finished.is_none() && !report.verdict.is_trusted());
}
