//! Binary trees in files: the one format of trees that are stored on purpose (`runner bvh precompute`) and of those that
//! [`crate::sbvh::cache`] keeps.
//!
//! Little-endian; R leaves, L levels, P bytes of JSON:
//!
//! ```text
//! magic    "BL BVH2\n"                                                       8 bytes
//! counts   version, triangles, R, L, P: u32 each                            20
//! content  SHA-256 of the triangles that the tree is over                   32
//! made     how it was made, a [`Made`] in JSON                               P
//! levels   the node after each level's last: u32                           4 L
//! leaves   least corner, greatest corner: f32 each; triangle: u32         28 R
//! inner    left child, right child: u32                                 8 (R-1)
//! check    SHA-256 of everything before                                     32
//! ```
//!
//! Boxes of inner nodes are not stored: they are those of their children. A tree is only taken from a file whose check,
//! counts, links and levels are all right, and that is over the very triangles that it is asked for: a tree over others
//! would lose hits without a word.

use crate::{
    builder::Method,
    bvh2::{Aabb, Bvh2, Bvh2Node, LEAF, MAX_LEVELS, MAX_TRIANGLES, Triangle},
    hploc::HplocParams,
    morton::MortonParams,
    ploc::PlocParams,
    sbvh::SbvhParams,
    validate,
};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// Goes up whenever the file looks different, or a method makes other trees of the same parameters.
pub const VERSION: u32 = 2;

const MAGIC: [u8; 8] = *b"BL BVH2\n";

const HEADER_BYTES: usize = 8 + 20 + 32;

/// Of [`Made`] in JSON: more than any has, so that a damaged count asks for no memory.
const MOST_JSON: usize = 1 << 16;

/// A SHA-256.
pub type Hash = [u8; 32];

/// How a binary tree is made: a method and all that it goes by.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "method", rename_all = "lowercase")]
pub enum Recipe {
    /// Clustering along a curve: [`crate::ploc`].
    Ploc {
        /// The curve.
        morton: MortonParams,
        /// The clustering.
        ploc: PlocParams,
    },
    /// The same up the hierarchy of the codes: [`crate::hploc`].
    Hploc {
        /// The curve.
        morton: MortonParams,
        /// The clustering.
        hploc: HplocParams,
    },
    /// Spatial splits: [`crate::sbvh`].
    Sbvh {
        /// When to split.
        sbvh: SbvhParams,
    },
    /// Boxes halved in the middle: [`crate::midpoint`], which goes by nothing.
    Midpoint,
}

impl Recipe {
    /// Its method.
    pub fn method(&self) -> Method {
        match self {
            Self::Ploc { .. } => Method::Ploc,
            Self::Hploc { .. } => Method::Hploc,
            Self::Sbvh { .. } => Method::Sbvh,
            Self::Midpoint => Method::Midpoint,
        }
    }
}

/// How the tree in a file came to be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Made {
    /// Name of the scene, for people; empty where nobody said.
    pub scene: String,
    /// Method and parameters.
    pub recipe: Recipe,
    /// What making it took, in seconds.
    pub seconds: f64,
}

/// Why no tree is taken from a file; what it says goes on from the file's name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// It begins with something else.
    #[error("is no file of a binary tree")]
    Other,
    /// Another version of Broadleaf wrote it.
    #[error("is of version {0}, and this program reads version {VERSION}")]
    Version(u32),
    /// It was cut short, or changed, or whoever wrote it made a mistake.
    #[error("is damaged: {0}")]
    Damaged(String),
    /// It is sound, and over other triangles.
    #[error(
        "is a tree over the {triangles} triangles of {scene}, not over those of this scene (their hashes differ)"
    )]
    OtherScene {
        /// Name of the scene that it is over.
        scene: String,
        /// How many triangles that has.
        triangles: u32,
    },
}

/// What tells triangles from all others: their SHA-256, nine little-endian floats each, in file order.
pub fn content(triangles: &[Triangle]) -> Hash {
    let mut hash = Sha256::new();
    for part in triangles.chunks(1 << 12) {
        let bytes: Vec<u8> =
            part.as_flattened().as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        hash.update(bytes);
    }
    hash.finalize().into()
}

fn bytes_of(leaves: usize, levels: usize, json: usize) -> usize {
    HEADER_BYTES + json + 4 * levels + 28 * leaves + 8 * (leaves - 1) + 32
}

