//! Trees kept on disk, because they take seconds to build.
//!
//! A file for each tree, in the format of [`crate::treefile`], named after the hash of what it was built from. What is
//! wrong with one is no failure: the tree is built as if there were no file, and [`Built::notes`] says why.

use super::{SbvhParams, build};
use crate::{
    bvh2::{Bvh2, Triangle},
    scene::hex,
    treefile::{self, Fault, Hash, Made, Recipe},
};
use sha2::{Digest, Sha256};
use std::{
    env, fs,
    io::{self, Write},
    path::{Path, PathBuf},
    time::Instant,
};

/// Where a tree came from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Built {
    /// Whether it was read instead of built.
    pub cached: bool,
    /// What building it took, in seconds; when that was, if it was read.
    pub seconds: f64,
    /// Files that could not be used or not be written, one sentence each. The tree is right all the same.
    pub notes: Vec<String>,
}

/// `$XDG_CACHE_HOME/broadleaf`, or `~/.cache/broadleaf`; `None` where the environment tells neither.
pub fn default_folder() -> Option<PathBuf> {
    folder_of(|name| env::var_os(name).map(PathBuf::from))
}

fn folder_of(variable: impl Fn(&str) -> Option<PathBuf>) -> Option<PathBuf> {
    // Relative paths are to be ignored, says the XDG Base Directory Specification.
    let variable = |name| variable(name).filter(|path| path.is_absolute());
    let caches = variable("XDG_CACHE_HOME").or_else(|| Some(variable("HOME")?.join(".cache")))?;
    Some(caches.join("broadleaf"))
}

/// The tree that [`build`] makes, read from `folder` if it is there, otherwise built and written there.
/// Without a folder it is built.
///
/// A folder that cannot be read or written is no failure: [`Built::notes`] tells.
///
/// # Panics
/// As [`build`].
pub fn load_or_build(triangles: &[Triangle], params: &SbvhParams, folder: Option<&Path>) -> (Bvh2, Built) {
    let mut built = Built::default();
    let place = folder.map(|folder| {
        let content = treefile::content(triangles);
        (folder, folder.join(format!("bvh2-{}", hex(&key(&content, params)))), content)
    });
    let made = |seconds| Made {
        // The same triangles are the same tree, whatever they are called.
        scene: String::new(),
        recipe: Recipe::Sbvh { sbvh: params.clone() },
        seconds,
    };
    if let Some((_, path, content)) = &place {
        match fs::read(path) {
            Ok(bytes) => match treefile::decode(&bytes, content, triangles.len()) {
                Ok((tree, found)) if found == made(found.seconds) => {
                    return (tree, Built { cached: true, seconds: found.seconds, ..built });
                }
                Ok(_) => {
                    built.notes.push(unusable(path, &Fault::Damaged("it is of other parameters".into())))
                }
                Err(fault) => built.notes.push(unusable(path, &fault)),
            },
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => {
                built.notes.push(format!("the cached tree {} cannot be read: {error}", path.display()));
            }
        }
    }
    let started = Instant::now();
    let tree = build(triangles, params);
    built.seconds = started.elapsed().as_secs_f64();
    if let Some((folder, path, content)) = &place {
        let bytes = treefile::encode(&tree, &made(built.seconds), content, triangles.len());
        if let Err(error) = write(folder, path, &bytes) {
            built.notes.push(format!("the tree cannot be cached in {}: {error}", folder.display()));
        }
    }
    (tree, built)
}

fn unusable(path: &Path, fault: &Fault) -> String {
    format!("the cached tree {} {fault}; it was built again", path.display())
}

/// What a tree depends on.
fn key(content: &Hash, params: &SbvhParams) -> Hash {
    let mut hash = Sha256::new();
    hash.update(treefile::VERSION.to_le_bytes());
    let params = serde_json::to_vec(params).expect("numbers under names");
    hash.update((params.len() as u64).to_le_bytes());
    hash.update(params);
    hash.update(content);
    hash.finalize().into()
}

