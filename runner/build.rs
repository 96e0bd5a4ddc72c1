//! Embeds the commit that runner is built from, for the record.
//!
//! `BROADLEAF_COMMIT=<hash>` or `<hash>-dirty` states it where there is no git: in a build from an
//! archive, or in a container that the checkout was copied into.

use std::path::Path;
use std::process::Command;

/// What a measurement depends on; see `host::commit`, which reads the same list.
const SOURCES: &str = include_str!("src/sources.txt");

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=src/sources.txt");
    println!("cargo::rerun-if-env-changed=BROADLEAF_COMMIT");
    let commit = match std::env::var("BROADLEAF_COMMIT") {
        Ok(commit) if !commit.trim().is_empty() => commit.trim().to_string(),
        _ => from_git().unwrap_or_default(),
    };
    let hash = commit.strip_suffix("-dirty").unwrap_or(&commit);
    let is_hash = matches!(hash.len(), 40 | 64) && hash.bytes().all(|byte| byte.is_ascii_hexdigit());
    assert!(
        hash.is_empty() || is_hash,
        "BROADLEAF_COMMIT must be the full hash of a commit, or that and \"-dirty\", not {commit:?}"
    );
    println!("cargo::rustc-env=BROADLEAF_COMMIT={commit}");
}

/// `HASH` or `HASH-dirty`; nothing where this is no checkout.
fn from_git() -> Option<String> {
    // A commit moves HEAD, or the branch that HEAD names, or packs it; staging moves the index.
    let branch = git(&["symbolic-ref", "--quiet", "HEAD"]);
    for name in ["HEAD", "index", "packed-refs"].into_iter().chain(branch.as_deref()) {
        if let Some(path) = git(&["rev-parse", "--path-format=absolute", "--git-path", name])
            && Path::new(&path).exists()
        {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    let head = git(&["rev-parse", "--verify", "HEAD"])?;
    let mut status = vec!["status", "--porcelain", "--"];
    status.extend(SOURCES.lines());
    let dirty = git(&status)?;
    Some(if dirty.is_empty() { head } else { format!("{head}-dirty") })
}

/// What git prints, run at the root of the workspace.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git")
        .arg("--no-optional-locks")
        .args(["-C", concat!(env!("CARGO_MANIFEST_DIR"), "/..")])
        .args(arguments)
        .output()
        .ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim_end().to_string())
}
