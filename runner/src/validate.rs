//! `runner validate`: every invariant and the oracle, on a user's own scene.

use crate::{
    args::{self, Global},
    commands::print,
    params::Params,
    session::{Loaded, Plant, Session, TraceMemory},
    table::thousands,
    variant::Variant,
};
use anyhow::{Context, bail};
use glam::DVec3;
use rayon::prelude::*;
use std::fmt::Display;
use tracer::{
    builder::{BuildParams, Builder, Method, Widen},
    bvh2::{Aabb, Triangle},
    collapse, contract,
    gpu::Pass,
    layout::{self, Layout, LeafTriangles},
    path::{self, Camera, PathTracer},
    traverse::{Counting, Hit, Ray, Traversal, Tree, TriangleTest, Wave, cpu},
    validate, with_layout,
};

/// Checks the variants that the command line names and says what was checked.
///
/// # Errors
/// Something does not hold, or could not be checked.
pub fn validate(global: &Global, arguments: &args::Validate) -> anyhow::Result<()> {
    let variants = Variant::select(&arguments.variant)?;
    for &variant in &variants {
        Params::with(variant, &arguments.tuning.set)?;
    }
    let session = Session::open(global)?;
    let available = session.available(variants, &arguments.variant)?;
    let variants = &available.there;
    let params: Vec<Params> =
        variants.iter().map(|&v| Params::with(v, &arguments.tuning.set)).collect::<anyhow::Result<_>>()?;
    let loaded = session.load(&arguments.scene)?;
    let mut failures = 0;
    let mut oracle = Oracle::default();
    for (&variant, params) in variants.iter().zip(&params) {
        let mut checks = Checks { variant, failures: 0, held: Vec::new() };
        let done = check(&session, &loaded, variant, params, arguments, &mut oracle, &mut checks)
            .with_context(|| format!("{variant} could not be checked to the end"));
        checks.print()?;
        done?;
        failures += checks.failures;
    }
    session.finish()?;
    if failures > 0 {
        bail!("{failures} checks failed");
    }
    print(&format!("{}: everything holds", loaded.scene.name))?;
    available.finish(&session.gpu)
}

/// What has been checked of one variant: failures are printed at once, the rest in a line a check.
struct Checks {
    variant: Variant,
    failures: usize,
    /// By check: how often it held, and what the last look was at.
    held: Vec<(&'static str, usize, String)>,
}

impl Checks {
    /// Counts one check: what was looked at, or what is wrong with it.
    fn report(
        &mut self,
        what: &'static str,
        view: &str,
        found: Result<String, String>,
    ) -> anyhow::Result<()> {
        match found {
            Ok(looked) => {
                match self.held.iter_mut().find(|(known, ..)| *known == what) {
                    Some((_, times, last)) => (*times, *last) = (*times + 1, looked),
                    None => self.held.push((what, 1, looked)),
                }
                Ok(())
            }
            Err(wrong) => {
                self.failures += 1;
                let of_view = if view.is_empty() { String::new() } else { format!(", tree for {view:?}") };
                print(&format!("FAILED  {}: {what}{of_view}: {wrong}", self.variant))
            }
        }
    }

