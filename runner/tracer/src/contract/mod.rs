//! A binary tree with larger leaves → a wide one: which boxes share a node.
//!
//! [`WideBvh`] is the seam between contraction and layout. A node is a list of nodes of the binary tree, in
//! which the exact boxes stay; how they are stored is the layout's business.
//!
//! ```text
//! binary tree, nodes 8 to 14 inner          wide, arity 4
//!             14                            node 0: of 14   leaves 3   nodes 10 8 9     first_node 1
//!          /      \                         node 1: of 10   leaves 0 1                  first_triangle 1
//!        12        13                       node 2: of 8    …
//!       /  \      /  \                      node 3: of 9    …
//!     10    3    8    9
//!    /  \  (1 triangle)
//!   0    1
//! ```
//!
//! Leaves come first in a node. The children that are nodes follow each other from `first_node` on, and the
//! triangles of those that are leaves from `first_triangle` on, in the order of the slots, so one index of
//! each is enough for a layout. Nodes and runs of triangles get their places from counters: their order
//! differs from build to build, the tree does not; [`WideBvh::canonical`] brings equal trees into equal
//! order. [`Numbering::DepthFirst`] gives them an order of their own afterwards.
//!
//! Contraction runs in one of two forms, which make the same tree: [`Form::Handover`], a single launch in
//! which invocations wait for each other (Benthin et al. 2024; thesis 2.1.4), and [`Form::Levels`], a
//! dispatch a level, which needs nobody to wait and is the faster one.

use crate::{
    bvh2::{Bvh2, Bvh2Buffers, MAX_TRIANGLES},
    gpu::{Buffer, Error, Gpu, Kernel, Pass, groups, shaders},
};
use bytemuck::{Pod, Zeroable};
use depth_first::{DepthFirst, Made, Placed};
use optimal::{Costs, Planner, Plans};
use serde::{Deserialize, Serialize};

pub mod cpu;
mod depth_first;
pub mod optimal;

/// By what a contraction says which child of a node under construction is replaced by its own children.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Contraction {
    /// Largest surface area × triangles first, until the node is full (thesis 4.2.1).
    #[default]
    Sah,
    /// Surface-area guided tree contraction (Gu et al. 2015; thesis 2.1.2): while an area is more than α of
    /// the node's, the largest first. Nodes need not become full.
    Satc,
    /// Constant branches tree contraction (Gu et al. 2015; thesis 4.2.2): the child that sample rays visit
    /// most often, until the node is full; by area where visits do not exceed the threshold.
    Cbtc,
    /// Ray-distribution guided tree contraction (Gu et al. 2015; thesis 2.1.2): while visits are more than α
    /// of the node's, the most visited first; nothing where the node's do not exceed the threshold.
    Rdtc,
    /// Largest surface area first, until the node is full; leaves stay as they are (Wald et al. 2008).
    Wald,
    /// The same, and where slots are left, leaves are split (Áfra 2013).
    Afra,
    /// The nodes log2(arity) levels below (Ernst and Greiner 2008).
    Fixed,
    /// Of least SAH cost, leaves included (Ylitie et al. 2017, 3.4): see [`optimal`].
    Optimal,
}

impl Contraction {
    /// Every contraction.
    pub const ALL: &[Self] =
        &[Self::Sah, Self::Satc, Self::Cbtc, Self::Rdtc, Self::Wald, Self::Afra, Self::Fixed, Self::Optimal];

    /// Whether it needs visit counts, so that its trees belong to a view.
    pub fn by_view(self) -> bool {
        matches!(self, Self::Cbtc | Self::Rdtc)
    }

    /// Whether leaves are what the collapse made of them.
    pub fn keeps_leaves(self) -> bool {
        !matches!(self, Self::Afra | Self::Optimal)
    }

    /// Whether it opens children until the node is full or only leaves are left.
    pub fn fills(self) -> bool {
        matches!(self, Self::Sah | Self::Cbtc | Self::Wald | Self::Afra)
    }
}

