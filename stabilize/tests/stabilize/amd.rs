//! AMD's cards, whose clocks are locked through files.

#[path = "../support/amd.rs"]
mod support;

use crate::machine::{Machine, Ran, appears, eventually};
use crate::nobody;
use nix::sys::signal::{Signal, kill};
use nix::unistd::{Pid, geteuid};
use record::{Hold, Policy, Report, Verdict};
use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use support::{ADDRESS, Clock, StandIn};

const LEVEL: &str = "power_dpm_force_performance_level";

/// What is not counted on AMD, as the verdict says it.
const NOT_COUNTED: &str = "the GPU does not count software power cap and software thermal slowdown";

/// Puts a card into a computer.
fn card(machine: &Machine) -> StandIn {
    let folder = machine.path("sys");
    fs::create_dir(&folder).unwrap();
    StandIn::new(&folder)
}

/// A computer with AMD's card alone.
fn amd() -> (Machine, StandIn) {
    let machine = Machine::without_library();
    let card = card(&machine);
    (machine, card)
}

/// stabilize on a computer with this card, with time for the stand-in to see what was written.
fn stabilize(machine: &Machine, card: &StandIn, words: &[&str]) -> Command {
    let settle: &[&str] = if words.contains(&"--") { &["--settle", "1"] } else { &[] };
    let mut command = machine.stabilize(&[settle, words].concat());
    command.env("STABILIZE_SYSFS", card.root());
    command
}

fn run(machine: &Machine, card: &StandIn, words: &[&str]) -> Ran {
    Ran::of(&mut stabilize(machine, card, words))
}

fn report(machine: &Machine, card: &StandIn, words: &[&str]) -> (Ran, Report) {
    let path = machine.path("report.json");
    let ran = run(machine, card, &[&["--report", path.to_str().unwrap()], words].concat());
    let report = Report::read(&path).unwrap_or_else(|error| panic!("{error}: {ran:?}"));
    (ran, report)
}

/// A command that runs until it is told.
struct Running {
    child: Child,
    report: std::path::PathBuf,
    go: std::path::PathBuf,
    /// The process of the command itself.
    command: Pid,
}

impl Running {
    fn start(machine: &Machine, card: &StandIn, words: &[&str]) -> Running {
        let [report, new, ready, go] = ["report.json", "new", "ready", "go"].map(|name| machine.path(name));
        for old in [&ready, &go] {
            let _ = fs::remove_file(old);
        }
        let [new, shown, until] = [&new, &ready, &go].map(|path| path.display());
        // Also when the test has failed and the computer is gone.
        let script = format!(
            "echo $$ > {new}; mv {new} {shown}; while [ -e {shown} ] && ! [ -e {until} ]; do sleep 0.01; done"
        );
        let own = ["-q", "--report", report.to_str().unwrap()];
        let words = [&own, words, &["--", "sh", "-c", &script]].concat();
        let child = stabilize(machine, card, &words).stderr(Stdio::null()).spawn().unwrap();
        appears(&ready);
        let command = Pid::from_raw(fs::read_to_string(&ready).unwrap().trim().parse().unwrap());
        Running { child, report, go, command }
    }

    /// Lets it end, and gives the exit status and the report.
    fn end(mut self) -> (Option<i32>, Report) {
        fs::write(self.go, "").unwrap();
        (self.child.wait().unwrap().code(), Report::read(&self.report).unwrap())
    }
}

fn hold(asked: &str, locked: Option<u32>, delivered: Option<u32>, remark: Option<&str>) -> Hold {
    let (asked, remark) = (asked.into(), remark.map(String::from));
    Hold { asked, locked_mhz: locked, delivered_mhz: delivered, remark }
}

