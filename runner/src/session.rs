//! What every command that traces needs: an open device, a loaded scene, a built tree.

use crate::{
    args::{self, Global},
    describe,
    params::Params,
    progress::remark,
    table::thousands,
    variant::Variant,
};
use anyhow::{Context, anyhow, bail};
use std::{
    cell::RefCell,
    fs,
    path::Path,
    rc::Rc,
    sync::{
        Arc, OnceLock,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};
use tracer::{
    builder::{
        BuildError, BuildParams, BuildReport, BuildWorkspace, Builder, Method, Summary, WideWorkspace, Widen,
    },
    bvh2::Bvh2,
    contract::{VisitCounter, Visits},
    driver,
    gpu::{Buffer, Gpu, Options, Pass, Selector},
    layout::Layout,
    list,
    measure::tree::stats,
    midpoint,
    path::{Camera, DeviceScene, PathTracer},
    sbvh::{
        SbvhParams,
        cache::{self, Built},
    },
    scene::{self, Scene, SearchPath},
    traverse::{Buffers, Counting, Hit, Queue, Ray, Structure, Traversal, Tree, Wave},
    treefile::{self, Recipe},
    with_layout,
};
use winit::raw_window_handle::HasDisplayHandle;

/// An open device and where scenes are found.
pub struct Session {
    pub gpu: Gpu,
    pub quiet: bool,
    search: SearchPath,
}

/// A scene in host and device memory.
pub struct Loaded {
    pub scene: Scene,
    pub device: DeviceScene,
    /// What the user called it.
    spec: String,
    /// The binary tree that a file gave, which all builds start from.
    given: Option<Given>,
    /// The binary tree that the CPU last made of it, and what it took.
    built: RefCell<Option<Rc<BuiltOnCpu>>>,
    /// The rays of views that were collected last; the one used last comes last.
    wavefronts: RefCell<Vec<(Seen, Rc<Bounces>)>>,
}

/// The rays of each bounce of a view.
pub struct Bounces {
    /// Bounce by bounce, the primary rays first; none is empty.
    pub waves: Vec<TraceMemory>,
    /// Room for a copy of the queue of each, so that all are read at once.
    pub queues: Buffer,
}

/// What the rays of a view depend on: its name, the picture's size, and what a path is.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// The view's name.
    pub view: String,
    /// Width and height.
    pub size: (u32, u32),
    /// Depth and seed among them.
    pub path: tracer::path::Params,
}

/// A binary tree that was built on the CPU.
pub struct BuiltOnCpu {
    recipe: Recipe,
    /// The tree.
    pub tree: Bvh2,
    /// What building it took, in milliseconds.
    pub milliseconds: f64,
}

/// A binary tree from a file.
pub struct Given {
    tree: Bvh2,
    /// What it is made by.
    pub recipe: Recipe,
    /// The file, in the record's words.
    pub adopted: record::Adopted,
}

impl Loaded {
    /// The rays of each bounce that are seen so, or what collects them where they are not there. All variants are
    /// measured with the same ones, those that the first of them met. Kept are as many as an eighth of the device's
    /// memory holds.
    ///
    /// # Errors
    /// Collecting failed.
    pub fn wavefronts(
        &self,
        gpu: &Gpu,
        seen: &Seen,
        collect: impl FnOnce() -> anyhow::Result<Vec<TraceMemory>>,
    ) -> anyhow::Result<Rc<Bounces>> {
        let place = self.wavefronts.borrow().iter().position(|(its, _)| its == seen);
        let found = match place {
            Some(place) => self.wavefronts.borrow_mut().remove(place),
            None => {
                let waves = collect()?;
                let queues = gpu.buffer("queues", (size_of::<Queue>() * waves.len()) as u64)?;
                (seen.clone(), Rc::new(Bounces { waves, queues }))
            }
        };
        let waves = found.1.clone();
        self.wavefronts.borrow_mut().push(found);
        while self.wavefronts.borrow().len() > 1 && self.wavefront_bytes() > gpu.info().memory_bytes / 8 {
            self.wavefronts.borrow_mut().remove(0);
        }
        Ok(waves)
    }

