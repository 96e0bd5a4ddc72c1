//! Help for shells and manual readers, from the same definition as `--help`.

use crate::{Cli, Exit, output::print};
use anyhow::Context;
use clap::CommandFactory;

/// `compare completions`.
///
/// # Errors
/// Stdout cannot be written to.
pub fn completions(shell: clap_complete::Shell) -> anyhow::Result<Exit> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "compare", &mut text);
    print(&String::from_utf8(text)?)?;
    Ok(Exit::Done)
}

/// `compare man`.
///
/// # Errors
/// There is no such command, or stdout cannot be written to.
pub fn man(command: Option<&str>) -> anyhow::Result<Exit> {
    let mut cli = Cli::command();
    cli.build();
    let page = match command {
        None => cli,
        Some(name) => cli
            .find_subcommand(name)
            .cloned()
            .with_context(|| format!("no command {name:?}; `compare --help` lists them"))?,
    };
    let mut text = Vec::new();
    clap_mangen::Man::new(page).render(&mut text)?;
    print(&String::from_utf8(text)?)?;
    Ok(Exit::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Terminals of 100 columns would break longer lines wherever they end.
    #[test]
    fn the_text_below_the_options_of_history_fits_a_terminal() {
        let cli = Cli::command();
        let text = cli.find_subcommand("history").unwrap().get_after_help().unwrap().to_string();
        assert!(text.lines().count() > 5);
        for line in text.lines() {
            assert!(line.chars().count() <= 95, "{line}");
        }
    }
}
