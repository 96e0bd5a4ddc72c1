//! Chains the stages of a build: triangles in device memory → nodes that a kernel can traverse.
//!
//! ```text
//! triangles → bounds, codes → sort → leaves, clustering → collapse → wide tree → nodes, triangles
//!             \ morton /              \    ploc    /                 contract    \    layout   /
//! ```
//!
//! With [`Method::Hploc`] clustering and collapse are one launch.
//!
//! Everything is recorded into one submission, and nothing is read back before its end: how many
//! iterations the clustering takes, and how large each is, only the GPU knows.
//!
//! A binary tree can also come from elsewhere, such as [`crate::sbvh`], [`crate::midpoint`] or a file ([`crate::treefile`]): then
//! [`BuildWorkspace::adopt`] takes the place of everything before the collapse.

use crate::{
    bvh2::{Bvh2, Bvh2Buffers, LevelsHeader, MAX_LEVELS, MAX_TRIANGLES},
    collapse::{Collapse, CollapseParams, Subtree},
    contract::{
        self, Contract, ContractParams, Contraction, Form, Progress, VisitCounter, Visits, WideBuffers,
        WideBvh,
    },
    gpu::{Buffer, Error, Gpu, Pass, Timings},
    hploc::{Hploc, HplocBuffers, HplocParams},
    layout::{self, Encode, Layout, LayoutBuffers, LayoutParams, NodeLayout},
    morton::{BOUNDS_BYTES, Morton, MortonParams, SceneBounds},
    ploc::{Ploc, PlocBuffers, PlocParams},
    sort::{Sort, SortBuffers, SortParams},
    traverse::{Structure, Tree, TriangleParams, groups::STACK_PER_NODE},
};
use serde::{Deserialize, Serialize};
use std::{cell::Cell, fmt, time::Instant};

/// Everything that may be chosen about a build.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BuildParams {
    /// Where the binary tree comes from.
    pub method: Method,
    /// The curve that triangles are sorted along.
    pub morton: MortonParams,
    /// The sorting along it.
    pub sort: SortParams,
    /// The clustering.
    pub ploc: PlocParams,
    /// The clustering in a single launch.
    pub hploc: HplocParams,
    /// The merging of leaves.
    pub collapse: CollapseParams,
    /// Which boxes share a node.
    pub contract: ContractParams,
    /// How nodes are stored.
    pub layout: LayoutParams,
    /// How triangles are stored, and tested.
    pub triangle: TriangleParams,
}

/// Where the binary tree comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Parallel locally-ordered clustering on the device: [`crate::ploc`].
    #[default]
    Ploc,
    /// The same up the hierarchy of the codes, in a single launch: [`crate::hploc`].
    Hploc,
    /// Spatial splits, on the CPU: [`crate::sbvh`]. Better, and slower to build.
    Sbvh,
    /// Boxes halved in the middle, on the CPU, with leaves of all subtrees of up to `collapse.max_leaf` triangles:
    /// [`crate::midpoint`]. RTRS's.
    Midpoint,
}

impl fmt::Display for Method {
    /// As `build.method` is spelt.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.pad(match self {
            Self::Ploc => "ploc",
            Self::Hploc => "hploc",
            Self::Sbvh => "sbvh",
            Self::Midpoint => "midpoint",
        })
    }
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
    /// Leaves may have more triangles than nodes of the layout can say.
    #[error(
        "leaves of up to {most} triangles, and nodes of {layout:?} can say {limit}: set {parameter}={limit} or less"
    )]
    LeavesTooLarge {
        /// The layout.
        layout: Layout,
        /// The parameter that allows it.
        parameter: &'static str,
        /// What it allows.
        most: u32,
        /// What can be said.
        limit: usize,
    },
    /// The device or its driver failed, or there is too little memory.
    #[error(transparent)]
    Gpu(#[from] Error),
}

