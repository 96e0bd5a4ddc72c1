//! The commands other than `run`.

use crate::{
    args::{self, Global, Heatmap, Seen, Size},
    params::Params,
    picture::Picture,
    progress::{bar, remark},
    rayfile,
    session::{Loaded, Planted, Session},
    table::{table, thousands},
    variant::Variant,
};
use anyhow::Context;
use std::{io::Write, path::Path};
use tracer::{
    gpu::Pass,
    path::{self, Camera, PathTracer},
    scene::{SearchPath, Source, built_in},
    traverse::{Buffers, Counts, Hit, Queue, Ray, Traversal, Wave, cpu},
};

/// Prints to stdout; a reader that has gone away is no error.
fn print(text: &str) -> anyhow::Result<()> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(error).context("cannot write to stdout")
        }
        _ => Ok(()),
    }
}

/// `runner devices`.
pub fn devices(json: bool) -> anyhow::Result<()> {
    let all = tracer::gpu::devices()?;
    if json {
        return print(&serde_json::to_string_pretty(&all)?);
    }
    let mut rows = table(&[
        "device",
        "kind",
        "driver",
        "Vulkan",
        "subgroup",
        "shared KiB",
        "memory GiB",
        "tick ns",
        "optional features",
        "UUID",
    ]);
    for info in &all {
        rows.add_row([
            format!("{}: {}", info.index, info.name),
            format!("{:?}", info.kind).to_lowercase(),
            format!("{} {}", info.driver_name, info.driver_info),
            info.api_version.clone(),
            info.subgroup_size.to_string(),
            (info.shared_memory_bytes >> 10).to_string(),
            format!("{:.1}", info.memory_bytes as f64 / f64::from(1 << 30)),
            info.timestamp_period_ns.to_string(),
            info.optional.join(", "),
            info.uuid.clone(),
        ]);
    }
    let mut text = rows.to_string();
    for info in all.iter().filter(|i| !i.missing.is_empty()) {
        text += &format!("\n{} cannot be used: it lacks {}", info.name, info.missing.join(", "));
    }
    print(&text)
}

/// `runner scenes`.
pub fn scenes(global: &Global) -> anyhow::Result<()> {
    let search = SearchPath::new(global.scene_dir.iter().cloned());
    let mut rows = table(&["scene", "title", "source", "licence", "state"]);
    let mut missing = String::new();
    for entry in built_in() {
        let descriptor = entry.descriptor()?;
        let (source, state) = match &descriptor.source {
            Source::Generator { generator, .. } => (format!("generator {generator}"), "ready"),
            Source::File { file, .. } if search.find(Path::new(file)).is_some() => (file.clone(), "found"),
            Source::File { file, .. } => {
                missing += &format!("\n{}: {}", entry.name, descriptor.get);
                (file.clone(), "missing")
            }
        };
        rows.add_row([entry.name, &descriptor.title, &source, &descriptor.licence, state]);
    }
    if !missing.is_empty() {
        let folders: Vec<_> = search.folders().iter().map(|f| f.display().to_string()).collect();
        missing = format!(
            "\n\nLooked in {}. Put missing files there, or name their folder with --scene-dir or \
             BROADLEAF_SCENES:{missing}",
            folders.join(", ")
        );
    }
    print(&format!("{rows}{missing}"))
}

/// `runner schema`.
pub fn schema() -> anyhow::Result<()> {
    print(&serde_json::to_string_pretty(&record::json_schema())?)
}

