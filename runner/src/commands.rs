//! The commands other than `run`.

use crate::{
    args::{self, Global, Seen},
    config,
    params::Params,
    picture::Picture,
    progress::{bar, remark},
    rayfile,
    session::{self, Loaded, Plant, Session, TraceMemory},
    size::Size,
    table::{self, table, thousands},
    variant::Variant,
};
use anyhow::{Context, bail};
use clap::CommandFactory;
use std::{
    io::Write,
    path::Path,
    time::{Duration, Instant},
};
use tracer::{
    gpu::DeviceInfo,
    layout::Layout,
    path::{self, Camera, PathTracer},
    scene::{SearchPath, Source, built_in},
    traverse::{Counting, Hit, Ray, Tree, Wave, cpu},
};

/// Prints to stdout; a reader that has gone away is no error.
pub fn print(text: &str) -> anyhow::Result<()> {
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
    let best = all.iter().filter(|i| i.missing.is_empty()).min_by_key(|i| (i.kind, i.index)).map(|i| i.index);
    let texts: Vec<_> = all.iter().map(|info| described(info, best == Some(info.index))).collect();
    print(&texts.join("\n\n"))
}

/// A device in a few lines.
fn described(info: &DeviceInfo, best: bool) -> String {
    let gib = |bytes: u64| format!("{:.1} GiB", bytes as f64 / f64::from(1 << 30));
    let [least, most] = info.subgroup_size_range;
    let range = if least < most { format!(" ({least} to {most})") } else { String::new() };
    let timestamps = match info.timestamp_bits {
        0 => "none".to_owned(),
        bits => format!("a tick of {} ns, {bits} bits", info.timestamp_period_ns),
    };
    let mut lines = vec![
        ("kind", format!("{:?}", info.kind).to_lowercase()),
        ("driver", format!("{} {}, Vulkan {}", info.driver_name, info.driver_info, info.api_version)),
        ("subgroup", format!("{}{range} invocations", info.subgroup_size)),
        (
            "workgroup",
            format!(
                "at most {} invocations, {} KiB of shared memory",
                info.max_workgroup_size,
                info.shared_memory_bytes >> 10
            ),
        ),
        (
            "memory",
            format!("{}, at most {} in one piece", gib(info.memory_bytes), gib(info.max_allocation_bytes)),
        ),
        ("timestamps", timestamps),
        ("UUID", info.uuid.clone()),
    ];
    if info.multiprocessors > 0 {
        lines.insert(3, ("processors", info.multiprocessors.to_string()));
    }
    let listed = |features: &[String]| if features.is_empty() { "none".into() } else { features.join(", ") };
    lines.push(("optional", listed(&info.optional)));
    if !info.missing.is_empty() {
        lines.push(("lacks", format!("{}, so it cannot be used", listed(&info.missing))));
    }
    let mut text = format!("{}: {}", info.index, info.name);
    if best {
        text += "  (taken unless --device names another)";
    }
    for (name, value) in lines {
        text += &format!("\n   {name:<11}{value}");
    }
    text
}

/// `runner scenes`.
pub fn scenes(global: &Global, json: bool) -> anyhow::Result<()> {
    let search = SearchPath::new(global.scene_dir.iter().cloned());
    let mut rows = table(&["scene", "triangles", "state", "licence", "title"]);
    let mut missing = String::new();
    let mut all = Vec::new();
    for entry in built_in() {
        let descriptor = entry.descriptor()?;
        let (triangles, found, state) = match &descriptor.source {
            Source::Generator { triangles, .. } => (Some(*triangles), None, "generated"),
            Source::Models(_) => (None, None, "models"),
            Source::File { file, triangles, .. } => match search.find(Path::new(file)) {
                Some(path) => (*triangles, Some(path), "found"),
                None => {
                    missing += &format!("\n  {file}: {}", descriptor.get);
                    (*triangles, None, "missing")
                }
            },
        };
        if json {
            all.push(serde_json::json!({
                "name": entry.name,
                "title": descriptor.title,
                "licence": descriptor.licence,
                "credit": descriptor.credit,
                "get": descriptor.get,
                "source": descriptor.source,
                "state": state,
                "path": found,
            }));
            continue;
        }
        // The licence's name; its terms stand in the descriptor.
        let licence = descriptor.licence.split([',', ':', ';', '(']).next().unwrap_or_default().trim();
        let licence = licence.trim_end_matches(" terms").trim_end_matches(" at the source");
        rows.add_row([
            entry.name.to_owned(),
            triangles.map_or_else(String::new, thousands),
            state.to_owned(),
            shortened(licence, 18),
            shortened(&descriptor.title, 60),
        ]);
    }
    if json {
        return print(&serde_json::to_string_pretty(&all)?);
    }
    table::align(&mut rows, &[0, 2, 3, 4]);
    if !missing.is_empty() {
        let folders: Vec<_> = search.folders().iter().map(|f| f.display().to_string()).collect();
        let looked = if folders.is_empty() { "no folder".to_owned() } else { folders.join(", ") };
        missing = format!(
            "\n\nMissing; looked in {looked}.\nPut the files there, or name their folder with --scene-dir or \
             BROADLEAF_SCENES.{missing}"
        );
    }
    print(&(table::shown(&rows) + &missing))
}