/// What a build took on the device, in milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BuildMilliseconds {
    /// Splitting in space, on the CPU; nothing where the tree is built on the device.
    pub sbvh: f64,
    /// Halving boxes in the middle, on the CPU; nothing where the tree is built otherwise.
    pub midpoint: f64,
    /// Copying a binary tree to the device that was made before; nothing where it was made for this build.
    pub adopt: f64,
    /// Scene bounds and Morton codes.
    pub morton: f64,
    /// Sorting the codes.
    pub sort: f64,
    /// Leaves and clustering.
    pub ploc: f64,
    /// Leaves, and clustering and merging leaves in a single launch.
    pub hploc: f64,
    /// Merging leaves.
    pub collapse: f64,
    /// Choosing which boxes share a node.
    pub contract: f64,
    /// Writing nodes and triangles in their layout.
    pub layout: f64,
    /// From the first dispatch to the end of the last, and what was done on the CPU before.
    pub total: f64,
}

/// What was done on the CPU before the first dispatch, in milliseconds.
#[derive(Clone, Copy, Debug, Default)]
struct Before {
    /// Splitting in space.
    sbvh: f64,
    /// Halving boxes in the middle.
    midpoint: f64,
    /// Copying a tree to the device.
    adopt: f64,
}

impl BuildMilliseconds {
    fn of(timings: &Timings, Before { sbvh, midpoint, adopt }: Before) -> Self {
        let under = |name: &str| timings.milliseconds(&format!("build/{name}"));
        Self {
            sbvh,
            midpoint,
            adopt,
            morton: under("morton"),
            sort: under("sort"),
            ploc: under("ploc"),
            hploc: under("hploc"),
            collapse: under("collapse"),
            contract: under("contract"),
            layout: under("layout"),
            total: sbvh + midpoint + adopt + timings.milliseconds("build"),
        }
    }
}

/// The kernels of a build, compiled for one layout and set of parameters.
#[derive(Debug)]
pub struct Builder {
    gpu: Gpu,
    params: BuildParams,
    morton: Morton,
    clustering: Option<Clustering>,
    collapse: Collapse,
    widen: Widen,
}

/// The kernels that make the binary tree on the device.
#[derive(Debug)]
struct Clustering {
    sort: Sort,
    method: ClusteringMethod,
}

#[derive(Debug)]
enum ClusteringMethod {
    Ploc(Ploc),
    Hploc(Hploc),
}

/// Memory that they need besides the tree.
#[derive(Debug)]
struct ClusteringBuffers {
    sorted: SortBuffers,
    method: MethodBuffers,
}

#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "a workspace has one")]
enum MethodBuffers {
    Ploc(PlocBuffers),
    Hploc(HplocBuffers),
}

/// Device memory for builds of up to so many triangles, so that a build itself allocates nothing.
#[derive(Debug)]
pub struct BuildWorkspace {
    capacity: usize,
    /// Of the last build.
    last: Cell<Option<Last>>,
    bounds: Buffer,
    tree: Bvh2Buffers,
    clustering: Option<ClusteringBuffers>,
    subtrees: Buffer,
    /// The wide tree, its nodes and its triangles.
    pub wide: WideWorkspace,
}

/// The kernels that make nodes of a collapsed binary tree: contraction and layout.
#[derive(Debug)]
pub struct Widen {
    gpu: Gpu,
    contract: Contract,
    encode: Encode,
}

/// A wide tree in device memory, as contraction made it and as kernels traverse it.
#[derive(Debug)]
pub struct WideWorkspace {
    capacity: usize,
    /// Of the last contraction, how many levels it had; 0 before the first.
    levels: Cell<u32>,
    wide: WideBuffers,
    layout: Layout,
    stride: usize,
    /// The tree in its layout; `Summary` says how many nodes.
    pub stored: LayoutBuffers,
}

/// A tree in numbers that a build leaves for the host to read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Summary {
    /// Nodes.
    pub nodes: u32,
    /// Nodes on the longest way from the root to a leaf, the root included.
    pub depth: u32,
    /// Entries that a traversal's stack needs at most: one for every further child on a way from the root to
    /// a leaf, and one that marks the end.
    pub stack: u32,
    /// Levels of the binary tree, that is iterations of the clustering; 0 where there are none.
    pub levels: u32,
    /// Those that were processed by a dispatch each, before one workgroup took over.
    pub large_levels: u32,
    /// The same of the clustering itself, which needs all of a workgroup's shared memory.
    pub iterations: u32,
}

