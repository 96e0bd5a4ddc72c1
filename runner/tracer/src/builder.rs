//! Chains the stages of a build: triangles in device memory → nodes that a kernel can traverse.
//!
//! ```text
//! triangles → bounds, codes → sort → leaves, clustering → collapse → rearrangement, triangles
//!             \ morton /              \    ploc    /                 \      rearrange      /
//! ```
//!
//! Everything is recorded into one submission, and nothing is read back before its end: how many
//! iterations the clustering takes, and how large each is, only the GPU knows.

use crate::{
    bvh2::{Bvh2, Bvh2Buffers, MAX_LEVELS, MAX_TRIANGLES},
    collapse::{Collapse, CollapseParams, Subtree},
    gpu::{Buffer, Error, Gpu, Pass, Timings},
    layout::{
        LeafOrder, LeafTriangle,
        binary::{BinaryNode, Rearrange, RearrangeBuffers, Summary},
    },
    morton::{BOUNDS_BYTES, Morton, MortonParams, SceneBounds},
    ploc::{Ploc, PlocBuffers, PlocParams},
    sort::{Sort, SortBuffers},
};
use serde::{Deserialize, Serialize};
use std::{cell::Cell, ops::Range};

/// Everything that may be chosen about a build.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BuildParams {
    /// The curve that triangles are sorted along.
    pub morton: MortonParams,
    /// The clustering.
    pub ploc: PlocParams,
    /// The merging of leaves.
    pub collapse: CollapseParams,
}

/// Why a build was refused or failed.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// There are no triangles.
    #[error("the scene has no triangles, so there is nothing to build a tree over")]
    Empty,
    /// There are more than child indices can count.
    #[error("the scene has {0} triangles, and nodes can count {MAX_TRIANGLES}; use a smaller scene")]
    TooMany(usize),
    /// The device or its driver failed, or there is too little memory.
    #[error(transparent)]
    Gpu(#[from] Error),
}

/// What a build took on the device, in milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BuildMilliseconds {
    /// Scene bounds and Morton codes.
    pub morton: f64,
    /// Sorting the codes.
    pub sort: f64,
    /// Leaves and clustering.
    pub ploc: f64,
    /// Merging leaves.
    pub collapse: f64,
    /// Writing nodes and triangles in their layout.
    pub rearrange: f64,
    /// From the first dispatch to the end of the last.
    pub total: f64,
}

/// The kernels of a build, compiled for one set of parameters.
#[derive(Debug)]
pub struct Builder {
    gpu: Gpu,
    params: BuildParams,
    morton: Morton,
    sort: Sort,
    ploc: Ploc,
    collapse: Collapse,
    rearrange: Rearrange,
    leaf_order: LeafOrder,
}

/// Device memory for builds of up to so many triangles, so that a build itself allocates nothing.
#[derive(Debug)]
pub struct BuildWorkspace {
    capacity: usize,
    /// Triangles of the last build, and what it needed.
    last: Cell<Option<(usize, Dispatches)>>,
    bounds: Buffer,
    sort: SortBuffers,
    tree: Bvh2Buffers,
    ploc: PlocBuffers,
    subtrees: Buffer,
    rearrange: RearrangeBuffers,
    /// Of [`BinaryNode`]; `BuildReport::summary` says how many.
    pub nodes: Buffer,
    /// Of [`LeafTriangle`], as many as there are triangles.
    pub triangles: Buffer,
}

/// What to build over.
#[derive(Clone, Copy)]
struct Input<'a> {
    triangles: &'a Buffer,
    count: usize,
}

/// How many dispatches to record where only the GPU knows how many there is work for.
#[derive(Clone, Copy, Debug)]
struct Dispatches {
    /// Iterations of the clustering.
    iterations: u32,
    /// Levels in the stages that go level by level.
    levels: u32,
}

/// What a build made and how long it took.
#[derive(Clone, Debug)]
pub struct BuildReport {
    /// Numbers of nodes and levels, and the depth.
    pub summary: Summary,
    /// Iterations of the clustering that were recorded before its tail; `summary.iterations` were needed.
    pub recorded: u32,
    /// Time by phase.
    pub milliseconds: BuildMilliseconds,
    /// Every span; single dispatches only where [`Builder::build`] was asked for them.
    pub timings: Timings,
}