impl std::fmt::Display for Contraction {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Sah => "sah",
            Self::Satc => "satc",
            Self::Cbtc => "cbtc",
            Self::Rdtc => "rdtc",
            Self::Wald => "wald",
            Self::Afra => "afra",
            Self::Fixed => "fixed",
            Self::Optimal => "optimal",
        })
    }
}

/// How a contraction is launched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Form {
    /// The faster one as far as it is known: level by level. On an H100 it takes half the time of a single launch,
    /// because invocations that look for work take it from those that have some.
    #[default]
    Auto,
    /// A single launch, work handed from invocation to invocation; fast only where the device is known to let every
    /// workgroup that has started go on.
    Handover,
    /// A dispatch a level.
    Levels,
}

/// In which order nodes, and triangles, follow each other in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Numbering {
    /// As they are made: level by level, of a level in any order.
    #[default]
    Creation,
    /// Subtree by subtree (Ylitie et al. 2017, end of 3.3).
    DepthFirst,
}

/// What may be chosen about a contraction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ContractParams {
    /// Which child is opened.
    pub method: Contraction,
    /// α of `satc` and `rdtc`: a child is opened while its probability of being visited exceeds it.
    pub alpha: f32,
    /// How it is launched. Both forms make the same tree.
    pub form: Form,
    /// In which order its nodes end up.
    pub numbering: Numbering,
    /// c_node of `optimal`: what visiting a node costs.
    pub c_node: f32,
    /// c_prim of `optimal`: what testing a triangle costs. Less: larger leaves and fewer nodes.
    pub c_prim: f32,
    /// P_max of `optimal`: most triangles a leaf.
    pub p_max: u32,
}

impl ContractParams {
    /// Those that the optimal contraction goes by.
    pub fn costs(&self) -> Costs {
        Costs { node: self.c_node, triangle: self.c_prim, max_leaf: self.p_max }
    }
}

impl Default for ContractParams {
    fn default() -> Self {
        // Ylitie et al. 2017, 5.1: c_prim = 0.3 is 98% of the best rate at 5% more memory than the least.
        Self {
            method: Contraction::Sah,
            alpha: 0.6,
            form: Form::Auto,
            numbering: Numbering::Creation,
            c_node: 1.0,
            c_prim: 0.3,
            p_max: 3,
        }
    }
}

/// A node of a [`WideBvh`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WideNode {
    /// Index of the first child that is a node; the others follow.
    pub first_node: u32,
    /// Place of the first triangle of the first child that is a leaf; the others follow.
    pub first_triangle: u32,
    /// Triangles in the whole subtree.
    pub triangles: u32,
    /// Children that are leaves, with their numbers of triangles.
    pub leaves: Vec<WideLeaf>,
    /// Children that are nodes, by their index in the binary tree.
    pub nodes: Vec<u32>,
}

/// A leaf of a [`WideBvh`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WideLeaf {
    /// Its index in the binary tree.
    pub node: u32,
    /// Its triangles, 1 to 16.
    pub triangles: u32,
}

/// A wide tree over a binary one, in host memory. Node 0 is the root.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WideBvh {
    /// Most children of a node.
    pub arity: usize,
    /// The nodes.
    pub nodes: Vec<WideNode>,
}

const HEADER: usize = 4;
const CHILD_MASK: u32 = 0x0fff_ffff;
const COUNT_SHIFT: u32 = 28;
const _: () = assert!(2 * MAX_TRIANGLES <= 1 << COUNT_SHIFT);

impl WideBvh {
    /// Copies a wide tree of `nodes` nodes from the device.
    ///
    /// # Errors
    /// A transfer failed.
    pub fn read(from: &WideBuffers, nodes: usize) -> Result<Self, Error> {
        let words: Vec<u32> = from.nodes().read(0, nodes * from.words())?;
        let node = |w: &[u32]| {
            let (children, leaves) = ((w[2] >> 4) as usize, (w[2] & 15) as usize);
            let (leaves, inner) = w[HEADER..HEADER + children].split_at(leaves);
            let leaf = |w: &u32| WideLeaf { node: w & CHILD_MASK, triangles: (w >> COUNT_SHIFT) + 1 };
            WideNode {
                first_node: w[0],
                first_triangle: w[1],
                triangles: w[3],
                leaves: leaves.iter().map(leaf).collect(),
                nodes: inner.to_vec(),
            }
        };
        Ok(Self { arity: from.arity, nodes: words.chunks_exact(from.words()).map(node).collect() })
    }