/// `runner resources`.
pub fn resources(global: &Global, tuning: &args::Tuning) -> anyhow::Result<()> {
    let mut params = Params::default();
    params.set(&tuning.set)?;
    let session = Session::open(global)?;
    let mut rows = table(&["variant", "rays", "workgroup", "statistic", "value"]);
    for &variant in Variant::ALL {
        let traversal = Traversal::new(&session.gpu, &params.trace, 0, false)?;
        for wave in [Wave::Primary, Wave::Secondary] {
            let kernel = traversal.kernel(wave);
            for statistic in kernel.statistics() {
                rows.add_row([
                    variant.to_string(),
                    format!("{wave:?}").to_lowercase(),
                    kernel.workgroup_size().to_string(),
                    statistic.name,
                    statistic.value.to_string(),
                ]);
            }
        }
    }
    if rows.is_empty() {
        let name = &session.gpu.info().name;
        return print(&format!(
            "the driver of {name} does not tell: it lacks VK_KHR_pipeline_executable_properties"
        ));
    }
    print(&rows.to_string())
}

/// A scene, its tree and a camera, as `render` and `rays` want them.
struct Stage {
    session: Session,
    loaded: Loaded,
    planted: Planted,
    params: Params,
    camera: Camera,
    view: String,
}

impl Stage {
    fn new(global: &Global, seen: &Seen, size: Size) -> anyhow::Result<Self> {
        let variant = Variant::one(&seen.variant)?;
        let mut params = Params::default();
        params.set(&seen.tuning.set)?;
        let session = Session::open(global)?;
        let loaded = session.load(&seen.scene)?;
        let names: Vec<String> = loaded.scene.views.iter().map(|v| v.name.clone()).collect();
        let view = args::pick(&names, &seen.view).map_err(anyhow::Error::msg)?[0];
        let camera = Camera::new(&loaded.scene.views[view], size.width, size.height);
        let planted = session.plant(&loaded, variant, &params, None, 1, |_| ())?;
        Ok(Self { session, loaded, planted, params, camera, view: names[view].clone() })
    }
}

/// `runner render`.
pub fn render(global: &Global, render: &args::Render) -> anyhow::Result<()> {
    let size = render.size;
    let stage = Stage::new(global, &render.seen, size)?;
    let session = &stage.session;
    let counting = render.heatmap.is_some();
    let path = path::Params { depth: render.depth, seed: render.seen.seed };
    let device = &stage.loaded.device;
    let tracer = PathTracer::new(&session.gpu, device, (size.width, size.height), &path, counting)?;
    let traversal = session.traversal(&stage.planted, &stage.params, counting)?;
    let tree = &stage.planted.tree;

    let picture = if let Some(heatmap) = render.heatmap {
        let of = |c: &Counts| match heatmap {
            Heatmap::Nodes => c.nodes,
            Heatmap::Boxes => c.boxes,
            Heatmap::Triangles => c.triangles,
        };
        let mut costs = vec![0; size.width as usize * size.height as usize];
        tracer.wavefronts(&traversal, tree, &stage.camera, 0, |wave| {
            for (&pixel, counts) in wave.pixels.iter().zip(&wave.counts) {
                costs[pixel as usize] = of(counts);
            }
            false
        })?;
        let (picture, scale) = Picture::heat_map(&costs, size.width as usize);
        print(&format!(
            "{heatmap:?} a primary ray: least {}, median {}, mean {:.2}, greatest {}; the colours end at {}",
            scale.least, scale.median, scale.mean, scale.greatest, scale.upper
        ))?;
        picture
    } else {
        tracer.clear()?;
        let bar = bar(render.samples.into(), session.quiet);
        bar.set_message(format!("{}, {}", stage.loaded.scene.name, stage.view));
        for sample in 0..render.samples {
            tracer.sample(&traversal, tree, &stage.camera, sample)?;
            bar.inc(1);
        }
        bar.finish_and_clear();
        let sums = tracer.picture()?;
        Picture::tone_mapped(&sums, size.width as usize, render.samples, render.exposure)
    };
    picture.write(&render.output)?;
    remark(session.quiet, format_args!("picture: {}", render.output.display()));
    session.finish()
}

