//! Closest hits of many rays: one kernel a layout, launched over a queue of rays.

pub mod cpu;
pub mod groups;
#[cfg(test)]
mod interface_tests;
mod triangle;

pub use triangle::{TriangleFormat, TriangleParams, TriangleTest};

use crate::{
    Error, driver,
    gpu::{Gpu, Kernel, Pass, shaders},
    layout::Layout,
    list::{self, Listing},
};
use bytemuck::{Pod, Zeroable};
use groups::Order;

/// A ray as kernels and ray files hold it: points `origin + t * direction` with `t_min < t < t_max`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Ray {
    /// In the scene's units.
    pub origin: [f32; 3],
    /// Nothing nearer is hit.
    pub t_min: f32,
    /// Need not be normalized; `t` is in its lengths.
    pub direction: [f32; 3],
    /// Nothing farther is hit; may be infinite.
    pub t_max: f32,
}

/// The nearest triangle a ray meets.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Hit {
    /// Distance in lengths of the ray's direction; infinite for a miss.
    pub t: f32,
    /// Index in the scene's file order, or [`Hit::MISS`].
    pub triangle: u32,
}

impl Hit {
    /// In place of a triangle where nothing was hit.
    pub const MISS: u32 = u32::MAX;
    /// Nothing was hit.
    pub const NONE: Self = Self { t: f32::INFINITY, triangle: Self::MISS };
}

/// One wavefront's queue as kernels see it (`ray.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Queue {
    /// The first ray that no invocation has fetched.
    pub next: u32,
    /// Rays in the wavefront.
    pub count: u32,
    /// Rays whose hit has been written.
    pub finished: u32,
    /// Nothing.
    pub unused: u32,
}

/// What one ray cost.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Counts {
    /// Inner nodes visited.
    pub nodes: u32,
    /// Boxes tested.
    pub boxes: u32,
    /// Triangles tested.
    pub triangles: u32,
    /// Nothing.
    pub unused: u32,
}

/// How well the subgroups that traced a wavefront were used: what they executed, and in how many lanes each time. Over
/// the size of a subgroup, lanes of a step are the SIMD utilization of Ylitie et al. 2017 (tables 7 and 10).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Utilization {
    /// Steps in which lanes visited a node.
    pub node_steps: u64,
    /// Lanes that did, over all these steps.
    pub node_lanes: u64,
    /// Steps in which lanes tested a triangle.
    pub triangle_steps: u64,
    /// Lanes that did.
    pub triangle_lanes: u64,
    /// Steps in which lanes fetched a ray and made it ready; those that found the queue empty are none.
    pub fetches: u64,
    /// Lanes that did.
    pub fetch_lanes: u64,
}

const _: () = assert!(size_of::<Ray>() == 32 && std::mem::offset_of!(Ray, direction) == 16);
const _: () = assert!(size_of::<Hit>() == 8 && size_of::<Queue>() == 16 && size_of::<Counts>() == 16);
// Kernels have 64 bits as two words.
const _: () = assert!(size_of::<Utilization>() == 6 * 8 && cfg!(target_endian = "little"));