#[test]
fn clocks_are_locked_and_the_level_is_put_back() {
    for level in ["auto", "high", "manual"] {
        let (machine, card) = amd();
        card.write(LEVEL, &format!("{level}\n"));
        let running = Running::start(&machine, &card, &[]);
        assert_eq!(card.level(), "manual");
        // The last step is the nearest to 0.98 of the last.
        assert_eq!((card.locked(Clock::Graphics), card.locked(Clock::Memory)), (Some(4), Some(2)), "{level}");
        let (status, report) = running.end();
        assert_eq!(status, Some(0));
        assert_eq!(card.level(), level);
        assert_eq!((card.locked(Clock::Graphics), card.locked(Clock::Memory)), (None, None), "{level}");

        let gpu = &report.gpus[0];
        assert_eq!((&*gpu.name, &*gpu.uuid), ("AMD GPU 1002:744c", "1234567890abcdef"));
        assert_eq!((gpu.pci.as_deref(), &*gpu.driver), (Some(ADDRESS), "6.10.5"));
        let policy = Policy {
            graphics: hold("auto", Some(2400), Some(2400), None),
            memory: hold("auto", Some(1250), Some(1250), None),
            persistence: None,
        };
        assert_eq!(gpu.policy, policy);
        let restored: Vec<&str> = gpu.restored.iter().map(|restoration| &*restoration.what).collect();
        let expected = match level {
            // Who had made it manual may have locked clocks, and nobody can tell which.
            "manual" => vec!["memory clock unlocked", "graphics clock unlocked"],
            "high" => vec!["performance level high"],
            _ => vec!["performance level auto"],
        };
        assert_eq!(restored, expected);
        assert!(gpu.restored.iter().all(|restoration| restoration.failed.is_none()), "{gpu:?}");
        assert_eq!(gpu.before.reading.reading().unwrap().temperature_celsius, Some(61));
        assert_eq!(report.verdict, Verdict::Unknown { reason: NOT_COUNTED.into() });
    }
}

#[test]
fn clocks_are_locked_to_steps_as_asked() {
    let (machine, card) = amd();
    for (words, graphics, memory) in [
        (["--graphics-clock", "1250", "--memory-clock", "keep"], Some(2), None),
        (["--graphics-clock", "keep", "--memory-clock", "1000"], None, Some(1)),
        (["--graphics-clock", "base", "--memory-clock", "max"], None, Some(2)),
    ] {
        let running = Running::start(&machine, &card, &words);
        assert_eq!((card.locked(Clock::Graphics), card.locked(Clock::Memory)), (graphics, memory));
        let policy = running.end().1.gpus.remove(0).policy;
        assert_eq!(card.level(), "auto");
        let remark = policy.graphics.remark.unwrap_or_default();
        assert_eq!(remark == "1250 MHz is no step; the nearest is 1200", words[1] == "1250", "{remark}");
        assert_eq!(remark.contains("does not tell its base"), words[1] == "base", "{remark}");
    }
}

#[test]
fn somebodys_own_locks_can_be_put_back() {
    let (machine, card) = amd();
    card.write(LEVEL, "manual\n");
    card.write("pp_dpm_sclk", "1\n");
    let running = Running::start(&machine, &card, &["--restore-to", "800"]);
    assert_eq!((card.locked(Clock::Graphics), card.locked(Clock::Memory)), (Some(4), Some(2)));
    assert_eq!(running.end().0, Some(0));
    assert_eq!((card.locked(Clock::Graphics), card.locked(Clock::Memory)), (Some(1), None));
    assert_eq!(card.level(), "manual");
}

#[test]
fn a_verdict_is_unknown_and_says_why() {
    let (machine, card) = amd();
    let (ran, report) = report(&machine, &card, &["--fail-on-throttle", "--", "true"]);
    assert_eq!(ran.status, Some(124), "{ran:?}");
    assert!(ran.err.ends_with(&format!("stabilize: unknown: {NOT_COUNTED}\n")), "{ran:?}");
    assert_eq!(report.gpus[0].verdict, Verdict::Unknown { reason: NOT_COUNTED.into() });
    // What can be known is told.
    let running = Running::start(&machine, &card, &[]);
    card.write(LEVEL, "auto\n");
    let told = running.end().1.verdict.to_string();
    for clock in ["graphics clock, locked at 2400", "memory clock, locked at 1250"] {
        assert!(told.contains(&format!("the {clock} MHz, was no longer so at the end")), "{told}");
    }
    assert!(told.contains(NOT_COUNTED), "{told}");
}