/// What to build over.
#[derive(Clone, Copy)]
struct Input<'a> {
    triangles: &'a Buffer,
    count: usize,
}

/// What a contraction goes by beside the tree.
#[derive(Clone, Copy)]
struct Source<'a> {
    visits: Option<Visits<'a>>,
    /// Levels that the collapse was recorded for; nothing where the tree has none.
    large: Option<u32>,
}

/// What is known of a binary tree.
#[derive(Clone, Copy, Debug)]
struct Last {
    /// Triangles that it was made of.
    triangles: usize,
    /// Its leaves: more, where triangles were split.
    leaves: usize,
    /// What it needed.
    dispatches: Dispatches,
    /// What was done on the CPU took so long.
    before: Before,
}

/// How many dispatches to record where only the GPU knows how many there is work for.
#[derive(Clone, Copy, Debug)]
struct Dispatches {
    /// Iterations of the clustering.
    iterations: u32,
    /// Levels in the stages that go level by level; nothing where the tree has none.
    levels: Option<u32>,
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

impl Summary {
    fn of(progress: &Progress, header: &LevelsHeader) -> Self {
        Self {
            nodes: progress.nodes,
            depth: progress.depth,
            stack: progress.stack,
            levels: header.levels(),
            large_levels: header.tail,
            iterations: header.iterations,
        }
    }
}

impl Builder {
    /// Compiles the kernels.
    ///
    /// # Errors
    /// The driver's compiler failed, or leaves would be too large for the layout.
    ///
    /// # Panics
    /// A parameter is out of its documented range, or the contraction goes by view: there have to be visits
    /// first, see [`Widen`].
    pub fn new(gpu: &Gpu, params: &BuildParams, layout: Layout) -> Result<Self, BuildError> {
        Self::compile(gpu, params, layout, true)
    }

    /// The same for binary trees that [`BuildWorkspace::adopt`] is given, whatever method made them.
    ///
    /// # Errors
    /// As [`Builder::new`].
    ///
    /// # Panics
    /// As [`Builder::new`].
    pub fn adopting(gpu: &Gpu, params: &BuildParams, layout: Layout) -> Result<Self, BuildError> {
        Self::compile(gpu, params, layout, false)
    }

    fn compile(gpu: &Gpu, params: &BuildParams, layout: Layout, clusters: bool) -> Result<Self, BuildError> {
        assert!(!params.contract.method.by_view(), "{} needs a tree and visits", params.contract.method);
        let words = params.morton.words();
        let method = match params.method {
            _ if !clusters => None,
            Method::Ploc => Some(ClusteringMethod::Ploc(Ploc::new(gpu, &params.ploc)?)),
            Method::Hploc => {
                Some(ClusteringMethod::Hploc(Hploc::new(gpu, &params.hploc, &params.collapse, words)?))
            }
            Method::Sbvh | Method::Midpoint => None,
        };
        let clustering =
            |method| Ok::<_, Error>(Clustering { sort: Sort::new(gpu, words, &params.sort)?, method });
        Ok(Self {
            gpu: gpu.clone(),
            params: params.clone(),
            morton: Morton::new(gpu, &params.morton)?,
            clustering: method.map(clustering).transpose()?,
            collapse: Collapse::new(gpu, &params.collapse)?,
            widen: Widen::new(gpu, params, layout)?,
        })
    }

    /// What it was compiled for.
    pub fn params(&self) -> &BuildParams {
        &self.params
    }

    /// The clustering, whose block sizes tests go around.
    ///
    /// # Panics
    /// The tree comes from elsewhere.
    pub fn ploc(&self) -> &Ploc {
        match &self.clustering {
            Some(Clustering { method: ClusteringMethod::Ploc(ploc), .. }) => ploc,
            _ => panic!("the tree is made by {:?}", self.params.method),
        }
    }