/// How traversal is launched and scheduled.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// Subgroups a workgroup for primary rays; times the subgroup size it is the workgroup size (thesis
    /// 6.2.1).
    pub primary_subgroups: u32,
    /// Subgroups a workgroup for secondary rays.
    pub secondary_subgroups: u32,
    /// Idle lanes fetch new primary rays when fewer than this share of a subgroup has one: the thesis's 20 of
    /// 32. More keeps lanes busier, costs more visits to the queue, and mixes rays that would stay together; 0 waits until no
    /// lane has any.
    pub primary_fetch_below: f32,
    /// The same of secondary rays.
    pub secondary_fetch_below: f32,
    /// Triangle tests are put off when at most this share of a subgroup has any left and another lane
    /// could visit nodes (triangle postponing, Ylitie et al. 2017, 4.4; the thesis has none, which is 0).
    pub postpone_below: f32,
    /// Schedule of primary rays: 0 for phases, in which all lanes of a subgroup look for leaves and then all
    /// test triangles, as the thesis does; otherwise by vote, in which so many lanes at a node weigh as much
    /// as one with a triangle.
    pub primary_vote: f32,
    /// Schedule of secondary rays, which part sooner and gain from votes.
    pub secondary_vote: f32,
    /// Nodes that the lanes of a subgroup visit in phases before they vote whether any has to go on, 1 to 4. More spares votes,
    /// and lets lanes idle that need no more.
    pub visits_a_vote: u32,
    /// Lanes go on to triangles when at most this share of a subgroup still looks for a leaf, in phases, and 0 waits for all.
    /// More keeps few lanes from holding up others, and tests triangles with fewer lanes.
    pub search_above: f32,
    /// How many primary rays a lane takes where the lanes of a subgroup walk the tree together, in place of either
    /// schedule; 0 where they do not. In GLSL and wide layouts that are not quantized, of no more children than a
    /// subgroup has lanes.
    pub primary_packets: u32,
    /// Whether a lane that has found a leaf postpones it and visits nodes on until all have found one (speculative traversal,
    /// Aila and Laine 2009), in phases. Otherwise it waits, which is less work, and pays where rays stay together.
    pub speculate: bool,
    /// Whether primary rays of a subgroup that all point into one octant are traced by code for that octant, which knows the
    /// planes where they enter and leave boxes: in phases without barriers, through `Binary`. In GLSL.
    pub octants: bool,
    /// When the queue is empty and this share of a workgroup's subgroups has ended, all of them end together the primary rays
    /// that are left: lanes without a ray take over parts of others' ways, so that a launch does not wait for few long ones.
    /// 0 where each ends what it has begun. In GLSL, in phases without barriers, and where a workgroup has more than one
    /// subgroup and no more than a subgroup lanes.
    pub end_together: f32,
    /// How many nodes a lane visits, and triangles it tests, between two looks at what others have left then.
    pub end_steps: u32,
    /// Entries of the traversal stack; made larger where a tree needs more.
    pub stack: u32,
    /// Whether the stages of a path are launched apart, or are one persistent kernel.
    pub kernels: Kernels,
    /// How the compressed layout is traversed, which has a schedule of its own.
    #[serde(skip)]
    pub groups: groups::Params,
    /// In which order children are visited in the compressed layout; in the others the nearest is first.
    #[serde(skip)]
    pub order: Order,
    /// What the kernels are written in. No parameter: it belongs to a variant.
    #[serde(skip)]
    pub language: Language,
    /// What is done differently in that language.
    #[serde(skip)]
    pub technique: Technique,
    /// How the driver's own ray tracing is used, for trees that it has built; all else is then without meaning.
    #[serde(skip)]
    pub driver: driver::Params,
}

/// What a traversal is written in: the same algorithm, line by line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Language {
    /// One source for all layouts, by macros.
    #[default]
    Glsl,
    /// One source for all layouts, which are types that are linked to it.
    Slang,
}

impl Language {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Glsl, Self::Slang];

    /// Why this build has no kernels in it; nothing where it has them.
    pub fn missing(self) -> Option<&'static str> {
        match self {
            Self::Glsl => None,
            Self::Slang => shaders::SLANG_MISSING,
        }
    }
}

/// What the thesis changed in its Slang kernels to make them faster (5.2 and 5.3), and tried.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Technique {
    /// The subgroups of a workgroup wait for each other between nodes and triangles, so that lanes which have parted
    /// meet again (thesis 5.3). For schedules in phases only: votes of 0.
    pub barrier: bool,
    /// A triangle's distance is computed before it is known whether it is hit (thesis 5.2). Of the watertight test;
    /// Woop's always does that, and Möller and Trumbore's never.
    pub hoist: bool,
    /// Lanes that part in a branch go on together behind it (`SPV_KHR_maximal_reconvergence`).
    pub reconverge: bool,
}

