//! Where scene files and descriptors are looked for.

use std::path::{Path, PathBuf};

/// The environment variable that lists folders with scene files, separated as in `PATH`.
pub const ENVIRONMENT: &str = "BROADLEAF_SCENES";

/// Folders that are searched for scene files and for descriptors (`NAME.toml`), first to last.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SearchPath {
    folders: Vec<PathBuf>,
}

impl SearchPath {
    /// The given folders (`--scene-dir`, in order), then those of `BROADLEAF_SCENES`, then `scenes/`
    /// in the working directory.
    pub fn new(scene_dirs: impl IntoIterator<Item = PathBuf>) -> Self {
        Self::from_parts(scene_dirs, std::env::var_os(ENVIRONMENT).as_deref())
    }

    /// Only these folders: neither the environment nor the working directory is asked.
    pub fn only(folders: impl IntoIterator<Item = PathBuf>) -> Self {
        Self { folders: folders.into_iter().collect() }
    }

    fn from_parts(
        scene_dirs: impl IntoIterator<Item = PathBuf>,
        environment: Option<&std::ffi::OsStr>,
    ) -> Self {
        let mut folders: Vec<PathBuf> = scene_dirs.into_iter().collect();
        if let Some(list) = environment {
            folders.extend(std::env::split_paths(list).filter(|folder| !folder.as_os_str().is_empty()));
        }
        folders.push(PathBuf::from("scenes"));
        Self { folders }
    }

    /// The folders, in the order in which they are searched.
    pub fn folders(&self) -> &[PathBuf] {
        &self.folders
    }

    /// The first file of that name.
    pub fn find(&self, file: &Path) -> Option<PathBuf> {
        self.folders.iter().map(|folder| folder.join(file)).find(|path| path.is_file())
    }
}

/// A list of folders for a message.
pub(crate) fn listed<'a>(folders: impl IntoIterator<Item = &'a Path>) -> String {
    let text: Vec<String> = folders.into_iter().map(|folder| folder.display().to_string()).collect();
    if text.is_empty() { "(no folder)".to_owned() } else { text.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_come_before_the_environment_and_the_working_directory() {
        let list = std::env::join_paths(["/b", "/c"]).unwrap();
        let path = SearchPath::from_parts([PathBuf::from("/a")], Some(&list));
        assert_eq!(path.folders(), ["/a", "/b", "/c", "scenes"].map(PathBuf::from));
    }

    #[test]
    fn the_first_folder_with_the_file_wins() {
        let first = tempfile::tempdir().unwrap();
        let second = tempfile::tempdir().unwrap();
        std::fs::write(second.path().join("x.glb"), b"").unwrap();
        let path = SearchPath::only([first.path().to_owned(), second.path().to_owned()]);
        assert_eq!(path.find(Path::new("x.glb")), Some(second.path().join("x.glb")));
        std::fs::write(first.path().join("x.glb"), b"").unwrap();
        assert_eq!(path.find(Path::new("x.glb")), Some(first.path().join("x.glb")));
        assert_eq!(path.find(Path::new("y.glb")), None);
    }
}
