//! Whose rights are used for what: root's for the clocks, and those of the user who called `sudo` for all else.
//!
//! `sudo` itself is rarely there where tests run, so its variables stand in for it.

use crate::machine::{Machine, Ran, appears, eventually};
use crate::nobody::{self, NOBODY};
use nix::sys::signal::{Signal, kill};
use nix::unistd::{Gid, Pid, getgrouplist};
use nvml_stand_in::State;
use record::Report;
use std::ffi::CString;
use std::fs::{self, Permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// A computer whose clocks only root may lock.
fn root_only() -> Machine {
    let machine = Machine::new();
    machine.edit(|state| state.root_only = true);
    machine
}

/// Runs stabilize as root, for the user who called `sudo`. The screen is left out, because root takes the system's
/// bus from no user's variable.
fn sudo(machine: &Machine, words: &[&str]) -> Ran {
    Ran::of(nobody::through_sudo(&mut machine.stabilize(&[&["--may-sleep"], words].concat())))
}

fn owner(path: &Path) -> u32 {
    fs::symlink_metadata(path).unwrap_or_else(|error| panic!("{}: {error}", path.display())).uid()
}

fn set_mode(path: &Path, mode: u32) {
    fs::set_permissions(path, Permissions::from_mode(mode)).unwrap();
}

/// A script that says who runs it.
const WHO: &str = "grep -E '^(Uid|Gid|Groups|CapEff):' /proc/self/status; echo $HOME $USER $LOGNAME; \
                   env | grep ^SUDO_ | sort";

/// What [`WHO`] then says, of a user without rights.
fn who(uid: u32, groups: &[Gid], home: &str, name: &str) -> Vec<String> {
    let four = |id: u32| vec![id.to_string(); 4].join(" ");
    let mut groups: Vec<u32> = groups.iter().map(|group| group.as_raw()).collect();
    groups.sort_unstable();
    let groups = groups.iter().map(u32::to_string).collect::<Vec<_>>().join(" ");
    vec![
        format!("Uid: {}", four(uid)),
        format!("Gid: {}", four(uid)),
        format!("Groups: {groups}"),
        "CapEff: 0000000000000000".into(),
        format!("{home} {name} {name}"),
    ]
}

/// Lines with single spaces.
fn tidy(text: &str) -> Vec<String> {
    text.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
}

#[test]
fn under_sudo_the_command_is_the_users_and_the_locks_are_roots() {
    if !nobody::can_be("under_sudo_the_command_is_the_users_and_the_locks_are_roots") {
        return;
    }
    let machine = root_only();
    let before = machine.settings();
    let home = machine.give_away("home");
    let (report, during) = (home.join("out/report.json"), home.join("during.json"));
    let script = format!("cp \"$NVML_STAND_IN\" {}; {WHO}", during.display());
    let ran = sudo(&machine, &["--report", report.to_str().unwrap(), "--", "sh", "-c", &script]);
    assert_eq!(ran.status, Some(0), "{ran:?}");
    let entry = nobody::entry();
    let name = CString::new(entry.name.clone()).unwrap();
    let groups = getgrouplist(&name, entry.gid).unwrap();
    assert_eq!(tidy(&ran.out), who(NOBODY, &groups, entry.dir.to_str().unwrap(), &entry.name));
    let held = State::read(&during).unwrap().gpus[0].settings();
    assert!(held.locked_graphics.is_some() && held.locked_memory.is_some(), "{held:?} {ran:?}");
    assert_eq!(machine.settings(), before);
    // The folder that was missing, and the report in it, are the user's.
    assert_eq!((owner(report.parent().unwrap()), owner(&report)), (NOBODY, NOBODY));
    assert_eq!(Report::read(&report).unwrap().status, Some(0));
}

#[test]
fn under_sudo_the_command_is_roots_when_asked() {
    if !nobody::can_be("under_sudo_the_command_is_roots_when_asked") {
        return;
    }
    let machine = root_only();
    let report = machine.give_away("home").join("report.json");
    let words = ["--as-root", "--report", report.to_str().unwrap(), "--", "sh", "-c", WHO];
    let ran = sudo(&machine, &words);
    let own = Ran::of(machine.program("sh").args(["-c", WHO]));
    let said = tidy(&ran.out);
    assert_eq!(said[..5], tidy(&own.out)[..5], "{ran:?}");
    assert!(said[5..].contains(&format!("SUDO_UID={NOBODY}")), "{ran:?}");
    assert_eq!(owner(&report), NOBODY);
}

#[test]
fn a_user_without_an_entry_has_the_group_that_sudo_tells() {
    if !nobody::can_be("a_user_without_an_entry_has_the_group_that_sudo_tells") {
        return;
    }
    const STRANGER: u32 = 3_765_432_101;
    let machine = root_only();
    let stranger = |uid: &str| {
        let mut command = machine.stabilize(&["--may-sleep", "--", "sh", "-c", WHO]);
        Ran::of(command.env("SUDO_UID", uid).env("SUDO_GID", STRANGER.to_string()).env("SUDO_USER", "jo"))
    };
    let ran = stranger(&STRANGER.to_string());
    assert_eq!(tidy(&ran.out), who(STRANGER, &[Gid::from_raw(STRANGER)], "/", "jo"), "{ran:?}");
    let ran = stranger("jo");
    assert!(ran.status == Some(125) && ran.err.contains("SUDO_UID is no number"), "{ran:?}");
}

#[test]
fn under_sudo_clocks_are_put_back_by_root_also_after_a_sudden_death() {
    if !nobody::can_be("under_sudo_clocks_are_put_back_by_root_also_after_a_sudden_death") {
        return;
    }
    let machine = root_only();
    let before = machine.settings();
    let ready = machine.give_away("home").join("ready");
    let script = format!("echo $$ > {0}.new; mv {0}.new {0}; exec sleep 60", ready.display());
    // A temporary report would stay behind.
    let report = machine.path("home/report.json");
    let words = ["--may-sleep", "--report", report.to_str().unwrap(), "--", "sh", "-c", &script];
    let mut command = machine.stabilize(&words);
    let mut child = nobody::through_sudo(&mut command).stderr(Stdio::null()).spawn().unwrap();
    appears(&ready);
    assert_ne!(machine.settings(), before);
    child.kill().unwrap();
    child.wait().unwrap();
    eventually(Duration::from_secs(2), "the clocks are put back", || machine.settings() == before);
    // The next one comes once the watchdog has ended.
    assert_eq!(machine.run(&["--strict", "--queue", "20", "--", "true"]).status, Some(0));
    let command: i32 = fs::read_to_string(&ready).unwrap().trim().parse().unwrap();
    kill(Pid::from_raw(command), Signal::SIGKILL).unwrap();
}

#[test]
fn under_sudo_no_report_is_written_where_the_user_cannot() {
    if !nobody::can_be("under_sudo_no_report_is_written_where_the_user_cannot") {
        return;
    }
    let machine = root_only();
    let (home, private) = (machine.give_away("home"), machine.path("private"));
    fs::create_dir(&private).unwrap();
    set_mode(&private, 0o700);
    let (report, touched) = (private.join("report.json"), home.join("touched"));
    let words = ["--report", report.to_str().unwrap(), "--", "touch", touched.to_str().unwrap()];
    let ran = sudo(&machine, &words);
    assert_eq!(ran.status, Some(125), "{ran:?}");
    assert!(ran.err.contains(&format!("cannot write the report to {}", report.display())), "{ran:?}");
    assert!(!touched.exists() && !report.exists() && !machine.was_touched(), "{ran:?}");
    // Root itself could.
    assert_eq!(machine.run(&words).status, Some(0));
    assert!(touched.exists() && report.exists());
}

#[test]
fn under_sudo_a_link_for_a_report_leads_nowhere() {
    if !nobody::can_be("under_sudo_a_link_for_a_report_leads_nowhere") {
        return;
    }
    let machine = root_only();
    let (precious, report) = (machine.path("precious"), machine.give_away("home").join("report.json"));
    fs::write(&precious, "x").unwrap();
    symlink(&precious, &report).unwrap();
    let ran = sudo(&machine, &["--report", report.to_str().unwrap(), "--", "true"]);
    assert_eq!(ran.status, Some(0), "{ran:?}");
    assert_eq!((fs::read_to_string(&precious).unwrap().as_str(), owner(&precious)), ("x", 0));
    // The link gave way to the report.
    assert!(fs::symlink_metadata(&report).unwrap().is_file());
    assert_eq!(owner(&report), NOBODY);
}

#[test]
fn under_sudo_a_report_may_have_a_relative_path() {
    if !nobody::can_be("under_sudo_a_report_may_have_a_relative_path") {
        return;
    }
    let machine = root_only();
    let home = machine.give_away("home");
    let script = "cd /; cat \"$STABILIZE_REPORT\"";
    let mut command =
        machine.stabilize(&["--may-sleep", "--report", "report.json", "--", "sh", "-c", script]);
    let ran = Ran::of(nobody::through_sudo(command.current_dir(&home)));
    let read: Report = serde_json::from_str(&ran.out).unwrap_or_else(|error| panic!("{error}: {ran:?}"));
    assert_eq!(read.status, None);
    assert_eq!(owner(&home.join("report.json")), NOBODY);
}

#[test]
fn under_sudo_the_command_can_read_a_report_that_nobody_asked_for() {
    if !nobody::can_be("under_sudo_the_command_can_read_a_report_that_nobody_asked_for") {
        return;
    }
    let machine = root_only();
    let script = "stat -c '%n %u' \"$STABILIZE_REPORT\" >&2; cat \"$STABILIZE_REPORT\"";
    let ran = sudo(&machine, &["-q", "--", "sh", "-c", script]);
    let read: Report = serde_json::from_str(&ran.out).unwrap_or_else(|error| panic!("{error}: {ran:?}"));
    assert!(read.gpus[0].policy.graphics.locked_mhz.is_some());
    let (path, owner) = ran.err.trim().rsplit_once(' ').unwrap();
    assert_eq!(owner, NOBODY.to_string());
    assert!(!fs::exists(path).unwrap());
}

/// Renaming a file to `/dev/null` would take that away from everybody.
#[test]
fn a_report_replaces_nothing_but_a_file() {
    let machine = Machine::new();
    for kind in ["pipe", "folder"] {
        let path = machine.path(kind);
        match kind {
            "pipe" => nix::unistd::mkfifo(&path, nix::sys::stat::Mode::S_IRWXU).unwrap(),
            _ => fs::create_dir(&path).unwrap(),
        }
        let before = fs::metadata(&path).unwrap().file_type();
        let link = machine.path(&format!("link to {kind}"));
        symlink(&path, &link).unwrap();
        for path in [path.as_path(), &link] {
            let ran = machine.run(&["--report", path.to_str().unwrap(), "--", "true"]);
            assert!(ran.status == Some(125) && ran.err.contains("it is no file"), "{ran:?}");
        }
        assert_eq!(fs::metadata(&path).unwrap().file_type(), before);
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink() && !machine.was_touched());
    }
}

