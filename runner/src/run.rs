//! `runner run`: measures scenes and writes the record as it goes.

use crate::{
    args::{self, Global, Size},
    commands::print,
    host,
    params::Params,
    progress::{bar, remark},
    resources,
    session::{Loaded, Plant, Seedling, Session, interrupted, watch_for_interrupts},
    table,
    telemetry::Telemetry,
    variant::Variant,
};
use anyhow::Context;
use indicatif::ProgressBar;
use record::{Adaptation, Build, Count, Counters, Launch, Phase, Point, Record, Repetition, Source};
use std::{
    collections::BTreeMap,
    path::Path,
    time::{Duration, Instant},
};
use tracer::{
    builder::BuildReport,
    gpu::{DeviceInfo, DeviceKind, shaders},
    measure::tree::TreeStats,
    path::{self, Camera, PathTracer, SingleKernel},
    scene::{Origin, Scene, View},
    traverse::{self, Counting, Traversal, Tree},
};

/// Measures what the command line asks for.
///
/// # Errors
/// Anything that keeps a scene from being measured; what was measured before is in the record.
pub fn run(global: &Global, run: &args::Run) -> anyhow::Result<()> {
    let variants = Variant::select(&run.variant)?;
    let params: Vec<Params> =
        variants.iter().map(|&v| Params::with(v, &run.tuning.set)).collect::<anyhow::Result<_>>()?;
    watch_for_interrupts()?;
    let session = Session::open(global)?;
    let cpu = session.gpu.info().kind == DeviceKind::Cpu;
    let size = run.size.unwrap_or(if cpu {
        Size { width: 320, height: 180 }
    } else {
        Size { width: 1920, height: 1080 }
    });
    let plan = Plan {
        size,
        samples: run.samples.unwrap_or(if cpu { 3 } else { 15 }),
        warm_up: run.warm_up,
        warm_up_time: if cpu { Duration::ZERO } else { WARM_UP_TIME },
        warm_up_view_time: if cpu { Duration::ZERO } else { WARM_UP_VIEW_TIME },
        builds: run.builds.unwrap_or(if cpu { 3 } else { 10 }),
        path: path::Params { depth: run.depth, seed: run.seed },
    };
    let info = session.gpu.info();
    let telemetry = Telemetry::open(info.vendor_id, uuid_bytes(&info.uuid), info.pci.as_deref());

    let mut record = Record::new(
        host::tool(),
        host::gather(run.host_name),
        device(info),
        record::Run {
            width: size.width,
            height: size.height,
            samples: plan.samples,
            warm_up: plan.warm_up,
            depth: run.depth,
            seed: run.seed.into(),
        },
    );
    record.shaders = shaders::ALL.iter().map(|s| (s.name.to_owned(), s.sha256())).collect();
    record.parameters = flattened(&params[0])?;

    let bar = bar(0, session.quiet);
    let mut writer = Writer { record, output: run.output.as_deref() };
    writer.write()?;
    let mut points_left = (run.scenes.len() * variants.len()) as u64;
    for spec in &run.scenes {
        bar.set_message(format!("{spec}: loading"));
        let loaded = session.load(spec)?;
        let views = match &run.views {
            Some(list) => {
                let names: Vec<String> = loaded.scene.views.iter().map(|v| v.name.clone()).collect();
                args::pick(&names, list).map_err(anyhow::Error::msg)?
            }
            None => (0..loaded.scene.views.len()).collect(),
        };
        for (&variant, params) in variants.iter().zip(&params) {
            // The time left is an estimate: the scenes to come are taken to have as many views as this one.
            let steps = views.len() as u64 * u64::from(plan.warm_up + plan.samples + 1);
            bar.set_length(bar.position() + points_left * steps);
            points_left -= 1;
            let mut measuring = Measuring {
                session: &session,
                telemetry: &telemetry,
                loaded: &loaded,
                variant,
                params,
                plan: &plan,
                bar: &bar,
            };
            measuring.measure(&views, &mut writer)?;
            if interrupted() {
                break;
            }
        }
        if interrupted() {
            break;
        }
    }
    bar.finish_and_clear();
    if !interrupted() {
        writer.record.finished = Some(record::Timestamp::now());
        writer.write()?;
    }
    print(&table::summary(&writer.record))?;
    if let Some(output) = &run.output {
        remark(session.quiet, format_args!("record: {}", output.display()));
    }
    session.finish()?;
    if interrupted() {
        std::process::exit(130);
    }
    Ok(())
}