    /// Bytes of device memory that the rays take which are kept.
    pub fn wavefront_bytes(&self) -> u64 {
        self.wavefronts.borrow().iter().flat_map(|(_, bounces)| &bounces.waves).map(TraceMemory::bytes).sum()
    }

    /// The binary tree of a recipe: the last one, or from disk, or built now.
    ///
    /// # Panics
    /// It is for the device.
    pub fn built_on_cpu(&self, recipe: &Recipe, quiet: bool) -> Rc<BuiltOnCpu> {
        if let Some(built) = self.built.borrow().as_ref().filter(|built| built.recipe == *recipe) {
            return built.clone();
        }
        let (tree, seconds) = match recipe {
            Recipe::Sbvh { sbvh } => self.split(sbvh, quiet),
            Recipe::Midpoint => {
                let started = Instant::now();
                let tree = midpoint::build(&self.scene.positions);
                (tree, started.elapsed().as_secs_f64())
            }
            Recipe::Ploc { .. } | Recipe::Hploc { .. } => panic!("the device clusters"),
        };
        let built = Rc::new(BuiltOnCpu { recipe: recipe.clone(), tree, milliseconds: 1e3 * seconds });
        *self.built.borrow_mut() = Some(built.clone());
        built
    }

    /// The binary tree with spatial splits, from disk or built now, and the seconds that building it took.
    fn split(&self, params: &SbvhParams, quiet: bool) -> (Bvh2, f64) {
        let folder = cache::default_folder();
        let (tree, built) = cache::load_or_build(&self.scene.positions, params, folder.as_deref());
        for note in &built.notes {
            remark(quiet, format_args!("{}: {note}", self.scene.name));
        }
        let Built { cached, seconds, .. } = built;
        let (leaves, triangles) = (tree.leaves as u64, self.scene.positions.len() as u64);
        let when = if cached { "kept from before, when it took" } else { "built in" };
        remark(
            quiet,
            format_args!(
                "{}: a tree of {} references to {} triangles, {when} {seconds:.2} s",
                self.scene.name,
                thousands(leaves),
                thousands(triangles)
            ),
        );
        (tree, seconds)
    }

    /// Lets all builds start from the binary tree in a file.
    ///
    /// # Errors
    /// The file cannot be read, is none of a binary tree, is damaged, or is of another scene.
    pub fn give(&mut self, path: &Path, quiet: bool) -> anyhow::Result<&Given> {
        let started = Instant::now();
        let triangles = &self.scene.positions;
        let way_out = || {
            format!(
                "make one that fits: runner bvh precompute {} -o {}",
                shell_word(&self.spec),
                shell_word(&path.to_string_lossy())
            )
        };
        let bytes = fs::read(path)
            .map_err(|error| anyhow!("cannot read {}: {error}; {}", path.display(), way_out()))?;
        let (tree, made) = treefile::decode(&bytes, &treefile::content(triangles), triangles.len())
            .map_err(|fault| anyhow!("{} {fault}; {}", path.display(), way_out()))?;
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let sha256 = scene::sha256(&bytes);
        let read = 1e3 * started.elapsed().as_secs_f64();
        remark(
            quiet,
            format_args!(
                "{}: a binary tree of {} leaves from {}, built by {}",
                self.scene.name,
                thousands(tree.leaves as u64),
                path.display(),
                made.recipe.method()
            ),
        );
        let adopted = describe::adopted(name, sha256, &made, read);
        Ok(self.given.insert(Given { tree, recipe: made.recipe, adopted }))
    }

    /// The binary tree that a file gave, if one did.
    pub fn given(&self) -> Option<&Given> {
        self.given.as_ref()
    }

    /// Compiles a build, of all stages or of those after the binary tree where that is given.
    fn builder(&self, gpu: &Gpu, params: &BuildParams, layout: Layout) -> Result<Builder, BuildError> {
        match self.given {
            Some(_) => Builder::adopting(gpu, params, layout),
            None => Builder::new(gpu, params, layout),
        }
    }

