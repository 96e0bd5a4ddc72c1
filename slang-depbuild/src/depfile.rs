//! Dependency files in make's format: `target: source source`.

use std::env;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// What a dependency file says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Depfile {
    /// The file that was made, as the build knows it.
    pub target: PathBuf,
    /// The files that it was made from.
    pub dependencies: Vec<PathBuf>,
}

/// A name that make's format cannot express.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?}: no dependency file can list a name with a line break, or with a backslash at its end")]
pub struct Unwritable(pub PathBuf);

impl Depfile {
    /// Reads a dependency file: ours, or that of another compiler. Rules after the first add their
    /// dependencies; nothing comes from those that have none, which compilers add for make's sake.
    ///
    /// # Errors
    /// It cannot be read, or there is no rule in it.
    pub fn read(path: &Path) -> io::Result<Self> {
        let why = || {
            io::Error::new(
                io::ErrorKind::InvalidData,
                format!("{}: not a dependency file, which has a target and a colon", path.display()),
            )
        };
        Self::parse(&fs::read(path)?).ok_or_else(why)
    }

    /// The same, from the contents of one.
    #[must_use]
    pub fn parse(contents: &[u8]) -> Option<Self> {
        let mut found: Option<Self> = None;
        for line in logical_lines(contents) {
            let Some((target, dependencies)) = rule(&line) else { continue };
            match &mut found {
                None => found = Some(Self { target, dependencies }),
                Some(first) => first.dependencies.extend(dependencies),
            }
        }
        found
    }

    /// Its text: each dependency on a line of its own and, if `phony`, an empty rule for each, so that make
    /// does not insist on one that is gone.
    ///
    /// # Errors
    /// A name contains a line break, or ends in a backslash.
    pub fn text(&self, phony: bool) -> Result<Vec<u8>, Unwritable> {
        let mut text = escape(&self.target)?;
        text.push(b':');
        for dependency in &self.dependencies {
            text.extend(b" \\\n  ");
            text.extend(escape(dependency)?);
        }
        text.push(b'\n');
        if phony {
            for dependency in &self.dependencies {
                text.extend(escape(dependency)?);
                text.extend(b":\n");
            }
        }
        Ok(text)
    }
}

/// The dependencies that an earlier run listed, if its output is newer than all of them, than the running
/// program, and than each of `tools` (the compiler, say).
///
/// Other options than that run had are not noticed: in a build script they come from the running program, and
/// a tool that was installed just now counts as new whatever date its file bears.
#[must_use]
pub fn up_to_date(output: &Path, depfile: &Path, tools: &[&Path]) -> Option<Vec<PathBuf>> {
    let made = fs::metadata(output).and_then(|found| found.modified()).ok()?;
    let dependencies = Depfile::read(depfile).ok()?.dependencies;
    let program = env::current_exe().ok()?;
    let older = |time: Option<SystemTime>| time.is_some_and(|time| time < made);
    let modified = |path: &PathBuf| fs::metadata(path).and_then(|found| found.modified()).ok();
    let up_to_date = older(modified(&program))
        && tools.iter().all(|tool| older(installed(tool)))
        && dependencies.iter().all(|dependency| older(modified(dependency)));
    up_to_date.then_some(dependencies)
}

/// When a tool came here: packages keep the dates that their files had elsewhere.
fn installed(tool: &Path) -> Option<SystemTime> {
    let found = fs::metadata(tool).ok()?;
    let modified = found.modified().ok()?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        use std::time::Duration;
        let seconds = Duration::from_secs(u64::try_from(found.ctime()).ok()?);
        let changed =
            SystemTime::UNIX_EPOCH + seconds + Duration::from_nanos(found.ctime_nsec().unsigned_abs());
        Some(modified.max(changed))
    }
    #[cfg(not(unix))]
    Some(modified)
}

/// A name as make wants it: `$` doubled, a backslash before white space, `#` and `:`, and then one more for
/// each backslash that stood there. Backslashes elsewhere are themselves.
fn escape(path: &Path) -> Result<Vec<u8>, Unwritable> {
    let mut text = Vec::new();
    let mut backslashes = 0;
    for &byte in path.as_os_str().as_encoded_bytes() {
        match byte {
            b'\n' | b'\r' => return Err(Unwritable(path.to_owned())),
            b' ' | b'\t' | b'#' | b':' => text.extend(std::iter::repeat_n(b'\\', backslashes + 1)),
            b'$' => text.push(b'$'),
            _ => {}
        }
        backslashes = if byte == b'\\' { backslashes + 1 } else { 0 };
        text.push(byte);
    }
    // Where white space follows, make wants it doubled; where the line ends, there is no way to write it.
    if backslashes > 0 { Err(Unwritable(path.to_owned())) } else { Ok(text) }
}

/// Lines, after joining those that end in a backslash to the next.
fn logical_lines(contents: &[u8]) -> Vec<Vec<u8>> {
    let mut lines = vec![Vec::new()];
    for line in contents.split(|&byte| byte == b'\n') {
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        let last = lines.last_mut().expect("there is always one");
        let backslashes = line.iter().rev().take_while(|&&byte| byte == b'\\').count();
        if backslashes % 2 == 1 {
            last.extend(&line[..line.len() - 1]);
            last.push(b' ');
        } else {
            last.extend(line);
            lines.push(Vec::new());
        }
    }
    lines
}

