//! Builds trees over scenes, with any parameters, and prints what each phase and each kernel took and how
//! good the tree is: for tuning the builder.
//!
//! ```text
//! cargo run --release -p tracer --example build -- SCENE… [method=ploc,hploc] [layout=binary,wide4] [bits=16,21]
//!     [radius=8,16] [window=32] [keys=12] [form=levels] [repeat=10] [kernels]
//! ```

use std::collections::BTreeMap;
use tracer::{
    builder::{BuildParams, BuildReport, Builder, Method},
    contract::Form,
    gpu::{Gpu, Options},
    hploc::HplocParams,
    layout::Layout,
    measure::tree::stats,
    scene::{SearchPath, load},
    with_layout,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut scenes = Vec::new();
    let mut lists = BTreeMap::from([
        ("bits", vec![]),
        ("radius", vec![]),
        ("window", vec![]),
        ("keys", vec![12]),
        ("repeat", vec![10]),
    ]);
    let mut layouts = vec![Layout::Binary];
    let mut methods = vec![Method::Ploc];
    let mut form = Form::Auto;
    let mut kernels = false;
    for argument in std::env::args().skip(1) {
        // A scene may have parameters of its own: `city:triangles=100000`.
        match argument.split_once('=') {
            Some(("layout", names)) => {
                let find = |name| {
                    let found = Layout::ALL.iter().find(|l| l.symbol() == name);
                    found.copied().ok_or_else(|| {
                        let there: Vec<_> = Layout::ALL.iter().map(|l| l.symbol()).collect();
                        format!("no layout is called {name}; there are {}", there.join(", "))
                    })
                };
                layouts = names.split(',').map(find).collect::<Result<_, _>>()?;
            }
            Some(("method", names)) => {
                let find = |name| match name {
                    "ploc" => Ok(Method::Ploc),
                    "hploc" => Ok(Method::Hploc),
                    _ => Err(format!("trees are made on the device by ploc or hploc, not {name}")),
                };
                methods = names.split(',').map(find).collect::<Result<_, _>>()?;
            }
            Some(("form", "levels")) => form = Form::Levels,
            Some(("form", "handover")) => form = Form::Handover,
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
    let repeat = lists["repeat"][0];
    let gpu = Gpu::open(&Options::default())?;
    println!("{}", gpu.info());
    println!(
        "{:<24} {:>9} {:<6} {:<10} {:>4} {:>6} {:>6} {:>7} {:>7} {:>7} {:>8} {:>8} {:>7} {:>7}  {:>9} {:>5} {:>5} {:>8} {:>6} {:>6}",
        "scene",
        "triangles",
        "method",
        "layout",
        "bits",
        "radius",
        "window",
        "morton",
        "sort",
        "ploc",
        "collapse",
        "contract",
        "layout",
        "total",
        "nodes",
        "depth",
        "steps",
        "SAH",
        "leaf",
        "node"
    );
    for scene in &scenes {
        let triangles = load(scene, &SearchPath::new([]))?.positions;
        let count = triangles.len();
        let buffer = gpu.upload("triangles", &triangles)?;
        let (bits, radii, windows) = (
            or_default("bits", defaults.morton.bits),
            or_default("radius", defaults.ploc.radius),
            or_default("window", defaults.hploc.window),
        );
        let mut all = Vec::new();
        for &method in &methods {
            for &layout in &layouts {
                for &bits in &bits {
                    for &radius in &radii {
                        all.extend(windows.iter().map(|&window| (method, layout, bits, radius, window)));
                    }
                }
            }
        }
        for (method, layout, bits, radius, window) in all {
            let mut params = BuildParams { method, ..defaults.clone() };
            params.morton.bits = bits;
            params.ploc.radius = radius;
            params.hploc = HplocParams { radius, window };
            params.sort.keys = lists["keys"][0];
            params.contract.form = form;
            let builder = Builder::new(&gpu, &params, layout)?;
            let workspace = builder.workspace(count)?;
            // The first build also compiles the kernels.
            let mut best: Option<BuildReport> = None;
            for round in 0..=repeat {
                let report = builder.build(&workspace, &buffer, count, false)?;
                let total = |r: &BuildReport| r.milliseconds.total;
                if round > 0 && best.as_ref().is_none_or(|b| total(&report) < total(b)) {
                    best = Some(report);
                }
            }
            let best = best.ok_or("repeat is at least 1")?;
            let (s, t) = (best.summary, best.milliseconds);
            let tree = with_layout!(layout, L => {
                stats::<L>(
                    &workspace.wide.read_nodes::<L>(s.nodes as usize)?,
                    layout.stride(&params.layout),
                    &params.collapse,
                )
            });
            println!(
                "{scene:<24} {count:>9} {:<6} {:<10} {bits:>4} {radius:>6} {window:>6} {:>7.3} {:>7.3} {:>7.3} {:>8.3} {:>8.3} {:>7.3} {:>7.3}  {:>9} {:>5} {:>5} {:>8.3} {:>6.2} {:>6.2}",
                format!("{:?}", params.method).to_lowercase(),
                layout.symbol(),
                t.morton,
                t.sort,
                t.ploc + t.hploc,
                t.collapse,
                t.contract,
                t.layout,
                t.total,
                s.nodes,
                s.depth,
                format!("{}/{}", s.iterations, best.recorded),
                tree.sah_cost,
                tree.triangles_per_leaf,
                tree.children_per_node
            );
            if kernels {
                for span in &builder.build(&workspace, &buffer, count, true)?.timings.spans {
                    println!("    {:<28} {:>8.4}", span.path, span.milliseconds);
                }
            }
        }
    }
    Ok(())
}