/// A binary BVH in device memory, and nothing else.
#[derive(Debug)]
pub struct Built {
    /// Of [`BinaryNode`], `report.summary.nodes` of them; node 0 is the root.
    pub nodes: Buffer,
    /// Of [`LeafTriangle`], in the order of the leaves.
    pub triangles: Buffer,
    /// How many triangles.
    pub count: usize,
    /// How it was made.
    pub report: BuildReport,
}

impl Builder {
    /// Compiles the kernels.
    ///
    /// # Errors
    /// The driver's compiler failed.
    ///
    /// # Panics
    /// A parameter is out of its documented range.
    pub fn new(gpu: &Gpu, params: &BuildParams) -> Result<Self, Error> {
        Ok(Self {
            gpu: gpu.clone(),
            params: params.clone(),
            morton: Morton::new(gpu, &params.morton)?,
            sort: Sort::new(gpu, params.morton.words())?,
            ploc: Ploc::new(gpu, &params.ploc)?,
            collapse: Collapse::new(gpu, &params.collapse)?,
            rearrange: Rearrange::new(gpu)?,
            leaf_order: LeafOrder::new(gpu)?,
        })
    }

    /// What it was compiled for.
    pub fn params(&self) -> &BuildParams {
        &self.params
    }

    /// The clustering, whose block sizes tests go around.
    pub fn ploc(&self) -> &Ploc {
        &self.ploc
    }

    /// Allocates for scenes of up to `capacity` triangles; about 330 bytes each.
    ///
    /// # Errors
    /// No triangles, too many, or too little memory.
    pub fn workspace(&self, capacity: usize) -> Result<BuildWorkspace, BuildError> {
        check(capacity)?;
        let gpu = &self.gpu;
        Ok(BuildWorkspace {
            capacity,
            last: Cell::new(None),
            bounds: gpu.buffer("scene bounds", BOUNDS_BYTES)?,
            sort: self.sort.buffers(gpu, capacity, self.params.morton.words())?,
            tree: Bvh2Buffers::new(gpu, capacity)?,
            ploc: self.ploc.buffers(gpu, capacity)?,
            subtrees: Collapse::buffer(gpu, capacity)?,
            rearrange: Rearrange::buffers(gpu, capacity)?,
            nodes: gpu.buffer("nodes", (size_of::<BinaryNode>() * (capacity - 1).max(1)) as u64)?,
            triangles: gpu
                .buffer("triangles in leaf order", (size_of::<LeafTriangle>() * capacity) as u64)?,
        })
    }

    /// Builds a tree over the first `count` of `triangles` (nine finite floats each) into the workspace.
    ///
    /// The first build in a workspace records iterations of the clustering on suspicion. A further one over
    /// as many triangles records as many as the last one needed, and more if they turn out too few.
    ///
    /// `time_dispatches` adds a span for each dispatch to the timings, at about a microsecond each.
    ///
    /// # Errors
    /// No triangles, too many, or the device failed.
    ///
    /// # Panics
    /// There are more triangles than the workspace was made for, or than the buffer holds.
    pub fn build(
        &self,
        workspace: &BuildWorkspace,
        triangles: &Buffer,
        count: usize,
        time_dispatches: bool,
    ) -> Result<BuildReport, BuildError> {
        check(count)?;
        assert!(count <= workspace.capacity, "{count} triangles in a workspace for {}", workspace.capacity);
        assert!(36 * count as u64 <= triangles.bytes(), "{count} triangles in {triangles:?}");
        let input = Input { triangles, count };
        let mut timings = Timings::default();
        let mut done = 0;
        let mut recorded = match workspace.last.get() {
            Some((of, needed)) if of == count => needed,
            _ => {
                let iterations = self.ploc.iterations(count);
                Dispatches { iterations, levels: iterations }
            }
        };
        loop {
            let mut pass = Pass::new(&self.gpu)?;
            pass.time_dispatches(time_dispatches);
            pass.scope("build", |pass| {
                let order = (done == 0).then(|| self.record_order(pass, workspace, input));
                self.record_tree(pass, workspace, input, order, done..recorded.iterations, recorded.levels);
            });
            timings.spans.extend(pass.submit()?.spans);
            let summary: Summary = workspace.rearrange.summary.read(0, 1)?[0];
            let complete = summary.levels > 0 || count == 1;
            if complete && summary.large_levels <= recorded.levels {
                let milliseconds = BuildMilliseconds {
                    morton: timings.milliseconds("build/morton"),
                    sort: timings.milliseconds("build/sort"),
                    ploc: timings.milliseconds("build/ploc"),
                    collapse: timings.milliseconds("build/collapse"),
                    rearrange: timings.milliseconds("build/rearrange"),
                    total: timings.milliseconds("build"),
                };
                let Summary { iterations, large_levels: levels, .. } = summary;
                workspace.last.set(Some((count, Dispatches { iterations, levels })));
                let recorded = recorded.iterations;
                return Ok(BuildReport { summary, recorded, milliseconds, timings });
            }
            // Another scene than was expected: go on where it stopped. The clustering's tail, if it was
            // reached, does the same once more.
            done = recorded.iterations;
            if complete {
                recorded.levels = summary.large_levels;
            } else {
                assert!((done as usize) < MAX_LEVELS, "the number of iterations is bounded, see ploc::Step");
                let iterations = (done + 32).min(MAX_LEVELS as u32);
                recorded = Dispatches { iterations, levels: iterations };
            }
        }
    }