    fn print(&self) -> anyhow::Result<()> {
        for (what, times, last) in &self.held {
            let several = if *times > 1 { format!(" ({times} times, this the last)") } else { String::new() };
            print(&format!("ok      {}: {what}: {last}{several}", self.variant))?;
        }
        Ok(())
    }
}

fn require(holds: bool, wrong: impl Display) -> Result<(), String> {
    if holds { Ok(()) } else { Err(wrong.to_string()) }
}

fn check(
    session: &Session,
    loaded: &Loaded,
    variant: Variant,
    params: &Params,
    arguments: &args::Validate,
    oracle: &mut Oracle,
    checks: &mut Checks,
) -> anyhow::Result<()> {
    let gpu = &session.gpu;
    let triangles = &loaded.scene.positions;
    let (count, extent) = (triangles.len(), loaded.device.extent);

    // The binary tree in its own layout: what the variant is held against, and what sample rays go through.
    let binary = Builder::new(gpu, &params.build(Variant::BINARY), Layout::Binary)?;
    let workspace = loaded.workspace(session, params, &binary)?;
    let report = binary.build(&workspace, &loaded.device.positions, count, false)?;
    let reference = workspace.wide.tree(&report.summary, extent);

    let tree = workspace.read_tree()?;
    let scale = workspace.read_bounds()?.scale();
    // Of a tree with spatial splits, leaves are parts of triangles.
    let split = params.build.method == Method::Sbvh;
    let sound = if split { validate::references } else { validate::bvh2 };
    let sound = sound(&tree, triangles).map_err(|e| e.to_string());
    checks.report(
        "binary tree",
        "",
        sound.map(|()| {
            let nodes = thousands(tree.nodes.len() as u64);
            let leaves = match split {
                true => format!("its {} leaves cover the triangles", thousands(tree.leaves as u64)),
                false => "each triangle in one leaf".into(),
            };
            format!("{nodes} nodes: {leaves}, each node with one parent, boxes exact")
        }),
    )?;
    let subtrees = workspace.read_subtrees()?;
    checks.report(
        "collapse",
        "",
        require(
            subtrees == collapse::cpu::collapse(&tree, scale, &params.collapse()),
            "not what the CPU decides",
        )
        .map(|()| format!("{} decisions as the CPU takes them", thousands(subtrees.len() as u64))),
    )?;

    let size = (arguments.size.width, arguments.size.height);
    let path = path::Params { depth: arguments.depth, seed: arguments.seed, shade: params.shade.clone() };
    let tracer = PathTracer::new(gpu, &loaded.device, size, &path, false)?;
    let views = loaded.views(arguments.views.as_deref())?;
    let cameras: Vec<Camera> =
        views.iter().map(|&v| Camera::new(&loaded.scene.views[v], size.0, size.1)).collect();

    // Rays of every view and depth, and what they hit in the binary tree.
    let plain = session.traversal(&reference, Variant::BINARY, &params.of_binary(), Counting::Nothing)?;
    let mut rays: Vec<Ray> = Vec::new();
    let mut hits: Vec<Hit> = Vec::new();
    tracer.clear()?;
    for camera in &cameras {
        tracer.wavefronts(&plain, &reference, camera, 0, |wave| {
            rays.extend(wave.rays);
            hits.extend(wave.hits);
            true
        })?;
    }

    let test = params.triangle.test;
    let by_rounding = test != TriangleTest::Watertight || variant.is_driver();
    let judge = Judge { triangles, extent, test, by_rounding };
    oracle.ask(&judge, &rays, arguments.brute_force);

    let Some(layout) = variant.layout() else {
        return check_without_nodes(session, loaded, variant, params, &judge, oracle, &rays, &hits, checks);
    };
    let BuildParams { contract: contracted, layout: stored_as, .. } = params.build(variant);
    let widen = Widen::new(gpu, &params.build(variant), layout)?;
    let leaves = workspace.leaves();
    let wide = widen.workspace(leaves)?;
    let visits = contract::VisitCounter::new(gpu, leaves)?;
    let sampler = session.traversal(&reference, variant, &params.of_binary(), Counting::Visits)?;
    // A variant that goes by view has a tree for each; the others have one for all.
    let own_views = if variant.by_view { cameras.len() } else { 1 };
    for view in 0..own_views {
        let of_view = if variant.by_view { loaded.scene.views[views[view]].name.as_str() } else { "" };
        let seen = if variant.by_view {
            let (tree, sampling) = (&reference, &params.cbtc);
            tracer.sample_visits(&sampler, tree, &cameras[view], sampling, &workspace, &visits)?;
            let threshold = sampling.threshold;
            Some((visits.by_inner.read(0, leaves.max(2) - 1)?, threshold))
        } else {
            None
        };
        let on_device = seen
            .as_ref()
            .map(|(_, threshold)| contract::Visits { counts: &visits.by_inner, threshold: *threshold });
        let report = widen.build(&workspace, &wide, &loaded.device.positions, count, on_device)?;
        let summary = report.summary;
        let made = wide.read_wide(summary.nodes as usize)?;
        let twin_visits =
            seen.as_ref().map(|(counts, threshold)| contract::cpu::Visits { counts, threshold: *threshold });
        let arity = layout.arity();
        let twin = contract::cpu::contract(&tree, &subtrees, scale, arity, &contracted, twin_visits);
        let nodes = thousands(u64::from(summary.nodes));
        checks.report(
            "contraction",
            of_view,
            validate::wide(&made, &tree, &subtrees, contracted.method.keeps_leaves())
                .map_err(|e| e.to_string())
                .and_then(|()| require(made.canonical() == twin, "another tree than the CPU makes"))
                .and_then(|()| {
                    let found = (summary.depth, summary.stack);
                    require(made.depth_and_stack() == found, format!("{found:?} is not its depth and stack"))
                })
                .map(|()| {
                    let form = format!("{:?}", widen.form()).to_lowercase();
                    let method = contracted.method;
                    format!("{nodes} nodes by {method} ({form}), the tree that the CPU makes")
                }),
        )?;
        let found = with_layout!(layout, L => {
            let stored = wide.read_nodes::<L>(summary.nodes as usize)?;
            let leaves = wide.stored.triangles.read(leaves)?;
            let bounds = |leaf: u32| tree.nodes[leaf as usize].bounds();
            let parts: Option<Vec<Aabb>> =
                split.then(|| layout::cpu::places(&made, &tree).into_iter().map(bounds).collect());
            let same = {
                let (nodes, order) = layout::cpu::encode::<L>(&made, &tree, triangles, &stored_as);
                bytemuck::cast_slice::<_, u8>(&nodes) == bytemuck::cast_slice::<_, u8>(&stored)
                    && leaves.agree(&order)
            };
            require(same, "not the bytes that the CPU writes").and_then(|()| {
                validate::layout::<L>(&stored, &leaves, triangles, parts.as_deref()).map_err(|e| e.to_string())
            })
        });
        let bytes = layout.node_bytes();
        checks.report(
            "layout",
            of_view,
            found.map(|depth| {
                format!(
                    "{nodes} nodes of {bytes} bytes, {depth} deep, as the CPU writes them; boxes contain all \
                     below them, {} triangles in leaves",
                    thousands(leaves as u64)
                )
            }),
        )?;

        let own = wide.tree(&summary, extent);
        let traversal = session.traversal(&own, variant, params, Counting::Nothing)?;
        // Each kind of wavefront has a kernel of its own, and both have to find the hits of all rays.
        for wave in [Wave::Primary, Wave::Secondary] {
            let found = trace(session, &traversal, wave, &own, &rays)?;
            checks.report("hits", of_view, judge.same_hits(&rays, &hits, &found))?;
            checks.report("brute force", of_view, oracle.agrees(&judge, &rays, &found))?;
        }
    }
    Ok(())
}

/// Checks what is found where there are no nodes of ours: in the driver's own tree, of which it does not tell what it is
/// like, or without one.
#[expect(clippy::too_many_arguments, reason = "all that is known of a scene by then")]
fn check_without_nodes(
    session: &Session,
    loaded: &Loaded,
    variant: Variant,
    params: &Params,
    judge: &Judge<'_>,
    oracle: &Oracle,
    rays: &[Ray],
    hits: &[Hit],
    checks: &mut Checks,
) -> anyhow::Result<()> {
    let plant = session.plant(loaded, variant, params, None, 1, |_| ())?;
    let Plant::Planted(planted) = plant else { bail!("{variant} does not go by view") };
    let traversal = session.traversal(&planted.tree, variant, params, Counting::Nothing)?;
    // One pipeline of the driver's is for both kinds of wavefronts.
    let waves = if variant.is_driver() { &[Wave::Secondary][..] } else { &[Wave::Primary, Wave::Secondary] };
    for &wave in waves {
        let found = trace(session, &traversal, wave, &planted.tree, rays)?;
        if variant == Variant::BLANK {
            let hit = found.iter().filter(|hit| **hit != Hit::NONE).count();
            let nothing = require(hit == 0, format!("{hit} rays hit something"));
            let looked = || format!("{} rays, and none hits anything", thousands(rays.len() as u64));
            checks.report("misses", "", nothing.map(|()| looked()))?;
            continue;
        }
        checks.report("hits", "", judge.same_hits(rays, hits, &found))?;
        if variant.is_driver() {
            checks.report("distances", "", judge.tells_distances(rays, &found))?;
        }
        checks.report("brute force", "", oracle.agrees(judge, rays, &found))?;
    }
    Ok(())
}

fn trace(
    session: &Session,
    traversal: &Traversal,
    wave: Wave,
    tree: &Tree,
    rays: &[Ray],
) -> anyhow::Result<Vec<Hit>> {
    let memory = TraceMemory::new(&session.gpu, rays)?;
    let mut pass = Pass::new(&session.gpu)?;
    traversal.record(&mut pass, "trace", wave, tree, &memory.buffers(), rays.len());
    pass.submit()?;
    traversal.check(0, &memory.queue()?)?;
    memory.hits()
}

/// Compares hits.
struct Judge<'a> {
    triangles: &'a [Triangle],
    /// Largest absolute coordinate.
    extent: f32,
    /// What brute force tests triangles by.
    test: TriangleTest,
    /// Whether rays that pass an edge may hit the triangle or not.
    by_rounding: bool,
}

