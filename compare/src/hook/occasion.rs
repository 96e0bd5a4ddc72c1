//! Which commits get a text.

use crate::git::{Git, path};
use std::fs;

/// Files and folders in git's own folder while it makes commits out of others.
const UNDER_WAY: [&str; 6] =
    ["MERGE_HEAD", "CHERRY_PICK_HEAD", "REVERT_HEAD", "rebase-merge", "rebase-apply", "sequencer"];

/// Why a commit gets no text; nothing where it gets one.
///
/// `source` is what git gives its hook: nothing, `message`, `template`, `merge`, `squash` or `commit`.
///
/// # Errors
/// There is no `git`.
pub fn exempt(git: &Git, source: Option<&str>, message: &[u8]) -> anyhow::Result<Option<&'static str>> {
    if let Some(reason) = by_source(source).or_else(|| by_message(message)) {
        return Ok(Some(reason));
    }
    // With --amend -m the source is the message.
    if parent_amends() {
        return Ok(Some("an amend"));
    }
    for name in UNDER_WAY {
        let mut found = git.output(["rev-parse", "--git-path", name])?;
        found.pop();
        if git.top.join(path(&found)).exists() {
            return Ok(Some("made from another commit"));
        }
    }
    Ok(None)
}

fn by_source(source: Option<&str>) -> Option<&'static str> {
    match source {
        Some("merge") => Some("a merge"),
        Some("squash") => Some("a squash"),
        Some("commit") => Some("an amend"),
        _ => None,
    }
}

fn by_message(message: &[u8]) -> Option<&'static str> {
    let begins = ["fixup! ", "squash! ", "amend! "];
    if begins.iter().any(|begin| message.starts_with(begin.as_bytes())) {
        return Some("a fixup");
    }
    // Somebody has put it there already.
    let text = String::from_utf8_lossy(message);
    text.contains("Performance changes from the last benchmark:").then_some("told already")
}

/// Whether the `git` that runs the hook was told to amend, where the system tells its command line.
fn parent_amends() -> bool {
    let Ok(parent) = std::env::var("COMPARE_HOOK_GIT") else { return false };
    let is_number = !parent.is_empty() && parent.bytes().all(|byte| byte.is_ascii_digit());
    is_number && fs::read(format!("/proc/{parent}/cmdline")).is_ok_and(|line| amends(&line))
}

/// Git takes options for those that they are the beginning of, if there is only one such.
fn amends(command_line: &[u8]) -> bool {
    let arguments = command_line.split(|&byte| byte == 0).skip(1).take_while(|argument| argument != b"--");
    arguments.into_iter().any(|argument| argument.len() >= "--am".len() && b"--amend".starts_with(argument))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_may_be_cut_short() {
        assert!(amends(b"git\0commit\0--amend\0-m\0x\0"));
        assert!(amends(b"git\0commit\0--am\0"));
        assert!(!amends(b"git\0commit\0-a\0-m\0words about --amend\0--\0--amend\0"));
        assert!(!amends(b""));
    }

    #[test]
    fn messages_tell_fixups() {
        assert!(by_message(b"fixup! Measure\n").is_some());
        assert!(by_message(b"squash! Measure\n\nmore").is_some());
        assert!(by_message(b"Measure after the fixup! of yesterday\n").is_none());
        assert!(by_message(b"\n\xff").is_none());
        assert_eq!(
            (by_source(None), by_source(Some("message")), by_source(Some("template"))),
            (None, None, None)
        );
    }
}