#[test]
fn under_sudo_journals_are_kept_in_no_folder_of_the_users() {
    if !nobody::can_be("under_sudo_journals_are_kept_in_no_folder_of_the_users") {
        return;
    }
    let machine = root_only();
    let folder = machine.give_away("users");
    let run = |words: &[&str]| {
        let mut command = machine.stabilize(words);
        Ran::of(nobody::through_sudo(command.env("STABILIZE_STATE_DIR", &folder)))
    };
    let ran = run(&["--may-sleep", "--", "sh", "-c", "exit 7"]);
    let why = format!("cannot keep a journal in {}: it belongs to another user ({NOBODY})", folder.display());
    for clock in ["graphics", "memory"] {
        assert!(ran.err.contains(&format!("{clock} clock of GPU 0 not locked: {why}\n")), "{ran:?}");
    }
    assert_eq!(ran.status, Some(7));
    let touched = machine.give_away("home").join("touched");
    let ran = run(&["--may-sleep", "--strict", "--", "touch", touched.to_str().unwrap()]);
    assert!(ran.status == Some(125) && ran.err.contains(&why) && !touched.exists(), "{ran:?}");
    assert!(run(&["doctor"]).out.contains(&format!("journals: {} is somebody else's", folder.display())));
    assert!(!machine.was_touched());
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 0);
}

