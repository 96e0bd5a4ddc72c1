//! What the record says about the computer and about this program.

use record::{Commit, Host, Tool};
use std::env::consts;
use std::fs;
use std::path::Path;
use std::process::Command;

/// The checkout that runner was built from, where it still exists.
const CHECKOUT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// `HASH`, `HASH-dirty` or nothing, as build.rs found it.
const BUILT_FROM: &str = env!("BROADLEAF_COMMIT");

/// What a measurement depends on, as git's pathspecs: a changed README makes no number doubtful.
const SOURCES: &str = include_str!("sources.txt");

/// The computer. Its name is told only on request, since records are made to be shared.
pub fn gather(with_name: bool) -> Host {
    let read = |path: &str| fs::read_to_string(path).unwrap_or_default();
    let release = read("/proc/sys/kernel/osrelease");
    Host {
        name: with_name.then(|| read("/proc/sys/kernel/hostname").trim().to_string()),
        os: os_name(&read("/etc/os-release")),
        kernel: match release.trim() {
            "" => "unknown".into(),
            release => format!("Linux {release}"),
        },
        cpu: cpu_model(&read("/proc/cpuinfo")),
        cores: std::thread::available_parallelism().map_or(1, |cores| cores.get() as u32),
        memory_bytes: memory_bytes(&read("/proc/meminfo")),
    }
}

/// This program: its version, and the commit it was built from.
pub fn tool() -> Tool {
    Tool {
        name: env!("CARGO_PKG_NAME").into(),
        version: env!("CARGO_PKG_VERSION").into(),
        commit: commit(BUILT_FROM, Path::new(CHECKOUT)),
    }
}

/// The commit that was built in, and whether the sources differed from it.
///
/// The build looks at the sources only when git's own files change, so it misses an edit made
/// since. While the checkout still stands at the commit that was built, its present state counts
/// too; once it has moved on, it says nothing about this program.
fn commit(built_from: &str, checkout: &Path) -> Option<Commit> {
    let (hash, built_dirty) = match built_from.strip_suffix("-dirty") {
        Some(hash) => (hash, true),
        None => (built_from, false),
    };
    if hash.is_empty() {
        return None;
    }
    let dirty = built_dirty
        || (git(checkout, &["rev-parse", "--verify", "HEAD"]).as_deref() == Some(hash) && differs(checkout));
    Some(Commit { hash: hash.into(), dirty })
}

/// Whether the sources in a checkout differ from its commit, files that git does not know included.
fn differs(checkout: &Path) -> bool {
    let mut arguments = vec!["status", "--porcelain", "--"];
    arguments.extend(SOURCES.lines());
    git(checkout, &arguments).is_some_and(|changes| !changes.is_empty())
}

fn git(checkout: &Path, arguments: &[&str]) -> Option<String> {
    let output = Command::new("git")
        .arg("--no-optional-locks")
        .arg("-C")
        .arg(checkout)
        .args(arguments)
        .output()
        .ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim_end().to_string())
}

/// `PRETTY_NAME` of os-release(5), or the system's family.
fn os_name(os_release: &str) -> String {
    os_release
        .lines()
        .find_map(|line| line.strip_prefix("PRETTY_NAME="))
        .map(|name| name.trim_matches(['"', '\'']).to_string())
        .filter(|name| !name.is_empty())
        .unwrap_or_else(|| consts::OS.into())
}

/// The first model that /proc/cpuinfo names, or the architecture: ARM kernels name no model.
fn cpu_model(cpuinfo: &str) -> String {
    cpuinfo
        .lines()
        .filter_map(|line| line.split_once(':'))
        .find(|(key, _)| key.trim() == "model name")
        .map(|(_, model)| model.split_whitespace().collect::<Vec<_>>().join(" "))
        .filter(|model| !model.is_empty())
        .unwrap_or_else(|| consts::ARCH.into())
}

