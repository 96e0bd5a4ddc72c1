//! Builds SBVH trees over scenes and prints how they compare with PLOC's: for tuning the builder.
//!
//! ```text
//! cargo run --release -p tracer --example sbvh -- SCENE… [alpha=1e-5] [object_bins=32] [spatial_bins=32]
//!     [sweep=64] [budget=2] [repeat=1] [alone]
//! ```
//!
//! The cost is that of the tree as it is, one reference a leaf, with c_t = c_i = 1; the time is the least of
//! `repeat` builds. `alone` leaves PLOC's tree out, which takes long to build on the CPU.

use std::time::Instant;
use tracer::{
    bvh2::{Bvh2, Bvh2Node},
    morton::{self, MortonParams},
    ploc::{self, PlocParams},
    sbvh::{self, SbvhParams},
    scene::{SearchPath, load},
    sort,
};

/// Expected cost of a ray that meets the root: areas of all nodes, by the root's.
fn cost(tree: &Bvh2) -> f64 {
    let area = |node: &Bvh2Node| {
        let e: [f64; 3] = std::array::from_fn(|i| f64::from(node.hi[i]) - f64::from(node.lo[i]));
        e[0] * e[1] + e[1] * e[2] + e[2] * e[0]
    };
    tree.nodes.iter().map(area).sum::<f64>() / area(&tree.nodes[tree.nodes.len() - 1])
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut scenes = Vec::new();
    let mut params = SbvhParams::default();
    let (mut repeat, mut with_ploc) = (1, true);
    for argument in std::env::args().skip(1) {
        match argument.split_once('=') {
            Some(("alpha", value)) => params.alpha = value.parse()?,
            Some(("object_bins", value)) => params.object_bins = value.parse()?,
            Some(("spatial_bins", value)) => params.spatial_bins = value.parse()?,
            Some(("sweep", value)) => params.sweep = value.parse()?,
            Some(("budget", value)) => params.budget = value.parse()?,
            Some(("repeat", value)) => repeat = value.parse()?,
            _ if argument == "alone" => with_ploc = false,
            // A scene may have parameters of its own: `city:triangles=100000`.
            _ => scenes.push(argument),
        }
    }
    println!(
        "{:<24} {:>9} {:>10} {:>6} {:>6} {:>9} {:>9} {:>6} {:>8} {:>7}",
        "scene", "triangles", "references", "factor", "levels", "PLOC", "SBVH", "ratio", "seconds", "threads"
    );
    for scene in &scenes {
        let triangles = load(scene, &SearchPath::new([]))?.positions;
        let ploc = with_ploc.then(|| {
            let bounds = morton::cpu::bounds(&triangles);
            let codes = morton::cpu::codes(&triangles, &bounds, &MortonParams::default());
            let order = sort::cpu::order(&codes);
            cost(&ploc::cpu::build(&triangles, &order, bounds.scale(), &PlocParams::default()))
        });
        let mut best: Option<(f64, Bvh2)> = None;
        for _ in 0..repeat {
            let started = Instant::now();
            let tree = sbvh::build(&triangles, &params);
            let seconds = started.elapsed().as_secs_f64();
            if best.as_ref().is_none_or(|b| seconds < b.0) {
                best = Some((seconds, tree));
            }
        }
        let (seconds, tree) = best.ok_or("repeat is at least 1")?;
        let sbvh = cost(&tree);
        println!(
            "{scene:<24} {:>9} {:>10} {:>6.3} {:>6} {:>9.3} {sbvh:>9.3} {:>6.3} {seconds:>8.3} {:>7}",
            triangles.len(),
            tree.leaves,
            tree.leaves as f64 / triangles.len() as f64,
            tree.levels.len(),
            ploc.unwrap_or(f64::NAN),
            sbvh / ploc.unwrap_or(f64::NAN),
            rayon::current_num_threads()
        );
    }
    Ok(())
}