    /// Allocates for trees of up to `capacity` leaves; about 400 bytes each. Where triangles are not split, they are as
    /// many as the leaves.
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
            tree: Bvh2Buffers::new(gpu, capacity)?,
            clustering: (self.clustering.as_ref())
                .map(|Clustering { sort, method }| {
                    Ok::<_, Error>(ClusteringBuffers {
                        sorted: sort.buffers(gpu, capacity, self.params.morton.words())?,
                        method: match method {
                            ClusteringMethod::Ploc(ploc) => MethodBuffers::Ploc(ploc.buffers(gpu, capacity)?),
                            ClusteringMethod::Hploc(_) => {
                                MethodBuffers::Hploc(Hploc::buffers(gpu, capacity)?)
                            }
                        },
                    })
                })
                .transpose()?,
            subtrees: Collapse::buffer(gpu, capacity)?,
            wide: self.widen.workspace(capacity)?,
        })
    }

    /// Builds a tree over the first `count` of `triangles` (nine finite floats each) into the workspace; where the
    /// binary tree comes from the CPU, over what the workspace has adopted.
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
        let (clustering, buffers) = match (&self.clustering, &workspace.clustering) {
            (Some(clustering), Some(buffers)) => (clustering, buffers),
            (None, None) => return self.build_adopted(workspace, triangles, count, time_dispatches),
            _ => panic!("a workspace of another builder"),
        };
        let (ploc, clusters) = match (&clustering.method, &buffers.method) {
            (ClusteringMethod::Ploc(ploc), MethodBuffers::Ploc(clusters)) => (ploc, clusters),
            (ClusteringMethod::Hploc(hploc), MethodBuffers::Hploc(clusters)) => {
                let record = |pass: &mut Pass| {
                    let SortBuffers { keys, values, .. } = &buffers.sorted;
                    let at = self.record_order(pass, workspace, input, clustering, &buffers.sorted);
                    pass.scope("hploc", |pass| {
                        let BuildWorkspace { bounds, tree, subtrees, .. } = workspace;
                        let sorted = (&keys[at], &values[at]);
                        hploc.record(pass, triangles, count, sorted, bounds, tree, subtrees, clusters);
                    });
                };
                let last = Last {
                    triangles: count,
                    leaves: count,
                    dispatches: Dispatches { iterations: 0, levels: None },
                    before: Before::default(),
                };
                let report = self.build_once(workspace, input, last, time_dispatches, record)?;
                workspace.last.set(Some(last));
                return Ok(report);
            }
            _ => panic!("a workspace of another builder"),
        };
        let mut timings = Timings::default();
        let mut done = 0;
        let mut recorded = match workspace.last.get() {
            Some(last) if last.triangles == count => last.dispatches,
            _ => {
                let iterations = ploc.iterations(count);
                Dispatches { iterations, levels: Some(iterations) }
            }
        };
        let levels = &workspace.wide.levels;
        loop {
            let mut pass = Pass::new(&self.gpu)?;
            pass.time_dispatches(time_dispatches);
            let large = recorded.levels;
            pass.scope("build", |pass| {
                let sorted = &buffers.sorted;
                let order =
                    (done == 0).then(|| self.record_order(pass, workspace, input, clustering, sorted));
                let BuildWorkspace { bounds, tree, subtrees, .. } = workspace;
                pass.scope("ploc", |pass| {
                    if let Some(order) = order {
                        ploc.record_leaves(pass, triangles, count, &sorted.values[order], tree, clusters);
                    }
                    ploc.record(pass, tree, bounds, clusters, done..recorded.iterations);
                });
                pass.scope("collapse", |pass| {
                    self.collapse.record(pass, tree, bounds, subtrees, large.unwrap_or(0));
                });
                self.widen.record(
                    pass,
                    workspace,
                    &workspace.wide,
                    input,
                    Source { visits: None, large },
                    true,
                );
            });
            timings.extend(pass.submit()?);
            let header = workspace.tree.header()?;
            let complete = header.count > 0 || count == 1;
            if complete && Some(header.tail) <= recorded.levels {
                let source = Source { visits: None, large };
                let progress = self.widen.finish(workspace, &workspace.wide, input, source, &mut timings)?;
                let (iterations, tail) = (header.iterations, header.tail);
                workspace.last.set(Some(Last {
                    triangles: count,
                    leaves: count,
                    dispatches: Dispatches { iterations, levels: Some(tail) },
                    before: Before::default(),
                }));
                return Ok(BuildReport {
                    summary: Summary::of(&progress, &header),
                    recorded: recorded.iterations,
                    milliseconds: BuildMilliseconds::of(&timings, Before::default()),
                    timings,
                });
            }
            levels.set(0);
            // Another scene than was expected: go on where it stopped. The clustering's tail, if it was
            // reached, does the same once more.
            done = recorded.iterations;
            if complete {
                recorded.levels = Some(header.tail);
            } else {
                assert!((done as usize) < MAX_LEVELS, "the number of iterations is bounded, see ploc::Step");
                let iterations = (done + 32).min(MAX_LEVELS as u32);
                recorded = Dispatches { iterations, levels: Some(iterations) };
            }
        }
    }

    /// What follows the binary tree that the workspace has adopted.
    fn build_adopted(
        &self,
        workspace: &BuildWorkspace,
        triangles: &Buffer,
        count: usize,
        time_dispatches: bool,
    ) -> Result<BuildReport, BuildError> {
        let last = workspace.last.get().filter(|last| last.triangles == count);
        let last = last.expect("a tree over these triangles was adopted");
        let input = Input { triangles, count: last.leaves };
        self.build_once(workspace, input, last, time_dispatches, |pass| {
            pass.scope("morton", |pass| self.morton.record_bounds(pass, triangles, count, &workspace.bounds));
            pass.scope("collapse", |pass| {
                let (tree, bounds) = (&workspace.tree, &workspace.bounds);
                let large = last.dispatches.levels.unwrap_or(0);
                self.collapse.record(pass, tree, bounds, &workspace.subtrees, large);
            });
        })
    }

    /// A build of one submission: what `record` records makes a collapsed binary tree, of which `last` is known.
    fn build_once(
        &self,
        workspace: &BuildWorkspace,
        input: Input<'_>,
        last: Last,
        time_dispatches: bool,
        record: impl FnOnce(&mut Pass),
    ) -> Result<BuildReport, BuildError> {
        let source = Source { visits: None, large: last.dispatches.levels };
        let mut pass = Pass::new(&self.gpu)?;
        pass.time_dispatches(time_dispatches);
        pass.scope("build", |pass| {
            record(pass);
            self.widen.record(pass, workspace, &workspace.wide, input, source, true);
        });
        let mut timings = Timings::default();
        timings.extend(pass.submit()?);
        let progress = self.widen.finish(workspace, &workspace.wide, input, source, &mut timings)?;
        Ok(BuildReport {
            summary: Summary::of(&progress, &workspace.tree.header()?),
            recorded: 0,
            milliseconds: BuildMilliseconds::of(&timings, last.before),
            timings,
        })
    }

    /// Which of the key and value buffers hold the triangles' order.
    fn record_order(
        &self,
        pass: &mut Pass,
        w: &BuildWorkspace,
        input: Input<'_>,
        clustering: &Clustering,
        sorted: &SortBuffers,
    ) -> usize {
        let Input { triangles, count } = input;
        pass.scope("morton", |pass| self.morton.record(pass, triangles, count, &w.bounds, &sorted.keys[0]));
        let bits = self.params.morton.code_bits();
        pass.scope("sort", |pass| clustering.sort.record(pass, sorted, count, bits))
    }
}

