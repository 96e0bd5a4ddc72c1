//! Every variant of a tree leads to the same hits: over all scenes that come with the program, rays as path
//! tracing makes them are traced through each layout, and distances are held against the binary one's.

mod support;

use std::{env, path::PathBuf};
use support::{assert_silent, builder, gpu, on_any_tree, traversal};
use tracer::{
    builder::Widen,
    gpu::Pass,
    layout::Layout,
    path::{Camera, DeviceScene, Params, PathTracer},
    scene::{self as scenes, SceneError, SearchPath, built_in},
    traverse::{Buffers, Counting, Hit, Queue, Ray, Tree, Wave},
};

const SIZE: (u32, u32) = (48, 27);

/// Set, the test takes minutes and leaves no scene out.
const ALL_SCENES: &str = "BROADLEAF_ALL_SCENES";

/// Above so many, building takes too long for every day on a CPU driver.
const MOST_TRIANGLES: usize = 300_000;

/// Closest hits of rays, traced as one wavefront.
fn trace(tree: &Tree, wave: Wave, rays: &[Ray]) -> Vec<Hit> {
    let n = rays.len();
    let kernels = traversal(tree, Counting::Nothing);
    let ray_buffer = gpu().upload("rays", rays).unwrap();
    let hits = gpu().buffer("hits", 8 * n as u64).unwrap();
    let queue = gpu().upload("queue", &[Queue { count: n as u32, ..Queue::default() }]).unwrap();
    let buffers = Buffers {
        rays: ray_buffer.address(),
        hits: hits.address(),
        queue: queue.address(),
        counts: 0,
        visits: 0,
        utilization: 0,
    };
    let mut pass = Pass::new(gpu()).unwrap();
    kernels.record(&mut pass, "trace", wave, tree, &buffers, n);
    pass.submit().unwrap();
    kernels.check(0, &queue.read(0, 1).unwrap()[0]).unwrap();
    hits.read(0, n).unwrap()
}

#[test]
fn every_layout_gives_the_same_distances_in_every_scene() {
    let shared = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes");
    let search = SearchPath::new([shared]);
    let all = env::var_os(ALL_SCENES).is_some();
    let others = Layout::ALL[1..].iter().map(|&l| Widen::new(gpu(), &on_any_tree(l), l).unwrap());
    let others: Vec<Widen> = others.collect();
    let mut compared = 0;
    for name in built_in().iter().map(|b| b.name) {
        let scene = match scenes::load(name, &search) {
            Ok(scene) => scene,
            Err(SceneError::MissingFile { file, .. }) => {
                println!("SKIPPED: {name}: {file} is not there; set BROADLEAF_SCENES");
                continue;
            }
            Err(error) => panic!("{error}"),
        };
        let n = scene.positions.len();
        if n > MOST_TRIANGLES && !all {
            println!("SKIPPED: {name}: {n} triangles; set {ALL_SCENES}=1 for all scenes");
            continue;
        }
        let device = DeviceScene::upload(gpu(), &scene).unwrap();
        let workspace = builder().workspace(n).unwrap();
        let report = builder().build(&workspace, &device.positions, n, false).unwrap();
        let binary = workspace.wide.tree(&report.summary, device.extent);
        let tracer =
            PathTracer::new(gpu(), &device, SIZE, &Params { depth: 4, ..Params::default() }, false).unwrap();
        let mut waves = Vec::new();
        for view in [&scene.views[0], &scene.views[5]] {
            let camera = Camera::new(view, SIZE.0, SIZE.1);
            let kernels = traversal(&binary, Counting::Nothing);
            let keep = |wave| {
                waves.push(wave);
                true
            };
            tracer.wavefronts(kernels, &binary, &camera, 0, keep).unwrap();
        }
        let rays: usize = waves.iter().map(|w| w.rays.len()).sum();
        let found = waves.iter().flat_map(|w| &w.hits).filter(|h| h.triangle != Hit::MISS).count();
        assert!(found > 500, "{name}: {found} of {rays} rays hit");
        for other in &others {
            let to = other.workspace(n).unwrap();
            let report = other.build(&workspace, &to, &device.positions, n, None).unwrap();
            let tree = to.tree(&report.summary, device.extent);
            for wave in &waves {
                let hits = trace(&tree, Wave::at(wave.depth), &wave.rays);
                for ((ray, hit), want) in wave.rays.iter().zip(&hits).zip(&wave.hits) {
                    // Kernels of different layouts are compiled apart and may be rounded apart, by what single
                    // precision can tell about the scene's extent.
                    let off = (hit.t - want.t).abs();
                    let near = hit.t == want.t || off <= 1e-5 * want.t + 1e-6 * device.extent;
                    let what = format!("{name}, {:?}, depth {}", tree.structure, wave.depth);
                    assert!(near, "{what}: {ray:?}: {hit:?}, not {want:?}");
                }
            }
        }
        println!("{name}: {n} triangles, {rays} rays, {found} hits");
        compared += 1;
    }
    // Scenes that are made and not loaded are always there.
    assert!(compared >= 1);
    assert_silent();
}
