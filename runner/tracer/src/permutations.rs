//! Which kernels are compiled more than once, and for what: the one table that the build script, the
//! shaders and the host go by.
//!
//! GLSL can size arrays in a node by macros only, not by specialization constants (thesis 3.1), so arity
//! and layout are settled when a shader is compiled. This file is plain Rust without dependencies, because
//! the build script includes it too.

/// How a node is stored. Each has a folder under `layout/`, and a number of children.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Layout {
    /// Two children, 56 bytes (thesis 4.1).
    Binary,
    /// Up to four children, 120 bytes (thesis 4.3.1).
    Wide4,
    /// Up to six children, 176 bytes.
    Wide6,
    /// Up to eight children, 232 bytes.
    Wide8,
    /// Up to four children, 52 bytes (thesis 4.3.2).
    Quantized4,
    /// Up to six children, 64 bytes.
    Quantized6,
    /// Up to eight children, 76 bytes.
    Quantized8,
    /// Up to eight children, 80 bytes (Ylitie et al. 2017).
    Compressed8,
    /// Two children, 40 bytes, leaves too (Lewis 2024, listing 4).
    Direct,
    /// Two children, 16 bytes, leaves twice as many (Lewis 2024, listings 5 and 6).
    Reduced,
}

impl Layout {
    /// Every layout, in the order of tables.
    pub const ALL: &[Self] = &[
        Self::Binary,
        Self::Wide4,
        Self::Wide6,
        Self::Wide8,
        Self::Quantized4,
        Self::Quantized6,
        Self::Quantized8,
        Self::Compressed8,
        Self::Direct,
        Self::Reduced,
    ];

    /// Most children of a node.
    pub const fn arity(self) -> usize {
        match self {
            Self::Binary | Self::Direct | Self::Reduced => 2,
            Self::Wide4 | Self::Quantized4 => 4,
            Self::Wide6 | Self::Quantized6 => 6,
            Self::Wide8 | Self::Quantized8 | Self::Compressed8 => 8,
        }
    }

    /// Its name in shader and file names.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Binary => "binary",
            Self::Wide4 => "wide4",
            Self::Wide6 => "wide6",
            Self::Wide8 => "wide8",
            Self::Quantized4 => "quantized4",
            Self::Quantized6 => "quantized6",
            Self::Quantized8 => "quantized8",
            Self::Compressed8 => "compressed8",
            Self::Direct => "direct",
            Self::Reduced => "reduced",
        }
    }

    /// The macro that tells shaders which folder's `node.glsl` to take; `ARITY` tells them the rest.
    pub const fn family(self) -> &'static str {
        match self {
            Self::Binary => "LAYOUT_BINARY",
            Self::Wide4 | Self::Wide6 | Self::Wide8 => "LAYOUT_WIDE",
            Self::Quantized4 | Self::Quantized6 | Self::Quantized8 => "LAYOUT_QUANTIZED",
            Self::Compressed8 => "LAYOUT_COMPRESSED",
            Self::Direct => "LAYOUT_DIRECT",
            Self::Reduced => "LAYOUT_REDUCED",
        }
    }
}

impl Layout {
    /// The folder under `layout/` with the Slang module of its node, and the type there; none of a layout that is
    /// traced in GLSL only.
    pub fn slang(self) -> Option<(&'static str, String)> {
        let arity = self.arity();
        match self {
            Self::Binary => Some(("binary", "Binary".into())),
            Self::Wide4 | Self::Wide6 | Self::Wide8 => Some(("wide", format!("Wide<{arity}>"))),
            Self::Quantized4 | Self::Quantized6 | Self::Quantized8 => {
                Some(("quantized", format!("Quantized<{arity}>")))
            }
            Self::Compressed8 | Self::Direct | Self::Reduced => None,
        }
    }
}

/// Arities that contraction kernels are compiled for.
pub const ARITIES: &[usize] = &[2, 4, 6, 8];

/// Sources under `src/` that are compiled once for each of [`Layout::ALL`].
pub const PER_LAYOUT: &[&str] = &["layout/encode", "traverse/closest_hit", "path/single"];

/// Those of them that have a twin in Slang beside them.
pub const IN_SLANG: &[&str] = &["traverse/closest_hit"];

/// Sources under `src/` that are compiled once for each of [`ARITIES`].
pub const PER_ARITY: &[&str] = &["contract/levels", "contract/handover", "contract/optimal/costs"];

/// What names of shaders' sources end in: compute kernels, and the three kinds of the driver's ray tracing.
pub const KINDS: [&str; 4] = ["comp", "rgen", "rmiss", "rchit"];