#[test]
fn a_lock_that_is_not_delivered_is_told() {
    let (machine, card) = amd();
    card.ignore_writes(true);
    let (ran, report) = report(&machine, &card, &["--graphics-clock", "1900", "--", "true"]);
    assert_eq!(ran.status, Some(0));
    let remark = "the driver accepted 1900 MHz but delivers 500 MHz";
    let policy = &report.gpus[0].policy;
    assert_eq!(policy.graphics, hold("1900", Some(1900), Some(500), Some(remark)));
    let given_up = "the driver accepted 1250 MHz but delivers 96 MHz; so it is left free";
    assert_eq!(policy.memory, hold("auto", None, None, Some(given_up)));
    let said = format!("stabilize: graphics clock of GPU 0 locked to 1900 MHz, but {remark}\n");
    assert!(ran.err.contains(&said), "{ran:?}");
    assert_eq!(card.level(), "auto");
    let touched = machine.path("touched");
    let strict = ["--strict", "--graphics-clock", "1900", "--", "touch", touched.to_str().unwrap()];
    let ran = run(&machine, &card, &strict);
    assert!(ran.status == Some(125) && !touched.exists(), "{ran:?}");
    assert_eq!(card.level(), "auto");
}

#[test]
fn without_rights_the_way_out_is_told() {
    let (machine, card) = amd();
    card.deny();
    let user = |words: &[&str]| {
        let mut command = if geteuid().is_root() {
            machine.give_away("");
            machine.stabilize_as_nobody(words)
        } else {
            machine.stabilize(words)
        };
        Ran::of(command.env("STABILIZE_SYSFS", card.root()))
    };
    let ran = user(&["--", "sh", "-c", "exit 7"]);
    assert_eq!(ran.status, Some(7), "{ran:?}");
    for clock in ["graphics", "memory"] {
        let line = format!("stabilize: {clock} clock of GPU 0 not locked: no permission\n");
        assert!(ran.err.contains(&line), "{ran:?}");
    }
    assert!(ran.err.contains("stabilize: to lock clocks: sudo /"), "{ran:?}");
    let touched = machine.path("touched");
    let ran = user(&["--strict", "--", "touch", touched.to_str().unwrap()]);
    assert!(ran.status == Some(125) && !touched.exists(), "{ran:?}");
    let doctor = user(&["doctor"]).out;
    assert_eq!(doctor.matches("cannot be locked: no permission").count(), 2, "{doctor}");
    assert!(doctor.contains("fix: sudo /"), "{doctor}");
    assert_eq!(card.level(), "auto");
}

#[test]
fn a_level_that_could_not_be_put_back_is_left_alone() {
    let (machine, card) = amd();
    card.write(LEVEL, "perf_determinism\n");
    let ran = run(&machine, &card, &["--", "sh", "-c", "exit 7"]);
    let line = "graphics clock of GPU 0 not locked: the performance level is perf_determinism, whose limit";
    assert!(ran.status == Some(7) && ran.err.contains(line) && !ran.err.contains("sudo"), "{ran:?}");
    assert_eq!(card.level(), "perf_determinism");
}

#[test]
fn the_level_is_put_back_after_a_sudden_death() {
    for level in ["auto", "manual"] {
        let (machine, card) = amd();
        card.write(LEVEL, &format!("{level}\n"));
        let mut running = Running::start(&machine, &card, &[]);
        assert_eq!(card.locked(Clock::Graphics), Some(4));
        running.child.kill().unwrap();
        running.child.wait().unwrap();
        eventually(Duration::from_secs(2), "everything is put back", || {
            card.level() == level
                && card.locked(Clock::Graphics).is_none()
                && card.locked(Clock::Memory).is_none()
        });
        // The command was not asked to end.
        kill(running.command, None).unwrap();
        kill(running.command, Signal::SIGKILL).unwrap();
    }
}

#[test]
fn a_card_that_is_taken_out_is_told() {
    let (machine, card) = amd();
    let running = Running::start(&machine, &card, &[]);
    card.unplug();
    let (status, report) = running.end();
    assert_eq!(status, Some(125));
    let [restoration] = &report.gpus[0].restored[..] else { panic!("{report:?}") };
    assert_eq!(restoration.what, "performance level auto");
    assert_eq!(restoration.failed.as_deref(), Some("the GPU is lost"));
}

