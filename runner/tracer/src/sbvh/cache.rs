//! Trees kept on disk, because they take seconds to build.
//!
//! A file for each tree, named after the hash of what it was built from. Little-endian; R leaves, L levels:
//!
//! ```text
//! magic    "BL SBVH\n"                                                       8 bytes
//! key      SHA-256 of version, parameters and triangles                     32
//! counts   version, triangles, R, L: u32 each                               16
//! seconds  that the build took: f64                                          8
//! levels   the node after each level's last: u32                           4 L
//! leaves   least corner, greatest corner: f32 each; triangle: u32         28 R
//! inner    left child, right child: u32                                 8 (R-1)
//! check    SHA-256 of everything before                                     32
//! ```
//!
//! Boxes of inner nodes are not stored: they are those of their children. What is read is only used if the
//! check and every count, link and level are right; otherwise the tree is built as if there were no file,
//! and [`Built::notes`] says why.

use super::{SbvhParams, build};
use crate::{
    bvh2::{Aabb, Bvh2, Bvh2Node, LEAF, MAX_LEVELS, MAX_TRIANGLES, Triangle},
    scene::hex,
    validate,
};
use sha2::{Digest, Sha256};
use std::{
    env, fs,
    io::{self, Write},
    path::{Path, PathBuf},
    time::Instant,
};

/// Goes up whenever [`build`] makes other trees or the file looks different: then old files are not found.
const VERSION: u32 = 1;

const MAGIC: [u8; 8] = *b"BL SBVH\n";

const HEADER_BYTES: usize = 8 + 32 + 16 + 8;