impl Params {
    /// Whether a kind of wavefront is traced by `by_octant.comp`.
    fn by_octant(&self, layout: Layout, wave: Wave) -> bool {
        self.octants && layout == Layout::Binary && wave == Wave::Primary && !self.technique.barrier
    }

    /// Invocations a workgroup of the kernel for a kind of wavefront.
    pub fn workgroup_size(&self, gpu: &Gpu, wave: Wave) -> u32 {
        let subgroups = match wave {
            Wave::Primary => self.primary_subgroups,
            Wave::Secondary => self.secondary_subgroups,
        };
        subgroups.saturating_mul(gpu.info().subgroup_size)
    }

    /// Whether the device has room for the workgroups of both kernels.
    pub fn fits(&self, gpu: &Gpu, layout: Layout) -> bool {
        [Wave::Primary, Wave::Secondary].into_iter().all(|wave| {
            let size = self.workgroup_size(gpu, wave);
            size <= gpu.info().max_workgroup_size && self.check_shared_memory(gpu, layout, size).is_ok()
        })
    }

    /// Fails where workgroups of a size cannot have the stack's shared entries.
    fn check_shared_memory(&self, gpu: &Gpu, layout: Layout, size: u32) -> Result<(), Error> {
        let sharing = if self.groups.share_triangles { 8 + 512 / gpu.info().subgroup_size } else { 0 };
        let bytes = size.saturating_mul(8 * self.groups.shared_stack.max(1) + sharing);
        let limit = gpu.info().shared_memory_bytes;
        if layout.is_compressed() && bytes > limit {
            return Err(Error::SharedStack { size, entries: self.groups.shared_stack, bytes, limit });
        }
        Ok(())
    }
}

/// How many kernels trace a path (thesis 5.1.1, table 3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kernels {
    /// One for each stage, launched by the host.
    #[default]
    Separate,
    /// One for all stages, with a software scheduler: [`crate::path::SingleKernel`].
    Single,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            primary_subgroups: 8,
            secondary_subgroups: 8,
            primary_fetch_below: 0.625,
            secondary_fetch_below: 0.8125,
            postpone_below: 0.25,
            primary_vote: 0.0,
            secondary_vote: 1.0,
            visits_a_vote: 1,
            search_above: 0.0,
            primary_packets: 0,
            speculate: true,
            octants: false,
            end_together: 0.0,
            end_steps: 4,
            stack: 64,
            kernels: Kernels::Separate,
            groups: groups::Params::default(),
            order: Order::default(),
            language: Language::Glsl,
            technique: Technique::default(),
            driver: driver::Params::default(),
        }
    }
}

/// Which of the two launches a wavefront takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wave {
    /// Rays from the camera.
    Primary,
    /// Rays that continue a path.
    Secondary,
}

impl Wave {
    /// The kind of wavefront at a path's depth.
    pub fn at(depth: usize) -> Self {
        if depth == 0 { Self::Primary } else { Self::Secondary }
    }
}

/// What rays are traced through.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Structure {
    /// A tree of ours.
    Nodes(Layout),
    /// The driver's own ray tracing.
    Driver,
    /// No tree.
    List(Listing),
}

impl Structure {
    /// How nodes are stored; nothing where there are none, or none that the driver tells of.
    pub fn layout(self) -> Option<Layout> {
        match self {
            Self::Nodes(layout) => Some(layout),
            Self::Driver | Self::List(_) => None,
        }
    }
}

/// Where a tree in its traversal layout lies on the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tree {
    /// Address of the nodes; node 0 is the root. Of the driver's trees, of the structure.
    pub nodes: u64,
    /// Address of the triangles in leaf order, 48 bytes each.
    pub triangles: u64,
    /// Address of their indices in file order, 0 where triangles contain them.
    pub indices: u64,
    /// What triangles are stored for.
    pub test: TriangleTest,
    /// What it is.
    pub structure: Structure,
    /// How many of the triangles rays are tested against, where there is no tree.
    pub listed: u32,
    /// Bytes from one node to the next.
    pub stride: usize,
    /// Entries that a traversal's stack needs at most; of the compressed layout, where children are not visited by
    /// distance.
    pub stack: u32,
    /// Largest absolute coordinate of the scene.
    pub extent: f32,
}

