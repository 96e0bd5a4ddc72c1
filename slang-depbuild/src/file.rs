//! Files that are written whole or not at all.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use tempfile::NamedTempFile;

/// The new contents of a file, which has the old ones still.
pub struct Pending {
    path: PathBuf,
    contents: Contents,
}

enum Contents {
    Beside(NamedTempFile),
    /// For what must not be replaced by a file, such as `/dev/null`.
    Direct(Vec<u8>),
}

impl Pending {
    /// Writes beside the file, and makes its folder if there is none.
    pub fn new(path: &Path, contents: &[u8]) -> io::Result<Self> {
        let special = fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir());
        let contents = if special {
            Contents::Direct(contents.to_vec())
        } else {
            let folder = folder_of(path);
            fs::create_dir_all(folder)?;
            let mut builder = tempfile::Builder::new();
            #[cfg(unix)]
            let all = std::os::unix::fs::PermissionsExt::from_mode(0o666);
            // As any other file, and less what the umask takes; a temporary one is its owner's alone.
            #[cfg(unix)]
            builder.permissions(all);
            let mut file = builder.prefix(".slang-depbuild-").tempfile_in(folder)?;
            file.write_all(contents)?;
            Contents::Beside(file)
        };
        Ok(Self { path: path.to_owned(), contents })
    }

    /// Puts it into its place, as if it had been written at the given time.
    pub fn commit(self, written: SystemTime) -> io::Result<()> {
        match self.contents {
            Contents::Beside(file) => {
                file.as_file().set_modified(written)?;
                file.persist(&self.path)?;
                Ok(())
            }
            Contents::Direct(contents) => fs::write(&self.path, contents),
        }
    }
}

/// The folder that a file lies in.
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_keeps_its_old_contents_until_the_new_are_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new folder/a.spv");
        Pending::new(&path, b"old").unwrap().commit(SystemTime::now()).unwrap();
        let pending = Pending::new(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"old");
        pending.commit(SystemTime::UNIX_EPOCH).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(fs::metadata(&path).unwrap().modified().unwrap(), SystemTime::UNIX_EPOCH);
        drop(Pending::new(&path, b"never").unwrap());
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_written_to_and_not_replaced() {
        Pending::new(Path::new("/dev/null"), b"x").unwrap().commit(SystemTime::now()).unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }
}
