//! Where journals lie, opened so that nobody else can make the process write elsewhere.

use crate::gpu::Identity;
use anyhow::{Context, bail};
use nix::dir::Dir;
use nix::fcntl::{OFlag, openat};
use nix::sys::stat::{FileStat, Mode, SFlag, fstat};
use nix::unistd::geteuid;
use std::fs::{DirBuilder, File};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

/// Root's folder. It outlives a reboot, as a journal must after a power cut.
const OF_ROOT: &str = "/var/lib/stabilize";

/// An open folder of journals that belongs to this process's user, and that nobody else can write.
pub struct Folder {
    handle: OwnedFd,
    path: PathBuf,
}

/// Where this process's user keeps journals.
///
/// # Errors
/// The environment does not tell.
pub fn own() -> anyhow::Result<PathBuf> {
    if let Some(chosen) = variable("STABILIZE_STATE_DIR") {
        return Ok(chosen);
    }
    if geteuid().is_root() {
        return Ok(OF_ROOT.into());
    }
    variable("XDG_STATE_HOME")
        .or_else(|| Some(variable("HOME")?.join(".local/state")))
        .map(|state| state.join("stabilize"))
        .context("neither HOME nor XDG_STATE_HOME is set")
}

/// Folders that may hold journals which this process can read: its own, and root's.
pub fn all() -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = own().into_iter().collect();
    if variable("STABILIZE_STATE_DIR").is_none() && !geteuid().is_root() {
        folders.push(OF_ROOT.into());
    }
    folders
}

fn variable(name: &str) -> Option<PathBuf> {
    std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from)
}

impl Folder {
    /// Opens the folder, or makes it.
    ///
    /// # Errors
    /// It cannot be made, is somebody else's, or somebody else can write to it.
    pub fn make(path: &Path) -> anyhow::Result<Folder> {
        let context = || format!("cannot keep a journal in {}", path.display());
        DirBuilder::new().recursive(true).mode(0o755).create(path).with_context(context)?;
        Folder::open(path).with_context(context)
    }

    /// Opens the folder.
    ///
    /// # Errors
    /// It is not there, is somebody else's, or somebody else can write to it.
    pub fn open(path: &Path) -> anyhow::Result<Folder> {
        let flags = OFlag::O_DIRECTORY | OFlag::O_NOFOLLOW | OFlag::O_CLOEXEC;
        let handle = nix::fcntl::open(path, flags, Mode::empty())?;
        check(&fstat(&handle)?, SFlag::S_IFDIR)?;
        Ok(Folder { handle, path: path.into() })
    }

    /// Opens the file of a GPU, or makes it.
    ///
    /// # Errors
    /// It cannot be opened, or is somebody else's.
    pub fn file(&self, gpu: &Identity) -> anyhow::Result<File> {
        self.named(&file_name(gpu))
    }

    fn named(&self, name: &str) -> anyhow::Result<File> {
        let flags = OFlag::O_RDWR | OFlag::O_APPEND | OFlag::O_CREAT | OFlag::O_NOFOLLOW | OFlag::O_CLOEXEC;
        let open = || -> anyhow::Result<File> {
            let file = openat(self.handle.as_fd(), name, flags, Mode::from_bits_truncate(0o644))?;
            let stat = fstat(&file)?;
            check(&stat, SFlag::S_IFREG)?;
            if stat.st_nlink != 1 {
                bail!("it has several names");
            }
            Ok(file.into())
        };
        open().with_context(|| format!("cannot open {}", self.path.join(name).display()))
    }

    /// All files of GPUs.
    ///
    /// # Errors
    /// One cannot be opened.
    pub fn files(&self) -> anyhow::Result<Vec<File>> {
        names(&self.path)?.iter().map(|name| self.named(name)).collect()
    }
}

/// Names of the journals in a folder; none where there is no folder.
///
/// # Errors
/// It cannot be read.
pub fn names(path: &Path) -> anyhow::Result<Vec<String>> {
    let flags = OFlag::O_DIRECTORY | OFlag::O_CLOEXEC;
    let mut folder = match Dir::open(path, flags, Mode::empty()) {
        Ok(folder) => folder,
        Err(nix::errno::Errno::ENOENT) => return Ok(Vec::new()),
        Err(error) => return Err(error).with_context(|| format!("cannot read {}", path.display())),
    };
    let mut names = Vec::new();
    for entry in folder.iter() {
        names
            .extend(entry?.file_name().to_str().ok().filter(|name| name.ends_with(SUFFIX)).map(String::from));
    }
    names.sort();
    Ok(names)
}

const SUFFIX: &str = ".journal";

fn file_name(gpu: &Identity) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    gpu.uuid.chars().map(safe).collect::<String>() + SUFFIX
}

/// Whether it is of the kind expected, ours, and not for others to write.
fn check(stat: &FileStat, kind: SFlag) -> anyhow::Result<()> {
    if SFlag::from_bits_truncate(stat.st_mode) & SFlag::S_IFMT != kind {
        bail!("it is something else");
    }
    if stat.st_uid != geteuid().as_raw() {
        bail!("it belongs to another user ({})", stat.st_uid);
    }
    if stat.st_mode & 0o022 != 0 {
        bail!("others may write to it (mode {:o})", stat.st_mode & 0o777);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::Vendor;
    use std::fs::{self, Permissions};
    use std::os::unix::fs::{PermissionsExt, symlink};

    fn gpu(uuid: &str) -> Identity {
        let name = "GPU".to_owned();
        Identity { vendor: Vendor::Nvidia, name, uuid: uuid.into(), pci: None, driver: String::new() }
    }

    #[track_caller]
    fn refused(result: anyhow::Result<impl Sized>, why: &str) {
        let error = format!("{:#}", result.err().expect("it must be refused"));
        assert!(error.contains(why), "{error}");
    }

    #[test]
    fn what_others_may_write_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state");
        let made = Folder::make(&path).unwrap();
        made.file(&gpu("GPU-1")).unwrap();
        fs::set_permissions(path.join("GPU-1.journal"), Permissions::from_mode(0o666)).unwrap();
        refused(made.file(&gpu("GPU-1")), "others may write");
        fs::set_permissions(&path, Permissions::from_mode(0o777)).unwrap();
        refused(Folder::make(&path), "others may write");
    }

    #[test]
    fn links_are_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state");
        let made = Folder::make(&path).unwrap();
        let precious = folder.path().join("precious");
        fs::write(&precious, "x").unwrap();
        symlink(&precious, path.join("GPU-1.journal")).unwrap();
        refused(made.file(&gpu("GPU-1")), "cannot open");
        fs::hard_link(&precious, path.join("GPU-2.journal")).unwrap();
        refused(made.file(&gpu("GPU-2")), "several names");
        symlink(&path, folder.path().join("link")).unwrap();
        refused(Folder::make(&folder.path().join("link")), "cannot keep a journal");
        assert_eq!(fs::read_to_string(&precious).unwrap(), "x");
    }

    #[test]
    fn another_users_folder_is_refused() {
        if !geteuid().is_root() {
            // Only root can give a folder away.
            return refused(Folder::open(Path::new("/")), "another user");
        }
        let folder = tempfile::tempdir().unwrap();
        std::os::unix::fs::chown(folder.path(), Some(65534), None).unwrap();
        refused(Folder::open(folder.path()), "another user");
    }

    #[test]
    fn identifiers_make_names_that_stay_in_the_folder() {
        assert_eq!(file_name(&gpu("0000:03:00.0")), "0000_03_00_0.journal");
        assert_eq!(file_name(&gpu("../etc/passwd")), "___etc_passwd.journal");
    }
}