/// `MemTotal` of /proc/meminfo in bytes, or 0.
fn memory_bytes(meminfo: &str) -> u64 {
    meminfo
        .lines()
        .find_map(|line| line.strip_prefix("MemTotal:"))
        .and_then(|rest| rest.trim().strip_suffix("kB"))
        .and_then(|kib| kib.trim().parse::<u64>().ok())
        .map_or(0, |kib| kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn system_files_are_understood() {
        let os_release = "NAME=\"Debian\"\nPRETTY_NAME=\"Debian GNU/Linux 12 (bookworm)\"\n";
        assert_eq!(os_name(os_release), "Debian GNU/Linux 12 (bookworm)");
        assert_eq!(os_name(""), consts::OS);
        let cpuinfo = "processor\t: 0\nmodel\t\t: 85\nmodel name\t: Some   CPU @ 2.00GHz\n";
        assert_eq!(cpu_model(cpuinfo), "Some CPU @ 2.00GHz");
        assert_eq!(cpu_model("processor\t: 0\n"), consts::ARCH);
        assert_eq!(memory_bytes("MemTotal:       16 kB\nMemFree: 1 kB\n"), 16 * 1024);
        assert_eq!(memory_bytes("nonsense"), 0);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn this_computer_is_described() {
        let host = gather(false);
        assert_eq!(host.name, None);
        assert!(host.cores > 0 && host.memory_bytes > 1 << 20, "{host:?}");
        assert!(host.kernel.starts_with("Linux "), "{host:?}");
        assert!(gather(true).name.is_some_and(|name| !name.is_empty()));
    }

    #[test]
    fn this_program_is_described() {
        let tool = tool();
        assert_eq!(tool.name, "runner");
        assert_eq!(tool.commit.is_some(), !BUILT_FROM.is_empty());
        if let Some(commit) = tool.commit {
            assert!(commit.hash.bytes().all(|byte| byte.is_ascii_hexdigit()), "{commit:?}");
        }
    }

    /// A checkout with one commit, and that commit's hash.
    fn checkout() -> (tempfile::TempDir, String) {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        fs::create_dir(at.join("runner")).unwrap();
        fs::write(at.join("runner/main.rs"), "one").unwrap();
        fs::write(at.join("README.md"), "one").unwrap();
        let identity = ["-c", "user.name=a", "-c", "user.email=a@example.org"];
        let commit = [&identity[..], &["commit", "-q", "--no-verify", "-m", "x"]].concat();
        for arguments in [&["init", "-q"][..], &["add", "."], &commit] {
            git(at, arguments).unwrap_or_else(|| panic!("git {arguments:?}"));
        }
        let head = git(at, &["rev-parse", "HEAD"]).unwrap();
        (folder, head)
    }

    #[test]
    fn an_edit_since_the_build_makes_it_dirty() {
        let (folder, head) = checkout();
        let dirty = || commit(&head, folder.path()).unwrap().dirty;
        assert!(!dirty());
        fs::write(folder.path().join("README.md"), "two").unwrap();
        fs::write(folder.path().join("record.json"), "{}").unwrap();
        assert!(!dirty(), "neither of these is a source");
        fs::write(folder.path().join("runner/new.comp"), "").unwrap();
        assert!(dirty(), "the build takes in every shader it finds");
        fs::remove_file(folder.path().join("runner/new.comp")).unwrap();
        assert!(!dirty());
        fs::write(folder.path().join("runner/main.rs"), "two").unwrap();
        assert!(dirty());
    }

    #[test]
    fn a_checkout_that_moved_on_says_nothing() {
        let (folder, _) = checkout();
        fs::write(folder.path().join("runner/main.rs"), "two").unwrap();
        let other = "0123456789012345678901234567890123456789";
        let found = commit(other, folder.path()).unwrap();
        assert_eq!((found.hash.as_str(), found.dirty), (other, false));
        let found = commit(&format!("{other}-dirty"), folder.path()).unwrap();
        assert_eq!((found.hash.as_str(), found.dirty), (other, true));
        assert_eq!(commit(other, &folder.path().join("gone")).unwrap().hash, other);
        assert_eq!(commit("", folder.path()), None);
    }
}