    /// The same tree with nodes and runs of triangles numbered level by level, from left to right.
    pub fn canonical(&self) -> Self {
        let mut nodes = Vec::with_capacity(self.nodes.len());
        let (mut next_node, mut next_triangle) = (1, 0);
        let mut order = std::collections::VecDeque::from([0u32]);
        while let Some(index) = order.pop_front() {
            let mut node = self.nodes[index as usize].clone();
            order.extend((0..node.nodes.len() as u32).map(|i| node.first_node + i));
            // Of no children there is no first.
            node.first_node = if node.nodes.is_empty() { 0 } else { next_node };
            node.first_triangle = if node.leaves.is_empty() { 0 } else { next_triangle };
            next_node += node.nodes.len() as u32;
            next_triangle += node.leaves.iter().map(|l| l.triangles).sum::<u32>();
            nodes.push(node);
        }
        Self { arity: self.arity, nodes }
    }

    /// The same tree with nodes and runs of triangles numbered depth first: see [`Numbering::DepthFirst`].
    pub fn depth_first(&self) -> Self {
        let mut placed = vec![None; self.nodes.len()];
        let (mut next_node, mut next_triangle) = (1, 0);
        // A node's number before and after.
        let mut todo = vec![(0u32, 0u32)];
        while let Some((index, place)) = todo.pop() {
            let mut node = self.nodes[index as usize].clone();
            let children = (0..node.nodes.len() as u32).rev();
            todo.extend(children.map(|i| (node.first_node + i, next_node + i)));
            node.first_node = if node.nodes.is_empty() { 0 } else { next_node };
            node.first_triangle = if node.leaves.is_empty() { 0 } else { next_triangle };
            next_node += node.nodes.len() as u32;
            next_triangle += node.leaves.iter().map(|l| l.triangles).sum::<u32>();
            placed[place as usize] = Some(node);
        }
        let nodes = placed.into_iter().map(|node| node.expect("each place is some node's")).collect();
        Self { arity: self.arity, nodes }
    }

    /// Nodes on the longest way from the root to a leaf, the root included, and the entries that a
    /// traversal's stack needs at most: one for every further child on such a way, and one for the end.
    pub fn depth_and_stack(&self) -> (u32, u32) {
        let (mut depth, mut stack) = (0, 0);
        let mut todo = vec![(0u32, 0, 1)];
        while let Some((index, above, entries)) = todo.pop() {
            let node = &self.nodes[index as usize];
            let entries = entries + (node.leaves.len() + node.nodes.len()) as u32 - 1;
            depth = depth.max(above + 1);
            stack = stack.max(entries);
            todo.extend((0..node.nodes.len() as u32).map(|i| (node.first_node + i, above + 1, entries)));
        }
        (depth, stack)
    }

    /// The leaves of the binary tree below node `index` of it, from left to right: a leaf's triangles, in
    /// the order in which layouts store them.
    pub fn triangles_below(tree: &Bvh2, index: u32) -> Vec<u32> {
        let mut found = Vec::new();
        let mut todo = vec![index];
        while let Some(index) = todo.pop() {
            if (index as usize) < tree.leaves {
                found.push(index);
            } else {
                let node = tree.nodes[index as usize];
                todo.extend([node.right, node.left]);
            }
        }
        found
    }
}

/// A wide tree in device memory, and what a contraction needs beside it.
#[derive(Debug)]
pub struct WideBuffers {
    arity: usize,
    capacity: usize,
    /// `WideNodes` in `wide.glsl`, as they are made.
    made: Buffer,
    tasks: Buffer,
    /// The same in another order.
    placed: Option<Placed>,
    ways: Buffer,
    /// Of the optimal contraction.
    plans: Option<Plans>,
    /// One [`Progress`].
    pub progress: Buffer,
}

