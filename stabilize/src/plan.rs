//! What would be done.

use crate::args::Options;
use crate::clocks::Wanted;
use crate::gpu::{Change, Domain, Found, Gpu};
use crate::user::Invoker;
use std::io::{self, Write};

/// Prints it.
///
/// # Errors
/// Nobody reads it.
pub fn print(
    options: &Options,
    found: &Found,
    chosen: &[(u32, &dyn Gpu)],
    invoker: Option<&Invoker>,
    command: &[String],
) -> io::Result<()> {
    let mut out = io::stdout().lock();
    for why in &found.missing {
        writeln!(out, "not to be had: {why}")?;
    }
    for &(index, gpu) in chosen {
        let identity = gpu.identity();
        writeln!(out, "GPU {index}: {} ({}, driver {})", identity.name, identity.uuid, identity.driver)?;
        if options.observe {
            writeln!(out, "  nothing is changed")?;
            continue;
        }
        for step in steps(options, gpu) {
            writeln!(out, "  {step}")?;
        }
    }
    if chosen.is_empty() {
        writeln!(out, "no GPU is stabilized")?;
    }
    if !options.may_sleep && !options.observe {
        writeln!(
            out,
            "screen saver, idling and sleep are kept off over D-Bus (`stabilize doctor` tries the buses)"
        )?;
    }
    if let Some(celsius) = options.wait_below {
        let limit = options.wait_limit.as_secs_f64();
        writeln!(out, "first, wait until the GPU is below {celsius} °C, {limit} s at most")?;
    }
    let who = match invoker {
        Some(invoker) if !options.as_root => format!(" as {}", invoker.name),
        _ => String::new(),
    };
    writeln!(out, "then run{who}: {}", quoted(command))?;
    if !options.observe && !chosen.is_empty() {
        writeln!(out, "then put everything back, also after SIGKILL")?;
    }
    writeln!(
        out,
        "trusted if each reason slows the GPU down for at most {}% of the run",
        100.0 * options.tolerance
    )
}

fn steps(options: &Options, gpu: &dyn Gpu) -> Vec<String> {
    let mut steps = Vec::new();
    match gpu.preparations() {
        Ok(changes) => {
            for change in changes {
                let undo = gpu.undo_of(&change).ok().flatten();
                let undo = undo.map_or_else(String::new, |undo| format!(", and {undo} at the end"));
                steps.push(format!("{change}{undo}"));
            }
        }
        Err(trouble) => steps.push(format!("cannot be prepared: {trouble}")),
    }
    let to = options.restore_to.unwrap_or_default();
    for (domain, wanted, to) in [
        (Domain::Graphics, options.graphics_clock, to.graphics),
        (Domain::Memory, options.memory_clock, to.memory),
    ] {
        let highest = gpu.highest(domain).map_or_else(|_| "the highest".into(), |mhz| format!("{mhz} MHz"));
        let what = match (wanted, domain) {
            (Wanted::Keep, _) => "left as it is".to_owned(),
            (Wanted::Auto, Domain::Graphics) => {
                format!("locked to {highest}, then to 0.98 of what the GPU really runs at")
            }
            (Wanted::Auto, Domain::Memory) => {
                format!("locked to {highest}, unless that changes other clocks")
            }
            (Wanted::Max, _) => format!("locked to {highest}"),
            (Wanted::Base, _) => match gpu.base(domain) {
                Ok(mhz) => format!("locked to {mhz} MHz"),
                Err(trouble) => format!("not locked: the driver does not tell its base ({trouble})"),
            },
            (Wanted::Mhz(mhz), _) => format!("locked to {mhz} MHz, or the nearest step"),
        };
        let end = match (wanted, to) {
            (Wanted::Keep, _) => String::new(),
            (_, Some(mhz)) => format!("; {} at the end", Change::Lock { domain, mhz }),
            (_, None) => "; free at the end".into(),
        };
        let obstacle = gpu.obstacle(domain).filter(|_| wanted != Wanted::Keep);
        let obstacle = obstacle.map_or_else(String::new, |trouble| format!(" (but: {trouble})"));
        steps.push(format!("{domain} {what}{end}{obstacle}"));
    }
    steps
}

/// This command line with `sudo` before it.
pub fn with_sudo() -> String {
    let program = std::env::current_exe().map(|path| path.to_string_lossy().into_owned());
    let mut words = vec!["sudo".to_owned(), program.unwrap_or_else(|_| "stabilize".into())];
    words.extend(std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned()));
    quoted(&words)
}

/// Words as a shell reads them.
fn quoted(words: &[String]) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:%+@".contains(c);
    let quote = |word: &String| {
        if !word.is_empty() && word.chars().all(plain) {
            word.clone()
        } else {
            format!("'{}'", word.replace('\'', r"'\''"))
        }
    };
    words.iter().map(quote).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_for_a_shell() {
        let words = ["sh", "-c", "exit 7", "", "it's"].map(String::from);
        assert_eq!(quoted(&words), r"sh -c 'exit 7' '' 'it'\''s'");
    }
}