impl Widen {
    /// Compiles the kernels for a layout and what `params` say of contraction and layout.
    ///
    /// # Errors
    /// The driver's compiler failed, or leaves would be too large for the layout.
    pub fn new(gpu: &Gpu, params: &BuildParams, layout: Layout) -> Result<Self, BuildError> {
        let (parameter, most) = match params.contract.method {
            Contraction::Optimal => ("contract.p_max", params.contract.p_max),
            _ => ("collapse.max_leaf", params.collapse.max_leaf),
        };
        let limit = layout.limits().triangles_per_leaf;
        if most as usize > limit {
            return Err(BuildError::LeavesTooLarge { layout, parameter, most, limit });
        }
        Ok(Self {
            gpu: gpu.clone(),
            contract: Contract::new(gpu, layout.arity(), &params.contract)?,
            encode: Encode::new(gpu, layout, &params.layout, params.triangle.test)?,
        })
    }

    /// How the contraction is launched.
    pub fn form(&self) -> Form {
        self.contract.form()
    }

    /// Allocates for trees of up to `capacity` leaves.
    ///
    /// # Errors
    /// Too little memory.
    pub fn workspace(&self, capacity: usize) -> Result<WideWorkspace, Error> {
        let wide = self.contract.buffers(&self.gpu, capacity)?;
        Ok(WideWorkspace {
            capacity,
            levels: Cell::new(0),
            layout: self.encode.layout(),
            stride: self.encode.stride(),
            stored: self.encode.buffers(&self.gpu, wide.capacity(), capacity)?,
            wide,
        })
    }