    /// Memory for builds of the scene, with the binary tree in it where that comes from a file or the CPU.
    ///
    /// # Errors
    /// Too little memory.
    pub fn workspace(
        &self,
        session: &Session,
        params: &Params,
        builder: &Builder,
    ) -> anyhow::Result<BuildWorkspace> {
        if let Some(Given { tree, .. }) = &self.given {
            let workspace = builder.workspace(tree.leaves)?;
            workspace.adopt(&session.gpu, tree, self.device.triangles, None)?;
            return Ok(workspace);
        }
        match params.build.method {
            Method::Ploc | Method::Hploc => Ok(builder.workspace(self.device.triangles)?),
            method @ (Method::Sbvh | Method::Midpoint) => {
                let built = self.built_on_cpu(&params.recipe(), session.quiet);
                let workspace = builder.workspace(built.tree.leaves)?;
                let (tree, made) = (&built.tree, Some((method, built.milliseconds)));
                workspace.adopt(&session.gpu, tree, self.device.triangles, made)?;
                Ok(workspace)
            }
        }
    }

    /// The views that a list names, or all.
    ///
    /// # Errors
    /// It names one that is not there, or none.
    pub fn views(&self, list: Option<&str>) -> anyhow::Result<Vec<usize>> {
        let names: Vec<String> = self.scene.views.iter().map(|view| view.name.clone()).collect();
        match list {
            Some(list) => args::pick(&names, list).map_err(anyhow::Error::msg),
            None => Ok((0..names.len()).collect()),
        }
    }
}

/// A tree that can be traversed.
pub struct Planted {
    pub tree: Tree,
    /// What is known of it.
    pub statistics: record::Tree,
    _memory: Memory,
}

/// Where a tree lies.
#[expect(dead_code, reason = "it is held for as long as rays are traced through it")]
enum Memory {
    Ours(Box<WideWorkspace>),
    Driver(driver::Structure),
    List(list::List),
}

/// A binary tree to which variants that go by view return for every view: what sample rays are traced
/// through, and what the tree of a view is made of.
pub struct Seedling {
    variant: Variant,
    layout: Layout,
    params: Params,
    workspace: BuildWorkspace,
    tree: Tree,
    sampler: Traversal,
    visits: VisitCounter,
    widen: Widen,
    wide: WideWorkspace,
    /// Of the binary tree.
    pub statistics: record::Tree,
}

/// The tree of one view.
pub struct Grown {
    pub tree: Tree,
    pub summary: Summary,
    /// From clearing the visit counts to having them, in milliseconds.
    pub sampling_milliseconds: f64,
    /// Contraction and layout.
    pub build: BuildReport,
}

/// What a first build leaves.
pub enum Plant {
    /// One tree for all views.
    Planted(Box<Planted>),
    /// A tree for each view is still to be made.
    Seedling(Box<Seedling>),
}

impl Plant {
    /// Of the tree that the first build made.
    pub fn statistics(&self) -> &record::Tree {
        match self {
            Self::Planted(planted) => &planted.statistics,
            Self::Seedling(seedling) => &seedling.statistics,
        }
    }
}

impl Seedling {
    /// Traces sample rays from a view and makes its tree. What [`Seedling::grow`] made before is lost.
    ///
    /// # Errors
    /// The device failed.
    pub fn grow(&self, loaded: &Loaded, tracer: &PathTracer<'_>, camera: &Camera) -> anyhow::Result<Grown> {
        let sampling = &self.params.cbtc;
        let (sampler, workspace) = (&self.sampler, &self.workspace);
        let milliseconds =
            tracer.sample_visits(sampler, &self.tree, camera, sampling, workspace, &self.visits)?;
        self.widen(loaded, milliseconds)
    }

