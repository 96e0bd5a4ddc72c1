//! Builds trees over scenes, with any parameters, and prints what each phase and each kernel took and how
//! good the tree is: for tuning the builder.
//!
//! ```text
//! cargo run --release -p tracer --example build -- SCENE… [bits=16,21] [radius=8,16] [repeat=10] [kernels]
//! ```

use std::collections::BTreeMap;
use tracer::{
    builder::{BuildParams, BuildReport, Builder},
    gpu::{Gpu, Options},
    layout::binary::{Binary, BinaryNode},
    measure::tree::stats,
    scene::{SearchPath, load},
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut scenes = Vec::new();
    let mut lists = BTreeMap::from([("bits", vec![]), ("radius", vec![]), ("repeat", vec![10])]);
    let mut kernels = false;
    for argument in std::env::args().skip(1) {
        // A scene may have parameters of its own: `city:triangles=100000`.
        match argument.split_once('=') {
            Some((name, values)) if lists.contains_key(name) => {
                let list = lists.get_mut(name).expect("it is there");
                *list = values.split(',').map(str::parse).collect::<Result<Vec<u32>, _>>()?;
            }
            _ if argument == "kernels" => kernels = true,
            _ => scenes.push(argument),
        }
    }
    let defaults = BuildParams::default();
    let or_default = |name, default| match &lists[name][..] {
        [] => vec![default],
        some => some.to_vec(),
    };
    let gpu = Gpu::open(&Options::default())?;
    println!("{}", gpu.info());
    println!(
        "{:<24} {:>9} {:>4} {:>6} {:>7} {:>7} {:>7} {:>8} {:>9} {:>7}  {:>9} {:>5} {:>5} {:>8} {:>6}",
        "scene",
        "triangles",
        "bits",
        "radius",
        "morton",
        "sort",
        "ploc",
        "collapse",
        "rearrange",
        "total",
        "nodes",
        "depth",
        "steps",
        "SAH",
        "leaf"
    );
    for scene in &scenes {
        let triangles = load(scene, &SearchPath::new([]))?.positions;
        let count = triangles.len();
        let buffer = gpu.upload("triangles", &triangles)?;
        for &bits in &or_default("bits", defaults.morton.bits) {
            for &radius in &or_default("radius", defaults.ploc.radius) {
                let mut params = defaults.clone();
                params.morton.bits = bits;
                params.ploc.radius = radius;
                let builder = Builder::new(&gpu, &params)?;
                let workspace = builder.workspace(count)?;
                // The first build also compiles the kernels.
                let mut best: Option<BuildReport> = None;
                for round in 0..=lists["repeat"][0] {
                    let report = builder.build(&workspace, &buffer, count, false)?;
                    let total = |r: &BuildReport| r.milliseconds.total;
                    if round > 0 && best.as_ref().is_none_or(|b| total(&report) < total(b)) {
                        best = Some(report);
                    }
                }
                let best = best.ok_or("repeat is at least 1")?;
                let (s, t) = (best.summary, best.milliseconds);
                let nodes: Vec<BinaryNode> = workspace.nodes.read(0, s.nodes as usize)?;
                let tree = stats::<Binary>(&nodes, &params.collapse);
                println!(
                    "{scene:<24} {count:>9} {bits:>4} {radius:>6} {:>7.3} {:>7.3} {:>7.3} {:>8.3} {:>9.3} {:>7.3}  {:>9} {:>5} {:>5} {:>8.3} {:>6.2}",
                    t.morton,
                    t.sort,
                    t.ploc,
                    t.collapse,
                    t.rearrange,
                    t.total,
                    s.nodes,
                    s.depth,
                    format!("{}/{}", s.iterations, best.recorded),
                    tree.sah_cost,
                    tree.triangles_per_leaf
                );
                if kernels {
                    for span in &builder.build(&workspace, &buffer, count, true)?.timings.spans {
                        println!("    {:<28} {:>8.4}", span.path, span.milliseconds);
                    }
                }
            }
        }
    }
    Ok(())
}
