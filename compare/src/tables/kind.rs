//! Which tables there are.

use super::{
    Input, Table, best, bounces, builds, memory, resources, roofline, scene, single_kernel, tests_per_ray,
    traversal_cost, workgroup,
};

/// A kind of table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// One for each scene: build, rates and what rays meet, of every variant (thesis tables 13 to 17)
    Scene,
    /// Rates with each size of workgroup relative to the best, by variant (7 to 12)
    Workgroup,
    /// Rates with each traversal cost relative to the best, by variant, and the best cost (6, 5)
    TraversalCost,
    /// The best value of everything that was varied, by variant (4)
    Best,
    /// Registers, memory and occupancy of the kernels (2)
    Resources,
    /// Rates of separate kernels relative to a single one (3)
    SingleKernel,
    /// Rates of bounces 0, 1, 4 and 8 relative to the first row's (Ylitie et al. 2017, tables 8 to 10)
    Bounces,
    /// Nodes and triangles that a ray is tested against, and bytes that it asks for, by bounce (the same, 1, 2, 7)
    Tests,
    /// Bytes of nodes for each triangle (the same, 6), and beside those of triangles (Lewis 2024, figure 8)
    Memory,
    /// How near the kernels come to what the device can do at best; takes --roofline
    Roofline,
    /// How fast trees are built, phase by phase and in how many launches, and how good they are
    Builds,
}

impl Kind {
    /// All of them.
    pub const ALL: [Kind; 11] = [
        Kind::Scene,
        Kind::Workgroup,
        Kind::TraversalCost,
        Kind::Best,
        Kind::Resources,
        Kind::SingleKernel,
        Kind::Bounces,
        Kind::Tests,
        Kind::Memory,
        Kind::Roofline,
        Kind::Builds,
    ];

    /// The tables of this kind that come of some records; at least one.
    ///
    /// # Errors
    /// The records have not what it takes; the error says what would.
    pub fn tables(self, input: &Input) -> anyhow::Result<Vec<Table>> {
        match self {
            Kind::Scene => scene::tables(input),
            Kind::Workgroup => workgroup::tables(input),
            Kind::TraversalCost => traversal_cost::tables(input),
            Kind::Best => best::tables(input),
            Kind::Resources => resources::tables(input),
            Kind::SingleKernel => single_kernel::tables(input),
            Kind::Bounces => bounces::tables(input),
            Kind::Tests => tests_per_ray::tables(input),
            Kind::Memory => memory::tables(input),
            Kind::Roofline => roofline::tables(input),
            Kind::Builds => builds::tables(input),
        }
    }
}