struct Plan {
    size: Size,
    samples: u32,
    warm_up: u32,
    /// Least time spent on warming up before builds, where warming up is wanted.
    warm_up_time: Duration,
    /// The same before each view.
    warm_up_view_time: Duration,
    builds: u32,
    path: path::Params,
}

/// All parameters by their dotted names.
fn flattened(params: &Params) -> anyhow::Result<record::Parameters> {
    let mut flat = record::Parameters::default();
    for (stage, value) in serde_json::to_value(params)?.as_object().into_iter().flatten() {
        flat.add(stage, value)?;
    }
    Ok(flat)
}

/// A GPU lowers its clocks within a second of idling, while the host loads a scene or reads counters back,
/// and takes a while to raise them again.
const WARM_UP_TIME: Duration = Duration::from_millis(400);

/// Before a view, when it has been busy within the last second.
const WARM_UP_VIEW_TIME: Duration = Duration::from_millis(150);

/// The record and the file that follows it.
struct Writer<'a> {
    record: Record,
    output: Option<&'a Path>,
}

impl Writer<'_> {
    fn write(&self) -> anyhow::Result<()> {
        match self.output {
            Some(path) => self.record.write_atomic(path).context("the record cannot be written"),
            None => Ok(()),
        }
    }
}

/// One scene with one variant.
struct Measuring<'a> {
    session: &'a Session,
    telemetry: &'a Telemetry,
    loaded: &'a Loaded,
    variant: Variant,
    params: &'a Params,
    plan: &'a Plan,
    bar: &'a ProgressBar,
}

/// The traversal kernels of a variant: those that are timed, and those that count.
struct Kernels {
    timed: Timed,
    counting: Traversal,
}

/// How paths are traced while they are timed.
enum Timed {
    Separate(Traversal),
    Single(SingleKernel),
}

impl Kernels {
    fn new(session: &Session, tree: &Tree, params: &Params) -> anyhow::Result<Self> {
        let timed = match params.trace.kernels {
            traverse::Kernels::Separate => {
                Timed::Separate(session.traversal(tree, params, Counting::Nothing)?)
            }
            traverse::Kernels::Single => Timed::Single(SingleKernel::new(&session.gpu, &params.trace, tree)?),
        };
        Ok(Self { timed, counting: session.traversal(tree, params, Counting::Rays)? })
    }

    /// Entries of the traversal stack they were compiled with.
    fn stack(&self) -> u32 {
        self.counting.stack()
    }

    fn recorded(&self) -> Vec<record::Kernel> {
        match &self.timed {
            Timed::Separate(traversal) => resources::recorded(traversal),
            Timed::Single(single) => vec![resources::recorded_as(single.kernel(), "all")],
        }
    }

    fn sample(
        &self,
        tracer: &PathTracer<'_>,
        tree: &Tree,
        camera: &Camera,
        sample: u32,
    ) -> Result<path::Sample, tracer::Error> {
        match &self.timed {
            Timed::Separate(traversal) => tracer.sample(traversal, tree, camera, sample),
            Timed::Single(single) => tracer.sample_in_one(single, tree, camera, sample),
        }
    }
}