impl Judge<'_> {
    /// A hit's distance evaluated once more in double precision for the triangle that was chosen: over slivers
    /// the distances that kernels compute differ by more than rays that go astray.
    fn distance(&self, ray: &Ray, hit: &Hit) -> f32 {
        match self.triangles.get(hit.triangle as usize) {
            Some(triangle) => cpu::refine(ray, triangle, hit.t),
            None => hit.t,
        }
    }

    /// Whether two hits are at the same distance along a ray: to 1e-5 of it, and to what single precision can
    /// tell about coordinates of the scene's extent. Where a test is not watertight, or is the driver's own, which rounds
    /// in its own way, a ray that passes an edge of the nearer triangle may hit it or not.
    fn same(&self, ray: &Ray, a: &Hit, b: &Hit) -> bool {
        let reach = ray.origin.iter().fold(self.extent, |m, x| m.max(x.abs()));
        let length = ray.direction.iter().map(|d| d * d).sum::<f32>().sqrt();
        let [s, t] = [a, b].map(|hit| self.distance(ray, hit));
        let off = (s - t).abs();
        if s == t || off.is_finite() && off <= 1e-5 * s.abs().max(t.abs()) + 1e-6 * reach / length {
            return true;
        }
        let nearer = if s < t { a } else { b };
        let passes = |triangle| cpu::passes_edge(ray, triangle, self.extent);
        self.by_rounding && self.triangles.get(nearer.triangle as usize).is_some_and(passes)
    }

    /// Whether the distances that hits tell are those of their triangles, which [`Judge::same`] does not look at: to 2^-14
    /// of the distance and of the scene's extent, as far as the ray's angle to the triangle and the triangle's shape let
    /// single precision tell. Drivers promise no precision; this one is 1000 times what rounding alone explains.
    fn tells_distances(&self, rays: &[Ray], found: &[Hit]) -> Result<String, String> {
        let off = |(ray, hit): &(&Ray, &Hit)| {
            let Some(triangle) = self.triangles.get(hit.triangle as usize) else { return *hit != &Hit::NONE };
            let exact = f64::from(cpu::refine(ray, triangle, hit.t));
            let [v0, v1, v2] = triangle.map(|v| DVec3::from_array(v.map(f64::from)));
            let direction = DVec3::from_array(ray.direction.map(f64::from));
            let (edges, normal) = ([v1 - v0, v2 - v0, v2 - v1], (v1 - v0).cross(v2 - v0));
            let longest = edges.iter().map(|edge| edge.length_squared()).fold(0.0, f64::max);
            let sliver = longest / normal.length();
            let grazing = normal.length() * direction.length() / normal.dot(direction).abs();
            let reach = ray.origin.iter().fold(self.extent, |m, x| m.max(x.abs()));
            let size = exact + f64::from(reach) / direction.length();
            let limit = 0.5f64.powi(14) * size * grazing.max(1.0) * sliver.max(1.0);
            let off = (f64::from(hit.t) - exact).abs();
            // Nothing hits a triangle without area.
            normal == DVec3::ZERO || off.is_nan() || off > limit
        };
        let all: Vec<(&Ray, &Hit)> = rays.iter().zip(found).collect();
        let wrong: Vec<_> = all.par_iter().filter(|pair| off(pair)).collect();
        match wrong.first() {
            None => Ok(format!("{} distances are those of the triangles", thousands(rays.len() as u64))),
            Some((ray, hit)) => Err(format!(
                "{} of {} distances are off, the first {ray:?}: {hit:?}",
                wrong.len(),
                rays.len()
            )),
        }
    }

    fn same_hits(&self, rays: &[Ray], expected: &[Hit], found: &[Hit]) -> Result<String, String> {
        let differs = |i: &usize| !self.same(&rays[*i], &expected[*i], &found[*i]);
        let wrong: Vec<usize> = (0..rays.len()).into_par_iter().filter(differs).collect();
        match wrong.first() {
            None => Ok(format!(
                "{} primary rays and bounces of all views at the distances of Binary, by the kernels for both",
                thousands(rays.len() as u64)
            )),
            Some(&i) => Err(format!(
                "{} of {} rays differ from Binary, the first {:?}: {:?}, not {:?}",
                wrong.len(),
                rays.len(),
                rays[i],
                found[i],
                expected[i]
            )),
        }
    }
}