    /// Makes nodes of the collapsed binary tree that the last build left in `from`, over the same
    /// `triangles`, by the `visits` that its inner nodes had. Only phases from contraction on take time.
    ///
    /// # Errors
    /// The device failed.
    ///
    /// # Panics
    /// There is no build in `from` of that many triangles, or no room for it in `to`.
    pub fn build(
        &self,
        from: &BuildWorkspace,
        to: &WideWorkspace,
        triangles: &Buffer,
        count: usize,
        visits: Option<Visits<'_>>,
    ) -> Result<BuildReport, BuildError> {
        let last = from.last.get().filter(|last| last.triangles == count);
        let Last { leaves, dispatches, .. } = last.unwrap_or_else(|| panic!("no build of {count} triangles"));
        assert!(leaves <= to.capacity, "{leaves} leaves in a workspace for {}", to.capacity);
        let input = Input { triangles, count: leaves };
        let mut timings = Timings::default();
        let mut pass = Pass::new(&self.gpu)?;
        pass.time_dispatches(false);
        let source = Source { visits, large: dispatches.levels };
        pass.scope("build", |pass| self.record(pass, from, to, input, source, true));
        timings.extend(pass.submit()?);
        let progress = self.finish(from, to, input, source, &mut timings)?;
        let header = from.tree.header()?;
        Ok(BuildReport {
            summary: Summary::of(&progress, &header),
            recorded: 0,
            milliseconds: BuildMilliseconds::of(&timings, Before::default()),
            timings,
        })
    }

    fn record(
        &self,
        pass: &mut Pass,
        from: &BuildWorkspace,
        to: &WideWorkspace,
        input: Input<'_>,
        source: Source<'_>,
        afresh: bool,
    ) {
        let levels = match (afresh, to.levels.get()) {
            (true, known) if known > 0 => known,
            _ => LEVELS_ON_SUSPICION,
        };
        pass.scope("contract", |pass| {
            let tree = contract::Input {
                tree: &from.tree,
                subtrees: &from.subtrees,
                bounds: &from.bounds,
                large_levels: source.large,
                visits: source.visits,
            };
            self.contract.record(pass, &tree, &to.wide, afresh, levels);
        });
        pass.scope("layout", |pass| {
            let Input { triangles, count } = input;
            let made = layout::Input { tree: &from.tree, wide: &to.wide, triangles, count };
            self.encode.record(pass, &made, &to.stored);
        });
    }

    /// Goes on until the contraction is complete, where more levels were needed than recorded.
    fn finish(
        &self,
        from: &BuildWorkspace,
        to: &WideWorkspace,
        input: Input<'_>,
        source: Source<'_>,
        timings: &mut Timings,
    ) -> Result<Progress, Error> {
        loop {
            let progress: Progress = to.wide.progress.read(0, 1)?[0];
            if progress.finished == progress.nodes {
                to.levels.set(progress.depth);
                return Ok(progress);
            }
            // A single launch goes on until the tree is complete. It must not be tried again and again.
            if self.form() != Form::Levels {
                return Err(Error::EndedEarly { device: self.gpu.info().name.clone() });
            }
            let mut pass = Pass::new(&self.gpu)?;
            pass.time_dispatches(false);
            pass.scope("build", |pass| self.record(pass, from, to, input, source, false));
            timings.extend(pass.submit()?);
        }
    }
}

/// Levels of a wide tree that are recorded while nobody knows how many it has; empty ones cost little.
const LEVELS_ON_SUSPICION: u32 = 32;