/// At most `length` characters, the last of them an ellipsis where some had to go.
fn shortened(text: &str, length: usize) -> String {
    if text.chars().count() <= length {
        return text.to_owned();
    }
    let kept: String = text.chars().take(length - 1).collect();
    format!("{}…", kept.trim_end())
}

/// `runner completions`.
pub fn completions(shell: clap_complete::Shell) -> anyhow::Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut args::Cli::command(), "runner", &mut text);
    print(String::from_utf8(text)?.trim_end())
}

/// `runner man`.
pub fn man(command: Option<&str>) -> anyhow::Result<()> {
    let mut cli = args::Cli::command();
    cli.build();
    let page = match command {
        None => cli,
        Some(name) => cli
            .find_subcommand(name)
            .cloned()
            .with_context(|| format!("no command {name:?}; `runner --help` lists them"))?,
    };
    let mut text = Vec::new();
    clap_mangen::Man::new(page).render(&mut text)?;
    print(String::from_utf8(text)?.trim_end())
}

/// `runner schema`.
pub fn schema() -> anyhow::Result<()> {
    print(&serde_json::to_string_pretty(&record::json_schema())?)
}

/// `runner config schema`.
pub fn config_schema() -> anyhow::Result<()> {
    print(&serde_json::to_string_pretty(config::json_schema())?)
}

/// `runner variants`.
pub fn variants(global: &Global, tuning: &args::Tuning, json: bool) -> anyhow::Result<()> {
    let mut rows =
        table(&["variant", "language", "children", "node bytes", "boxes", "contraction", "c_t", "subgroups"]);
    let mut all = Vec::new();
    // What a device has no part in is told without one, too.
    let device = chosen_device(global);
    let mut reasons: Vec<String> = Vec::new();
    for &variant in Variant::ALL {
        let params = Params::with(variant, &tuning.set)?;
        let missing = variant.missing().map(ToOwned::to_owned).or_else(|| match &device {
            _ if !variant.is_driver() => None,
            Ok(info) => variant.unavailable(info).map(|why| why.to_string()),
            Err(why) => Some(format!("{why:#}")),
        });
        if let Some(reason) = missing.as_ref().filter(|reason| !reasons.contains(reason)) {
            reasons.push(reason.clone());
        }
        let layout = variant.layout();
        let bytes = layout.map(Layout::node_bytes);
        let stride = layout.map(|layout| layout.stride(&params.layout));
        let method = layout.map(|_| params.build(variant).contract.method);
        if json {
            all.push(serde_json::json!({
                "name": variant.name(),
                "language": variant.language(),
                "missing": missing,
                "children": layout.map(Layout::arity),
                "node_bytes": bytes,
                "stride_bytes": stride,
                "quantized": layout.map(Layout::is_quantized),
                "bits": layout.map(|layout| layout.bits(&params.layout)),
                "contraction": method.map(|method| method.to_string()),
                "by_view": variant.by_view,
                "parameters": params,
            }));
            continue;
        }
        let language = match &missing {
            None => variant.language().to_owned(),
            Some(_) => format!("{}, unavailable", variant.language()),
        };
        let mut row = vec![variant.to_string(), language];
        match layout {
            None => row.resize(8, "–".into()),
            Some(layout) => row.extend([
                layout.arity().to_string(),
                match (bytes, stride) {
                    (Some(bytes), Some(stride)) if stride != bytes => format!("{bytes} in {stride}"),
                    _ => layout.node_bytes().to_string(),
                },
                format!("{} bits a plane", layout.bits(&params.layout)),
                method.filter(|_| layout != Layout::Binary).map_or_else(|| "none".into(), |m| m.to_string()),
                params.collapse.traversal_cost.to_string(),
                format!("{}, {}", params.trace.primary_subgroups, params.trace.secondary_subgroups),
            ]),
        }
        rows.add_row(row);
    }
    if json {
        return print(&serde_json::to_string_pretty(&all)?);
    }
    table::align(&mut rows, &[0, 1, 4, 5]);
    let said = |reason: &String| match reason.contains("unavailable") {
        true => format!("\n\n{reason}"),
        false => format!("\n\nunavailable: {reason}"),
    };
    let unavailable: String = reasons.iter().map(said).collect();
    print(&format!(
        "{}{unavailable}\n\ncontraction: sah by surface area and triangles, cbtc by visits of sample rays from the view, optimal of least\n\
         SAH cost. c_t: what visiting a node costs when leaves are merged. subgroups: of a workgroup, for primary and\n\
         secondary rays. Driver: the driver's own ray tracing, which does not tell what its trees are like. Naive: no tree,\n\
         every triangle. Blank: no triangle either, what all else costs. These two are taken by their names only.\n\
         All of these are parameters; `--set` changes them, as it does in `runner run`.",
        table::shown(&rows)
    ))
}

