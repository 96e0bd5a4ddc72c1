//! Makes a record of the results that Cezner's thesis (2025) prints in its tables 13 to 17.
//!
//! ```sh
//! cargo run --release -p compare --example import_cezner -- cezner2025_tables13-17.csv reports/reference/cezner2025.json
//! ```
//!
//! The thesis prints means over 8 views and 15 samples, and no sample. So each row becomes one point with one view
//! and one sample, whose rays and milliseconds give the printed rates. What a record must have and the thesis does
//! not tell is 0 or empty; `reports/reference/README.md` lists it.

mod environment;
mod point;
mod printed;
mod row;

use anyhow::{Context, bail};
use row::Row;
use std::path::Path;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [table, output] = &arguments[..] else { bail!("usage: import_cezner TABLES.csv RECORD.json") };
    let mut reader = csv::Reader::from_path(table).with_context(|| format!("cannot read {table}"))?;
    let rows: Vec<Row> =
        reader.deserialize().collect::<Result<_, _>>().with_context(|| format!("cannot read {table}"))?;
    let mut record = environment::empty();
    for (index, scene) in rows.chunk_by(|a, b| a.scene == b.scene).enumerate() {
        let points = point::points(13 + index as u32, scene);
        record.results.extend(points.with_context(|| format!("scene {}", scene[0].scene))?);
    }
    if let Err(problems) = record.validate() {
        bail!("the record does not make sense: {}", problems[0]);
    }
    record.write_atomic(Path::new(output))?;
    println!("{}: {} points", output, record.results.len());
    Ok(())
}
