use crate::{Device, Error, Timestamp, Tool, replace};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::Path;

/// The number of the schema of [`Roofline`] that this version writes, and the newest that it reads.
pub const ROOFLINE_SCHEMA: u32 = 1;

/// What a device can do at best, as `runner roofline` has measured it: the roofs below which every traversal stays
/// (after Williams, Waterman, Patterson 2009).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Roofline {
    /// Number of the schema; see [`ROOFLINE_SCHEMA`]. Its name tells this file from a benchmark record.
    pub roofline_schema: u32,
    /// The program that measured.
    pub tool: Tool,
    /// When it had.
    pub measured: Timestamp,
    /// The device.
    pub device: Device,
    /// Its multiprocessors; absent where the driver does not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub multiprocessors: Option<u32>,
    /// Clock of the multiprocessors right after arithmetic was measured, in MHz; absent where nobody tells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sm_clock_mhz: Option<u32>,
    /// Bytes a second that are read and written, both counted, while memory is copied.
    pub copy_bytes_per_second: f64,
    /// How fast nodes are read at random.
    pub node_reads: Vec<NodeReads>,
    /// How fast the device computes.
    pub rates: Vec<Rate>,
}

/// How fast nodes of one size are read at random from a table of one size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NodeReads {
    /// Bytes of the table.
    pub table_bytes: u64,
    /// Bytes from one node to the next, all of which are read.
    pub node_bytes: u32,
    /// Whether the lanes of a subgroup read their nodes together, in pieces of 16 bytes, or each its own.
    pub together: bool,
    /// Nodes a second.
    pub nodes_per_second: f64,
}

/// How fast one sort of arithmetic is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Rate {
    /// Which.
    pub operation: Operation,
    /// Operations a second.
    pub per_second: f64,
}

/// A sort of arithmetic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Operation {
    /// A fused multiply-add of 32-bit floats.
    FusedMultiplyAdd,
    /// A minimum or maximum of two 32-bit floats.
    MinMax,
    /// A minimum or maximum of three 32-bit integers.
    MinMaxOfThree,
    /// An addition of 32-bit integers.
    Add,
    /// A bitwise function of three 32-bit integers.
    Logic,
    /// A byte of a word to a 32-bit float, with an addition of it.
    ByteToFloat,
    /// One axis of a ray's test against a box: two fused multiply-adds, a minimum and a maximum.
    SlabAxis,
}

impl fmt::Display for Operation {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.pad(match self {
            Operation::FusedMultiplyAdd => "FP32 fused multiply-add",
            Operation::MinMax => "FP32 min or max",
            Operation::MinMaxOfThree => "integer min or max of three",
            Operation::Add => "integer add",
            Operation::Logic => "integer logic of three",
            Operation::ByteToFloat => "byte to float",
            Operation::SlabAxis => "slab axis (2 FMA, min, max)",
        })
    }
}

impl Roofline {
    /// Operations a second.
    pub fn rate(&self, operation: Operation) -> Option<f64> {
        self.rates.iter().find(|rate| rate.operation == operation).map(|rate| rate.per_second)
    }

    /// Operations a clock of each multiprocessor; nothing where their number or clock is not known.
    pub fn per_clock(&self, per_second: f64) -> Option<f64> {
        let clocks = f64::from(self.sm_clock_mhz?) * 1e6 * f64::from(self.multiprocessors?);
        (clocks > 0.0).then(|| per_second / clocks)
    }

    /// Nodes of so many bytes that are read a second from a table of so many. Between sizes that were measured, the time
    /// of a node follows its bytes and the logarithm of the table's; beyond them it is that of the nearest table, and in
    /// proportion to a node's bytes where it is larger than any.
    pub fn nodes_per_second(&self, node_bytes: f64, table_bytes: f64, together: bool) -> Option<f64> {
        let of: Vec<&NodeReads> = self.node_reads.iter().filter(|reads| reads.together == together).collect();
        let mut tables: Vec<u64> = of.iter().map(|reads| reads.table_bytes).collect();
        tables.sort_unstable();
        tables.dedup();
        let seconds_at = |table: u64| -> Option<f64> {
            let mut nodes: Vec<(f64, f64)> = (of.iter())
                .filter(|reads| reads.table_bytes == table && reads.nodes_per_second > 0.0)
                .map(|reads| (f64::from(reads.node_bytes), 1.0 / reads.nodes_per_second))
                .collect();
            nodes.sort_by(|a, b| a.0.total_cmp(&b.0));
            let &(largest, seconds) = nodes.last()?;
            // A smaller node than any is read no faster: that much nobody has measured.
            Some(if node_bytes > largest {
                seconds * node_bytes / largest
            } else {
                between(&nodes, node_bytes)
            })
        };
        let mut points = Vec::new();
        for table in tables {
            points.push(((table.max(1) as f64).log2(), seconds_at(table)?));
        }
        (!points.is_empty()).then(|| 1.0 / between(&points, table_bytes.max(1.0).log2()))
    }

