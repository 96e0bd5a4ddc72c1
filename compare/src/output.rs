//! What goes to stdout.

use anyhow::Context;
use std::io::{ErrorKind, Write};

/// Prints to stdout and ends the line; a reader that has gone away is no error.
///
/// # Errors
/// Stdout cannot be written to, such as a file on a disk that is full.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.trim_end_matches('\n').as_bytes()).and_then(|()| out.write_all(b"\n")) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error).context("cannot write to stdout"),
        _ => Ok(()),
    }
}