impl Measuring<'_> {
    fn measure(&mut self, views: &[usize], writer: &mut Writer<'_>) -> anyhow::Result<()> {
        let plan = self.plan;
        let scene = &self.loaded.scene;
        self.bar.set_message(format!("{}, {}: building", scene.name, self.variant));
        let mut repetitions = Vec::new();
        let warm_up = (plan.warm_up > 0).then_some(plan.warm_up_time);
        let plant =
            self.session.plant(self.loaded, self.variant, self.params, warm_up, plan.builds, |report| {
                repetitions.push(repetition(report));
            })?;
        let mut own = flattened(self.params)?;
        own.0.retain(|name, value| writer.record.parameters.get(name) != Some(value));
        writer.record.results.push(Point {
            scene: described(scene),
            variant: self.variant.to_string(),
            parameters: own,
            build: Build { repetitions },
            tree: tree(plant.statistics()),
            kernels: Vec::new(),
            views: Vec::new(),
        });

        let size = (plan.size.width, plan.size.height);
        let tracer = PathTracer::new(&self.session.gpu, &self.loaded.device, size, &plan.path, true)?;
        tracer.clear()?;
        let mut kernels: Option<Kernels> = None;
        for (done, &view) in views.iter().enumerate() {
            self.bar.set_message(format!(
                "{}, {}, view {} of {}: {}",
                scene.name,
                self.variant,
                done + 1,
                views.len(),
                scene.views[view].name
            ));
            let view = &scene.views[view];
            let started = Instant::now();
            let camera = Camera::new(view, plan.size.width, plan.size.height);
            let (tree, adaptation) = match &plant {
                Plant::Planted(planted) => (planted.tree, None),
                Plant::Seedling(seedling) => {
                    let (tree, adaptation) = self.adapt(seedling, &tracer, &camera)?;
                    (tree, Some(adaptation))
                }
            };
            // Trees of different views may need stacks of different size.
            let kernels = match &mut kernels {
                Some(kernels) if tree.stack <= kernels.stack() => kernels,
                kernels => kernels.insert(Kernels::new(self.session, &tree, self.params)?),
            };
            // Compiling the kernels has left it idle before the first.
            let least = if done == 0 { plan.warm_up_time } else { plan.warm_up_view_time };
            let started = if done == 0 { Instant::now() } else { started };
            let measured = self.view(view, (started, least), &tracer, kernels, &tree, &camera)?;
            let point = writer.record.results.last_mut().expect("pushed above");
            point.kernels = kernels.recorded();
            if let Some(measured) = measured {
                point.views.push(record::View { adaptation, ..measured });
                writer.write()?;
            }
            if interrupted() {
                break;
            }
        }
        if writer.record.results.last().is_some_and(|point| point.views.is_empty()) {
            writer.record.results.pop();
        }
        Ok(())
    }

    /// Makes the tree of a view as often as trees are built, after warming up as long as that.
    fn adapt(
        &self,
        seedling: &Seedling,
        tracer: &PathTracer<'_>,
        camera: &Camera,
    ) -> anyhow::Result<(Tree, Adaptation)> {
        let plan = self.plan;
        let grow = || seedling.grow(self.loaded, tracer, camera);
        let started = Instant::now();
        let mut grown = grow()?;
        while plan.warm_up > 0 && started.elapsed() < plan.warm_up_view_time {
            grown = grow()?;
        }
        let mut sampling_milliseconds = Vec::new();
        let mut repetitions = Vec::new();
        for _ in 0..plan.builds {
            grown = grow()?;
            sampling_milliseconds.push(grown.sampling_milliseconds);
            repetitions.push(repetition(&grown.build));
        }
        let tree = tree(&seedling.measure(&grown)?);
        Ok((grown.tree, Adaptation { sampling_milliseconds, build: Build { repetitions }, tree }))
    }

    /// `None` when the user interrupted it. The device has been busy since `started`, and is to be for at
    /// `least` so long before it is measured.
    fn view(
        &self,
        view: &View,
        (started, least): (Instant, Duration),
        tracer: &PathTracer<'_>,
        kernels: &Kernels,
        tree: &Tree,
        camera: &Camera,
    ) -> anyhow::Result<Option<record::View>> {
        let plan = self.plan;
        let mut warmed = 0;
        while warmed < plan.warm_up || (plan.warm_up > 0 && started.elapsed() < least) {
            kernels.sample(tracer, tree, camera, u32::MAX - warmed)?;
            warmed += 1;
        }
        self.bar.inc(u64::from(plan.warm_up));
        let before = self.telemetry.sample();
        let mut samples = Vec::new();
        for sample in 0..plan.samples {
            if interrupted() {
                return Ok(None);
            }
            let measured = kernels.sample(tracer, tree, camera, sample)?;
            let depths = measured.waves.iter().map(|w| Launch { rays: w.rays, milliseconds: w.milliseconds });
            samples.push(record::Sample { depths: depths.collect() });
            self.bar.inc(1);
        }
        let after = self.telemetry.sample();
        let counts = tracer.count(&kernels.counting, tree, camera, 0)?;
        let depths = counts.iter().map(|c| Count {
            rays: c.rays,
            nodes: c.nodes,
            boxes: c.boxes,
            triangles: c.triangles,
        });
        let counters = Counters { depths: depths.collect() };
        self.bar.inc(1);
        Ok(Some(record::View {
            name: view.name.clone(),
            adaptation: None,
            samples,
            counters: Some(counters),
            before,
            after,
            pictures: Vec::new(),
        }))
    }
}

fn repetition(report: &BuildReport) -> Repetition {
    let took = &report.milliseconds;
    let phases = [
        ("morton", took.morton),
        ("sort", took.sort),
        ("ploc", took.ploc),
        ("collapse", took.collapse),
        ("contract", took.contract),
        ("layout", took.layout),
    ];
    // A tree for a view is made of one that is there: its first phases take no part.
    let took_part = |(_, milliseconds): &(&str, f64)| *milliseconds > 0.0;
    Repetition {
        milliseconds: took.total,
        phases: phases
            .into_iter()
            .filter(took_part)
            .map(|(name, milliseconds)| Phase { name: name.into(), milliseconds })
            .collect(),
    }
}

