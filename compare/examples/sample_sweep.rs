//! Makes the record of a sweep that nobody measured, from which every table can be made: `scripts/test-latex` does.
//!
//! ```sh
//! cargo run -p compare --example sample_sweep -- sweep.json
//! ```
//!
//! Rates follow a made-up rule. One scene's name has all letters that mean something to LaTeX, and some that it does
//! not know.

use anyhow::{Context, bail};
use record::{Launch, Point, Record, Sample, Value};
use std::path::Path;

const SCENES: [&str; 2] = ["plain", r#"odd_{50%} & $x$ #1 ^~\ <ě, ą, 日> | 'a' "b" `c` *d* [e] --"#];

const VARIANTS: [&str; 7] =
    ["Binary", "Wide4", "Wide4 CBTC", "Wide4 Quantized", "Wide4 Quantized CBTC", "Wide8", "Wide8 Slang"];

const SIZES: [u32; 9] = [2, 4, 8, 12, 16, 20, 24, 28, 32];

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [output] = &arguments[..] else { bail!("usage: sample_sweep RECORD.json") };
    let mut record = record::example();
    record.sweep = None;
    record.references.clear();
    record.parameters.set("trace.kernels", "separate");
    record.results = points(&record)?;
    if let Err(problems) = record.validate() {
        bail!("the record does not make sense: {}", problems[0]);
    }
    record.write_atomic(Path::new(output))?;
    Ok(())
}

/// Points with each size of workgroup, with each traversal cost, and with a single kernel.
fn points(record: &Record) -> anyhow::Result<Vec<Point>> {
    let sample = record.results.first().context("the example has no point")?;
    let mut points = Vec::new();
    for scene in SCENES {
        for (at, variant) in VARIANTS.into_iter().enumerate() {
            let mut add = |rate: f64, parameters: &[(&str, Value)], subgroups: u32| {
                let mut point = sample.clone();
                point.scene.name = scene.into();
                point.variant = variant.into();
                for (name, value) in parameters {
                    point.parameters.set(*name, value.clone());
                }
                for kernel in &mut point.kernels {
                    kernel.registers = Some(40 + 8 * at as u32);
                    kernel.workgroup_size = 32 * subgroups;
                }
                let launch = |mrps: f64| Launch { rays: 1_000_000, milliseconds: 1e3 / mrps };
                let depths = vec![launch(1000.0 * rate), launch(250.0 * rate)];
                point.views[0].samples = vec![Sample { depths, ..Sample::default() }];
                points.push(point);
            };
            let own = 1.0 + at as f64 / 10.0;
            for size in SIZES {
                let apart = f64::from(size.abs_diff(4 * (1 + at as u32))) / 100.0;
                let axes = ["trace.primary_subgroups", "trace.secondary_subgroups"];
                add(own * (1.0 - apart), &axes.map(|axis| (axis, size.into())), size);
            }
            for cost in [1.0, 3.0, 4.0, 5.0, 6.0] {
                add(own * (1.0 - cost / 50.0), &[("collapse.c_t", cost.into())], 8);
            }
            add(own * 0.8, &[("trace.kernels", "single".into())], 8);
        }
    }
    Ok(points)
}
