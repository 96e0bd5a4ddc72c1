//! The program from outside.

use crate::common::compare_in;
use std::path::Path;
use std::process::Output;

fn compare(arguments: &[&str]) -> Output {
    compare_in(Path::new("."), arguments)
}

#[test]
fn help_tells_what_the_exit_status_means() {
    let output = compare(&["--help"]);
    assert_eq!(output.status.code(), Some(0));
    let help = String::from_utf8(output.stdout).unwrap();
    assert!(help.contains("Exit status: 0 done, 1 failed, 2 usage, 3 a regression"), "{help}");
}

#[test]
fn a_wrong_command_line_is_told_on_stderr() {
    for arguments in [&[][..], &["--nonsense"], &["paint", "a.json"]] {
        let output = compare(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        assert!(!output.stderr.is_empty(), "{arguments:?}");
    }
}

#[test]
fn shells_and_manual_readers_are_helped() {
    let completions = compare(&["completions", "bash"]);
    assert!(String::from_utf8(completions.stdout).unwrap().contains("_compare()"));
    let page = compare(&["man"]);
    assert!(String::from_utf8(page.stdout).unwrap().contains(".TH compare"));
    let unknown = compare(&["man", "paint"]);
    assert_eq!(unknown.status.code(), Some(1));
    assert!(String::from_utf8(unknown.stderr).unwrap().contains("compare --help"));
}