/// Hits found by testing every triangle, for some of the rays. They depend on no tree, so one answer serves all
/// trees and variants that are asked about the same rays.
#[derive(Default)]
struct Oracle {
    /// The rays that were asked about.
    rays: Vec<Ray>,
    /// Every so-many-th of them, and what it hits.
    hits: Vec<(usize, Hit)>,
}

impl Oracle {
    /// Traces every so-many-th of `rays`, so that tests of rays with triangles stay below `millions`.
    fn ask(&mut self, judge: &Judge<'_>, rays: &[Ray], millions: u64) {
        if bytemuck::cast_slice::<_, u8>(&self.rays) == bytemuck::cast_slice::<_, u8>(rays) {
            return;
        }
        let affordable = (millions * 1_000_000 / judge.triangles.len() as u64).max(1);
        let step = (rays.len() as u64).div_ceil(affordable).max(1) as usize;
        let chosen: Vec<usize> = (0..rays.len()).step_by(step).collect();
        let triangles = LeafTriangles::in_file_order(judge.test, judge.triangles);
        self.hits = chosen.par_iter().map(|&i| (i, cpu::brute_force(&triangles, &rays[i]))).collect();
        self.rays = rays.to_vec();
    }

    fn agrees(&self, judge: &Judge<'_>, rays: &[Ray], found: &[Hit]) -> Result<String, String> {
        let differs = |(i, hit): &&(usize, Hit)| !judge.same(&rays[*i], hit, &found[*i]);
        let wrong: Vec<&(usize, Hit)> = self.hits.iter().filter(differs).collect();
        match wrong.first() {
            None => Ok(format!("{} rays against all triangles", thousands(self.hits.len() as u64))),
            Some((i, hit)) => Err(format!(
                "{} of {} rays differ from brute force, the first {:?}: {:?}, not {hit:?}",
                wrong.len(),
                self.hits.len(),
                rays[*i],
                found[*i]
            )),
        }
    }
}
