//! Against a real D-Bus daemon, with stand-ins for the services.

#[path = "../../tests/support/bus.rs"]
mod bus;

use super::address::{Place, parse};
use super::*;
use bus::{Answer, Bus, Desktop, Held};
use nix::sys::socket::{AddressFamily, Backlog, SockFlag, SockType, UnixAddr, bind, listen, socket};
use nix::unistd::geteuid;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Instant;

/// More than a service on this machine can take. Tests that wait for it in full have their own.
const AMPLE: Duration = Duration::from_secs(20);

fn addresses(session: &str, system: &str) -> Addresses {
    Addresses { session: parse(session), system: parse(system) }
}

fn of(desktop: &Desktop) -> Addresses {
    addresses(desktop.session.address(), desktop.system.address())
}

fn awake(addresses: &Addresses, limit: Duration) -> Screen {
    Screen::awake_at(addresses, None, "tests", limit)
}

/// Why the screen saver and why idleness are not held off; empty if they are.
fn refusals(screen: &Screen) -> [String; 2] {
    let [saver, idle] = screen.outcomes() else { panic!("{:?}", screen.outcomes()) };
    assert_eq!((&*saver.what, &*saver.service), ("screen saver", "org.freedesktop.ScreenSaver"));
    assert_eq!((&*idle.what, &*idle.service), ("idle and sleep", "org.freedesktop.login1"));
    [saver, idle].map(|outcome| outcome.refusal.clone().unwrap_or_default())
}

#[track_caller]
fn assert_refusals(screen: &Screen, saver: &str, idle: &str) {
    assert_eq!(refusals(screen), [saver, idle]);
}

#[test]
fn both_are_held_for_the_life_and_no_longer() {
    let desktop = Desktop::start();
    let screen = awake(&of(&desktop), AMPLE);
    assert_refusals(&screen, "", "");
    let uid = geteuid().as_raw();
    let held = |what: &str, mode: &str| Held {
        what: what.into(),
        who: "stabilize".into(),
        why: "tests".into(),
        mode: mode.into(),
        uid,
    };
    assert_eq!(desktop.saver.held(), [held("", "")]);
    assert_eq!(desktop.logind.held(), [held("idle:sleep", "block")]);
    drop(screen);
    // The screen saver was told, so there is nothing to wait for. logind's file may just have been
    // inherited by a bus that another test starts: zbus receives it so.
    assert_eq!(desktop.saver.held(), []);
    assert!(desktop.logind.comes_to_hold(0));
}

#[test]
fn several_can_be_held_by_one_process() {
    let desktop = Desktop::start();
    let first = awake(&of(&desktop), AMPLE);
    let second = awake(&of(&desktop), AMPLE);
    assert_eq!((desktop.saver.held().len(), desktop.logind.held().len()), (2, 2));
    // Also by a thread that did not ask.
    std::thread::spawn(move || drop(first)).join().unwrap();
    assert_eq!(desktop.saver.held().len(), 1);
    assert!(desktop.logind.comes_to_hold(1));
    drop(second);
    assert_eq!(desktop.saver.held(), []);
    assert!(desktop.logind.comes_to_hold(0));
}

#[test]
fn commands_do_not_inherit_what_is_held() {
    let desktop = Desktop::start();
    let screen = awake(&of(&desktop), AMPLE);
    let mut command = Command::new("sleep").arg("60").spawn().unwrap();
    drop(screen);
    assert!(desktop.saver.comes_to_hold(0) && desktop.logind.comes_to_hold(0));
    command.kill().unwrap();
    command.wait().unwrap();
}

#[test]
fn the_older_path_will_do() {
    let (session, system) = (Bus::start(), Bus::start());
    let saver = session.screen_saver("/ScreenSaver");
    let screen = awake(&addresses(session.address(), system.address()), AMPLE);
    assert_eq!(refusals(&screen)[0], "");
    assert_eq!(saver.held().len(), 1);
    drop(screen);
    assert_eq!(saver.held(), []);
}

