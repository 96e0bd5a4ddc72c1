//! The traversal of the compressed layout (Ylitie et al. 2017, section 4): what is still to be visited is kept in
//! groups of up to 8 nodes or 24 triangles, 64 bits each.
//!
//! ```text
//! node group       first_node                      31   hits   24 23             8 7    imask   0
//!                  of the children of one node     what is met    nothing           which are nodes
//!
//! triangle group   first_triangle                  0000 0000      23     one bit a triangle     0
//! ```
//!
//! The highest of the `hits` is visited next: the child in slot s has bit 24 + (s XOR (7 - octant)), so that it comes
//! the sooner the fewer signs of the ray's direction differ from those of s. Its place is `first_node` and the number
//! of nodes in lower slots, which `imask` tells. An octant is negative signs, x in bit 0.
//!
//! Each turn of the main loop (algorithm 1) takes a node from the current group and puts what is left onto the stack,
//! tests the node's children, and tests triangles until none are left or too few lanes of the subgroup have any: these
//! go onto the stack as well. Or all triangles are tested at once, by all lanes together: see `share.glsl`.

use serde::{Deserialize, Serialize};

pub mod cpu;

/// In which order a node's children are visited (Ylitie et al. 2017, 3.2 and table 2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Order {
    /// By slot, as the signs of the ray's direction say.
    #[default]
    Octant,
    /// The nearest box first. Every child is a group of its own then: to count what order costs, not to be fast.
    Distance,
    /// By slot, as if the ray had another direction in each node.
    Random,
}

impl Order {
    /// Every order.
    pub const ALL: &[Self] = &[Self::Octant, Self::Distance, Self::Random];
}

/// When lanes without a ray fetch new ones (Ylitie et al. 2017, 4.4 and table 10).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fetch {
    /// When enough work was lost since the last time: N_w and N_d.
    #[default]
    LostWork,
    /// When enough lanes are inactive (Aila and Laine 2009): N_t.
    Inactive,
}

/// How the traversal in groups is scheduled. Numbers of lanes are those of a subgroup of 32, and are scaled for others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// When lanes without a ray fetch new ones.
    pub fetch: Fetch,
    /// N_w: turns that lanes may have lost since the last fetch. Fewer: lanes are busier, and coherent rays parted.
    pub n_w: u32,
    /// N_d: lost turns that are forgiven each turn, so that a few idle lanes make nobody fetch.
    pub n_d: u32,
    /// N_t: lanes that may be idle; 32 waits for all.
    pub n_t: u32,
    /// R_t: triangles are put off where a smaller share of the lanes with a ray have any.
    pub r_t: f32,
    /// Entries of the stack in shared memory, 0 to 16, 8 bytes an invocation each; the rest is in memory of its own.
    pub shared_stack: u32,
    /// Whether the lanes of a subgroup test the triangles of all their rays together (`groups/share.glsl`), so that none
    /// need be put off. Not in the paper.
    pub share_triangles: bool,
    /// Triangles of fewer rays than this share of a subgroup's lanes wait for more where they are shared, so that few lanes are
    /// idle, and rays look a little farther than they need; 0 for none.
    pub share_from: f32,
    /// When no ray is left to fetch and a smaller share of a subgroup's lanes than this has one, the others take over parts
    /// of theirs (`groups/steal.glsl`); 0 for never. Not in the paper.
    pub steal_below: f32,
}

impl Default for Params {
    fn default() -> Self {
        // 5.1; of 8 to 12 entries the paper found no difference.
        Self {
            fetch: Fetch::LostWork,
            n_w: 16,
            n_d: 4,
            n_t: 8,
            r_t: 0.2,
            shared_stack: 8,
            share_triangles: false,
            share_from: 0.0,
            steal_below: 0.0,
        }
    }
}

impl Params {
    /// Those from `STEAL_BELOW` on.
    pub(super) fn more_constants(&self, lanes: u32) -> [u32; 2] {
        let of_lanes = |share: f32| (share * lanes as f32).round() as u32;
        [of_lanes(self.steal_below), of_lanes(self.share_from).max(1)]
    }

    /// The constants of `closest_hits.glsl` from `SHARED_STACK` on, for subgroups of so many lanes.
    pub(super) fn constants(&self, order: Order, lanes: u32) -> [u32; 7] {
        let scaled = |of_32: u32| (of_32 * lanes).div_ceil(32);
        let r_t = (self.r_t * 1024.0).round() as u32;
        let inactive = u32::from(self.fetch == Fetch::Inactive);
        [self.shared_stack, inactive, scaled(self.n_w), scaled(self.n_d), scaled(self.n_t), r_t, order as u32]
    }
}

/// Entries of the stack for each node on the way down: what is left of its group, and postponed triangles.
pub const STACK_PER_NODE: u32 = 2;

/// How many times as many it takes in an order: by distance, each child is a group of its own.
pub(super) fn stack_times(order: Order) -> u32 {
    match order {
        Order::Octant | Order::Random => 1,
        Order::Distance => 4,
    }
}