#[test]
fn a_journal_that_another_could_have_written_is_refused() {
    let machine = Machine::new();
    let (folder, precious) = (machine.path("state"), machine.path("precious"));
    fs::create_dir(&folder).unwrap();
    set_mode(&folder, 0o755);
    let journal = folder.join(format!("{}.journal", machine.state().gpus[0].uuid));
    let refused = |why: &str| {
        let ran = machine.run(&["--", "sh", "-c", "exit 7"]);
        let line = format!("graphics clock of GPU 0 not locked: cannot open {}: {why}", journal.display());
        assert!(ran.status == Some(7) && ran.err.contains(&line), "{ran:?}");
        let touched = machine.path("touched");
        let ran = machine.run(&["--strict", "--", "touch", touched.to_str().unwrap()]);
        assert!(ran.status == Some(125) && ran.err.contains(&line) && !touched.exists(), "{ran:?}");
        let ran = machine.run(&["restore"]);
        assert!(ran.status == Some(125) && ran.err.contains(why), "{ran:?}");
        assert!(!machine.was_touched());
    };
    fs::write(&precious, "x").unwrap();
    symlink(&precious, &journal).unwrap();
    refused("ELOOP");
    assert_eq!(fs::read_to_string(&precious).unwrap(), "x");
    fs::remove_file(&journal).unwrap();
    fs::write(&journal, "").unwrap();
    set_mode(&journal, 0o666);
    refused("others may write to it (mode 666)");
    // It is the mode alone.
    set_mode(&journal, 0o644);
    assert_eq!(machine.run(&["--strict", "--", "true"]).status, Some(0));
    assert!(machine.was_touched());
}

