//! What the hook does.

use super::message::Message;
use super::{occasion, pair};
use crate::git::Git;
use crate::say;
use anyhow::Context;
use std::fs;
use std::path::Path;

/// Adds the text to the message. Whatever is wrong is told; it is no reason not to commit.
pub fn run(file: &Path, source: Option<&str>) {
    if let Err(error) = attempt(file, source) {
        say(format_args!("the message stays as it is: {error:#}"));
    }
}

fn attempt(file: &Path, source: Option<&str>) -> anyhow::Result<()> {
    let context = || format!("cannot read {}", file.display());
    let mut message = fs::read(file).with_context(context)?;
    let git = Git::here()?;
    if occasion::exempt(&git, source, &message)?.is_some() {
        return Ok(());
    }
    let said = pair::said(&git)?;
    if said.text.is_none() && said.remarks.is_empty() {
        return Ok(());
    }
    let comment = comment(&git, &message)?;
    if let Some(text) = &said.text {
        message = Message::new(&message, &comment).with(text);
    }
    let remarked = if strips_comments(&git)? {
        Message::new(&message, &comment).with_remarks(&said.remarks)
    } else {
        None
    };
    match remarked {
        Some(remarked) => message = remarked,
        None => said.remarks.iter().for_each(|remark| say(remark.trim_start_matches("compare: "))),
    }
    record::replace(file, |out| out.write_all(&message))
        .with_context(|| format!("cannot write {}", file.display()))
}

/// Whether comments are left out of the message in the end: without an editor (git says so by the name `:`) and with
/// some settings they are not.
fn strips_comments(git: &Git) -> anyhow::Result<bool> {
    if std::env::var_os("GIT_EDITOR").is_some_and(|editor| editor == ":") {
        return Ok(false);
    }
    let cleanup = git.line(["config", "--get", "commit.cleanup"])?;
    Ok(!matches!(cleanup.as_deref(), Some("whitespace" | "verbatim")))
}

/// What comments begin with.
fn comment(git: &Git, message: &[u8]) -> anyhow::Result<String> {
    let set = git.line(["config", "--get-regexp", "^core\\.comment(char|string)$"])?;
    let set = set.and_then(|line| line.split_once(' ').map(|(_, value)| value.to_owned()));
    Ok(match set {
        Some(set) if set == "auto" => {
            // Git has chosen one that no line began with, and its own comments are last.
            let last = message.split(|&byte| byte == b'\n').rfind(|line| !line.is_empty());
            let chosen = last.and_then(|line| line.first()).filter(|first| b"#;@!$%^&|:".contains(first));
            chosen.map_or('#', |&first| char::from(first)).into()
        }
        Some(set) if !set.is_empty() => set,
        _ => "#".into(),
    })
}
