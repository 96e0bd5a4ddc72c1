//! Ray-triangle tests to choose from.

use serde::{Deserialize, Serialize};

/// How rays are tested against triangles. Each test wants triangles stored its own way, so a tree carries the test
/// that it was stored for (Ylitie, Karras, Laine 2017, A.3, compares the three).
///
/// How exact each is, `reports/2026-11-22-triangle-tests` says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TriangleTest {
    /// No ray slips between triangles that share an edge: Woop, Benthin, Wald, "Watertight Ray/Triangle
    /// Intersection", JCGT 2013. Distances that rounding could bring to the wrong side of a ray's start are found
    /// once more, exactly.
    #[default]
    Watertight,
    /// Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", JGT 1997. Products of three lengths
    /// have to stay floats: scenes should measure between 1e-9 and 1e9 units.
    MoellerTrumbore,
    /// Kensler and Shirley, "Optimizing Ray-Triangle Intersection via Automated Search", RT 2006: Cramer's rule as Möller
    /// and Trumbore have it, by one cross product with the ray and the triangle's normal. Edges and most of the normal are
    /// stored ([`crate::layout::EdgeTriangle`]). For scenes of the same sizes.
    KenslerShirley,
    /// Woop's unit triangle: Woop, "A Ray Tracing Hardware Architecture for Dynamic Scenes", 2004. Triangles are
    /// stored as affine maps ([`crate::layout::UnitTriangle`]), which leave no room for the triangle's index: it
    /// lies apart, and is looked up when a ray is finished.
    Woop,
}

/// What triangles are stored as: `FORMAT` in `layout/leaf_triangle.glsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TriangleFormat {
    /// [`crate::layout::LeafTriangle`].
    Corners,
    /// [`crate::layout::EdgeTriangle`].
    Edges,
    /// [`crate::layout::UnitTriangle`], and indices apart.
    Maps,
}

impl TriangleTest {
    /// All.
    pub const ALL: [Self; 4] = [Self::Watertight, Self::MoellerTrumbore, Self::KenslerShirley, Self::Woop];

    /// What the test reads.
    pub fn format(self) -> TriangleFormat {
        match self {
            Self::Watertight | Self::MoellerTrumbore => TriangleFormat::Corners,
            Self::KenslerShirley => TriangleFormat::Edges,
            Self::Woop => TriangleFormat::Maps,
        }
    }

    /// Bytes that a triangle takes, its index included.
    pub fn triangle_bytes(self) -> usize {
        if self.format() == TriangleFormat::Maps { 52 } else { 48 }
    }
}

/// What may be chosen about triangles.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TriangleParams {
    /// How rays are tested against them, and therefore how they are stored.
    pub test: TriangleTest,
}
