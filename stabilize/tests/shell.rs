//! The tool says that it is not built yet, and never passes for one that ran its command.

use std::process::{Command, Output};

fn stabilize(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_stabilize")).args(arguments).output().unwrap()
}

#[test]
fn help_says_what_is_and_what_will_be() {
    let output = stabilize(&["--help"]);
    assert_eq!(output.status.code(), Some(0));
    let help = String::from_utf8(output.stdout).unwrap();
    for part in ["NOT BUILT YET", "lock the clocks", "stabilize [OPTIONS] -- CMD…", "125"] {
        assert!(help.contains(part), "{part}: {help}");
    }
}

#[test]
fn without_help_it_fails_and_runs_nothing() {
    let folder = std::env::temp_dir().join(format!("stabilize-{}", std::process::id()));
    let touched = folder.to_str().unwrap();
    for arguments in [&[][..], &["--", "touch", touched], &["touch", touched]] {
        let output = stabilize(arguments);
        assert_eq!(output.status.code(), Some(125), "{arguments:?}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(message.contains("NOT BUILT YET"), "{message}");
        assert_eq!(message.contains("Did not run"), !arguments.is_empty(), "{message}");
        assert!(!folder.exists(), "{arguments:?}");
    }
}

#[test]
fn an_unknown_option_is_not_taken_for_success() {
    assert_eq!(stabilize(&["--clocks"]).status.code(), Some(125));
}
