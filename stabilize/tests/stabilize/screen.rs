//! The screen and the machine stay awake while the command runs, and no longer.

#[path = "../support/bus.rs"]
mod bus;

use crate::machine::{Machine, Ran, appears, eventually};
use crate::nobody::{self, NOBODY};
use bus::{Answer, Bus, Desktop, Held};
use nix::sys::signal::{Signal, kill};
use nix::unistd::{Pid, geteuid};
use record::Report;
use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// What both services are called, and what they keep awake.
const SERVICES: [(&str, &str); 2] =
    [("screen saver", "org.freedesktop.ScreenSaver"), ("idle and sleep", "org.freedesktop.login1")];

/// stabilize on a computer whose buses are these.
fn on(session: &Bus, system: &Bus, machine: &Machine, words: &[&str]) -> Command {
    let mut command = machine.stabilize(words);
    command
        .env("DBUS_SESSION_BUS_ADDRESS", session.address())
        .env("DBUS_SYSTEM_BUS_ADDRESS", system.address());
    command
}

fn at(desktop: &Desktop, machine: &Machine, words: &[&str]) -> Command {
    on(&desktop.session, &desktop.system, machine, words)
}

/// A script that says when it runs, with its process, and ends when it is told.
fn waiting(machine: &Machine) -> String {
    let [new, ready, go] = ["new", "ready", "go"].map(|name| machine.path(name).display().to_string());
    // Also when the test has failed and the computer is gone.
    format!("echo $$ > {new}; mv {new} {ready}; while [ -e {ready} ] && ! [ -e {go} ]; do sleep 0.01; done")
}

/// How often each of the two is said to be refused, in lines with this in them.
fn lines(ran: &Ran, why: [&str; 2]) -> [usize; 2] {
    let count = |what: &str, why: &str| {
        let start = format!("stabilize: {what} not kept off: ");
        let mut lines: Vec<&str> = ran.err.lines().filter(|line| line.contains(what)).collect();
        lines.retain(|line| line.starts_with(&start) && line.contains(why));
        lines.len()
    };
    [count(SERVICES[0].0, why[0]), count(SERVICES[1].0, why[1])]
}

/// Why each of the two is refused, by the report; empty where it is not.
fn refusals(report: &Report) -> [String; 2] {
    let [saver, idle] = report.awake.as_slice() else { panic!("{:?}", report.awake) };
    for (inhibition, (what, service)) in [saver, idle].into_iter().zip(SERVICES) {
        assert_eq!((&*inhibition.what, &*inhibition.service), (what, service));
    }
    [saver, idle].map(|inhibition| inhibition.refusal.clone().unwrap_or_default())
}

#[test]
fn both_are_kept_off_while_the_command_runs() {
    let (machine, desktop) = (Machine::new(), Desktop::start());
    let (report, script) = (machine.path("report.json"), waiting(&machine));
    let words = ["-q", "--report", report.to_str().unwrap(), "--", "sh", "-c", &script];
    let mut child = at(&desktop, &machine, &words).spawn().unwrap();
    appears(&machine.path("ready"));
    let held = |what: &str, mode: &str| Held {
        what: what.into(),
        who: "stabilize".into(),
        why: "running sh".into(),
        mode: mode.into(),
        uid: geteuid().as_raw(),
    };
    assert_eq!(desktop.saver.held(), [held("", "")]);
    assert_eq!(desktop.logind.held(), [held("idle:sleep", "block")]);
    // The command can read as much.
    assert_eq!(refusals(&Report::read(&report).unwrap()), ["", ""]);
    fs::write(machine.path("go"), "").unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!((desktop.saver.held(), desktop.logind.held()), (vec![], vec![]));
    assert_eq!(refusals(&Report::read(&report).unwrap()), ["", ""]);
}

#[test]
fn nothing_is_kept_off_once_stabilize_is_killed() {
    let (machine, desktop) = (Machine::new(), Desktop::start());
    let script = waiting(&machine);
    // A temporary report would stay behind.
    let report = machine.path("report.json");
    let words = ["-q", "--report", report.to_str().unwrap(), "--", "sh", "-c", &script];
    let mut child = at(&desktop, &machine, &words).stderr(Stdio::null()).spawn().unwrap();
    appears(&machine.path("ready"));
    assert_eq!((desktop.saver.held().len(), desktop.logind.held().len()), (1, 1));
    let command = fs::read_to_string(machine.path("ready")).unwrap();
    let command = Pid::from_raw(command.trim().parse().unwrap());
    child.kill().unwrap();
    child.wait().unwrap();
    eventually(Duration::from_secs(2), "both are let go", || {
        desktop.saver.held().is_empty() && desktop.logind.held().is_empty()
    });
    // Before the computer goes, its watchdog has to.
    assert_eq!(machine.run(&["--queue", "20", "--", "true"]).status, Some(0));
    // It was not the command's end that did it.
    kill(command, None).unwrap();
    kill(command, Signal::SIGKILL).unwrap();
}

#[test]
fn services_that_refuse_are_told_on_a_line_each() {
    let (machine, desktop) = (Machine::without_library(), Desktop::start());
    desktop.saver.answer(Answer::Refuse("not\nnow"));
    desktop.logind.answer(Answer::Refuse("ask again"));
    let path = machine.path("report.json");
    let words = ["--report", path.to_str().unwrap(), "--", "sh", "-c", "exit 5"];
    let ran = Ran::of(&mut at(&desktop, &machine, &words));
    assert_eq!(ran.status, Some(5), "{ran:?}");
    let why = ["org.freedesktop.ScreenSaver refuses: not now", "org.freedesktop.login1 refuses: ask again"];
    assert_eq!(lines(&ran, why), [1, 1], "{ran:?}");
    let refusals = refusals(&Report::read(&path).unwrap());
    assert!(refusals[0].contains(why[0]) && refusals[1].contains(why[1]), "{refusals:?}");
}