impl WideBuffers {
    /// Words of a node.
    fn words(&self) -> usize {
        HEADER + self.arity
    }

    /// Nodes there is room for.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// `WideNodes` in `wide.glsl`, in their final order.
    pub fn nodes(&self) -> &Buffer {
        self.placed.as_ref().map_or(&self.made, |placed| &placed.nodes)
    }

    /// The node of the binary tree that each was made of.
    fn made_of(&self) -> &Buffer {
        self.placed.as_ref().map_or(&self.tasks, |placed| &placed.tasks)
    }
}

/// `Progress` in `wide.glsl`: how far a contraction has come.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct Progress {
    /// Nodes that have a place.
    pub nodes: u32,
    /// Nodes whose children have been chosen; the tree is complete when it equals `nodes`.
    pub finished: u32,
    /// Triangles that have a place.
    pub triangles: u32,
    claimed: u32,
    /// Nodes on the longest way from the root to a leaf, the root included.
    pub depth: u32,
    /// Entries that a traversal's stack needs at most.
    pub stack: u32,
    groups_done: u32,
    begin: u32,
    end: u32,
    groups: [u32; 3],
}

const ARGUMENTS: u64 = std::mem::offset_of!(Progress, groups) as u64;

/// Visit counts of a binary tree's inner nodes, for contractions that go by view.
#[derive(Clone, Copy, Debug)]
pub struct Visits<'a> {
    /// One u32 for each inner node, in the order of the binary tree's nodes.
    pub counts: &'a Buffer,
    /// The threshold t: counts above it are trusted.
    pub threshold: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PreparePush {
    levels: u64,
    wide: u64,
    tasks: u64,
    ways: u64,
    progress: u64,
    large_levels: u32,
    pad: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    nodes: u64,
    levels: u64,
    subtrees: u64,
    bounds: u64,
    visits: u64,
    plans: u64,
    wide: u64,
    tasks: u64,
    ways: u64,
    progress: u64,
    threshold: u32,
    alpha: f32,
    capacity: u32,
    pad: u32,
}

/// The kernels, compiled for one arity and one method.
#[derive(Debug)]
pub struct Contract {
    prepare: Kernel,
    planner: Option<Planner>,
    depth_first: Option<DepthFirst>,
    kernel: Kernel,
    arity: usize,
    params: ContractParams,
    form: Form,
    /// Workgroups of the single launch.
    resident: u32,
}

const WORKGROUP: u32 = 128;

impl Contract {
    /// Compiles the kernels.
    ///
    /// # Errors
    /// The driver's compiler failed.
    ///
    /// # Panics
    /// There are no kernels of that arity.
    pub fn new(gpu: &Gpu, arity: usize, params: &ContractParams) -> Result<Self, Error> {
        let info = gpu.info();
        let form = match params.form {
            Form::Auto => Form::Levels,
            form => form,
        };
        let shader = match form {
            Form::Handover => shaders::contract_handover(arity),
            _ => shaders::contract_levels(arity),
        };
        // A lone subgroup waits for nobody else, so anything can run the single launch, if slowly.
        let alone = form == Form::Handover && !info.hands_work_over();
        let size = if alone { info.subgroup_size } else { WORKGROUP.min(info.max_workgroup_size) };
        let plans = params.method == Contraction::Optimal;
        Ok(Self {
            prepare: Kernel::new(gpu, &shaders::CONTRACT_PREPARE, info.subgroup_size, &[])?,
            depth_first: DepthFirst::new(gpu, arity, params.numbering)?,
            planner: plans.then(|| Planner::new(gpu, arity, params.costs())).transpose()?,
            kernel: Kernel::new(gpu, shader, size, &[params.method as u32])?,
            arity,
            params: params.clone(),
            form,
            resident: if alone { 1 } else { 8 * info.multiprocessors.max(16) },
        })
    }

    /// The form that is launched; never `Auto`.
    pub fn form(&self) -> Form {
        self.form
    }

