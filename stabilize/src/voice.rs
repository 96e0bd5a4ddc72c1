//! What the user is told on stderr.

use std::fmt;
use std::io::Write;

/// Says something on stderr. If nobody can hear it, that is no reason to end: everything is still to be put back.
pub fn say(text: fmt::Arguments<'_>) {
    let _ = writeln!(std::io::stderr(), "stabilize: {text}");
}

/// What the user is told while it happens, and finds in the report.
pub struct Voice {
    quiet: bool,
    /// All of it.
    pub said: Vec<String>,
}

impl Voice {
    /// One that speaks, or only keeps what it would say.
    pub fn new(quiet: bool) -> Voice {
        Voice { quiet, said: Vec::new() }
    }

    /// Says something.
    pub fn say(&mut self, text: String) {
        if !self.quiet {
            say(format_args!("{text}"));
        }
        self.said.push(text);
    }

    /// Says something that must be heard.
    pub fn insist(&mut self, text: String) {
        say(format_args!("{text}"));
        self.said.push(text);
    }
}