/// `runner rays`.
pub fn rays(global: &Global, rays: &args::Rays) -> anyhow::Result<()> {
    let size = rays.size;
    let stage = Stage::new(global, &rays.seen, size)?;
    let session = &stage.session;
    let path = path::Params { depth: rays.depth + 1, seed: rays.seen.seed };
    let device = &stage.loaded.device;
    let tracer = PathTracer::new(&session.gpu, device, (size.width, size.height), &path, false)?;
    let traversal = session.traversal(&stage.planted, &stage.params, false)?;
    let mut found = None;
    tracer.clear()?;
    tracer.wavefronts(&traversal, &stage.planted.tree, &stage.camera, 0, |wave| {
        if wave.depth == rays.depth as usize {
            found = Some((wave.rays, wave.hits));
        }
        true
    })?;
    let (all, hits) = found.unwrap_or_default();
    rayfile::write_rays(&rays.output, &all)?;
    let hit = hits.iter().filter(|h| h.triangle != Hit::MISS).count();
    print(&format!(
        "{}, {}, depth {}: {} rays, {} hit something",
        stage.loaded.scene.name,
        stage.view,
        rays.depth,
        thousands(all.len() as u64),
        thousands(hit as u64)
    ))?;
    if let Some(path) = &rays.hits {
        rayfile::write_hits(path, &refined(&stage.loaded, &all, hits))?;
    }
    session.finish()
}

/// Hits with their distances evaluated once more in double precision.
fn refined(loaded: &Loaded, rays: &[Ray], mut hits: Vec<Hit>) -> Vec<Hit> {
    for (ray, hit) in rays.iter().zip(&mut hits).filter(|(_, hit)| hit.triangle != Hit::MISS) {
        hit.t = cpu::refine(ray, &loaded.scene.positions[hit.triangle as usize], hit.t);
    }
    hits
}

/// `runner trace`.
pub fn trace(global: &Global, trace: &args::Trace) -> anyhow::Result<()> {
    let variant = Variant::one(&trace.variant)?;
    let mut params = Params::default();
    params.set(&trace.tuning.set)?;
    let rays = rayfile::read_rays(&trace.rays)?;
    let session = Session::open(global)?;
    let loaded = session.load(&trace.scene)?;
    let planted = session.plant(&loaded, variant, &params, None, 1, |_| ())?;
    let traversal = session.traversal(&planted, &params, false)?;
    let gpu = &session.gpu;
    let ray_buffer = gpu.upload("rays", &rays)?;
    let hit_buffer = gpu.buffer("hits", size_of_val(rays.as_slice()) as u64 / 4)?;
    let start = Queue { count: rays.len() as u32, ..Queue::default() };
    let queue = gpu.upload("queue", &[start])?;
    let buffers =
        Buffers { rays: ray_buffer.address(), hits: hit_buffer.address(), queue: queue.address(), counts: 0 };
    let wave = if trace.primary { Wave::Primary } else { Wave::Secondary };
    let mut times = Vec::new();
    for launch in 0..=trace.launches {
        queue.write(&[start])?;
        let mut pass = Pass::new(gpu)?;
        traversal.record(&mut pass, "trace", wave, &planted.tree, &buffers, rays.len());
        let milliseconds = pass.submit()?.milliseconds("trace");
        let done: Vec<Queue> = queue.read(0, 1)?;
        traversal.check(0, &done[0])?;
        // The first launch may include compilation, and finds the caches cold.
        if launch > 0 {
            times.push(milliseconds);
        }
    }
    times.sort_by(f64::total_cmp);
    let rate = |milliseconds: f64| rays.len() as f64 / milliseconds / 1e3;
    let (fastest, median) = (times[0], times[times.len() / 2]);
    print(&format!(
        "{}, {variant}: {} rays, {} launches\nfastest {fastest:.4} ms, {:.1} MRps\nmedian  {median:.4} ms, {:.1} MRps",
        loaded.scene.name,
        thousands(rays.len() as u64),
        times.len(),
        rate(fastest),
        rate(median),
    ))?;
    if let Some(path) = &trace.hits {
        let hits = hit_buffer.read(0, rays.len())?;
        rayfile::write_hits(path, &refined(&loaded, &rays, hits))?;
    }
    session.finish()
}