    /// Which child is opened.
    pub fn method(&self) -> Contraction {
        self.params.method
    }

    /// Most nodes that a tree over `triangles` can have.
    ///
    /// Where nodes are filled, those that are not full have only leaves, at least two; counting children
    /// gives m_full (arity - 1) + m_other ≤ n - 1, and m_other ≤ n / 2.
    pub fn most_nodes(&self, triangles: usize) -> usize {
        if self.params.method.fills() {
            (triangles / 2 + triangles.div_ceil(2 * (self.arity - 1))).max(1)
        } else {
            (triangles - 1).max(1)
        }
    }

    /// Allocates for trees over up to `triangles` triangles.
    ///
    /// # Errors
    /// Too little memory.
    pub fn buffers(&self, gpu: &Gpu, triangles: usize) -> Result<WideBuffers, Error> {
        let capacity = self.most_nodes(triangles);
        let bytes = 4 * capacity as u64;
        Ok(WideBuffers {
            arity: self.arity,
            capacity,
            made: gpu.buffer("wide tree", bytes * (HEADER + self.arity) as u64)?,
            placed: (self.depth_first.as_ref())
                .map(|depth_first| depth_first.buffers(gpu, capacity, HEADER + self.arity))
                .transpose()?,
            plans: self.planner.as_ref().map(|planner| planner.buffers(gpu, triangles)).transpose()?,
            tasks: gpu.buffer("contraction tasks", bytes)?,
            ways: gpu.buffer("ways to wide nodes", bytes)?,
            progress: gpu.buffer("progress of a contraction", size_of::<Progress>() as u64)?,
        })
    }

    /// Contracts a collapsed tree, afresh or, where a recording of too few levels left it incomplete, from
    /// there on. `levels` counts only where the form goes level by level.
    ///
    /// # Panics
    /// The method goes by view and there are no visits.
    pub fn record(
        &self,
        pass: &mut Pass,
        input: &Input<'_>,
        buffers: &WideBuffers,
        afresh: bool,
        levels: u32,
    ) {
        assert!(
            input.visits.is_some() || !self.params.method.by_view(),
            "{} needs visits",
            self.params.method
        );
        if afresh {
            if self.form == Form::Handover {
                pass.fill(&buffers.tasks, u32::MAX);
            }
            let push = PreparePush {
                levels: input.tree.levels.address(),
                wide: buffers.made.address(),
                tasks: buffers.tasks.address(),
                ways: buffers.ways.address(),
                progress: buffers.progress.address(),
                large_levels: input.large_levels.unwrap_or(0),
                pad: 0,
            };
            pass.dispatch("prepare", &self.prepare, &push, 1);
            if let (Some(planner), Some(plans)) = (&self.planner, &buffers.plans) {
                planner.record(pass, input, plans);
            }
        }
        let push = Push {
            nodes: input.tree.nodes.address(),
            levels: input.tree.levels.address(),
            subtrees: input.subtrees.address(),
            bounds: input.bounds.address(),
            visits: input.visits.map_or(0, |v| v.counts.address()),
            plans: buffers.plans.as_ref().map_or(0, |made| made.plans.address()),
            wide: buffers.made.address(),
            tasks: buffers.tasks.address(),
            ways: buffers.ways.address(),
            progress: buffers.progress.address(),
            threshold: input.visits.map_or(0, |v| v.threshold),
            alpha: self.params.alpha,
            capacity: buffers.capacity as u32,
            pad: 0,
        };
        if self.form == Form::Handover {
            let most = self.resident.min(groups(buffers.capacity, self.kernel.workgroup_size()));
            pass.dispatch("handover", &self.kernel, &push, most);
        } else {
            for _ in 0..levels {
                pass.dispatch_indirect("level", &self.kernel, &push, &buffers.progress, ARGUMENTS);
            }
        }
        if let (Some(depth_first), Some(placed)) = (&self.depth_first, &buffers.placed) {
            let WideBuffers { made: nodes, tasks, progress, capacity, .. } = buffers;
            depth_first.record(pass, &Made { nodes, tasks, progress, capacity: *capacity }, placed);
        }
    }
}

