//! The file that git runs.

use std::path::Path;

/// What the name of the former hook has at its end. It stays in its folder, where links and scripts beside it are
/// found.
pub const FORMER: &str = ".before-compare";

const BEGIN: &str =
    "#!/bin/sh\n# compare's hook: `compare hook install` wrote it, `compare hook uninstall` removes it.\n";
const END: &str = "exit 0\n# end of compare's hook\n";

/// The script that runs this program. It takes no other program of this name from PATH: ImageMagick has one, too.
pub fn script(program: &Path) -> Vec<u8> {
    let before = format!(
        "{BEGIN}\
         if [ -x \"$0{FORMER}\" ]; then \"$0{FORMER}\" \"$@\" || exit $?; fi\n\
         compare="
    );
    let after = format!(
        "\n\
         if [ -x \"$compare\" ]; then\n    \
             COMPARE_HOOK_GIT=$PPID \"$compare\" hook run \"$@\"\n\
         else\n    \
             echo \"compare: $compare is not there any more, so the message stays as it is; run its hook install or uninstall anew\" >&2\n\
         fi\n\
         {END}"
    );
    [before.as_bytes(), &quoted(bytes(program)), after.as_bytes()].concat()
}

/// Whose a script is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Owner {
    /// This program's, and as it was written.
    Compare,
    /// This program's, and somebody has added to it.
    Both,
    /// Somebody else's.
    Other,
}

/// Whose this script is.
pub fn owner(script: &[u8]) -> Owner {
    match (script.starts_with(BEGIN.as_bytes()), script.ends_with(END.as_bytes())) {
        (true, true) => Owner::Compare,
        (true, false) => Owner::Both,
        _ => Owner::Other,
    }
}

/// As one word of a shell: only a quote ends it.
fn quoted(word: &[u8]) -> Vec<u8> {
    let inner: Vec<u8> =
        word.iter().flat_map(|byte| if *byte == b'\'' { b"'\\''".to_vec() } else { vec![*byte] }).collect();
    [b"'", &inner[..], b"'"].concat()
}

fn bytes(path: &Path) -> &[u8] {
    path.as_os_str().as_encoded_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_quoted() {
        let script = script(Path::new("/it's $HOME/`compare` \"x\""));
        let text = String::from_utf8(script.clone()).unwrap();
        assert!(text.contains("\ncompare='/it'\\''s $HOME/`compare` \"x\"'\n"), "{text}");
        assert_eq!(owner(&script), Owner::Compare);
    }

    #[test]
    fn what_somebody_added_is_seen() {
        let own = script(Path::new("/compare"));
        assert_eq!(owner(&[&own[..], b"more\n"].concat()), Owner::Both);
        assert_eq!(owner(b"#!/bin/sh\nexit 0\n"), Owner::Other);
        assert_eq!(owner(b""), Owner::Other);
    }
}