#[test]
fn services_that_refuse_are_quoted() {
    let desktop = Desktop::start();
    desktop.saver.answer(Answer::Refuse("not\nnow"));
    desktop.logind.answer(Answer::Refuse("Permission denied"));
    let screen = awake(&of(&desktop), AMPLE);
    assert_refusals(
        &screen,
        "org.freedesktop.ScreenSaver refuses: not now",
        "org.freedesktop.login1 refuses: Permission denied; root may, and who sits at the machine",
    );
    assert_eq!((desktop.saver.held(), desktop.logind.held()), (vec![], vec![]));

    // The one does without the other.
    desktop.logind.answer(Answer::Grant);
    let screen = awake(&of(&desktop), AMPLE);
    assert_refusals(&screen, "org.freedesktop.ScreenSaver refuses: not now", "");
    assert_eq!(desktop.logind.held().len(), 1);
}

#[test]
fn missing_services_are_named() {
    let bus = Bus::start();
    let _elsewhere = bus.screen_saver("/elsewhere");
    let screen = awake(&addresses(bus.address(), bus.address()), AMPLE);
    let [saver, idle] = refusals(&screen);
    assert_eq!(saver, "org.freedesktop.ScreenSaver has no Inhibit where it is looked for");
    assert_eq!(idle, "nothing on the system bus is called org.freedesktop.login1");

    let empty = Bus::start();
    let screen = awake(&addresses(empty.address(), empty.address()), AMPLE);
    assert_eq!(
        refusals(&screen)[0],
        "nothing on the session bus is called org.freedesktop.ScreenSaver; turn the screen saver off in \
         the desktop's settings"
    );
}

#[test]
fn services_that_say_nothing_are_waited_for_together_and_not_for_long() {
    let desktop = Desktop::start();
    desktop.saver.answer(Answer::Hang);
    desktop.logind.answer(Answer::Hang);
    let limit = Duration::from_secs(1);
    let start = Instant::now();
    let screen = awake(&of(&desktop), limit);
    let taken = start.elapsed();
    assert!(limit <= taken && taken < 2 * limit, "{taken:?}");
    assert_refusals(
        &screen,
        "org.freedesktop.ScreenSaver does not answer within 1s",
        "org.freedesktop.login1 does not answer within 1s",
    );
}

#[test]
fn the_drop_waits_for_nobody_for_long() {
    let short = RELEASE_LIMIT + Duration::from_secs(2);
    let desktop = Desktop::start();
    let screen = awake(&of(&desktop), AMPLE);
    desktop.saver.answer(Answer::Hang);
    let start = Instant::now();
    drop(screen);
    assert!(start.elapsed() < short, "{:?}", start.elapsed());
    // It was not told in a way that it took notice of, but the connection is gone.
    assert!(desktop.saver.comes_to_hold(0));

    desktop.saver.answer(Answer::Grant);
    let screen = awake(&of(&desktop), AMPLE);
    assert_refusals(&screen, "", "");
    drop((desktop.session, desktop.system));
    let start = Instant::now();
    drop(screen);
    assert!(start.elapsed() < short, "{:?}", start.elapsed());
}

#[test]
fn sockets_that_are_no_bus_are_waited_for_no_longer() {
    let folder = tempfile::tempdir().unwrap();
    let limit = Duration::from_millis(300);
    let at = |path: &Path| format!("unix:path={}", path.display());

    // One that never says a word, and one that nobody accepts from, with no room left to wait in.
    let silent = folder.path().join("silent");
    let _silent = UnixListener::bind(&silent).unwrap();
    let full = folder.path().join("full");
    let listener = socket(AddressFamily::Unix, SockType::Stream, SockFlag::SOCK_CLOEXEC, None).unwrap();
    bind(listener.as_raw_fd(), &UnixAddr::new(&full).unwrap()).unwrap();
    listen(&listener, Backlog::new(0).unwrap()).unwrap();
    let _waiting = connect(&parse(&at(&full)), None, SAVER.bus).unwrap();

    let start = Instant::now();
    let screen = awake(&addresses(&at(&silent), &at(&full)), limit);
    let taken = start.elapsed();
    assert!(limit <= taken && taken < limit + Duration::from_secs(2), "{taken:?}");
    assert_refusals(
        &screen,
        "the session bus does not answer within 300ms",
        &format!("the system bus at {} takes no connections", full.display()),
    );
}