    /// The same with every s-th of `rays` for sample rays.
    ///
    /// # Errors
    /// The device failed.
    pub fn grow_from(&self, gpu: &Gpu, loaded: &Loaded, rays: &[Ray]) -> anyhow::Result<Grown> {
        let sample: Vec<Ray> = rays.iter().step_by(self.params.cbtc.subsampling as usize).copied().collect();
        let memory = TraceMemory::new(gpu, &sample)?;
        let mut pass = Pass::new(gpu)?;
        pass.scope("sampling", |pass| {
            self.visits.clear(pass);
            let buffers = Buffers { visits: self.visits.by_node.address(), ..memory.buffers() };
            self.sampler.record(pass, "trace", Wave::Secondary, &self.tree, &buffers, sample.len());
            self.workspace.record_visits(pass, &self.visits);
        });
        let milliseconds = pass.submit()?.milliseconds("sampling");
        self.sampler.check(0, &memory.queue()?)?;
        self.widen(loaded, milliseconds)
    }

    fn widen(&self, loaded: &Loaded, sampling_milliseconds: f64) -> anyhow::Result<Grown> {
        let Loaded { device, scene, .. } = loaded;
        let visits = Visits { counts: &self.visits.by_inner, threshold: self.params.cbtc.threshold };
        let build = self
            .widen
            .build(&self.workspace, &self.wide, &device.positions, device.triangles, Some(visits))
            .with_context(|| format!("building {} for {}", self.variant, scene.name))?;
        let summary = build.summary;
        Ok(Grown { tree: self.wide.tree(&summary, device.extent), summary, sampling_milliseconds, build })
    }

    /// Statistics of the tree that was grown last.
    ///
    /// # Errors
    /// A transfer failed.
    pub fn measure(&self, grown: &Grown) -> anyhow::Result<record::Tree> {
        measure(self.layout, &self.wide, &grown.summary, &self.params)
    }
}

/// Builds `repetitions` times, each seen by `each`, after builds that nobody sees: one, and more until `warm_up` has
/// passed. What the last one came to.
fn again_and_again<R>(
    warm_up: Option<Duration>,
    repetitions: u32,
    build: impl Fn() -> anyhow::Result<R>,
    mut each: impl FnMut(&R),
) -> anyhow::Result<R> {
    if let Some(time) = warm_up {
        let started = Instant::now();
        build()?;
        while started.elapsed() < time {
            build()?;
        }
    }
    let mut last = None;
    for _ in 0..repetitions {
        let built = build()?;
        each(&built);
        last = Some(built);
    }
    Ok(last.expect("at least one repetition"))
}

fn measure(
    layout: Layout,
    memory: &WideWorkspace,
    summary: &Summary,
    params: &Params,
) -> anyhow::Result<record::Tree> {
    with_layout!(layout, L => {
        let nodes = memory.read_nodes::<L>(summary.nodes as usize)?;
        let stats = stats::<L>(&nodes, layout.stride(&params.layout), &params.collapse);
        Ok(describe::tree(&stats.stored_for(params.triangle.test)))
    })
}

/// Rays, hits and their queue in device memory, for a launch over rays from elsewhere.
pub struct TraceMemory {
    rays: Buffer,
    hits: Buffer,
    queue: Buffer,
    /// The queue in which all rays wait.
    full: Buffer,
    count: usize,
}

impl TraceMemory {
    /// Copies rays to the device.
    ///
    /// # Errors
    /// Too little memory.
    pub fn new(gpu: &Gpu, rays: &[Ray]) -> anyhow::Result<Self> {
        let full = [Queue { count: rays.len() as u32, ..Queue::default() }];
        Ok(Self {
            rays: gpu.upload("rays", rays)?,
            hits: gpu.buffer("hits", (size_of::<Hit>() * rays.len()) as u64)?,
            queue: gpu.upload("queue", &full)?,
            full: gpu.upload("full queue", &full)?,
            count: rays.len(),
        })
    }