#[test]
fn an_ordinary_user_is_told_how_to_call_sudo() {
    if !nobody::can_be("an_ordinary_user_is_told_how_to_call_sudo") {
        return;
    }
    let machine = root_only();
    machine.give_away("");
    let before = machine.settings();
    let ran = Ran::of(&mut machine.stabilize_as_nobody(&["--", "sh", "-c", "exit 7"]));
    assert_eq!(ran.status, Some(7), "{ran:?}");
    let program = fs::canonicalize(machine.path("stabilize")).unwrap();
    let line =
        format!("stabilize: to lock clocks: sudo {} --settle 0.05 -- sh -c 'exit 7'", program.display());
    for line in ["stabilize: graphics clock of GPU 0 not locked: no permission", &line] {
        assert!(ran.err.lines().any(|said| said == line), "{line} {ran:?}");
    }
    let touched = machine.path("touched");
    let words = ["--strict", "--", "touch", touched.to_str().unwrap()];
    let ran = Ran::of(&mut machine.stabilize_as_nobody(&words));
    assert!(ran.status == Some(125) && !touched.exists(), "{ran:?}");
    assert_eq!(machine.settings(), before);
    let doctor = Ran::of(&mut machine.stabilize_as_nobody(&["doctor"]));
    for part in ["an ordinary user", "cannot be locked: no permission", "fix: sudo /"] {
        assert!(doctor.out.contains(part), "{part} {doctor:?}");
    }
}

#[test]
fn an_ordinary_user_locks_what_the_driver_lets_everybody_lock() {
    if !nobody::can_be("an_ordinary_user_locks_what_the_driver_lets_everybody_lock") {
        return;
    }
    let machine = Machine::new();
    machine.give_away("");
    let before = machine.settings();
    let during = machine.path("during.json");
    let script = format!("cp \"$NVML_STAND_IN\" {}; id -u", during.display());
    let mut command = machine.stabilize_as_nobody(&["--strict", "--", "sh", "-c", &script]);
    // Nobody who is not root has been called by sudo.
    let ran = Ran::of(command.env("SUDO_UID", "1").env("SUDO_GID", "1"));
    assert_eq!((ran.status, ran.out.trim()), (Some(0), NOBODY.to_string().as_str()), "{ran:?}");
    assert!(State::read(&during).unwrap().gpus[0].settings().locked_graphics.is_some());
    assert_eq!(machine.settings(), before);
    let folder = machine.path("state");
    assert_eq!(owner(&folder), NOBODY);
    assert_eq!(owner(&fs::read_dir(&folder).unwrap().next().unwrap().unwrap().path()), NOBODY);
}