#[test]
fn the_doctor_and_the_plan_change_nothing() {
    let (machine, card) = amd();
    let doctor = run(&machine, &card, &["doctor"]);
    for part in [
        "GPU 0: AMD GPU 1002:744c (1234567890abcdef, driver 6.10.5)\n",
        "  graphics clock: now 500 MHz, highest 2400 MHz, base not told, 5 steps\n",
        "  memory clock: now 96 MHz, highest 1250 MHz, base not told, 3 steps\n",
        "  throttling: the driver does not count it",
    ] {
        assert!(doctor.out.contains(part), "{part} {doctor:?}");
    }
    assert_eq!(doctor.out.matches("can be locked, as far as can be told without trying").count(), 2);
    assert!(!doctor.out.contains("persistence"), "{doctor:?}");
    let plan = run(&machine, &card, &["--dry-run", "--", "true"]).out;
    assert!(plan.contains("performance level manual, and performance level auto at the end"), "{plan}");
    let ran = run(&machine, &card, &["--observe", "--", "true"]);
    assert_eq!(ran.status, Some(0), "{ran:?}");
    assert_eq!((card.level().as_str(), card.locked(Clock::Graphics)), ("auto", None));
    assert!(!machine.path("state").exists());
}

#[test]
fn cards_of_both_makers_are_held_together() {
    let machine = Machine::new();
    let card = card(&machine);
    let before = machine.settings();
    let running = Running::start(&machine, &card, &["--gpu", "all"]);
    assert_eq!(machine.settings()[0].locked_graphics, Some((1890, 1890)));
    assert_eq!((card.locked(Clock::Graphics), card.locked(Clock::Memory)), (Some(4), Some(2)));
    let (status, report) = running.end();
    assert_eq!(status, Some(0));
    assert_eq!((machine.settings(), card.level().as_str()), (before.clone(), "auto"));
    let locked: Vec<_> = report.gpus.iter().map(|gpu| (gpu.index, gpu.policy.graphics.locked_mhz)).collect();
    assert_eq!(locked, [(0, Some(1890)), (1, Some(2400))]);
    assert_eq!(report.gpus[0].verdict, Verdict::Trusted);
    // The worse one counts.
    assert_eq!(report.verdict, Verdict::Unknown { reason: NOT_COUNTED.into() });

    // The first is NVIDIA's.
    let running = Running::start(&machine, &card, &[]);
    assert_ne!(machine.settings(), before);
    assert_eq!(card.level(), "auto");
    running.end();
    let running = Running::start(&machine, &card, &["--gpu", "1234567890abcdef"]);
    assert_eq!((machine.settings(), card.level().as_str()), (before, "manual"));
    running.end();
}

#[test]
fn a_stand_in_for_sysfs_that_others_can_change_is_refused() {
    let refused = |machine: &Machine, card: &StandIn, why: &str| {
        let ran = run(machine, card, &["--", "sh", "-c", "exit 7"]);
        let line = format!("STABILIZE_SYSFS: {}: {why}", fs::canonicalize(card.root()).unwrap().display());
        assert!(ran.status == Some(7) && ran.err.contains(&line), "{ran:?}");
        let ran = run(machine, card, &["--strict", "--", "true"]);
        assert!(ran.status == Some(125) && ran.err.contains(&line), "{ran:?}");
        assert!(run(machine, card, &["doctor"]).out.contains(&line));
        assert_eq!(card.level(), "auto");
    };
    let (machine, card) = amd();
    fs::set_permissions(card.root(), Permissions::from_mode(0o777)).unwrap();
    refused(&machine, &card, "others can write to it");
    if !nobody::can_be("a_stand_in_for_sysfs_that_others_can_change_is_refused, of another user's") {
        return;
    }
    let (machine, card) = amd();
    // Gives the folder to another user.
    card.deny();
    refused(&machine, &card, "belongs to another user");
}