impl WideWorkspace {
    /// What a traversal needs to know of the tree that was last built, with the scene's largest absolute
    /// coordinate.
    pub fn tree(&self, summary: &Summary, extent: f32) -> Tree {
        Tree {
            nodes: self.stored.nodes.address(),
            triangles: self.stored.triangles.stored.address(),
            indices: self.stored.triangles.indices_address(),
            test: self.stored.triangles.test(),
            structure: Structure::Nodes(self.layout),
            listed: 0,
            stride: self.stride,
            stack: if self.layout.is_compressed() { STACK_PER_NODE * summary.depth } else { summary.stack },
            extent,
        }
    }

    /// Copies the nodes of a wide tree of `count` to the host: [`Layout::items`] of them.
    ///
    /// # Errors
    /// A transfer failed.
    ///
    /// # Panics
    /// They are stored in another layout.
    pub fn read_nodes<L: NodeLayout>(&self, count: usize) -> Result<Vec<L::Node>, Error> {
        let size = size_of::<L::Node>();
        assert_eq!(size, self.layout.node_bytes(), "{} nodes in a tree of {:?}", L::NAME, self.layout);
        let bytes: Vec<u8> = self.stored.nodes.read(0, self.layout.items(count) * self.stride)?;
        Ok(bytes.chunks_exact(self.stride).map(|b| bytemuck::pod_read_unaligned(&b[..size])).collect())
    }

    /// Copies the wide tree of `nodes` nodes, as the contraction made it, to the host.
    ///
    /// # Errors
    /// A transfer failed.
    pub fn read_wide(&self, nodes: usize) -> Result<WideBvh, Error> {
        WideBvh::read(&self.wide, nodes)
    }
}

impl BuildWorkspace {
    /// Copies a binary tree over `triangles` triangles to the device. Builds from it took as long before their first
    /// dispatch as making it by a method took the CPU, `made` milliseconds; where it was there already (`None`), as long as
    /// this copy.
    ///
    /// # Errors
    /// A transfer failed.
    ///
    /// # Panics
    /// It has more leaves than the workspace was made for.
    pub fn adopt(
        &self,
        gpu: &Gpu,
        tree: &Bvh2,
        triangles: usize,
        made: Option<(Method, f64)>,
    ) -> Result<(), Error> {
        assert!(tree.leaves <= self.capacity, "{} leaves in a workspace for {}", tree.leaves, self.capacity);
        let started = Instant::now();
        let levels = self.tree.write(gpu, tree)?;
        let before = match made {
            Some((Method::Sbvh, sbvh)) => Before { sbvh, ..Before::default() },
            Some((Method::Midpoint, midpoint)) => Before { midpoint, ..Before::default() },
            Some((Method::Ploc | Method::Hploc, _)) | None => {
                Before { adopt: 1e3 * started.elapsed().as_secs_f64(), ..Before::default() }
            }
        };
        let dispatches = Dispatches { iterations: 0, levels: Some(levels) };
        self.last.set(Some(Last { triangles, leaves: tree.leaves, dispatches, before }));
        Ok(())
    }

    /// Leaves of the last build's binary tree; 0 before the first.
    pub fn leaves(&self) -> usize {
        self.last.get().map_or(0, |last| last.leaves)
    }

    /// Records, after a traversal that counted visits of the last build's own wide tree, what that means for
    /// the binary tree.
    pub fn record_visits(&self, pass: &mut Pass, counter: &VisitCounter) {
        counter.record(pass, &self.tree, &self.wide.wide);
    }

    /// Copies the binary tree of the last build, one triangle a leaf, to the host.
    ///
    /// # Errors
    /// A transfer failed.
    pub fn read_tree(&self) -> Result<Bvh2, Error> {
        Bvh2::read(&self.tree, self.leaves())
    }

    /// Copies what the last build's collapse decided to the host.
    ///
    /// # Errors
    /// A transfer failed.
    pub fn read_subtrees(&self) -> Result<Vec<Subtree>, Error> {
        self.subtrees.read(0, self.leaves() - 1)
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

fn check(count: usize) -> Result<(), BuildError> {
    match count {
        0 => Err(BuildError::Empty),
        1..=MAX_TRIANGLES => Ok(()),
        _ => Err(BuildError::TooMany(count)),
    }
}