    /// Reads what `runner roofline` wrote.
    ///
    /// # Errors
    /// The file cannot be read, holds something else, or was written by a newer version.
    pub fn read(path: impl AsRef<Path>) -> Result<Roofline, Error> {
        let path = path.as_ref();
        let text = std::fs::read(path).map_err(|source| Error::Read { path: path.into(), source })?;
        let roofline: Roofline = serde_json::from_slice(&text)
            .map_err(|source| Error::NoRoofline { path: path.into(), source })?;
        match roofline.roofline_schema {
            1..=ROOFLINE_SCHEMA => Ok(roofline),
            found => Err(Error::NewerRoofline { path: path.into(), found }),
        }
    }

    /// Writes the file whole or not at all, as [`Record::write_atomic`](crate::Record::write_atomic) does.
    ///
    /// # Errors
    /// It cannot be written; what was there before is still there.
    pub fn write_atomic(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = path.as_ref();
        replace(path, |out| {
            serde_json::to_writer_pretty(&mut *out, self)?;
            out.write_all(b"\n")
        })
        .map_err(|source| Error::Write { path: path.into(), source })
    }
}

/// The value at a place between those of the nearest two; that of the first or last one beyond them. At least one, in
/// the order of places.
fn between(points: &[(f64, f64)], at: f64) -> f64 {
    let upper = points.partition_point(|(place, _)| *place < at);
    match (upper.checked_sub(1).map(|lower| points[lower]), points.get(upper)) {
        (Some((from, low)), Some(&(to, high))) => low + (high - low) * (at - from) / (to - from),
        (Some((_, only)), None) | (None, Some(&(_, only))) => only,
        (None, None) => f64::NAN,
    }
}

/// A roofline with simple numbers, for tests and documentation: copies 1 TB a second, reads 10 billion nodes of 64 bytes
/// a second from 4 MiB and half as many from 64 MiB, twice as many together, and does 1000 billion of each operation.
pub fn example_roofline() -> Roofline {
    let record = crate::example();
    let mut node_reads = Vec::new();
    for (mib, share) in [(4u64, 1.0), (64, 0.5)] {
        for (node_bytes, rate) in [(48, 12e9), (64, 10e9), (80, 8e9)] {
            for (together, times) in [(false, 1.0), (true, 2.0)] {
                let nodes_per_second = rate * share * times;
                node_reads.push(NodeReads { table_bytes: mib << 20, node_bytes, together, nodes_per_second });
            }
        }
    }
    let all = [
        Operation::FusedMultiplyAdd,
        Operation::MinMax,
        Operation::MinMaxOfThree,
        Operation::Add,
        Operation::Logic,
        Operation::ByteToFloat,
        Operation::SlabAxis,
    ];
    Roofline {
        roofline_schema: ROOFLINE_SCHEMA,
        tool: record.tool,
        measured: record.started,
        device: record.device,
        multiprocessors: Some(60),
        sm_clock_mhz: Some(2000),
        copy_bytes_per_second: 1e12,
        node_reads,
        rates: all.map(|operation| Rate { operation, per_second: 1e12 }).to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_measured_is_told_and_what_lies_between_follows() {
        let roofline = example_roofline();
        let mib = |mib: f64| mib * 1048576.0;
        let of = |bytes, table, together| roofline.nodes_per_second(bytes, mib(table), together).unwrap();
        let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-9, "{a} and {b}");
        near(of(64.0, 4.0, false), 10e9);
        near(of(64.0, 4.0, true), 20e9);
        near(of(64.0, 64.0, false), 5e9);
        // Half way from 4 to 64 MiB, in doublings, are 16: half way from 0.1 ns to 0.2 ns.
        near(of(64.0, 16.0, false), 1e9 / 0.15);
        near(of(72.0, 4.0, false), 2.0 / (1.0 / 10e9 + 1.0 / 8e9));
        // Beyond what was measured.
        near(of(64.0, 1.0, false), 10e9);
        near(of(64.0, 1000.0, false), 5e9);
        near(of(32.0, 4.0, false), 12e9);
        near(of(160.0, 4.0, false), 4e9);
        near(roofline.per_clock(60.0 * 2e9 * 128.0).unwrap(), 128.0);
        assert_eq!(Roofline { sm_clock_mhz: None, ..roofline.clone() }.per_clock(1.0), None);
        assert_eq!(Roofline { node_reads: vec![], ..roofline }.nodes_per_second(64.0, 1.0, true), None);
    }

    #[test]
    fn a_file_is_read_again_and_others_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/roofline.json");
        let roofline = example_roofline();
        roofline.write_atomic(&path).unwrap();
        assert_eq!(Roofline::read(&path).unwrap(), roofline);
        Roofline { roofline_schema: 7, ..roofline }.write_atomic(&path).unwrap();
        assert!(Roofline::read(&path).unwrap_err().to_string().contains("schema 7"));
        crate::example().write_atomic(&path).unwrap();
        let error = Roofline::read(&path).unwrap_err().to_string();
        assert!(error.contains("runner roofline"), "{error}");
    }
}
