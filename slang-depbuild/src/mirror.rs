//! A copy of the sources in which there is nothing else, no stale module above all.
//!
//! `slangc` resolves `import wide4` by looking for `wide4.slang-module` in every folder before it looks for
//! `wide4.slang`, and no option stops it. So it is given folders without modules: each source is copied from
//! `/a/b.slang` to `<root>/a/b.slang`, which leaves all relative paths between sources as they are;
//! absolute ones are replaced.
//!
//! Which files the compiler will want is not known before it has run, and only its preprocessor could tell.
//! But each of them is called by a word of a source or by a macro: `import layout.wide4;`, `#include "ray.h"`,
//! `#define LAYOUT wide4`. So *every* word and string of the sources, and every `-D`, is taken for the name of
//! a file and looked for in all folders of sources and includes. What is found is copied and read in turn,
//! until nothing new turns up. A file too many does no harm: the compiler lists those that it has read.

use std::collections::{HashMap, HashSet};
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

pub struct Mirror {
    root: PathBuf,
    /// By their copies.
    originals: HashMap<PathBuf, PathBuf>,
    folders: Unique<PathBuf>,
    names: Unique<String>,
    /// Up to where every name was looked for in every folder.
    searched: (usize, usize),
}

impl Mirror {
    /// In an empty folder, given without symbolic links.
    pub fn new(root: PathBuf) -> Self {
        Self {
            root,
            originals: HashMap::new(),
            folders: Unique::default(),
            names: Unique::default(),
            searched: (0, 0),
        }
    }

    /// Adds a folder of includes, and says where its copy is.
    pub fn add_folder(&mut self, folder: &Path) -> io::Result<PathBuf> {
        // One that does not exist has no includes.
        let folder = fs::canonicalize(folder).or_else(|_| std::path::absolute(folder))?;
        let copy = self.copy_of(&folder);
        fs::create_dir_all(&copy)?;
        self.folders.insert(folder);
        Ok(copy)
    }

    /// Adds a source, and says which file it is and where its copy is.
    pub fn add_source(&mut self, source: &Path) -> io::Result<(PathBuf, PathBuf)> {
        let path = std::path::absolute(source)?;
        let name = path.file_name().ok_or(io::ErrorKind::IsADirectory)?;
        let path = fs::canonicalize(crate::file::folder_of(&path))?.join(name);
        self.copy(&path)?;
        let copy = self.copy_of(&path);
        Ok((path, copy))
    }

    /// Adds the words of a macro.
    pub fn add_words(&mut self, text: &[u8]) {
        names(text, &mut |name| self.names.insert(name));
    }

    /// Adds everything that the sources may name.
    pub fn complete(&mut self) -> io::Result<()> {
        loop {
            let (folders, names) = (self.folders.list.len(), self.names.list.len());
            if (folders, names) == self.searched {
                return Ok(());
            }
            for folder in 0..folders {
                let first = if folder < self.searched.0 { self.searched.1 } else { 0 };
                for name in first..names {
                    let path = self.folders.list[folder].join(&self.names.list[name]);
                    self.try_copy(&path)?;
                }
            }
            self.searched = (folders, names);
        }
    }

    /// The file that a copy was made from.
    pub fn original(&self, copy: &Path) -> Option<&PathBuf> {
        self.originals.get(copy)
    }

    /// The compiler's messages with the names of the files instead of those of their copies.
    pub fn with_originals(&self, messages: &str) -> String {
        messages.replace(&self.root.to_string_lossy()[..], "")
    }

    /// A text in which the absolute paths of files are those of their copies.
    pub fn redirected(&self, text: &[u8]) -> Vec<u8> {
        let mut redirected = Vec::with_capacity(text.len());
        for (at, &byte) in text.iter().enumerate() {
            redirected.push(byte);
            let after = &text[at + 1..];
            if matches!(byte, b'"' | b'<') && after.starts_with(b"/") {
                let end = after.iter().position(|&byte| matches!(byte, b'"' | b'>' | b'\\' | b'\n'));
                let name = end.and_then(|end| std::str::from_utf8(&after[..end]).ok()).unwrap_or_default();
                if Path::new(name).is_file() || Path::new(&format!("{name}.slang")).is_file() {
                    redirected.extend(self.root.as_os_str().as_encoded_bytes());
                }
            }
        }
        redirected
    }

