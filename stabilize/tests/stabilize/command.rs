//! The command: its streams, its status, its signals, its children.

use crate::machine::{Machine, Ran, appears, eventually, waiting};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::fs;
use std::io::Write;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

fn send(child: &Child, signal: Signal) {
    kill(Pid::from_raw(child.id().cast_signed()), signal).unwrap();
}

#[test]
fn its_exit_status_is_passed_on() {
    for machine in [Machine::new(), Machine::without_library()] {
        for (words, status) in [
            (&["true"][..], 0),
            (&["sh", "-c", "exit 7"], 7),
            (&["sh", "-c", "exit 125"], 125),
            (&["sh", "-c", "kill -TERM $$"], 143),
            (&["sh", "-c", "kill -KILL $$"], 137),
            (&["no-such-program"], 127),
            (&["/no/such/program"], 127),
            (&["/etc/passwd"], 126),
            (&["/"], 126),
        ] {
            let ran = machine.run(&[&["--"], words].concat());
            assert_eq!(ran.status, Some(status), "{words:?} {ran:?}");
        }
    }
}

#[test]
fn wrong_options_are_its_own_failure() {
    let machine = Machine::new();
    for words in [
        &["--nonsense", "--", "true"][..],
        &["--memory-clock", "base", "--", "true"],
        &["--observe", "--strict", "--", "true"],
        &["true"],
        &["--"],
        &[],
    ] {
        let ran = machine.run(words);
        assert!(ran.status == Some(125) && ran.out.is_empty() && !ran.err.is_empty(), "{words:?} {ran:?}");
    }
    let help = machine.run(&["--help"]);
    for part in ["124 ", "125 ", "126 ", "127 ", "128+N", "--fail-on-throttle", "sudo", "outlive"] {
        assert!(help.status == Some(0) && help.out.contains(part), "{part}");
    }
    assert!(!machine.was_touched());
}

#[test]
fn streams_folder_environment_and_group_are_its_own() {
    let machine = Machine::new();
    let script =
        "cat; echo err >&2; pwd; echo $A; cut -d' ' -f5 /proc/self/stat; grep SigBlk /proc/self/status";
    let mut command = machine.stabilize(&["-q", "--", "sh", "-c", script]);
    command.current_dir("/usr").env("A", "b").process_group(0);
    let mut child =
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(b"in\n").unwrap();
    let group = child.id().to_string();
    let output = child.wait_with_output().unwrap();
    let lines: Vec<String> = String::from_utf8(output.stdout).unwrap().lines().map(String::from).collect();
    assert_eq!(lines[..4], ["in", "/usr", "b", &group], "{lines:?}");
    assert_eq!(lines[4], "SigBlk:\t0000000000000000");
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "err\n");
}

#[test]
fn it_finds_the_report_in_its_environment() {
    let machine = Machine::new();
    let (ran, report) = machine.report(&["--", "sh", "-c", "cat \"$STABILIZE_REPORT\""]);
    let before: record::Report = serde_json::from_str(&ran.out).unwrap();
    assert_eq!(before.gpus[0].policy, report.gpus[0].policy);
    assert_eq!((before.finished, before.status), (None, None));
    assert_eq!(report.status, Some(0));
    assert!(before.verdict.to_string().contains("still running"));
    // Without --report there is one all the same, which goes afterwards.
    let ran = machine.run(&[
        "--",
        "sh",
        "-c",
        "cat \"$STABILIZE_REPORT\" > /dev/null && echo \"$STABILIZE_REPORT\"",
    ]);
    assert!(ran.status == Some(0) && !fs::exists(ran.out.trim()).unwrap(), "{ran:?}");
}

#[test]
fn a_report_that_cannot_be_written_stops_everything_before_the_command() {
    let machine = Machine::new();
    let before = machine.settings();
    let touched = machine.path("touched");
    let ran = machine.run(&["--report", "/proc/no/report.json", "--", "touch", touched.to_str().unwrap()]);
    assert!(ran.status == Some(125) && ran.err.contains("/proc/no/report.json"), "{ran:?}");
    assert!(!touched.exists());
    assert_eq!(machine.settings(), before);
}

#[test]
fn signals_are_passed_on() {
    let machine = Machine::new();
    let before = machine.settings();
    for signal in [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP, Signal::SIGQUIT] {
        let ready = machine.path("ready");
        let name = signal.as_str().trim_start_matches("SIG");
        let script = format!("trap 'exit 9' {name}; {}", waiting(&ready, &machine.path("go")));
        let mut child = machine.stabilize(&["-q", "--", "sh", "-c", &script]).spawn().unwrap();
        appears(&ready);
        assert_ne!(machine.settings(), before);
        send(&child, signal);
        assert_eq!(child.wait().unwrap().code(), Some(9), "{signal}");
        assert_eq!(machine.settings(), before);
        fs::remove_file(ready).unwrap();
    }
}

