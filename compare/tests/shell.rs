//! The tool says that it is not built yet, and never passes for one that compared something.

use std::process::{Command, Output};

fn compare(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_compare")).args(arguments).output().unwrap()
}

#[test]
fn help_says_what_is_and_what_will_be() {
    let output = compare(&["--help"]);
    assert_eq!(output.status.code(), Some(0));
    let help = String::from_utf8(output.stdout).unwrap();
    for part in ["NOT BUILT YET", "commit message", "compare diff | table | plot"] {
        assert!(help.contains(part), "{part}: {help}");
    }
}

#[test]
fn without_help_it_fails_and_prints_no_data() {
    for arguments in [&[][..], &["diff", "a.json", "b.json"], &["table", "--csv", "a.json"]] {
        let output = compare(arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(message.contains("NOT BUILT YET"), "{message}");
    }
}