/// The file of a tree over `triangles` triangles whose hash is `content`.
///
/// # Panics
/// The tree has no leaves, or its nodes are in no order: see [`Bvh2::in_levels`].
pub fn encode(tree: &Bvh2, made: &Made, content: &Hash, triangles: usize) -> Vec<u8> {
    let (leaves, inner) = tree.nodes.split_at(tree.leaves);
    assert!(inner.is_empty() || !tree.levels.is_empty(), "a file has its nodes in levels");
    let json = serde_json::to_vec(made).expect("numbers and text under names");
    let mut bytes = Vec::with_capacity(bytes_of(tree.leaves, tree.levels.len(), json.len()));
    bytes.extend(MAGIC);
    let counts = [triangles, tree.leaves, tree.levels.len(), json.len()].map(|count| count as u32);
    for count in std::iter::once(VERSION).chain(counts) {
        bytes.extend(count.to_le_bytes());
    }
    bytes.extend(content);
    bytes.extend(json);
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

/// The tree over `triangles` triangles whose hash is `content`, and how it was made.
///
/// # Errors
/// The file is something else, of another version, damaged, or of other triangles; asked in this order.
pub fn decode(bytes: &[u8], content: &Hash, triangles: usize) -> Result<(Bvh2, Made), Fault> {
    let damaged = |reason: String| Err(Fault::Damaged(reason));
    if !bytes.starts_with(&MAGIC) {
        return Err(Fault::Other);
    }
    let word =
        |bytes: &[u8], i: usize| u32::from_le_bytes(bytes[4 * i..4 * i + 4].try_into().expect("four bytes"));
    if bytes.len() < HEADER_BYTES {
        return damaged(format!("it has {} bytes", bytes.len()));
    }
    let (header, body) = bytes.split_at(HEADER_BYTES);
    let [version, of, leaves, levels, json] = [2, 3, 4, 5, 6].map(|i| word(header, i));
    if version != VERSION {
        return Err(Fault::Version(version));
    }
    match bytes.split_last_chunk::<32>() {
        Some((contents, check)) if *check == *Sha256::digest(contents) => {}
        _ => return damaged("its checksum does not match".into()),
    }
    let [leaves, levels, json] = [leaves, levels, json].map(|count| count as usize);
    let sizes = (1..=MAX_TRIANGLES).contains(&leaves)
        && levels <= MAX_LEVELS
        && json <= MOST_JSON
        && bytes.len() == bytes_of(leaves, levels, json);
    if !sizes {
        return damaged(format!(
            "{leaves} leaves, {levels} levels and {json} bytes of JSON do not fit its size"
        ));
    }
    let (made, body) = body.split_at(json);
    let made: Made = match serde_json::from_slice(made) {
        Ok(made) => made,
        Err(error) => return damaged(format!("how it was made cannot be read: {error}")),
    };
    if header[28..] != *content || of as usize != triangles {
        let scene = if made.scene.is_empty() { "another scene".into() } else { made.scene };
        return Err(Fault::OtherScene { scene, triangles: of });
    }
    let (ends, body) = body.split_at(4 * levels);
    let (leaf_bytes, rest) = body.split_at(28 * leaves);
    let inner_bytes = &rest[..8 * (leaves - 1)];
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
    if let Err(invalid) = validate::links(&tree, triangles) {
        return damaged(invalid.0);
    }
    if tree.nodes[..leaves].iter().any(|leaf| leaf.bounds().is_empty()) {
        return damaged("a leaf has an empty box".into());
    }
    for i in leaves..tree.nodes.len() {
        let Bvh2Node { left, right, .. } = tree.nodes[i];
        let [l, r] = [left, right].map(|child| tree.nodes[child as usize].bounds());
        tree.nodes[i] = Bvh2Node::new(l.union(&r), left, right);
    }
    Ok((tree, made))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{hploc, midpoint, morton, ploc, sbvh, sort};

    fn triangles(count: usize) -> Vec<Triangle> {
        (0..count)
            .map(|i| {
                let (x, y) = (i as f32, (i * 5 % 12) as f32);
                [[x, 0.0, 0.0], [12.0 - x, 12.0, y], [x + 0.5, 0.0, 0.0]]
            })
            .collect()
    }

    fn made(recipe: Recipe) -> Made {
        Made { scene: "sticks".into(), recipe, seconds: 0.1 }
    }

    fn splits() -> Recipe {
        Recipe::Sbvh { sbvh: SbvhParams { alpha: 3e-5, ..SbvhParams::default() } }
    }

    fn bits(tree: &Bvh2) -> &[u32] {
        bytemuck::cast_slice(&tree.nodes)
    }

    #[test]
    fn trees_of_all_methods_and_sizes_are_read_as_they_were() {
        for count in [1, 2, 3, 12] {
            let triangles = triangles(count);
            let content = content(&triangles);
            let order: Vec<u32> = (0..count as u32).rev().collect();
            let clustered = ploc::cpu::build(&triangles, &order, 1.0, &PlocParams::default());
            let clustering = Recipe::Ploc { morton: MortonParams::default(), ploc: PlocParams { radius: 3 } };
            let (bounds, morton) = (morton::cpu::bounds(&triangles), MortonParams::default());
            let codes = morton::cpu::codes(&triangles, &bounds, &morton);
            let (sorted, hploc) = (sort::cpu::order(&codes), HplocParams::default());
            let climbed = hploc::cpu::build(&triangles, &codes, &sorted, bounds.scale(), &hploc).in_levels();
            let climbing = Recipe::Hploc { morton, hploc };
            let split = sbvh::build(&triangles, &SbvhParams::default());
            let halved = midpoint::build(&triangles);
            for (tree, recipe) in
                [(clustered, clustering), (climbed, climbing), (split, splits()), (halved, Recipe::Midpoint)]
            {
                let made = made(recipe);
                let (read, how) = decode(&encode(&tree, &made, &content, count), &content, count).unwrap();
                assert_eq!(bits(&read), bits(&tree));
                assert_eq!((read.leaves, read.levels), (tree.leaves, tree.levels));
                assert_eq!(how, made);
            }
        }
    }

    #[test]
    fn whatever_is_damaged_is_refused() {
        let triangles = triangles(12);
        let content = content(&triangles);
        let tree = sbvh::build(&triangles, &SbvhParams::default());
        let sound = encode(&tree, &made(splits()), &content, 12);
        for bit in 0..8 * sound.len() {
            let mut bytes = sound.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            let fault = decode(&bytes, &content, 12).unwrap_err();
            let expected = match bit / 8 {
                0..8 => fault == Fault::Other,
                8..12 => matches!(fault, Fault::Version(_)),
                _ => fault == Fault::Damaged("its checksum does not match".into()),
            };
            assert!(expected, "bit {bit}: {fault}");
        }
        for length in 0..sound.len() {
            let fault = decode(&sound[..length], &content, 12).unwrap_err();
            let expected =
                if length < 8 { fault == Fault::Other } else { matches!(fault, Fault::Damaged(_)) };
            assert!(expected, "cut after {length}: {fault}");
        }
        assert!(matches!(decode(&[&sound[..], &[0]].concat(), &content, 12), Err(Fault::Damaged(_))));
    }

    #[test]
    fn another_scene_is_told_by_its_name() {
        let triangles = triangles(12);
        let tree = sbvh::build(&triangles, &SbvhParams::default());
        let bytes = encode(&tree, &made(splits()), &content(&triangles), 12);
        let mut moved = triangles.clone();
        moved[7][2][1] = 0.25;
        for other in [&moved[..], &triangles[..11]] {
            let fault = decode(&bytes, &content(other), other.len()).unwrap_err().to_string();
            assert!(fault.contains("the 12 triangles of sticks"), "{fault}");
        }
    }

    /// Whoever writes a file can give a wrong tree a right checksum.
    #[test]
    fn a_wrong_tree_with_a_right_checksum_is_refused() {
        let triangles = triangles(12);
        let content = content(&triangles);
        let sound = sbvh::build(&triangles, &SbvhParams::default());
        let (r, root) = (sound.leaves, sound.nodes.len() - 1);
        let refused = |f: &dyn Fn(&mut Bvh2)| {
            let mut tree = sound.clone();
            f(&mut tree);
            decode(&encode(&tree, &made(splits()), &content, 12), &content, 12).unwrap_err().to_string()
        };
        assert!(refused(&|t| t.nodes[0].left = 12).contains("triangle 12 of 12"));
        assert!(refused(&|t| t.nodes[0].lo[0] = 100.0).contains("empty"));
        assert!(refused(&|t| t.nodes[root].left = root as u32).contains("has child"));
        assert!(refused(&|t| t.nodes[root].left = t.nodes[root].right).contains("two parents"));
        assert!(refused(&|t| t.levels[0].end = r as u32 - 1).contains("level 0"));
    }
}