    /// Records one launch over all rays, as a span called `name`.
    pub fn record(&self, pass: &mut Pass, name: &str, traversal: &Traversal, tree: &Tree, wave: Wave) {
        pass.copy(&self.full, 0, &self.queue, 0, size_of::<Queue>() as u64);
        traversal.record(pass, name, wave, tree, &self.buffers(), self.count);
    }

    /// Records a copy of the queue to item `at` of a buffer of queues.
    pub fn record_queue(&self, pass: &mut Pass, queues: &Buffer, at: usize) {
        let bytes = size_of::<Queue>() as u64;
        pass.copy(&self.queue, 0, queues, at as u64 * bytes, bytes);
    }

    /// Traces them all so many times in one submission, so that the device does not idle in between; milliseconds of each
    /// launch, of the traversal kernel alone.
    ///
    /// # Errors
    /// The device was lost, or its driver ended a loop.
    pub fn launch(
        &self,
        gpu: &Gpu,
        traversal: &Traversal,
        tree: &Tree,
        wave: Wave,
        launches: u32,
    ) -> anyhow::Result<Vec<f64>> {
        let mut pass = Pass::new(gpu)?;
        for launch in 0..launches {
            self.record(&mut pass, &launch.to_string(), traversal, tree, wave);
        }
        let timings = pass.submit()?;
        traversal.check(0, &self.queue()?)?;
        Ok((0..launches).map(|launch| timings.milliseconds(&launch.to_string())).collect())
    }

    /// How many rays there are.
    pub fn count(&self) -> usize {
        self.count
    }

    fn bytes(&self) -> u64 {
        ((size_of::<Ray>() + size_of::<Hit>()) * self.count) as u64
    }

    /// For a launch that counts nothing.
    pub fn buffers(&self) -> Buffers {
        let (rays, hits) = (self.rays.address(), self.hits.address());
        Buffers { rays, hits, queue: self.queue.address(), counts: 0, visits: 0, utilization: 0 }
    }

    /// How far the rays have come.
    ///
    /// # Errors
    /// A transfer failed.
    pub fn queue(&self) -> anyhow::Result<Queue> {
        Ok(self.queue.read(0, 1)?[0])
    }

    /// What they hit.
    ///
    /// # Errors
    /// A transfer failed.
    pub fn hits(&self) -> anyhow::Result<Vec<Hit>> {
        Ok(self.hits.read(0, self.count)?)
    }
}

/// The device that the command line asks for.
pub fn selector(global: &Global) -> Selector {
    match global.device.as_deref().unwrap_or_default() {
        "" => Selector::Best,
        device => device.parse().expect("every text selects something"),
    }
}

/// Variants that a device has, and those that were asked for in vain.
pub struct Available {
    /// At least one.
    pub there: Vec<Variant>,
    /// Those that somebody misses.
    pub missed: Vec<record::LeftOut>,
}

impl Available {
    /// Fails where somebody misses something, once everything else is done.
    ///
    /// # Errors
    /// Somebody does.
    pub fn finish(&self, gpu: &Gpu) -> anyhow::Result<()> {
        if self.missed.is_empty() { Ok(()) } else { Ok(driver::check(gpu.info())?) }
    }
}

impl Session {
    /// Opens the device that the command line asks for.
    ///
    /// # Errors
    /// No such device, or it cannot run our kernels.
    pub fn open(global: &Global) -> anyhow::Result<Self> {
        let gpu = Gpu::open(&Options { device: selector(global), validate: global.validate })?;
        Ok(Self::with(gpu, global))
    }

    /// The same, of a device that can show pictures in windows of a display.
    ///
    /// # Errors
    /// As of [`Session::open`], or the device cannot.
    pub fn open_for_display(global: &Global, display: impl HasDisplayHandle) -> anyhow::Result<Self> {
        let options = Options { device: selector(global), validate: global.validate };
        Ok(Self::with(Gpu::open_for_display(&options, display)?, global))
    }

    fn with(gpu: Gpu, global: &Global) -> Self {
        remark(global.quiet, format_args!("device {}", gpu.info()));
        Self { gpu, quiet: global.quiet, search: SearchPath::new(global.scene_dir.iter().cloned()) }
    }

