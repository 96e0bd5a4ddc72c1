//! The documentation shows what the program prints.

use crate::common::{compare_in, stderr, stdout};
use std::path::Path;

#[test]
fn examples_are_what_is_printed() {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    let page = include_str!("../../../docs/compare.md");
    let mut examples = 0;
    for (start, _) in page.match_indices("<!-- compare ") {
        let (command, rest) = page[start + "<!-- compare ".len()..].split_once(" -->\n```text\n").unwrap();
        let shown = rest.split_once("```").unwrap().0;
        let output = compare_in(root, &command.split(' ').collect::<Vec<_>>());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert_eq!(stdout(&output), shown, "compare {command}");
        examples += 1;
    }
    assert!(examples > 0);
}