/// The buffers of one launch, by address.
#[derive(Clone, Copy, Debug)]
pub struct Buffers {
    /// [`Ray`]s.
    pub rays: u64,
    /// [`Hit`]s, as many.
    pub hits: u64,
    /// One [`Queue`].
    pub queue: u64,
    /// [`Counts`], as many as rays; not touched unless the kernels count what rays cost.
    pub counts: u64,
    /// A u32 for each node; not touched unless the kernels count visits.
    pub visits: u64,
    /// One [`Utilization`], which is added to; not touched unless the kernels count what rays cost.
    pub utilization: u64,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Arguments {
    rays: u64,
    hits: u64,
    nodes: u64,
    triangles: u64,
    indices: u64,
    queue: u64,
    counts: u64,
    visits: u64,
    utilization: u64,
    extent: f32,
    unused: u32,
}

/// What a traversal counts beside finding hits; each is a permutation of the kernels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Counting {
    /// Nothing: the fastest, and the one to be timed.
    #[default]
    Nothing,
    /// What each ray costs, and how well subgroups are used: [`Counts`] and [`Utilization`].
    Rays,
    /// How often rays visit each node.
    Visits,
}

/// Loop iterations that a subgroup may take where the driver ends loops silently after 65,535.
const QUOTA: u32 = 60_000;
/// Launches over the same queue on such a driver; those that find it empty cost nothing.
const RELAUNCHES: u32 = 3;

/// What finds the closest hits in trees of one layout and size of stack, or in those of the driver.
#[derive(Debug)]
pub struct Traversal {
    gpu: Gpu,
    by: By,
}

#[derive(Debug)]
enum By {
    Kernels(Pair),
    Driver(driver::Rays),
    List(list::Rays),
}

/// The kernels for both kinds of wavefronts.
#[derive(Debug)]
struct Pair {
    primary: Kernel,
    secondary: Kernel,
    stack: u32,
    launches: u32,
}

impl Pair {
    fn kernel(&self, wave: Wave) -> &Kernel {
        match wave {
            Wave::Primary => &self.primary,
            Wave::Secondary => &self.secondary,
        }
    }
}

impl Traversal {
    /// Compiles the kernels for a tree.
    ///
    /// # Errors
    /// A workgroup size the device cannot run, a technique that it or the schedule does not allow, or a language
    /// that this build was made without. Of the driver's trees, counting what it does not tell.
    ///
    /// # Panics
    /// Visits are to be counted to nodes of a layout that [has boxes of its own](Layout::has_own_boxes), or of no tree.
    pub fn new(gpu: &Gpu, params: &Params, tree: &Tree, counting: Counting) -> Result<Self, Error> {
        let by = |by| Ok(Self { gpu: gpu.clone(), by });
        let layout = match tree.structure {
            Structure::Nodes(layout) => layout,
            Structure::Driver if counting != Counting::Nothing => {
                return Err(Error::DriverTellsNot("choose another variant"));
            }
            Structure::Driver => return by(By::Driver(driver::Rays::new(gpu, &params.driver)?)),
            Structure::List(_) => {
                assert!(counting != Counting::Visits, "a list has no nodes");
                return by(By::List(list::Rays::new(gpu, params, tree.test, counting)?));
            }
        };
        assert!(counting != Counting::Visits || !layout.has_own_boxes(), "{layout:?} counts no visits");
        let launches = if gpu.info().ends_long_loops() { RELAUNCHES } else { 1 };
        let kernel = |wave| {
            let shader = match params.language {
                Language::Glsl if params.by_octant(layout, wave) => &shaders::TRAVERSE_BY_OCTANT,
                Language::Glsl => shaders::traverse_closest_hit(layout),
                Language::Slang => shaders::traverse_closest_hit_slang(layout)
                    .ok_or(Error::NotBuilt { reason: shaders::SLANG_MISSING.unwrap_or_default() })?,
            };
            let size = params.workgroup_size(gpu, wave);
            params.check_shared_memory(gpu, layout, size)?;
            let (constants, stack) = constants(gpu, params, tree, layout, counting, wave)?;
            let reconverge = params.technique.reconverge;
            Ok::<_, Error>((Kernel::with_reconvergence(gpu, shader, size, &constants, reconverge)?, stack))
        };
        let ((primary, stack), (secondary, _)) = (kernel(Wave::Primary)?, kernel(Wave::Secondary)?);
        by(By::Kernels(Pair { primary, secondary, stack, launches }))
    }