    /// Where scenes are found.
    pub fn search(&self) -> &SearchPath {
        &self.search
    }

    /// Those of `variants` that the device has, and the others that `patterns` ask for by name, with why it has not.
    /// Those that are among many are left out with a remark.
    ///
    /// # Errors
    /// None is there.
    pub fn available(&self, variants: Vec<Variant>, patterns: &[String]) -> anyhow::Result<Available> {
        let mut available = Available { there: Vec::new(), missed: Vec::new() };
        let mut first = None;
        for variant in variants {
            match variant.unavailable(self.gpu.info()) {
                None => available.there.push(variant),
                Some(why) if variant.is_asked_for(patterns) => {
                    available
                        .missed
                        .push(record::LeftOut { variant: variant.to_string(), reason: why.to_string() });
                    first.get_or_insert(why);
                }
                Some(why) => {
                    remark(self.quiet, format_args!("left out: {why}"));
                    first.get_or_insert(why);
                }
            }
        }
        match first {
            Some(why) if available.there.is_empty() => Err(why.into()),
            _ => Ok(available),
        }
    }

    /// Loads a scene and copies it to the device.
    ///
    /// # Errors
    /// The scene cannot be found or read, or the device cannot hold it.
    pub fn load(&self, spec: &str) -> anyhow::Result<Loaded> {
        let scene = scene::load(spec, &self.search).with_context(|| format!("scene {spec}"))?;
        let report = &scene.report;
        for note in &report.notes {
            remark(self.quiet, format_args!("{}: {note}", scene.name));
        }
        if !report.is_clean() {
            remark(
                self.quiet,
                format_args!(
                    "{}: skipped {} triangles with NaN or infinite corners, {} with indices out of range, {} \
                     primitives that are no triangles",
                    scene.name, report.non_finite, report.out_of_range, report.skipped_primitives
                ),
            );
        }
        let device =
            DeviceScene::upload(&self.gpu, &scene).with_context(|| format!("scene {}", scene.name))?;
        Ok(Loaded {
            scene,
            device,
            spec: spec.to_owned(),
            given: None,
            built: RefCell::default(),
            wavefronts: RefCell::default(),
        })
    }

    /// Makes a variant's first build `repetitions` times in the same memory and keeps the last; `each` sees
    /// every build. Before them come builds that it does not see: one, and more until `warm_up` has passed.
    /// For a variant that goes by view the first build is that of the binary tree.
    ///
    /// # Errors
    /// Too little memory, or a parameter out of range.
    pub fn plant(
        &self,
        loaded: &Loaded,
        variant: Variant,
        params: &Params,
        warm_up: Option<Duration>,
        repetitions: u32,
        mut each: impl FnMut(record::Repetition),
    ) -> anyhow::Result<Plant> {
        let context = || format!("building {variant} for {}", loaded.scene.name);
        let Loaded { device: DeviceScene { positions, triangles: count, extent, .. }, .. } = loaded;
        let (count, extent) = (*count, *extent);
        let layout = match variant.structure {
            Structure::Nodes(layout) => layout,
            Structure::Driver => {
                let builder = driver::Builder::new(&self.gpu, &params.driver, positions, count)?;
                let build = || builder.build(positions).with_context(context);
                let took =
                    again_and_again(warm_up, repetitions, build, |took| each(describe::by_driver(took)))?;
                debug_assert!(took.total > 0.0);
                let structure = builder.finish();
                let (tree, statistics) = (structure.tree(extent), describe::driver_tree(&structure));
                let planted = Planted { tree, statistics, _memory: Memory::Driver(structure) };
                return Ok(Plant::Planted(Box::new(planted)));
            }
            Structure::List(listing) => {
                let builder = list::Builder::new(&self.gpu, listing, params.triangle.test, count)
                    .with_context(context)?;
                let build = || builder.build(positions).with_context(context);
                again_and_again(warm_up, repetitions, build, |&took| each(describe::listing(took)))?;
                let list = builder.finish();
                let (tree, statistics) = (list.tree(extent), describe::list(&list));
                let planted = Planted { tree, statistics, _memory: Memory::List(list) };
                return Ok(Plant::Planted(Box::new(planted)));
            }
        };
        let layout_of_first = if variant.by_view { Layout::Binary } else { layout };
        let structure = Structure::Nodes(layout_of_first);
        let first = Variant { structure, by_view: false, ..variant };
        let builder =
            loaded.builder(&self.gpu, &params.build(first), layout_of_first).with_context(context)?;
        let workspace = loaded.workspace(self, params, &builder).with_context(context)?;
        let build = || builder.build(&workspace, positions, count, false).with_context(context);
        let report =
            again_and_again(warm_up, repetitions, build, |report| each(describe::repetition(report)))?;
        let summary = report.summary;
        let statistics = measure(layout_of_first, &workspace.wide, &summary, params)?;
        let tree = workspace.wide.tree(&summary, extent);
        if !variant.by_view {
            // The rest of the workspace, several times the tree, is freed here.
            let planted = Planted { tree, statistics, _memory: Memory::Ours(Box::new(workspace.wide)) };
            return Ok(Plant::Planted(Box::new(planted)));
        }
        let widen = Widen::new(&self.gpu, &params.build(variant), layout).with_context(context)?;
        Ok(Plant::Seedling(Box::new(Seedling {
            variant,
            layout,
            params: params.clone(),
            sampler: self.traversal(&tree, variant, &params.of_binary(), Counting::Visits)?,
            visits: VisitCounter::new(&self.gpu, workspace.leaves()).with_context(context)?,
            wide: widen.workspace(workspace.leaves()).with_context(context)?,
            widen,
            workspace,
            tree,
            statistics,
        })))
    }

