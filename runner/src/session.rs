//! What every command that traces needs: an open device, a loaded scene, a built tree.

use crate::{args::Global, params::Params, progress::remark, variant::Variant};
use anyhow::{Context, bail};
use std::{
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};
use tracer::{
    builder::{BuildReport, Builder},
    gpu::{Buffer, Gpu, Options},
    layout::binary::{Binary, BinaryNode},
    measure::tree::{TreeStats, stats},
    path::DeviceScene,
    scene::{self, Scene, SearchPath},
    traverse::{Traversal, Tree},
};

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
}

/// A tree that can be traversed.
pub struct Planted {
    pub tree: Tree,
    pub statistics: TreeStats,
    _nodes: Buffer,
    _triangles: Buffer,
}

impl Session {
    /// Opens the device that the command line asks for.
    ///
    /// # Errors
    /// No such device, or it cannot run our kernels.
    pub fn open(global: &Global) -> anyhow::Result<Self> {
        let device = global.device.as_deref().unwrap_or_default();
        let device = if device.is_empty() {
            tracer::gpu::Selector::Best
        } else {
            device.parse().expect("every text selects something")
        };
        let gpu = Gpu::open(&Options { device, validate: global.validate })?;
        remark(global.quiet, format_args!("device {}", gpu.info()));
        Ok(Self { gpu, quiet: global.quiet, search: SearchPath::new(global.scene_dir.iter().cloned()) })
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
        Ok(Loaded { scene, device })
    }

    /// Builds a tree `repetitions` times in the same memory and keeps the last; `each` sees every build.
    /// Before them come builds that it does not see: one, and more until `warm_up` has passed.
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
        mut each: impl FnMut(&BuildReport),
    ) -> anyhow::Result<Planted> {
        let Variant::Binary = variant;
        let context = || format!("building {variant} for {}", loaded.scene.name);
        let count = loaded.device.triangles;
        let builder = Builder::new(&self.gpu, &params.build()).with_context(context)?;
        let workspace = builder.workspace(count).with_context(context)?;
        let build =
            || builder.build(&workspace, &loaded.device.positions, count, false).with_context(context);
        if let Some(time) = warm_up {
            let started = Instant::now();
            build()?;
            while started.elapsed() < time {
                build()?;
            }
        }
        let mut summary = None;
        for _ in 0..repetitions {
            let report = build()?;
            each(&report);
            summary = Some(report.summary);
        }
        let summary = summary.expect("at least one repetition");
        // The rest of the workspace, several times the tree, is freed here.
        let (nodes, triangles) = (workspace.nodes, workspace.triangles);
        let tree = Tree {
            nodes: nodes.address(),
            triangles: triangles.address(),
            depth: summary.depth,
            extent: loaded.device.extent,
        };
        let read: Vec<BinaryNode> = nodes.read(0, summary.nodes as usize)?;
        let statistics = stats::<Binary>(&read, &params.collapse);
        Ok(Planted { tree, statistics, _nodes: nodes, _triangles: triangles })
    }

    /// The traversal kernels for a tree.
    ///
    /// # Errors
    /// A workgroup size the device cannot run.
    pub fn traversal(&self, planted: &Planted, params: &Params, counting: bool) -> anyhow::Result<Traversal> {
        Ok(Traversal::new(&self.gpu, &params.trace, planted.tree.depth, counting)?)
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

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// After this, the first Ctrl-C makes [`interrupted`] true and the second one ends the program at once.
///
/// # Errors
/// The handler cannot be installed.
pub fn watch_for_interrupts() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
        eprintln!("\nfinishing the running sample; press Ctrl-C again to stop at once");
    })
    .context("cannot watch for Ctrl-C")
}

/// Whether the user wants to stop.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}