    fn copy_of(&self, path: &Path) -> PathBuf {
        let below = |part: &Component| matches!(part, Component::Normal(_));
        self.root.join(path.components().filter(below).collect::<PathBuf>())
    }

    fn try_copy(&mut self, path: &Path) -> io::Result<()> {
        let is_module = path.extension().is_some_and(|e| e == "slang-module" || e == "slang-lib");
        if is_module || !path.is_file() {
            return Ok(());
        }
        let real = normal(path);
        if !self.originals.contains_key(&self.copy_of(&real)) {
            // One that may not be read is the compiler's to complain about, if it is wanted.
            match self.copy(&real) {
                Err(error) if error.kind() == io::ErrorKind::PermissionDenied => return Ok(()),
                done => done?,
            }
        }
        // For `a/../b.h`, there must be an `a`.
        if real != path && path.components().any(|part| part == Component::ParentDir) {
            let mut folder = PathBuf::new();
            for part in crate::file::folder_of(path).components() {
                folder.push(part);
                fs::create_dir_all(self.copy_of(&normal(&folder)))?;
            }
        }
        Ok(())
    }

    fn copy(&mut self, path: &Path) -> io::Result<()> {
        let copy = self.copy_of(path);
        if self.originals.contains_key(&copy) {
            return Ok(());
        }
        let folder = crate::file::folder_of(path).to_owned();
        fs::create_dir_all(crate::file::folder_of(&copy))?;
        // A link stays one, so that a file with two names is the same file to the compiler.
        let target = fs::canonicalize(path)?;
        if !(target != *path && self.link(&target, &copy)?) {
            let contents = fs::read(path)?;
            fs::write(&copy, self.redirected(&contents))?;
            self.add_words(&contents);
        }
        self.originals.insert(copy, path.to_owned());
        self.folders.insert(folder);
        Ok(())
    }

    #[cfg(unix)]
    fn link(&mut self, target: &Path, copy: &Path) -> io::Result<bool> {
        self.copy(target)?;
        std::os::unix::fs::symlink(self.copy_of(target), copy)?;
        Ok(true)
    }

    #[cfg(not(unix))]
    fn link(&mut self, _: &Path, _: &Path) -> io::Result<bool> {
        Ok(false)
    }
}

/// A list without repetitions, in the order of arrival.
struct Unique<T> {
    list: Vec<T>,
    set: HashSet<T>,
}

impl<T> Default for Unique<T> {
    fn default() -> Self {
        Self { list: Vec::new(), set: HashSet::new() }
    }
}

impl<T: Clone + Eq + std::hash::Hash> Unique<T> {
    fn insert(&mut self, item: T) {
        if self.set.insert(item.clone()) {
            self.list.push(item);
        }
    }
}

/// Without `.` and `..`.
fn normal(path: &Path) -> PathBuf {
    let mut normal = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => drop(normal.pop()),
            Component::CurDir => {}
            part => normal.push(part),
        }
    }
    normal
}

/// Each name of a file that the words of a source may mean, relative to some folder: `a.b_c` for
/// `a/b_c.slang` and `a/b-c.slang`, and what stands in quotes or angle brackets for itself, too.
fn names(source: &[u8], take: &mut impl FnMut(String)) {
    let mut rest = source;
    while let Some((&first, after)) = rest.split_first() {
        rest = after;
        if first == b'"' || first == b'<' {
            let close = if first == b'"' { b'"' } else { b'>' };
            // What stands between is read again, as words: a quote may be a stray one.
            let end = after.iter().position(|&byte| byte == close || byte == b'\n');
            if let Some(text) = end.filter(|&end| after[end] == close).map(|end| &after[..end]) {
                quoted(text, take);
            }
        } else if is_word(first) {
            let end = after.iter().position(|&byte| !(is_word(byte) || byte == b'.')).unwrap_or(after.len());
            let word = &source[source.len() - after.len() - 1..][..=end];
            rest = &after[end..];
            if let (Ok(word), false) = (std::str::from_utf8(word), first.is_ascii_digit()) {
                modules(&word.trim_end_matches('.').replace('.', "/"), take);
            }
        }
    }
}

fn is_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_' || !byte.is_ascii()
}

