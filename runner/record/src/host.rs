use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The program that measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Tool {
    /// Name of the program.
    pub name: String,
    /// Its version.
    pub version: String,
    /// The source it was built from; absent when the build could not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub commit: Option<Commit>,
}

/// A state of the source in git.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Commit {
    /// Hash of the commit, in hexadecimal.
    pub hash: String,
    /// Whether files that the program or its scenes are made of differed from that commit.
    pub dirty: bool,
}

/// The computer that the device sits in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Host {
    /// Name of the computer; absent unless asked for, since records are made to be shared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Operating system and its version.
    pub os: String,
    /// Kernel and its release.
    pub kernel: String,
    /// Model of the CPU.
    pub cpu: String,
    /// Logical CPU cores that the process may use.
    pub cores: u32,
    /// Main memory in bytes.
    pub memory_bytes: u64,
}
