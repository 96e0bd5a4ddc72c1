//! Holds the ray-triangle tests against exact arithmetic and prints a table: how often each is wrong about a ray, and
//! how far its distances are off. What is measured are the twins of the kernels on the CPU.
//!
//! ```text
//! cargo run --release -p tracer --example accuracy -- [rays=1000000]
//! ```

mod exact;
mod inputs;
mod tally;

use inputs::{Inputs, Kind};
use rayon::prelude::*;
use tally::Tally;
use tracer::traverse::TriangleTest;

/// Rays of one seed.
const SHARD: u64 = 10_000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut rays = 1_000_000;
    for argument in std::env::args().skip(1) {
        match argument.split_once('=') {
            Some(("rays", number)) => rays = number.parse::<u64>()?,
            _ => return Err(format!("{argument}: there is only rays=NUMBER").into()),
        }
    }
    println!(
        "| rays and triangles | test | false misses | false hits | slips | outside the box | error of t, median | largest |"
    );
    println!("|---|---|---:|---:|---:|---:|---:|---:|");
    for kind in Kind::ALL {
        for (test, mut tally) in TriangleTest::ALL.into_iter().zip(measure(kind, rays)) {
            let name = serde_json::to_value(test)?;
            let slips = match kind {
                Kind::MeshEdges | Kind::MeshCorners | Kind::FarMeshEdges => rate(tally.slips, tally.met),
                _ => "".into(),
            };
            let (median, largest) = tally.error().map_or_else(Default::default, |(median, largest)| {
                (format!("{median:.1e}"), format!("{largest:.1e}"))
            });
            println!(
                "| {} | `{}` | {} | {} | {slips} | {} | {median} | {largest} |",
                kind.name(),
                name.as_str().unwrap_or_default(),
                rate(tally.false_misses, tally.inside),
                rate(tally.false_hits, tally.outside),
                rate(tally.false_outside + tally.true_outside, tally.hits),
            );
        }
    }
    Ok(())
}

/// What each test says of the same rays.
fn measure(kind: Kind, rays: u64) -> [Tally; TriangleTest::ALL.len()] {
    (0..rays.div_ceil(SHARD))
        .into_par_iter()
        .map(|shard| {
            let mut inputs = Inputs::new(shard);
            let mut tallies: [Tally; TriangleTest::ALL.len()] = Default::default();
            for _ in 0..SHARD.min(rays - shard * SHARD) {
                let case = inputs.case(kind);
                for (test, tally) in TriangleTest::ALL.into_iter().zip(&mut tallies) {
                    tally.add(test, &case);
                }
            }
            tallies
        })
        .reduce(Default::default, |a, b| {
            let mut b = b.into_iter();
            a.map(|tally| tally.merge(b.next().unwrap_or_default()))
        })
}

/// So many of a million, or nothing where there are none it could have been.
fn rate(of: u64, all: u64) -> String {
    if all == 0 {
        return String::new();
    }
    let million = 1e6 * of as f64 / all as f64;
    match of {
        0 => "0".into(),
        _ if million < 10.0 => format!("{million:.1}"),
        _ => format!("{million:.0}"),
    }
}