#[test]
fn no_bus_at_all_takes_no_time() {
    let start = Instant::now();
    let screen = awake(&addresses("unix:path=/nowhere/bus", "tcp:host=localhost,port=1"), AMPLE);
    let taken = start.elapsed();
    assert!(taken < Duration::from_secs(1), "{taken:?}");
    assert_refusals(
        &screen,
        "there is no session bus at /nowhere/bus; a desktop session has one",
        "the system bus is at tcp:host=localhost,port=1, and only unix:path= and unix:abstract= are supported",
    );
}

#[test]
fn the_first_address_that_works_is_taken() {
    let bus = Bus::start();
    let _saver = bus.screen_saver("/org/freedesktop/ScreenSaver");
    let abandoned = tempfile::tempdir().unwrap();
    let abandoned = abandoned.path().join("bus");
    drop(UnixListener::bind(&abandoned).unwrap());
    let list = format!("unix:abstract=/nobody/listens/here;{}", bus.address());
    let addresses = Addresses { session: parse(&list), system: vec![Place::Path(abandoned.clone())] };
    let screen = awake(&addresses, AMPLE);
    let gone = format!("there is no system bus: nobody listens at {}", abandoned.display());
    assert_refusals(&screen, "", &gone);
}

#[test]
fn a_probe_asks_without_holding_anything_off() {
    let presences = |addresses: &Addresses| {
        let reaches = probe_at(addresses, None, AMPLE);
        let [saver, login] = &reaches;
        assert_eq!((saver.bus, saver.service), ("session bus", "org.freedesktop.ScreenSaver"));
        assert_eq!((login.bus, login.what), ("system bus", "idle and sleep"));
        reaches.map(|reach| reach.presence)
    };
    let desktop = Desktop::start();
    // A probe does not depend on what they would answer.
    desktop.saver.answer(Answer::Hang);
    desktop.logind.answer(Answer::Hang);
    assert_eq!(presences(&of(&desktop)), [Ok(Presence::Running), Ok(Presence::Running)]);
    assert_eq!((desktop.saver.asked(), desktop.logind.asked()), (0, 0));

    let empty = Bus::start();
    empty.make_startable("org.freedesktop.ScreenSaver");
    let addresses_of_empty = addresses(empty.address(), empty.address());
    assert_eq!(presences(&addresses_of_empty), [Ok(Presence::Startable), Ok(Presence::Missing)]);

    let [session, system] = presences(&addresses("unix:path=/nowhere/a", "unix:path=/nowhere/b"));
    assert_eq!(session.unwrap_err(), "there is no session bus at /nowhere/a; a desktop session has one");
    assert_eq!(system.unwrap_err(), "there is no system bus at /nowhere/b");
}

/// This test program once more, running one test, which finds from the variables that it is to play
/// its other part. Ends with this value.
struct Helper(Child);

impl Helper {
    fn start(test: &str, variables: &[(&str, &str)]) -> Helper {
        let mut command = Command::new(env::current_exe().unwrap());
        command.args([&format!("screen::tests::{test}"), "--exact", "--nocapture"]);
        command.envs(variables.iter().copied()).stdout(Stdio::piped());
        Helper(command.spawn().unwrap())
    }

    /// Waits until it has written this line, and says whether it has.
    fn says(&mut self, wanted: &str) -> bool {
        let output = self.0.stdout.take().expect("asked once");
        BufReader::new(output).lines().map_while(Result::ok).any(|line| line.contains(wanted))
    }
}

