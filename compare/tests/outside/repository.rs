//! Temporary repositories, with nobody's settings but their own.

use record::Record;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::{TempDir, tempdir};

/// A repository in a folder with spaces in its name.
pub struct Repository {
    folder: TempDir,
    /// Its working tree.
    pub top: PathBuf,
}

impl Repository {
    /// One with a first commit and no record.
    pub fn new() -> Repository {
        let folder = tempdir().unwrap();
        let top = folder.path().join("a work tree");
        fs::create_dir(&top).unwrap();
        let repository = Repository { folder, top };
        repository.git(&["init", "-q", "-b", "main"]);
        for (name, value) in [("user.name", "Somebody"), ("user.email", "somebody@example.org")] {
            repository.git(&["config", name, value]);
        }
        repository.write("README", b"words\n");
        repository.git(&["add", "-A"]);
        repository.git(&["commit", "-qm", "Begin"]);
        repository
    }

    /// A folder beside the working tree.
    pub fn beside(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// What a program does in a folder of the working tree.
    pub fn output(&self, folder: &Path, program: &str, arguments: &[&str], set: &[(&str, &str)]) -> Output {
        Command::new(program)
            .current_dir(folder)
            .args(arguments)
            .env("GIT_CONFIG_GLOBAL", "/dev/null")
            .env("GIT_CONFIG_SYSTEM", "/dev/null")
            .env("LC_ALL", "C")
            .env_remove("GIT_DIR")
            .env_remove("GIT_INDEX_FILE")
            .env("GIT_EDITOR", "true")
            .envs(set.iter().copied())
            .output()
            .unwrap()
    }

    /// What git prints; it has to succeed.
    #[track_caller]
    pub fn git(&self, arguments: &[&str]) -> String {
        self.git_with(arguments, &[])
    }

    /// The same with variables set.
    #[track_caller]
    pub fn git_with(&self, arguments: &[&str], set: &[(&str, &str)]) -> String {
        let output = self.output(&self.top, "git", arguments, set);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "git {arguments:?}: {said}");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// What compare does.
    pub fn compare(&self, arguments: &[&str]) -> Output {
        self.output(&self.top, env!("CARGO_BIN_EXE_compare"), arguments, &[])
    }

    /// Writes a file, with the folders it needs.
    pub fn write(&self, name: &str, content: &[u8]) {
        let path = self.top.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }

    /// Writes a record that was measured in this minute of an hour.
    pub fn record(&self, name: &str, minute: u32, record: &Record) {
        let mut record = record.clone();
        record.started = format!("2026-05-01T12:{minute:02}:00Z").parse().unwrap();
        record.finished = Some(format!("2026-05-01T12:{minute:02}:59Z").parse().unwrap());
        self.write(name, &serde_json::to_vec_pretty(&record).unwrap());
    }

    /// Commits everything, and returns the message.
    #[track_caller]
    pub fn commit(&self, arguments: &[&str]) -> String {
        self.git(&["add", "-A"]);
        self.git(&[&["commit", "-q"], arguments].concat());
        self.message()
    }

    /// The message of the last commit.
    #[track_caller]
    pub fn message(&self) -> String {
        self.git(&["log", "-1", "--format=%B"]).trim_end().to_owned()
    }
}
