//! What commits change, from git's raw lists.

use crate::git::path;
use std::path::PathBuf;

/// One changed file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// The blob from before, where there was one.
    pub old: Option<String>,
    /// Its path then, which is another one if the file was renamed.
    pub old_path: PathBuf,
    /// The blob from after; nothing where the file is gone.
    pub new: Option<String>,
    /// Its path.
    pub path: PathBuf,
}

/// The changes of regular files in the output of a git command with `--raw --no-abbrev -z`.
pub fn changes(raw: &[u8]) -> Vec<Change> {
    let mut fields = raw.split(|&byte| byte == 0);
    let mut found = Vec::new();
    while let Some(field) = fields.next() {
        found.extend(change(field, &mut fields));
    }
    found
}

/// The change whose first field this is; it takes the paths from those that follow.
pub fn change<'f>(field: &[u8], rest: &mut impl Iterator<Item = &'f [u8]>) -> Option<Change> {
    let text = std::str::from_utf8(field).ok()?.trim_start_matches('\n').strip_prefix(':')?;
    let mut parts = text.split(' ');
    let mut next = || parts.next();
    let (old_mode, new_mode, old, new, status) = (next()?, next()?, next()?, next()?, next()?);
    let old_path = path(rest.next()?);
    let moved = status.starts_with(['R', 'C']);
    let path = if moved { path(rest.next()?) } else { old_path.clone() };
    // Neither links nor submodules: their blobs are no files. Of a file that is not there all digits are 0.
    let of = |mode: &str, id: &str| mode.starts_with("100").then(|| id.to_owned());
    Some(Change { old: of(old_mode, old), old_path, new: of(new_mode, new), path })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_may_hold_anything() {
        let raw = b":100644 100644 aa bb M\0:a b\nc.json\0:000000 100755 00 cc A\0n\"ew\0\
                    :100644 100644 aa dd R090\0old\0new\0:100644 000000 aa 00 D\0gone\0\
                    :100644 120000 aa ee T\0link\0:000000 160000 00 ff A\0sub\0";
        let found = changes(raw);
        let short: Vec<_> = found
            .iter()
            .map(|c| {
                (c.old.as_deref(), c.new.as_deref(), c.old_path.to_str().unwrap(), c.path.to_str().unwrap())
            })
            .collect();
        assert_eq!(
            short,
            [
                (Some("aa"), Some("bb"), ":a b\nc.json", ":a b\nc.json"),
                (None, Some("cc"), "n\"ew", "n\"ew"),
                (Some("aa"), Some("dd"), "old", "new"),
                (Some("aa"), None, "gone", "gone"),
                (Some("aa"), None, "link", "link"),
                (None, None, "sub", "sub"),
            ]
        );
    }

    #[test]
    fn what_is_cut_off_is_no_change() {
        assert_eq!(changes(b""), []);
        assert_eq!(changes(b":100644 100644 aa bb M"), []);
        assert_eq!(changes(b":100644 100644 aa bb R100\0old"), []);
        assert_eq!(changes(b"words\0and\0words"), []);
    }
}