#[test]
fn services_that_say_nothing_take_half_a_second_together() {
    let (machine, desktop) = (Machine::without_library(), Desktop::start());
    let timed = || {
        let started = Instant::now();
        let ran = Ran::of(&mut at(&desktop, &machine, &["--", "sh", "-c", "exit 5"]));
        assert_eq!(ran.status, Some(5), "{ran:?}");
        (started.elapsed(), ran)
    };
    let (usual, _) = timed();
    desktop.saver.answer(Answer::Hang);
    desktop.logind.answer(Answer::Hang);
    let (taken, ran) = timed();
    assert_eq!(lines(&ran, ["does not answer within"; 2]), [1, 1], "{ran:?}");
    assert!(taken < usual + Duration::from_millis(1200), "{usual:?} {taken:?}");
}

#[test]
fn without_a_bus_there_is_a_line_each() {
    let machine = Machine::without_library();
    let (ran, report) = machine.report(&["--", "sh", "-c", "exit 5"]);
    assert_eq!(ran.status, Some(5), "{ran:?}");
    let why = ["there is no session bus at /no/bus", "there is no system bus at /no/bus"];
    assert_eq!(lines(&ran, why), [1, 1], "{ran:?}");
    let refusals = refusals(&report);
    assert!(refusals[0].contains(why[0]) && refusals[1].contains(why[1]), "{refusals:?}");
}

#[test]
fn nobody_is_asked_who_need_not_be() {
    for option in ["--may-sleep", "--observe"] {
        let (machine, desktop) = (Machine::new(), Desktop::start());
        let report = machine.path("report.json");
        let words = [option, "--report", report.to_str().unwrap(), "--", "true"];
        let ran = Ran::of(&mut at(&desktop, &machine, &words));
        assert!(ran.status == Some(0) && !ran.err.contains("kept off"), "{option}: {ran:?}");
        assert_eq!((desktop.saver.asked(), desktop.logind.asked()), (0, 0), "{option}");
        assert_eq!(Report::read(&report).unwrap().awake, [], "{option}");
    }
}

#[test]
fn the_doctor_tells_who_is_there_and_asks_for_nothing() {
    let (machine, desktop) = (Machine::without_library(), Desktop::start());
    let told = |session: &Bus, system: &Bus| {
        let ran = Ran::of(&mut on(session, system, &machine, &["doctor"]));
        assert_eq!(ran.status, Some(0), "{ran:?}");
        let [saver, idle] = SERVICES.map(|(what, service)| {
            let start = format!("{what}: {service} on the ");
            let mut lines = ran.out.lines().filter_map(|line| line.strip_prefix(&start));
            lines.next().unwrap_or_else(|| panic!("{start} {ran:?}")).to_owned()
        });
        (saver, idle)
    };
    // Who would not answer is there all the same.
    desktop.saver.answer(Answer::Hang);
    let both = ("session bus: runs".to_owned(), "system bus: runs".to_owned());
    assert_eq!(told(&desktop.session, &desktop.system), both);
    assert_eq!((desktop.saver.asked(), desktop.logind.asked()), (0, 0));
    let empty = Bus::start();
    empty.make_startable(SERVICES[0].1);
    let (saver, idle) = told(&empty, &empty);
    assert_eq!(saver, "session bus: is started when it is asked");
    assert_eq!(idle, "system bus: is not there, so nobody keeps it off");
    let ran = machine.run(&["doctor"]);
    assert!(ran.out.contains("the session bus: there is no session bus at /no/bus"), "{ran:?}");
}

#[test]
fn the_command_inherits_nothing_but_its_streams() {
    let (machine, desktop) = (Machine::new(), Desktop::start());
    // The last one is that of the list itself. Whoever runs the tests may have left some open for all.
    let list = ["sh", "-c", "ls /proc/self/fd"];
    let alone = Ran::of(machine.program(list[0]).args(&list[1..]));
    let ran = Ran::of(&mut at(&desktop, &machine, &[&["--"], &list[..]].concat()));
    assert_eq!(ran.status, Some(0), "{ran:?}");
    assert_eq!(lines(&ran, [""; 2]), [0, 0], "{ran:?}");
    assert_eq!(ran.out, alone.out);
}

/// The session's bus lets in nobody but the user who called `sudo`.
#[test]
fn under_sudo_it_is_the_users_screen() {
    if !nobody::can_be("under_sudo_it_is_the_users_screen") {
        return;
    }
    let machine = Machine::new();
    let session = Bus::start_as(NOBODY, NOBODY);
    let saver = session.screen_saver("/org/freedesktop/ScreenSaver");
    session.shut_others_out();
    let script = waiting(&machine);
    machine.give_away("");
    let mut command = machine.stabilize(&["-q", "--", "sh", "-c", &script]);
    // Which system bus there is, a user does not tell root, so it is this computer's own, if it has one.
    command.env("DBUS_SESSION_BUS_ADDRESS", session.address());
    let mut child = nobody::through_sudo(&mut command).spawn().unwrap();
    appears(&machine.path("ready"));
    let users: Vec<u32> = saver.held().iter().map(|held| held.uid).collect();
    fs::write(machine.path("go"), "").unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(users, [NOBODY]);
    assert!(saver.comes_to_hold(0));
}
