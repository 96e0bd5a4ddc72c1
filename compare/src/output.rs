//! What goes to stdout.

use anyhow::Context;
use std::io::{ErrorKind, Write};

/// Prints to stdout and ends the line; a reader that has gone away is no error.
///
/// # Errors
/// Stdout cannot be written to, such as a file on a disk that is full.
pub fn print(text: &str) -> anyhow::Result<()> {
    write(std::io::stdout().lock(), text)
}

/// Prints text with colours, which are left out where stdout is no terminal or `NO_COLOR` is set.
///
/// # Errors
/// As [`print`].
pub fn print_coloured(text: &str) -> anyhow::Result<()> {
    write(anstream::AutoStream::auto(std::io::stdout().lock()), text)
}

fn write(mut out: impl Write, text: &str) -> anyhow::Result<()> {
    match out.write_all(text.trim_end_matches('\n').as_bytes()).and_then(|()| out.write_all(b"\n")) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error).context("cannot write to stdout"),
        _ => Ok(()),
    }
}
