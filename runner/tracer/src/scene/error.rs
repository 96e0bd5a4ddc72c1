//! What can go wrong between a name on the command line and a scene in memory.

use std::path::{Path, PathBuf};

use thiserror::Error;

/// Why a scene could not be loaded. Each message names the cause and a way out.
#[derive(Debug, Error)]
pub enum SceneError {
    /// No descriptor of that name, and no file there either.
    #[error(
        "there is no scene called '{name}'. Known scenes: {known}. A path must end in .glb, .gltf, .obj, .toml or .json; \
         a descriptor of your own is NAME.toml in a folder given by --scene-dir (looked in: {looked_in})"
    )]
    UnknownScene {
        /// What was asked for.
        name: String,
        /// Names of the built-in descriptors.
        known: String,
        /// The folders that were searched for a descriptor.
        looked_in: String,
    },

    /// The specification `NAME:key=value,…` cannot be understood.
    #[error("cannot understand the scene '{spec}': {reason}")]
    Spec {
        /// The text as given.
        spec: String,
        /// What is wrong with it, and what would be right.
        reason: String,
    },

    /// The descriptor exists, the file that it names does not.
    #[error(
        "scene '{name}' needs the file {file}, which is in none of: {looked_in}. {get}. \
         Then name its folder with --scene-dir or in BROADLEAF_SCENES"
    )]
    MissingFile {
        /// The scene's name.
        name: String,
        /// The file that the descriptor names.
        file: String,
        /// The folders that were searched.
        looked_in: String,
        /// Where a user gets the file.
        get: String,
    },

    /// The file differs from the one that the descriptor describes.
    #[error(
        "{path} is not the file that scene '{name}' describes: its sha256 is {found}, expected {expected}. \
         Fetch it again, or give the path instead of the name to use this file as it is"
    )]
    WrongHash {
        /// The scene's name.
        name: String,
        /// The file that was found.
        path: PathBuf,
        /// Its hash, in hexadecimal.
        found: String,
        /// The hash in the descriptor.
        expected: String,
    },

    /// A file could not be read.
    #[error("cannot read {path}: {source}. Check the path and its permissions")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },

    /// A file could not be written; what was there before still is.
    #[error("cannot write {path}: {source}. Check its folder and the permissions")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },

    /// A model file is damaged, cut short, or breaks the rules of its format.
    #[error(
        "{path} cannot be used: {reason}. The file may be damaged or cut short; fetch or export it again"
    )]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong, with its place in the file.
        reason: String,
    },

    /// The file needs something that the loader does not have.
    #[error(
        "{path} needs {feature}, which Broadleaf does not read. Convert it to plain glTF 2.0 triangles, or with gltfpack -cc"
    )]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The extension or feature that is missing.
        feature: String,
    },

    /// Nothing to trace.
    #[error("{path} holds no triangles{reason}. Check that the export included meshes")]
    Empty {
        /// The file or generator.
        path: PathBuf,
        /// Why none were left, or empty.
        reason: String,
    },

    /// More triangles than the loader holds, counted after instancing.
    #[error(
        "{path} has {triangles} triangles after instancing; at most {limit} can be held. Use a smaller scene"
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// How many there would be.
        triangles: u64,
        /// The limit.
        limit: u64,
    },

    /// A descriptor or views file that cannot be understood.
    #[error("the descriptor {path} cannot be used: {reason}")]
    Descriptor {
        /// The file, or the name of a built-in descriptor.
        path: PathBuf,
        /// What is wrong, with line and column where the parser knows.
        reason: String,
    },
}

impl SceneError {
    pub(crate) fn format(path: &Path, reason: impl Into<String>) -> Self {
        Self::Format { path: path.to_owned(), reason: reason.into() }
    }

    pub(crate) fn descriptor(path: &Path, reason: impl Into<String>) -> Self {
        Self::Descriptor { path: path.to_owned(), reason: reason.into() }
    }

    pub(crate) fn spec(spec: &str, reason: impl Into<String>) -> Self {
        Self::Spec { spec: spec.to_owned(), reason: reason.into() }
    }
}