    /// The largest [`Tree::stack`] that the kernels were compiled for; the driver sees to its own.
    pub fn stack(&self) -> u32 {
        match &self.by {
            By::Kernels(pair) => pair.stack,
            By::Driver(_) | By::List(_) => u32::MAX,
        }
    }

    /// The kernel that traces a kind of wavefront; nothing where the driver does.
    pub fn kernel(&self, wave: Wave) -> Option<&Kernel> {
        match &self.by {
            By::Kernels(pair) => Some(pair.kernel(wave)),
            By::List(list) => Some(list.kernel(wave)),
            By::Driver(_) => None,
        }
    }

    /// Records the traversal of a queue as one span called `name`. At most `rays` rays are queued.
    pub fn record(
        &self,
        pass: &mut Pass,
        name: &str,
        wave: Wave,
        tree: &Tree,
        buffers: &Buffers,
        rays: usize,
    ) {
        let pair = match &self.by {
            By::Kernels(pair) => pair,
            By::Driver(driver) => return driver.record(pass, name, tree, buffers, rays),
            By::List(list) => return list.record(pass, name, wave, tree, buffers, rays),
        };
        let kernel = pair.kernel(wave);
        let size = kernel.workgroup_size();
        let info = self.gpu.info();
        // Persistent threads: as many subgroups as the device can hold at once. Where a subgroup has a
        // quota of iterations there must be enough of them to serve all rays.
        let resident = match (info.multiprocessors, pair.launches) {
            (_, 2..) => rays.div_ceil(8 * size as usize) as u32,
            (0, _) => (256 * 64 * info.subgroup_size).div_ceil(size),
            (n, _) => (n * info.subgroups_per_multiprocessor * info.subgroup_size).div_ceil(size),
        };
        let groups = resident.min(rays.div_ceil(size as usize) as u32).max(1);
        let arguments = Arguments {
            rays: buffers.rays,
            hits: buffers.hits,
            nodes: tree.nodes,
            triangles: tree.triangles,
            indices: tree.indices,
            queue: buffers.queue,
            counts: buffers.counts,
            visits: buffers.visits,
            utilization: buffers.utilization,
            extent: tree.extent,
            unused: 0,
        };
        if pair.launches == 1 {
            pass.dispatch(name, kernel, &arguments, groups);
        } else {
            pass.scope(name, |pass| {
                for _ in 0..pair.launches {
                    pass.dispatch("launch", kernel, &arguments, groups);
                }
            });
        }
    }

    /// Whether every ray of a wavefront at `depth` has been finished.
    ///
    /// # Errors
    /// The driver ended a loop.
    pub fn check(&self, depth: usize, queue: &Queue) -> Result<(), Error> {
        match self.by {
            By::Kernels(_) | By::List(_) => check_finished(&self.gpu, depth, queue),
            // It is launched once for each ray, and nobody counts them.
            By::Driver(_) => Ok(()),
        }
    }
}

