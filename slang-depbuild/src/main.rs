//! Command line of slang-depbuild: compiles a Slang kernel, and says what it was made from.

mod args;

use args::Cli;
use clap::Parser;
use slang_depbuild::{Error, Slangc, Validation, compile};
use std::process::ExitCode;

const FAILED: u8 = 1;
const USAGE: u8 = 2;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // A reader that has gone away is no failure.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { USAGE } else { 0 });
        }
    };
    let (quiet, verbose) = (cli.quiet, cli.verbose);
    let slangc = match cli.slangc.as_ref().map_or_else(Slangc::find, Slangc::at) {
        Ok(slangc) => slangc,
        Err(missing) => {
            say(missing);
            return ExitCode::from(FAILED);
        }
    };
    if verbose {
        let version = slangc.version().unwrap_or_else(|why| why.to_string());
        say(format_args!("{} ({version})", slangc.path().display()));
    }
    let job = cli.job();
    match compile(&slangc, &job) {
        Ok(compiled) => {
            if !quiet {
                eprint!("{}", compiled.messages);
                if compiled.validation == Validation::NoValidator {
                    say(format_args!("{}: not validated, there is no spirv-val here", job.output.display()));
                }
            }
            if verbose {
                for source in &compiled.dependencies {
                    say(format_args!("{}: made from {}", job.output.display(), source.display()));
                }
            }
            ExitCode::SUCCESS
        }
        // These are slangc's own words, as an editor understands them.
        Err(Error::Rejected(messages)) => {
            eprint!("{messages}");
            if !messages.ends_with('\n') {
                eprintln!();
            }
            ExitCode::from(FAILED)
        }
        Err(error @ Error::Usage(_)) => {
            say(error);
            ExitCode::from(USAGE)
        }
        Err(error) => {
            say(error);
            ExitCode::from(FAILED)
        }
    }
}

fn say(what: impl std::fmt::Display) {
    eprintln!("slang-depbuild: {what}");
}