    /// The traversal kernels of a variant for a tree, whichever layout that has.
    ///
    /// # Errors
    /// A workgroup size the device cannot run, or a technique it cannot.
    pub fn traversal(
        &self,
        tree: &Tree,
        variant: Variant,
        params: &Params,
        counting: Counting,
    ) -> anyhow::Result<Traversal> {
        Ok(Traversal::new(&self.gpu, &params.trace(variant), tree, counting)?)
    }

    /// Fails when the validation layer has complained.
    ///
    /// # Errors
    /// It has.
    pub fn finish(&self) -> anyhow::Result<()> {
        match self.gpu.validation_messages().len() {
            0 => Ok(()),
            n => bail!("the validation layer gave {n} messages"),
        }
    }
}

/// A word as it can be typed into a shell.
fn shell_word(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-:=,+@".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// After this, the first Ctrl-C makes [`interrupted`] true and the second one ends the program at once. SIGTERM,
/// with which schedulers announce that time is up, does the same. `unit` is what is brought to its end before.
///
/// # Errors
/// The handler cannot be installed.
pub fn watch_for_interrupts(unit: &'static str) -> anyhow::Result<()> {
    // A wrapper such as stabilize passes on what the whole process group has had already, so what follows at once is
    // the same request.
    const SAME: Duration = Duration::from_millis(100);
    let first = Arc::new(OnceLock::new());
    let stop = move || {
        let since = first.get_or_init(Instant::now).elapsed();
        if INTERRUPTED.swap(true, Ordering::SeqCst) {
            if since > SAME {
                std::process::exit(130);
            }
            return;
        }
        eprintln!("\nfinishing the running {unit}; press Ctrl-C again to stop at once");
    };
    // SIGHUP is left alone: under nohup a sweep goes on when its terminal closes.
    #[cfg(unix)]
    {
        let mut signals = signal_hook::iterator::Signals::new([signal_hook::consts::SIGTERM])
            .context("cannot watch for SIGTERM")?;
        let stop = stop.clone();
        std::thread::spawn(move || signals.forever().for_each(|_| stop()));
    }
    ctrlc::set_handler(stop).context("cannot watch for Ctrl-C")
}

/// Whether the user wants to stop.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}