/// The specialization constants of `closest_hit.glsl`, and for trees of which [`Tree::stack`] they will do.
pub(crate) fn constants(
    gpu: &Gpu,
    params: &Params,
    tree: &Tree,
    layout: Layout,
    counting: Counting,
    wave: Wave,
) -> Result<(Vec<u32>, u32), Error> {
    let lanes = gpu.info().subgroup_size;
    let times = if layout.is_compressed() { groups::stack_times(params.order) } else { 1 };
    let stack = params.stack.max((times * tree.stack).next_multiple_of(32));
    let postpone = ((params.postpone_below * lanes as f32).round() as u32).min(lanes);
    let quota = if gpu.info().ends_long_loops() { QUOTA } else { 0 };
    let (fetch_below, vote, subgroups) = match wave {
        Wave::Primary => (params.primary_fetch_below, params.primary_vote, params.primary_subgroups),
        Wave::Secondary => (params.secondary_fetch_below, params.secondary_vote, params.secondary_subgroups),
    };
    let fetch_below = ((fetch_below * lanes as f32).round() as u32).clamp(1, lanes);
    // Any vote above zero is one.
    let vote = if vote > 0.0 { ((vote * 32.0).round() as u32).max(1) } else { 0 };
    let Technique { barrier, hoist, .. } = params.technique;
    if barrier && (vote > 0 || layout.is_compressed()) {
        return Err(Error::BarrierByVote);
    }
    let packets = params.primary_packets > 0 && wave == Wave::Primary;
    let wide = matches!(layout, Layout::Wide4 | Layout::Wide6 | Layout::Wide8);
    let lanes_are_enough = layout.arity() as u32 <= lanes;
    if packets && !(wide && lanes_are_enough && params.language == Language::Glsl) {
        return Err(Error::NoPackets);
    }
    let (entries, limit) = (stack, gpu.info().shared_memory_bytes);
    let bytes = params.primary_subgroups.saturating_mul(8 * entries);
    if packets && bytes > limit {
        return Err(Error::PacketStacks { packets: params.primary_subgroups, entries, bytes, limit });
    }
    let packets = if packets { params.primary_subgroups } else { 0 };
    let sharing = if params.groups.share_triangles { subgroups } else { 0 };
    let primary = wave == Wave::Primary;
    let together = primary && params.end_together > 0.0;
    if (together || primary && params.octants) && params.language != Language::Glsl {
        return Err(Error::GlslOnly);
    }
    let in_phases = vote == 0 && packets == 0 && !layout.is_compressed();
    let together = together && in_phases && !barrier && (2..=lanes).contains(&subgroups);
    let end_when = ((params.end_together * subgroups as f32).round() as u32).max(1);
    // For each lane what it leaves to others, and its hit; for each subgroup, twice, how it stands.
    let bytes =
        subgroups.saturating_mul(lanes * (12 + 8 + if counting == Counting::Rays { 12 } else { 0 }) + 32);
    if together && bytes > limit {
        return Err(Error::SharedEnds { subgroups, bytes, limit });
    }
    let speculate = params.speculate || vote > 0;
    let [barrier, hoist] = [barrier, hoist].map(u32::from);
    let stride = tree.stride as u32;
    let (counting, test) = (counting as u32, tree.test as u32);
    let of_all = [stack, fetch_below, quota, counting, postpone, stride, vote, barrier, hoist, test];
    let constants = of_all
        .into_iter()
        .chain(params.groups.constants(params.order, lanes))
        .chain([packets, params.primary_packets.max(1), sharing])
        .chain(params.groups.more_constants(lanes))
        .chain([params.visits_a_vote.max(1), (params.search_above * lanes as f32).round() as u32])
        .chain(if together { [params.end_steps.max(1), subgroups, end_when] } else { [0, 1, 1] })
        .chain([u32::from(speculate)])
        .collect();
    Ok((constants, stack / times))
}

/// Whether every ray of a wavefront at `depth` has been finished.
pub(crate) fn check_finished(gpu: &Gpu, depth: usize, queue: &Queue) -> Result<(), Error> {
    if queue.finished == queue.count {
        return Ok(());
    }
    Err(Error::LoopLimit {
        depth,
        unfinished: queue.count.abs_diff(queue.finished),
        rays: queue.count,
        device: gpu.info().name.clone(),
    })
}