#[test]
fn a_command_that_does_not_heed_them_is_killed_when_asked() {
    let machine = Machine::new();
    let before = machine.settings();
    let ready = machine.path("ready");
    let script = format!("trap '' TERM; {}", waiting(&ready, &machine.path("go")));
    let mut child =
        machine.stabilize(&["-q", "--kill-after", "0.2", "--", "sh", "-c", &script]).spawn().unwrap();
    appears(&ready);
    send(&child, Signal::SIGTERM);
    assert_eq!(child.wait().unwrap().code(), Some(137));
    assert_eq!(machine.settings(), before);
}

#[test]
fn a_signal_before_the_command_ends_it_all() {
    let machine = Machine::new();
    let before = machine.settings();
    let touched = machine.path("touched");
    machine.edit(|state| state.gpus[0].settling_reads = 1_000_000);
    let words = ["--settle", "60", "--", "touch", touched.to_str().unwrap()];
    let mut child = machine.stabilize(&words).stderr(Stdio::null()).spawn().unwrap();
    eventually(Duration::from_secs(20), "the clock is locked", || machine.settings() != before);
    send(&child, Signal::SIGTERM);
    assert_eq!(child.wait().unwrap().code(), Some(143));
    assert!(!touched.exists());
    assert_eq!(machine.settings(), before);
}

#[test]
fn what_outlives_it_is_counted_and_waited_for_only_when_asked() {
    let machine = Machine::new();
    let pid = machine.path("pid");
    let script = format!("setsid sleep 30 >/dev/null 2>&1 & echo $! > {}", pid.display());
    let started = Instant::now();
    let (ran, report) = machine.report(&["--", "sh", "-c", &script]);
    assert!(started.elapsed() < Duration::from_secs(20));
    assert_eq!(report.left_behind, 1, "{ran:?}");
    assert!(ran.err.contains("1 processes that the command started still run"), "{ran:?}");
    let left: i32 = fs::read_to_string(&pid).unwrap().trim().parse().unwrap();
    kill(Pid::from_raw(left), Signal::SIGKILL).unwrap();
    let (ran, report) = machine.report(&["--wait-all", "--", "sh", "-c", "(sleep 0.3; exit 4) & exit 5"]);
    assert_eq!((ran.status, report.left_behind), (Some(5), 0), "{ran:?}");
}

#[test]
fn nohup_has_its_way() {
    let machine = Machine::new();
    let ready = machine.path("ready");
    let go = machine.path("go");
    let script = waiting(&ready, &go);
    let stabilize = env!("CARGO_BIN_EXE_stabilize");
    let mut command = machine.program("nohup");
    command.args([stabilize, "-q", "--settle", "0.05", "--", "sh", "-c", &script]);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    appears(&ready);
    send(&child, Signal::SIGHUP);
    std::thread::sleep(Duration::from_millis(50));
    fs::write(go, "").unwrap();
    let status = child.wait().unwrap();
    assert_eq!((status.code(), status.signal()), (Some(0), None));
}

#[test]
fn a_reader_that_has_gone_away_is_no_reason_to_stay_locked() {
    let machine = Machine::new();
    let before = machine.settings();
    let mut child = machine.stabilize(&["--", "sleep", "0.2"]).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stderr.take());
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(machine.settings(), before);
}

#[test]
fn two_of_them_do_not_fight() {
    let machine = Machine::new();
    let before = machine.settings();
    let (ready, go) = (machine.path("ready"), machine.path("go"));
    let script = waiting(&ready, &go);
    let mut first = machine.stabilize(&["-q", "--", "sh", "-c", &script]).spawn().unwrap();
    appears(&ready);
    let second = machine.run(&["--", "true"]);
    assert_eq!(second.status, Some(125));
    assert!(second.err.contains(&format!("is held by stabilize {}", first.id())), "{second:?}");
    let status = machine.run(&["status"]).out;
    assert!(status.contains(&format!("held by process {}", first.id())), "{status}");
    assert!(status.contains("graphics clock locked to"), "{status}");
    assert!(machine.run(&["restore"]).out.contains("left alone"));
    assert_ne!(machine.settings(), before);
    let mut queued = machine.stabilize(&["-q", "--queue", "20", "--", "true"]).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(50));
    fs::write(&go, "").unwrap();
    assert_eq!(first.wait().unwrap().code(), Some(0));
    assert_eq!(queued.wait().unwrap().code(), Some(0));
    assert_eq!(machine.settings(), before);
}

#[test]
fn one_within_another_leaves_the_clocks_to_it() {
    let machine = Machine::new();
    let stabilize = env!("CARGO_BIN_EXE_stabilize");
    let ran = machine.run(&["--", stabilize, "--", "sh", "-c", "exit 3"]);
    assert_eq!(ran.status, Some(3), "{ran:?}");
    assert!(ran.err.contains("is held by the stabilize that runs this one"), "{ran:?}");
}

#[test]
fn it_keeps_quiet_when_told() {
    let machine = Machine::without_library();
    assert_eq!(machine.run(&["-q", "--", "true"]).err, "");
    let Ran { err, .. } = machine.run(&["--", "true"]);
    assert!(err.contains("no NVML library"), "{err}");
}