fn quoted(text: &[u8], take: &mut impl FnMut(String)) {
    // No system has longer names.
    if let (Ok(text), 1..=4096) = (std::str::from_utf8(text), text.len()) {
        let text = text.trim_end_matches('\\');
        if !text.is_empty() && !text.contains('\0') {
            take(text.to_owned());
            modules(text, take);
        }
    }
}

fn modules(name: &str, take: &mut impl FnMut(String)) {
    take(format!("{name}.slang"));
    if name.contains('_') {
        let dashed = name.replace('_', "-");
        take(format!("{dashed}.slang"));
        // A name that ends so already gets no second ending.
        take(dashed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names_in(source: &str) -> HashSet<String> {
        let mut found = HashSet::new();
        names(source.as_bytes(), &mut |name| {
            found.insert(name);
        });
        found
    }

    #[test]
    fn every_way_to_name_a_file_is_seen() {
        for (source, name) in [
            ("import wide4;", "wide4.slang"),
            ("import layout.wide_4;", "layout/wide_4.slang"),
            ("import layout.wide_4;", "layout/wide-4.slang"),
            ("__include \"part\";", "part.slang"),
            ("import \"../a b.slang\";", "../a b.slang"),
            ("#include \"ray.h\"", "ray.h"),
            ("#include <shared/ray.h>", "shared/ray.h"),
            ("#define LAYOUT wide4", "wide4.slang"),
            ("HEADER=\\\"ray.h\\\"", "ray.h"),
            ("don\"t import wide4;", "wide4.slang"),
            ("a<b; import wide4;\nc>d", "wide4.slang"),
            ("/* \" */ #include \"ray.h\"", "ray.h"),
            ("import größe;", "größe.slang"),
            ("x", "x.slang"),
        ] {
            assert!(names_in(source).contains(name), "{source}: {:?}", names_in(source));
        }
        assert!(names_in("0.5f 12 + - \"\"").is_empty());
    }

    #[test]
    fn the_mirror_has_what_is_named_and_no_modules() {
        let folder = tempfile::tempdir().unwrap();
        let base = fs::canonicalize(folder.path()).unwrap();
        let (real, root) = (base.join("real"), base.join("mirror"));
        for (file, contents) in [
            ("k/kernel.slang", "#include \"missing/../h.h\"\nimport a; \"a.slang-module\""),
            ("k/h.h", "import unused"),
            ("inc/a.slang", "import \"../far/b\";"),
            ("inc/a.slang-module", ""),
            ("far/b.slang", ""),
            ("far/other.slang", ""),
        ] {
            let path = real.join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, contents).unwrap();
        }
        fs::create_dir(real.join("k/missing")).unwrap();
        let mut mirror = Mirror::new(root);
        let includes = mirror.add_folder(&real.join("inc")).unwrap();
        let (path, copy) = mirror.add_source(&real.join("k/../k/kernel.slang")).unwrap();
        assert_eq!(path, real.join("k/kernel.slang"));
        mirror.complete().unwrap();
        let mut copied: Vec<&PathBuf> = mirror.originals.values().collect();
        copied.sort();
        assert_eq!(
            copied,
            ["far/b.slang", "inc/a.slang", "k/h.h", "k/kernel.slang"]
                .map(|f| real.join(f))
                .iter()
                .collect::<Vec<_>>()
        );
        assert_eq!(mirror.original(&copy), Some(&path));
        assert!(includes.join("../far/b.slang").is_file() && !includes.join("a.slang-module").exists());
        assert!(copy.with_file_name("missing").is_dir());
        assert_eq!(
            mirror.with_originals(&format!(" --> {}:3:30", copy.display())),
            format!(" --> {}:3:30", path.display())
        );
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_the_same_file() {
        let folder = tempfile::tempdir().unwrap();
        let base = fs::canonicalize(folder.path()).unwrap();
        fs::create_dir(base.join("real")).unwrap();
        fs::write(base.join("real/a.slang"), "").unwrap();
        std::os::unix::fs::symlink(base.join("real/a.slang"), base.join("b.slang")).unwrap();
        let mut mirror = Mirror::new(base.join("mirror"));
        let (_, copy) = mirror.add_source(&base.join("b.slang")).unwrap();
        let target = fs::canonicalize(copy).unwrap();
        assert_eq!(mirror.original(&target), Some(&base.join("real/a.slang")));
    }
}
