//! Another user, for tests of what a user may and root does not do for one. Only root can become one, so the tests
//! of it need root.

use crate::machine::Machine;
use nix::unistd::{Uid, User, geteuid};
use std::fs::{self, Permissions};
use std::io::Write;
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The number of a user that owns nothing: `nobody` of most distributions.
pub const NOBODY: u32 = 65534;

/// Whether this process can become somebody else. If not, a line names the test that was skipped.
pub fn can_be(test: &str) -> bool {
    let root = geteuid().is_root();
    if !root {
        skipped(test, "it needs root");
    }
    root
}

/// Says that a test was skipped.
pub fn skipped(test: &str, why: &str) {
    // Not through eprintln, which is not shown for tests that pass.
    let mut out = std::io::stderr();
    writeln!(out, "skipped, because {why}: {test}").unwrap();
}

/// The user's entry among the users.
pub fn entry() -> User {
    User::from_uid(Uid::from_raw(NOBODY)).unwrap().expect("every distribution has a user nobody")
}

/// Copies a program that is to be run.
pub fn copy_program(from: &Path, to: &Path) {
    // By another process: what another test starts meanwhile would inherit the copy, open to be written, and then
    // it cannot be run.
    let copied = Command::new("cp").arg(from).arg(to).status().unwrap();
    assert!(copied.success(), "{} is not copied", from.display());
}

/// Makes of root's command line one of a user who calls `sudo`.
pub fn through_sudo(command: &mut Command) -> &mut Command {
    command
        .env("SUDO_UID", NOBODY.to_string())
        .env("SUDO_GID", NOBODY.to_string())
        .env("SUDO_USER", entry().name)
        .env("SUDO_COMMAND", "stabilize")
}

impl Machine {
    /// Makes a folder of the user's, and lets everybody come to it. With an empty name, the computer's own folder
    /// is the user's, so that the stand-in's state can be written by the user.
    pub fn give_away(&self, name: &str) -> PathBuf {
        fs::set_permissions(self.path(""), Permissions::from_mode(0o755)).unwrap();
        let path = self.path(name);
        fs::create_dir_all(&path).unwrap();
        chown(&path, Some(NOBODY), Some(NOBODY)).unwrap();
        path
    }

    /// stabilize as the user, with some words.
    pub fn stabilize_as_nobody(&self, words: &[&str]) -> Command {
        // What was built may lie where only root comes.
        let program = self.path("stabilize");
        if !program.exists() {
            copy_program(Path::new(env!("CARGO_BIN_EXE_stabilize")), &program);
        }
        let mut command = self.program(program);
        if words.contains(&"--") {
            command.args(["--settle", "0.05"]);
        }
        command.args(words).uid(NOBODY).gid(NOBODY);
        command
    }
}