type Hash = [u8; 32];

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
        let key = key(triangles, params);
        (folder, folder.join(format!("sbvh-{}", hex(&key))), key)
    });
    if let Some((_, path, key)) = &place {
        match fs::read(path) {
            Ok(bytes) => match decode(&bytes, key, triangles.len()) {
                Ok((tree, seconds)) => return (tree, Built { cached: true, seconds, ..built }),
                Err(reason) => built.notes.push(format!(
                    "the cached tree {} is damaged ({reason}) and was built again",
                    path.display()
                )),
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
    if let Some((folder, path, key)) = &place
        && let Err(error) = write(folder, path, &encode(&tree, key, triangles.len(), built.seconds))
    {
        built.notes.push(format!("the tree cannot be cached in {}: {error}", folder.display()));
    }
    (tree, built)
}

/// What a tree depends on.
fn key(triangles: &[Triangle], params: &SbvhParams) -> Hash {
    let mut hash = Sha256::new();
    hash.update(VERSION.to_le_bytes());
    let params = serde_json::to_vec(params).expect("numbers under names");
    hash.update((params.len() as u64).to_le_bytes());
    hash.update(params);
    for part in triangles.chunks(1 << 12) {
        let bytes: Vec<u8> =
            part.as_flattened().as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        hash.update(bytes);
    }
    hash.finalize().into()
}

/// Puts a file in its place, whole or not at all.
fn write(folder: &Path, path: &Path, bytes: &[u8]) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    let mut file = tempfile::Builder::new().prefix(".sbvh-").tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.persist(path)?;
    Ok(())
}

fn bytes_of(leaves: usize, levels: usize) -> usize {
    HEADER_BYTES + 4 * levels + 28 * leaves + 8 * (leaves - 1) + 32
}

fn encode(tree: &Bvh2, key: &Hash, triangles: usize, seconds: f64) -> Vec<u8> {
    let (leaves, inner) = tree.nodes.split_at(tree.leaves);
    let mut bytes = Vec::with_capacity(bytes_of(tree.leaves, tree.levels.len()));
    bytes.extend(MAGIC);
    bytes.extend(key);
    for count in [VERSION, triangles as u32, tree.leaves as u32, tree.levels.len() as u32] {
        bytes.extend(count.to_le_bytes());
    }
    bytes.extend(seconds.to_le_bytes());
    tree.levels.iter().for_each(|level| bytes.extend(level.end.to_le_bytes()));
    for leaf in leaves {
        leaf.lo.iter().chain(&leaf.hi).for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend(leaf.left.to_le_bytes());
    }
    inner.iter().for_each(|node| [node.left, node.right].iter().for_each(|c| bytes.extend(c.to_le_bytes())));
    let check = Sha256::digest(&bytes);
    bytes.extend(check);
    bytes
}

/// A tree over `triangles` triangles and the seconds that it took, or what is wrong with the file.
fn decode(bytes: &[u8], key: &Hash, triangles: usize) -> Result<(Bvh2, f64), String> {
    let Some((contents, check)) = bytes.split_last_chunk::<32>().filter(|(c, _)| c.len() >= HEADER_BYTES)
    else {
        return Err(format!("it has {} bytes", bytes.len()));
    };
    if *check != *Sha256::digest(contents) {
        return Err("its checksum does not match".into());
    }
    let (header, body) = contents.split_at(HEADER_BYTES);
    let word =
        |bytes: &[u8], i: usize| u32::from_le_bytes(bytes[4 * i..4 * i + 4].try_into().expect("four bytes"));
    if header[..8] != MAGIC || header[8..40] != *key {
        return Err("it is of something else".into());
    }
    let [version, of, leaves, levels] = [10, 11, 12, 13].map(|i| word(header, i) as usize);
    let sizes = version == VERSION as usize
        && of == triangles
        && (1..=MAX_TRIANGLES).contains(&leaves)
        && levels <= MAX_LEVELS
        && bytes.len() == bytes_of(leaves, levels);
    if !sizes {
        return Err(format!("version {version}, {of} triangles, {leaves} leaves, {levels} levels"));
    }
    let seconds = f64::from_le_bytes(header[56..].try_into().expect("eight bytes"));
    let (ends, body) = body.split_at(4 * levels);
    let (leaf_bytes, inner_bytes) = body.split_at(28 * leaves);
    let corner = |leaf: &[u8], at: usize| std::array::from_fn(|k| f32::from_bits(word(leaf, at + k)));
    let mut nodes = Vec::with_capacity(2 * leaves - 1);
    nodes.extend(leaf_bytes.chunks_exact(28).map(|leaf| {
        let bounds = Aabb { lo: corner(leaf, 0), hi: corner(leaf, 3) };
        Bvh2Node::new(bounds, word(leaf, 6), LEAF)
    }));
    nodes.extend(
        inner_bytes.chunks_exact(8).map(|node| Bvh2Node::new(Aabb::EMPTY, word(node, 0), word(node, 1))),
    );
    let ends: Vec<u32> = std::iter::once(leaves as u32).chain((0..levels).map(|i| word(ends, i))).collect();
    let mut tree = Bvh2 { nodes, leaves, levels: ends.windows(2).map(|w| w[0]..w[1]).collect() };
    validate::links(&tree, triangles).map_err(|invalid| invalid.0)?;
    if tree.nodes[..leaves].iter().any(|leaf| leaf.bounds().is_empty()) {
        return Err("a leaf has an empty box".into());
    }
    for i in leaves..tree.nodes.len() {
        let Bvh2Node { left, right, .. } = tree.nodes[i];
        let [l, r] = [left, right].map(|child| tree.nodes[child as usize].bounds());
        tree.nodes[i] = Bvh2Node::new(l.union(&r), left, right);
    }
    Ok((tree, seconds))
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
            assert!(built.notes.len() == 1 && built.notes[0].contains("damaged"), "{what}: {built:?}");
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
    fn a_wrong_file_with_a_right_checksum_is_refused() {
        let (triangles, params) = (triangles(), SbvhParams::default());
        let (key, n) = (key(&triangles, &params), triangles.len());
        let sound = build(&triangles, &params);
        let (r, root) = (sound.leaves, sound.nodes.len() - 1);
        let refused = |f: &dyn Fn(&mut Bvh2)| {
            let mut tree = sound.clone();
            f(&mut tree);
            decode(&encode(&tree, &key, n, 1.0), &key, n).unwrap_err()
        };
        assert!(refused(&|t| t.nodes[0].left = 12).contains("triangle 12 of 12"));
        assert!(refused(&|t| t.nodes[0].lo[0] = 100.0).contains("empty"));
        assert!(refused(&|t| t.nodes[root].left = root as u32).contains("has child"));
        assert!(refused(&|t| t.nodes[root].left = t.nodes[root].right).contains("two parents"));
        assert!(refused(&|t| t.levels[0].end = r as u32 - 1).contains("level 0"));
        let bytes = encode(&sound, &key, n, 1.0);
        assert!(decode(&bytes, &key, n + 1).unwrap_err().contains("12 triangles"));
        assert!(decode(&bytes, &[0; 32], n).unwrap_err().contains("something else"));
        assert_eq!(decode(&bytes, &key, n), Ok((sound, 1.0)));
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