/// What is contracted.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// The binary tree.
    pub tree: &'a Bvh2Buffers,
    /// What the collapse decided about it.
    pub subtrees: &'a Buffer,
    /// The scene's bounds, whose size scales areas.
    pub bounds: &'a Buffer,
    /// Levels of the tree that the collapse was recorded for; where it has more, nothing is contracted. Nothing where
    /// the tree has no levels.
    pub large_levels: Option<u32>,
    /// How often sample rays visited its nodes.
    pub visits: Option<Visits<'a>>,
}

/// Turns visits that a traversal counted by its own nodes into visits by nodes of the binary tree.
#[derive(Debug)]
pub struct VisitCounter {
    kernel: Kernel,
    /// A u32 for each node of the tree that is traversed.
    pub by_node: Buffer,
    /// A u32 for each inner node of the binary tree.
    pub by_inner: Buffer,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct VisitsPush {
    levels: u64,
    tasks: u64,
    progress: u64,
    by_node: u64,
    by_inner: u64,
}

impl VisitCounter {
    /// Compiles the kernel and allocates for trees over up to `triangles` triangles.
    ///
    /// # Errors
    /// The driver's compiler failed, or too little memory.
    pub fn new(gpu: &Gpu, triangles: usize) -> Result<Self, Error> {
        let bytes = 4 * (triangles as u64 - 1).max(1);
        Ok(Self {
            kernel: Kernel::new(
                gpu,
                &shaders::CONTRACT_VISITS,
                WORKGROUP.min(gpu.info().max_workgroup_size),
                &[],
            )?,
            by_node: gpu.buffer("visits of nodes", bytes)?,
            by_inner: gpu.buffer("visits of the binary tree", bytes)?,
        })
    }

    /// Forgets what was counted.
    pub fn clear(&self, pass: &mut Pass) {
        pass.fill(&self.by_node, 0);
        pass.fill(&self.by_inner, 0);
    }

    /// Fills `by_inner` from what a traversal of `traversed`, made of `tree`, has counted in `by_node`.
    pub fn record(&self, pass: &mut Pass, tree: &Bvh2Buffers, traversed: &WideBuffers) {
        let push = VisitsPush {
            levels: tree.levels.address(),
            tasks: traversed.made_of().address(),
            progress: traversed.progress.address(),
            by_node: self.by_node.address(),
            by_inner: self.by_inner.address(),
        };
        let groups = groups(traversed.capacity, self.kernel.workgroup_size()).min(65_535);
        pass.dispatch("visits", &self.kernel, &push, groups);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::interface::{Field, Module, fields};

    #[test]
    fn shaders_see_arguments_as_the_host_does() {
        let push = fields!(Push: nodes, levels, subtrees, bounds, visits, plans, wide, tasks, ways, progress,
            threshold, alpha, capacity);
        for &arity in crate::permutations::ARITIES {
            for shader in [shaders::contract_levels(arity), shaders::contract_handover(arity)] {
                Module::read(shader).assert_push_constants(size_of::<Push>(), &push);
            }
        }
        Module::read(&shaders::CONTRACT_PREPARE).assert_push_constants(
            size_of::<PreparePush>(),
            &fields!(PreparePush: levels, wide, tasks, ways, progress, large_levels),
        );
        Module::read(&shaders::CONTRACT_VISITS).assert_push_constants(
            size_of::<VisitsPush>(),
            &fields!(VisitsPush: levels, tasks, progress, by_node, by_inner),
        );
        let mut progress =
            fields!(Progress: nodes, finished, triangles, claimed, depth, stack, groups_done, begin, end);
        let groups = std::mem::offset_of!(Progress, groups);
        progress.extend([("x", 0), ("y", 4), ("z", 8)].map(|(name, at)| Field {
            name,
            offset: groups + at,
            size: 4,
        }));
        for shader in [&shaders::CONTRACT_PREPARE, &shaders::CONTRACT_VISITS] {
            Module::read(shader).assert_block("Progress", &progress);
        }
    }
}