impl Drop for Helper {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Where the buses are that a helper is to use.
const SESSION: &str = "STABILIZE_TEST_SESSION";
const SYSTEM: &str = "STABILIZE_TEST_SYSTEM";

#[test]
fn nothing_is_held_after_a_sudden_death() {
    if let (Ok(session), Ok(system)) = (env::var(SESSION), env::var(SYSTEM)) {
        return hold_until_killed(&addresses(&session, &system));
    }
    let desktop = Desktop::start();
    let variables = [(SESSION, desktop.session.address()), (SYSTEM, desktop.system.address())];
    let mut helper = Helper::start("nothing_is_held_after_a_sudden_death", &variables);
    assert!(helper.says("holding"));
    assert_eq!((desktop.saver.held().len(), desktop.logind.held().len()), (1, 1));
    // This is SIGKILL.
    helper.0.kill().unwrap();
    assert!(desktop.saver.comes_to_hold(0) && desktop.logind.comes_to_hold(0));
}

/// The part of the one that dies.
fn hold_until_killed(addresses: &Addresses) {
    let screen = awake(addresses, AMPLE);
    assert_refusals(&screen, "", "");
    println!("holding");
    loop {
        std::thread::park();
    }
}

/// The user `nobody` of most distributions. That there is one by that name does not matter.
const NOBODY: u32 = 65534;

fn nobody() -> Rights {
    Rights { uid: NOBODY.into(), gid: NOBODY.into(), groups: vec![NOBODY.into()] }
}

#[test]
fn root_gets_on_the_bus_of_another_user() {
    if let Ok(session) = env::var(SESSION) {
        return switch_ids_until_killed(&session);
    }
    if !geteuid().is_root() {
        // Not through eprintln, which is not shown for tests that pass.
        let line = "skipped, because it needs root: root_gets_on_the_bus_of_another_user";
        writeln!(std::io::stderr(), "{line}").unwrap();
        return;
    }
    let session = Bus::start_as(NOBODY, NOBODY);
    let saver = session.screen_saver("/org/freedesktop/ScreenSaver");
    session.shut_others_out();
    // Ids belong to a whole process, so a helper's are switched.
    let mut helper = Helper::start("root_gets_on_the_bus_of_another_user", &[(SESSION, session.address())]);
    assert!(helper.says("holding"));
    let held = saver.held();
    assert_eq!(held.iter().map(|held| held.uid).collect::<Vec<_>>(), [NOBODY]);
    helper.0.kill().unwrap();
    assert!(saver.comes_to_hold(0));
}

/// The part of the one whose ids are switched.
fn switch_ids_until_killed(session: &str) {
    let ids = || -> Vec<String> {
        let status = fs::read_to_string("/proc/thread-self/status").unwrap();
        let ids = status.lines().filter(|line| line.starts_with("Uid") || line.starts_with("G"));
        ids.map(str::to_owned).collect()
    };
    let before = ids();
    let addresses = addresses(session, "unix:path=/nowhere/bus");

    let without = awake(&addresses, AMPLE);
    assert_eq!(refusals(&without)[0], "the session bus does not let user 0 in; it may be another user's");

    let with = Screen::awake_at(&addresses, Some(&nobody()), "tests", AMPLE);
    assert_eq!(refusals(&with)[0], "");
    let reach = probe_at(&addresses, Some(&nobody()), AMPLE);
    assert_eq!(reach[0].presence, Ok(Presence::Running));
    assert_eq!(before, ids(), "ids are not what they were");

    // What only root may open is closed to the one that is acted for.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bus");
    let _bus = UnixListener::bind(&path).unwrap();
    let refused = connect(&[Place::Path(path.clone())], Some(&nobody()), SAVER.bus).err().unwrap();
    let reason = format!("cannot connect to the session bus at {}: Permission denied", path.display());
    assert_eq!(refused, reason);
    assert_eq!(before, ids(), "ids are not what they were");

    // It would outlive who is killed.
    drop(folder);
    println!("holding");
    loop {
        std::thread::park();
    }
}