fn tree(stats: &TreeStats) -> record::Tree {
    record::Tree {
        nodes: stats.nodes,
        leaves: stats.leaves,
        node_bytes: stats.node_bytes,
        triangle_bytes: stats.triangle_bytes,
        average_children: stats.children_per_node,
        average_triangles_per_leaf: stats.triangles_per_leaf,
        depth: stats.depth,
        sah_cost: stats.sah_cost,
    }
}

fn described(scene: &Scene) -> record::Scene {
    let report = &scene.report;
    let source = match &scene.provenance.origin {
        Origin::File { path, sha256 } => Source::File {
            name: path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
            sha256: sha256.clone(),
        },
        Origin::Generated { generator, triangles, seed } => {
            let mut parameters = record::Parameters::default();
            parameters.set("triangles", *triangles);
            parameters.set("seed", *seed);
            Source::Generator { name: generator.to_string(), parameters, sha256: None }
        }
    };
    let skipped = [
        ("non_finite", report.non_finite),
        ("out_of_range", report.out_of_range),
        ("not_triangles", report.skipped_primitives),
    ];
    record::Scene {
        name: scene.name.clone(),
        source,
        triangles: scene.positions.len() as u64,
        skipped: skipped
            .into_iter()
            .filter(|(_, count)| *count > 0)
            .map(|(reason, count)| (reason.to_owned(), count))
            .collect::<BTreeMap<_, _>>(),
        load_milliseconds: report.seconds * 1e3,
    }
}

fn device(info: &DeviceInfo) -> record::Device {
    record::Device {
        name: info.name.clone(),
        vendor: vendor(info.vendor_id).into(),
        vendor_id: info.vendor_id,
        device_id: info.device_id,
        kind: match info.kind {
            DeviceKind::Discrete => record::DeviceKind::Discrete,
            DeviceKind::Integrated => record::DeviceKind::Integrated,
            DeviceKind::Virtual => record::DeviceKind::Virtual,
            DeviceKind::Cpu => record::DeviceKind::Cpu,
            DeviceKind::Other => record::DeviceKind::Other,
        },
        driver: record::Driver {
            name: info.driver_name.clone(),
            version: info.driver_version.to_string(),
            info: info.driver_info.clone(),
        },
        api_version: info.api_version.clone(),
        uuid: info.uuid.clone(),
        pci: info.pci.clone(),
        limits: record::Limits {
            subgroup_size: info.subgroup_size,
            subgroup_size_min: info.subgroup_size_range[0],
            subgroup_size_max: info.subgroup_size_range[1],
            shared_memory_bytes: info.shared_memory_bytes,
            workgroup_invocations: info.max_workgroup_size,
            workgroup_size: info.max_workgroup_axes,
            workgroup_count: info.max_workgroups,
            storage_buffer_bytes: info.storage_buffer_bytes,
            timestamp_period_nanoseconds: f64::from(info.timestamp_period_ns),
            timestamp_bits: info.timestamp_bits,
            heaps: info
                .heaps
                .iter()
                .map(|&(bytes, device_local)| record::Heap { bytes, device_local })
                .collect(),
        },
        features: info.optional.iter().cloned().collect(),
    }
}

/// The vendor behind a PCI or Khronos vendor number.
fn vendor(id: u32) -> &'static str {
    match id {
        0x10DE => "NVIDIA",
        0x1002 => "AMD",
        0x8086 => "Intel",
        0x13B5 => "Arm",
        0x5143 => "Qualcomm",
        0x106B => "Apple",
        0x10005 => "Mesa",
        0x1AE0 => "Google",
        _ => "unknown",
    }
}

fn uuid_bytes(uuid: &str) -> [u8; 16] {
    let digits: Vec<u8> = uuid.bytes().filter_map(|c| (c as char).to_digit(16)).map(|d| d as u8).collect();
    std::array::from_fn(|i| match digits.get(2 * i..2 * i + 2) {
        Some(pair) => pair[0] << 4 | pair[1],
        None => 0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_uuid_is_read_back_from_its_text() {
        let bytes = uuid_bytes("00112233-4455-6677-8899-aabbccddeeff");
        assert_eq!(bytes[..4], [0x00, 0x11, 0x22, 0x33]);
        assert_eq!(bytes[15], 0xff);
    }
}