    /// Which of the value buffers holds the triangles' order.
    fn record_order(&self, pass: &mut Pass, w: &BuildWorkspace, input: Input<'_>) -> usize {
        let Input { triangles, count } = input;
        pass.scope("morton", |pass| {
            self.morton.record(pass, triangles, count, &w.bounds, &w.sort.keys[0]);
        });
        pass.scope("sort", |pass| self.sort.record(pass, &w.sort, count, self.params.morton.code_bits()))
    }

    /// `steps` of the clustering, which starts afresh where there is an `order`, and what follows it, with
    /// a dispatch for each of `large` levels.
    fn record_tree(
        &self,
        pass: &mut Pass,
        w: &BuildWorkspace,
        input: Input<'_>,
        order: Option<usize>,
        steps: Range<u32>,
        large: u32,
    ) {
        let Input { triangles, count } = input;
        pass.scope("ploc", |pass| {
            if let Some(order) = order {
                self.ploc.record_leaves(pass, triangles, count, &w.sort.values[order], &w.tree, &w.ploc);
            }
            self.ploc.record(pass, &w.tree, &w.bounds, &w.ploc, steps);
        });
        pass.scope("collapse", |pass| {
            self.collapse.record(pass, &w.tree, &w.bounds, &w.subtrees, large);
        });
        pass.scope("rearrange", |pass| {
            self.rearrange.record(pass, &w.tree, &w.subtrees, &w.nodes, &w.rearrange, large);
            let positions = &w.rearrange.positions;
            self.leaf_order.record(pass, &w.tree, positions, triangles, &w.triangles, count);
        });
    }
}

impl BuildWorkspace {
    /// Copies the binary tree of the last build, one triangle a leaf, to the host.
    ///
    /// # Errors
    /// A transfer failed.
    pub fn read_tree(&self, count: usize) -> Result<Bvh2, Error> {
        Bvh2::read(&self.tree, count)
    }

    /// Copies what the last build's collapse decided to the host.
    ///
    /// # Errors
    /// A transfer failed.
    pub fn read_subtrees(&self, count: usize) -> Result<Vec<Subtree>, Error> {
        self.subtrees.read(0, count - 1)
    }

    /// Copies the last build's scene bounds to the host.
    ///
    /// # Errors
    /// A transfer failed.
    pub fn read_bounds(&self) -> Result<SceneBounds, Error> {
        let words: Vec<[u32; 12]> = self.bounds.read(0, 1)?;
        Ok(SceneBounds::decode(words[0]))
    }
}

/// Builds a tree over `count` triangles and keeps only what traversal needs.
///
/// # Errors
/// No triangles, too many, too little memory, or the device failed.
///
/// # Panics
/// A parameter is out of its documented range, or the buffer holds fewer triangles.
pub fn build(gpu: &Gpu, triangles: &Buffer, count: usize, params: &BuildParams) -> Result<Built, BuildError> {
    let builder = Builder::new(gpu, params)?;
    let workspace = builder.workspace(count)?;
    let report = builder.build(&workspace, triangles, count, false)?;
    // Before the collapse it was not known how many nodes there would be.
    let bytes = size_of::<BinaryNode>() as u64 * u64::from(report.summary.nodes);
    let nodes = gpu.buffer("nodes", bytes)?;
    let mut pass = Pass::new(gpu)?;
    pass.copy(&workspace.nodes, 0, &nodes, 0, bytes);
    pass.submit()?;
    Ok(Built { nodes, triangles: workspace.triangles, count, report })
}

fn check(count: usize) -> Result<(), BuildError> {
    match count {
        0 => Err(BuildError::Empty),
        1..=MAX_TRIANGLES => Ok(()),
        _ => Err(BuildError::TooMany(count)),
    }
}