/// What is known of the device that would be opened.
fn chosen_device(global: &Global) -> anyhow::Result<DeviceInfo> {
    Ok(tracer::gpu::describe(&session::selector(global))?)
}

/// A scene, its tree and a camera, as `render` and `rays` want them.
struct Stage {
    session: Session,
    loaded: Loaded,
    plant: Plant,
    variant: Variant,
    params: Params,
    camera: Camera,
    view: String,
}

impl Stage {
    fn new(global: &Global, seen: &Seen, size: Size) -> anyhow::Result<Self> {
        let variant = Variant::one(&seen.variant)?;
        let params = Params::with(variant, &seen.tuning.set)?;
        let session = Session::open(global)?;
        let loaded = session.load(&seen.scene)?;
        let view = loaded.scene.views[loaded.views(Some(&seen.view))?[0]].clone();
        let camera = Camera::new(&view, size.width, size.height);
        let plant = session.plant(&loaded, variant, &params, None, 1, |_| ())?;
        Ok(Self { session, loaded, plant, variant, params, camera, view: view.name })
    }

    /// The tree for the camera.
    fn tree(&self, tracer: &PathTracer<'_>) -> anyhow::Result<Tree> {
        match &self.plant {
            Plant::Planted(planted) => Ok(planted.tree),
            Plant::Seedling(seedling) => Ok(seedling.grow(&self.loaded, tracer, &self.camera)?.tree),
        }
    }
}

/// `runner render`.
pub fn render(global: &Global, render: &args::Render) -> anyhow::Result<()> {
    let size = render.size;
    let stage = Stage::new(global, &render.seen, size)?;
    let session = &stage.session;
    let counting = render.heatmap.is_some();
    if counting && stage.variant.is_driver() {
        bail!("the driver does not tell what rays meet in its tree: take another --variant for --heatmap");
    }
    let path =
        path::Params { depth: render.depth, seed: render.seen.seed, shade: stage.params.shade.clone() };
    let device = &stage.loaded.device;
    let tracer = PathTracer::new(&session.gpu, device, (size.width, size.height), &path, counting)?;
    let tree = &stage.tree(&tracer)?;
    let counted = if counting { Counting::Rays } else { Counting::Nothing };
    let traversal = session.traversal(tree, stage.variant, &stage.params, counted)?;

    let picture = if let Some(heatmap) = render.heatmap {
        let counts = tracer.primary_costs(&traversal, tree, &stage.camera, 0)?;
        let costs: Vec<u32> = counts.iter().map(|counts| heatmap.of(counts)).collect();
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
    let path =
        path::Params { depth: rays.depth + 1, seed: rays.seen.seed, shade: stage.params.shade.clone() };
    let device = &stage.loaded.device;
    let tracer = PathTracer::new(&session.gpu, device, (size.width, size.height), &path, false)?;
    let tree = stage.tree(&tracer)?;
    let traversal = session.traversal(&tree, stage.variant, &stage.params, Counting::Nothing)?;
    let mut found = None;
    tracer.clear()?;
    tracer.wavefronts(&traversal, &tree, &stage.camera, 0, |wave| {
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

/// How long `runner trace` keeps the device busy before launches count.
const BUSY_BEFORE_LAUNCHES: Duration = Duration::from_secs(1);
/// Launches in one submission; fewer where as many would keep a device from answering for long.
const MOST_AT_ONCE: u32 = 64;

/// `runner trace`.
pub fn trace(global: &Global, trace: &args::Trace) -> anyhow::Result<()> {
    let variant = Variant::one(&trace.variant)?;
    let params = Params::with(variant, &trace.tuning.set)?;
    let rays = rayfile::read_rays(&trace.rays)?;
    let session = Session::open(global)?;
    let loaded = session.load(&trace.scene)?;
    let gpu = &session.gpu;
    let plant = session.plant(&loaded, variant, &params, None, 1, |_| ())?;
    let tree = match &plant {
        Plant::Planted(planted) => planted.tree,
        Plant::Seedling(seedling) => seedling.grow_from(gpu, &loaded, &rays)?.tree,
    };
    let traversal = session.traversal(&tree, variant, &params, Counting::Nothing)?;
    let memory = TraceMemory::new(gpu, &rays)?;
    let wave = if trace.primary { Wave::Primary } else { Wave::Secondary };
    // The first launch may include compilation, and an idle device takes a while to raise its clock.
    let started = Instant::now();
    let mut at_once = 1;
    loop {
        memory.launch(gpu, &traversal, &tree, wave, at_once)?;
        if started.elapsed() > BUSY_BEFORE_LAUNCHES {
            break;
        }
        at_once = (2 * at_once).min(MOST_AT_ONCE);
    }
    let mut times = Vec::new();
    while times.len() < trace.launches as usize {
        let next = (trace.launches - times.len() as u32).min(at_once);
        times.extend(memory.launch(gpu, &traversal, &tree, wave, next)?);
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
        rayfile::write_hits(path, &refined(&loaded, &rays, memory.hits()?))?;
    }
    session.finish()
}