/// The target of a rule and what it depends on.
fn rule(line: &[u8]) -> Option<(PathBuf, Vec<PathBuf>)> {
    let (mut names, mut target) = (Vec::new(), None);
    let mut name = Vec::new();
    let mut rest = line.iter().copied().peekable();
    let mut backslashes = 0;
    while let Some(byte) = rest.next() {
        if byte == b'\\' {
            backslashes += 1;
            continue;
        }
        // A colon ends the target only before white space: on Windows there is one after the drive.
        let ends = byte == b':' && target.is_none() && rest.peek().is_none_or(u8::is_ascii_whitespace);
        let escaped = backslashes % 2 == 1;
        let special = matches!(byte, b' ' | b'\t' | b'#') || ends || (byte == b':' && escaped);
        name.extend(std::iter::repeat_n(b'\\', if special { backslashes / 2 } else { backslashes }));
        backslashes = 0;
        match byte {
            _ if special && escaped => name.push(byte),
            b'#' => break,
            b' ' | b'\t' => names.extend(take(&mut name)),
            b':' if ends => {
                names.extend(take(&mut name));
                target = Some(names.first()?.clone());
                names.clear();
            }
            b'$' => {
                rest.next_if_eq(&b'$');
                name.push(byte);
            }
            _ => name.push(byte),
        }
    }
    // The end of the line is white space too.
    name.extend(std::iter::repeat_n(b'\\', backslashes / 2));
    names.extend(take(&mut name));
    Some((target?, names))
}

fn take(name: &mut Vec<u8>) -> Option<PathBuf> {
    let name = std::mem::take(name);
    (!name.is_empty()).then(|| path(name))
}

#[cfg(unix)]
fn path(name: Vec<u8>) -> PathBuf {
    use std::os::unix::ffi::OsStringExt;
    std::ffi::OsString::from_vec(name).into()
}

#[cfg(not(unix))]
fn path(name: Vec<u8>) -> PathBuf {
    String::from_utf8_lossy(&name).into_owned().into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn depfile(target: &str, dependencies: &[&str]) -> Depfile {
        Depfile { target: target.into(), dependencies: dependencies.iter().map(PathBuf::from).collect() }
    }

    fn text(depfile: &Depfile) -> String {
        String::from_utf8(depfile.text(false).unwrap()).unwrap()
    }

    #[test]
    fn names_are_escaped_as_make_wants_them() {
        let names = depfile("out dir/a.spv", &["a b#c$d", r"back\slash", r"a\ b", "c:d"]);
        assert_eq!(
            text(&names),
            "out\\ dir/a.spv: \\\n  a\\ b\\#c$$d \\\n  back\\slash \\\n  a\\\\\\ b \\\n  c\\:d\n"
        );
        assert_eq!(Depfile::parse(text(&names).as_bytes()), Some(names));
    }

    #[test]
    fn phony_targets_add_no_dependency() {
        let depfile = depfile("a", &["b", "c d"]);
        let text = depfile.text(true).unwrap();
        assert!(text.ends_with(b"\nb:\nc\\ d:\n"));
        assert_eq!(Depfile::parse(&text), Some(depfile));
    }

    #[test]
    fn names_that_make_cannot_read_are_refused() {
        let error = depfile("a", &["b\nc"]).text(false).unwrap_err();
        assert!(error.to_string().starts_with(r#""b\nc": no dependency file can list a name with a line"#));
        assert!(depfile("a\\", &[]).text(false).is_err());
    }

    #[test]
    fn what_other_compilers_write_is_read() {
        // glslc, glslangValidator, slangc, and a compiler on Windows.
        for (text, target, dependencies) in [
            ("a.spv: a.comp b.glsl\n", "a.spv", vec!["a.comp", "b.glsl"]),
            ("a.spv: \\\n    a.comp \\\n    b\\ c.glsl\n", "a.spv", vec!["a.comp", "b c.glsl"]),
            ("a.spv : /x/a$$b.slang", "a.spv", vec!["/x/a$b.slang"]),
            ("c:\\o\\a.o: c:\\s\\a.c \\\r\n  d:/e.h\r\n", "c:\\o\\a.o", vec!["c:\\s\\a.c", "d:/e.h"]),
            ("a\\:b: c\\:d # a note", "a:b", vec!["c:d"]),
            ("a:\n", "a", vec![]),
        ] {
            assert_eq!(Depfile::parse(text.as_bytes()), Some(depfile(target, &dependencies)), "{text:?}");
        }
        assert_eq!(Depfile::parse(b"nothing here"), None);
        assert_eq!(Depfile::parse(b""), None);
        assert_eq!(Depfile::parse(b": b"), None);
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_again(
            target in r"[ab\\#$: \t]{0,8}[ab]",
            dependencies in prop::collection::vec(r"[ab\\#$:é \t]{0,9}[ab]", 0..5),
        ) {
            let depfile = depfile(&target, &dependencies.iter().map(String::as_str).collect::<Vec<_>>());
            let text = depfile.text(false).unwrap();
            prop_assert_eq!(Depfile::parse(&text), Some(depfile));
        }

        #[test]
        fn no_contents_make_the_reader_fail(contents in prop::collection::vec(any::<u8>(), 0..64)) {
            let _ = Depfile::parse(&contents);
        }
    }
}