#[test]
fn an_ordinary_user_sees_who_holds_the_gpu_where_journals_can_be_read() {
    if !nobody::can_be("an_ordinary_user_sees_who_holds_the_gpu_where_journals_can_be_read") {
        return;
    }
    let machine = root_only();
    machine.give_away("");
    let mut child = machine.stabilize(&["-q", "--", "sleep", "60"]).stderr(Stdio::null()).spawn().unwrap();
    let status = || Ran::of(&mut machine.stabilize_as_nobody(&["status"]));
    let holder = format!("held by process {} of root", child.id());
    eventually(Duration::from_secs(20), "the GPU is held", || status().out.contains(&holder));
    set_mode(&machine.path("state"), 0o700);
    let ran = status();
    assert!(ran.status == Some(0) && ran.err.is_empty(), "{ran:?}");
    // Nothing is said that is not known.
    assert!(ran.out.contains("cannot read") && ran.out.contains("state"), "{ran:?}");
    assert!(ran.out.contains("GPU 0") && !ran.out.contains("nobody"), "{ran:?}");
    kill(Pid::from_raw(child.id().cast_signed()), Signal::SIGTERM).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(128 + Signal::SIGTERM as i32));
}

#[test]
fn it_refuses_to_have_the_set_user_id_bit() {
    const TEST: &str = "it_refuses_to_have_the_set_user_id_bit";
    if !nobody::can_be(TEST) {
        return;
    }
    let machine = Machine::new();
    set_mode(&machine.path(""), 0o755);
    let with_bit = |program: &Path, name: &str| {
        let copy = machine.path(name);
        nobody::copy_program(program, &copy);
        set_mode(&copy, 0o4755);
        let mut command = Command::new(copy);
        command.uid(NOBODY).gid(NOBODY).current_dir("/");
        command
    };
    // Where the bit has no effect, as on a file system that is mounted so, there is nothing to refuse.
    let id = Ran::of(with_bit(Path::new("/usr/bin/id"), "id").arg("-u"));
    if id.out.trim() != "0" {
        return nobody::skipped(TEST, "the bit has no effect here");
    }
    let stabilize = Path::new(env!("CARGO_BIN_EXE_stabilize"));
    for words in [&["--", "id", "-u"][..], &["doctor"]] {
        let ran = Ran::of(with_bit(stabilize, "stabilize").args(words));
        assert!(ran.status == Some(125) && ran.out.is_empty(), "{ran:?}");
        assert!(ran.err.contains("must not have the set-user-ID bit; start it through sudo"), "{ran:?}");
    }
}

#[test]
fn the_real_sudo_changes_no_user() {
    let machine = root_only();
    let works = Command::new("sudo").args(["-n", "true"]).stdin(Stdio::null()).stderr(Stdio::null()).status();
    if !works.is_ok_and(|status| status.success()) {
        return nobody::skipped(
            "the_real_sudo_changes_no_user",
            "there is no sudo that asks for no password",
        );
    }
    let before = machine.settings();
    let mut command = Command::new("sudo");
    command.args(["-n", "env"]);
    // sudo lets none of the stand-ins' variables through.
    for (name, value) in [
        ("LD_LIBRARY_PATH", machine.path("")),
        (nvml_stand_in::STATE_VARIABLE, machine.path("gpu.json")),
        ("STABILIZE_STATE_DIR", machine.path("state")),
        ("STABILIZE_SYSFS", machine.path("no-sysfs")),
    ] {
        command.arg(format!("{name}={}", value.display()));
    }
    command.args([env!("CARGO_BIN_EXE_stabilize"), "--strict", "--may-sleep", "--settle", "0.05"]);
    let ran = Ran::of(command.args(["--", "sh", "-c", "id -u; id -g"]));
    let own = Ran::of(Command::new("sh").args(["-c", "id -u; id -g"]));
    assert_eq!((ran.status, ran.out.as_str()), (Some(0), own.out.as_str()), "{ran:?}");
    assert!(machine.was_touched());
    assert_eq!(machine.settings(), before);
    // Journals of root's, in a folder that may go as another user.
    Ran::of(Command::new("sudo").args(["-n", "rm", "-r"]).arg(machine.path("state")));
}