/// Puts a file in its place, whole or not at all.
fn write(folder: &Path, path: &Path, bytes: &[u8]) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    let mut file = tempfile::Builder::new().prefix(".bvh2-").tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.persist(path)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    fn triangles() -> Vec<Triangle> {
        (0..12)
            .map(|i| {
                let (x, y) = (i as f32, (i * 5 % 12) as f32);
                [[x, 0.0, 0.0], [12.0 - x, 12.0, y], [x + 0.5, 0.0, 0.0]]
            })
            .collect()
    }

    fn only_file(folder: &TempDir) -> PathBuf {
        let files: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|f| f.unwrap().path()).collect();
        assert_eq!(files.len(), 1, "{files:?}");
        files.into_iter().next().unwrap()
    }

    #[test]
    fn a_tree_is_built_once_and_read_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("not/yet/there");
        let (triangles, params) = (triangles(), SbvhParams::default());
        let (tree, built) = load_or_build(&triangles, &params, Some(&inside));
        assert!(!built.cached && built.notes.is_empty(), "{built:?}");
        let (read, again) = load_or_build(&triangles, &params, Some(&inside));
        assert_eq!(again, Built { cached: true, ..built });
        assert_eq!(bytemuck::cast_slice::<_, u32>(&read.nodes), bytemuck::cast_slice::<_, u32>(&tree.nodes));
        assert_eq!((read.leaves, read.levels), (tree.leaves, tree.levels));
        let (one, _) = load_or_build(&triangles[..1], &params, Some(&inside));
        assert_eq!(load_or_build(&triangles[..1], &params, Some(&inside)).0, one);
    }

    #[test]
    fn other_parameters_or_triangles_are_not_found() {
        let folder = tempfile::tempdir().unwrap();
        let (triangles, params) = (triangles(), SbvhParams::default());
        let cached = |triangles: &[Triangle], params: &SbvhParams| {
            load_or_build(triangles, params, Some(folder.path())).1.cached
        };
        assert!(!cached(&triangles, &params));
        let defaults = SbvhParams::default;
        for other in [
            SbvhParams { alpha: 2e-5, ..defaults() },
            SbvhParams { object_bins: 31, ..defaults() },
            SbvhParams { spatial_bins: 31, ..defaults() },
            SbvhParams { sweep: 63, ..defaults() },
            SbvhParams { budget: 1.0, ..defaults() },
        ] {
            assert!(!cached(&triangles, &other), "{other:?}");
        }
        let mut moved = triangles.clone();
        moved[7][2][1] = 0.25;
        assert!(!cached(&moved, &params));
        assert!(!cached(&triangles[..11], &params));
        assert!(cached(&triangles, &params));
    }

    #[test]
    fn no_damaged_file_is_trusted_and_the_next_one_is_sound() {
        let folder = tempfile::tempdir().unwrap();
        let (triangles, params) = (triangles(), SbvhParams::default());
        let get = || load_or_build(&triangles, &params, Some(folder.path()));
        let (tree, _) = get();
        let path = only_file(&folder);
        let sound = fs::read(&path).unwrap();
        let check = |bytes: &[u8], what: &str| {
            fs::write(&path, bytes).unwrap();
            let (again, built) = get();
            assert!(!built.cached && again == tree, "{what}");
            assert!(built.notes.len() == 1 && built.notes[0].contains("built again"), "{what}: {built:?}");
        };
        for at in 0..sound.len() {
            let mut bytes = sound.clone();
            bytes[at] ^= 1 << (at % 8);
            check(&bytes, &format!("byte {at}"));
        }
        for length in (0..sound.len()).step_by(13) {
            check(&sound[..length], &format!("cut after {length}"));
        }
        check(&[&sound[..], &[0]].concat(), "a byte more");
        assert!(get().1.cached, "what was built again was written");
    }

    #[test]
    fn a_tree_of_other_parameters_under_the_right_name_is_not_taken() {
        let folder = tempfile::tempdir().unwrap();
        let (triangles, params) = (triangles(), SbvhParams::default());
        let (tree, _) = load_or_build(&triangles, &params, Some(folder.path()));
        let path = only_file(&folder);
        let recipe = Recipe::Sbvh { sbvh: SbvhParams { budget: 0.0, ..params.clone() } };
        let made = Made { scene: String::new(), recipe, seconds: 1.0 };
        let content = treefile::content(&triangles);
        fs::write(&path, treefile::encode(&tree, &made, &content, triangles.len())).unwrap();
        let (again, built) = load_or_build(&triangles, &params, Some(folder.path()));
        assert!(again == tree && !built.cached && built.notes[0].contains("other parameters"), "{built:?}");
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_told_and_no_failure() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let (triangles, params) = (triangles(), SbvhParams::default());
        let (tree, built) = load_or_build(&triangles, &params, Some(&file.join("below")));
        assert_eq!(tree, build(&triangles, &params));
        assert!(built.notes.last().unwrap().contains("cannot be cached"), "{built:?}");
        let (same, built) = load_or_build(&triangles, &params, None);
        assert!(same == tree && built.notes.is_empty() && !built.cached, "{built:?}");
    }

    #[test]
    fn the_folder_is_where_the_environment_says() {
        let with = |cache: &'static str, home: &'static str| {
            folder_of(|name| {
                let value = if name == "HOME" { home } else { cache };
                (!value.is_empty()).then(|| value.into())
            })
        };
        assert_eq!(with("/c", "/h"), Some("/c/broadleaf".into()));
        assert_eq!(with("", "/h"), Some("/h/.cache/broadleaf".into()));
        assert_eq!(with("relative", "/h"), Some("/h/.cache/broadleaf".into()));
        assert_eq!(with("", ""), None);
    }
}
