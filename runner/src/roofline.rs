//! `runner roofline`: what the device can do at best, as tables and as a file for `compare`.

use crate::{
    args::{self, Global},
    commands::print,
    describe, host, measure,
    progress::{bar, remark},
    session::Session,
    table::{self, number, table},
};
use anyhow::Context;
use record::{NodeReads, Operation, ROOFLINE_SCHEMA, Rate, Roofline, Timestamp};
use std::{fmt::Write, time::Instant};
use tracer::roofline::{self, Plan};

/// Measures the device that the command line names.
///
/// # Errors
/// The device failed, came to other results than the CPU, or the file cannot be written.
pub fn roofline(global: &Global, arguments: &args::Roofline) -> anyhow::Result<()> {
    let session = Session::open(global)?;
    let telemetry = measure::telemetry(&session);
    let info = session.gpu.info();
    let plan = Plan::of(info, arguments.quick);
    let steps = 1 + plan.tables.len() * plan.nodes.len() + roofline::Operation::ALL.len();
    let bar = bar(steps as u64, session.quiet);
    let started = Instant::now();
    let roofs = roofline::measure(&session.gpu, &plan, |step| {
        bar.set_message(step.to_owned());
        bar.inc(1);
    })?;
    // Arithmetic came last: its clock is not lower yet.
    let clock = telemetry.moment().sm_clock_mhz;
    bar.finish_and_clear();
    let reads = roofs.reads.iter().map(|reads| NodeReads {
        table_bytes: reads.table_bytes,
        node_bytes: reads.node_bytes,
        together: reads.together,
        nodes_per_second: reads.per_second,
    });
    let rates = roofs.rates.iter();
    let measured = Roofline {
        roofline_schema: ROOFLINE_SCHEMA,
        tool: host::tool(),
        measured: Timestamp::now(),
        device: describe::device(info),
        multiprocessors: Some(info.multiprocessors).filter(|&count| count > 0),
        sm_clock_mhz: clock,
        copy_bytes_per_second: roofs.copy,
        node_reads: reads.collect(),
        rates: rates.map(|&(of, per_second)| Rate { operation: operation(of), per_second }).collect(),
    };
    if let Some(path) = &arguments.output {
        measured.write_atomic(path).context("the roofline cannot be written")?;
    }
    print(&if arguments.json { serde_json::to_string_pretty(&measured)? } else { text(&measured) })?;
    remark(session.quiet, format_args!("{:.1} s", started.elapsed().as_secs_f64()));
    if let Some(path) = &arguments.output {
        remark(session.quiet, format_args!("roofline: {}", path.display()));
    }
    session.finish()
}

/// In the file's words.
fn operation(of: roofline::Operation) -> Operation {
    match of {
        roofline::Operation::FusedMultiplyAdd => Operation::FusedMultiplyAdd,
        roofline::Operation::MinMax => Operation::MinMax,
        roofline::Operation::MinMaxOfThree => Operation::MinMaxOfThree,
        roofline::Operation::Add => Operation::Add,
        roofline::Operation::Logic => Operation::Logic,
        roofline::Operation::ByteToFloat => Operation::ByteToFloat,
        roofline::Operation::SlabAxis => Operation::SlabAxis,
    }
}

/// The tables.
fn text(measured: &Roofline) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "{}", measured.device.name);
    let copied = number(Some(measured.copy_bytes_per_second / 1e9));
    let _ = writeln!(text, "memory copy: {copied} GB/s, read and written\n");

    let mut sizes: Vec<u32> = measured.node_reads.iter().map(|reads| reads.node_bytes).collect();
    sizes.sort_unstable();
    sizes.dedup();
    let heads: Vec<String> =
        sizes.iter().flat_map(|size| ["alone", "together"].map(|how| format!("{size} B\n{how}"))).collect();
    let mut rows =
        table(&["table MiB"].into_iter().chain(heads.iter().map(String::as_str)).collect::<Vec<_>>());
    let mut tables: Vec<u64> = measured.node_reads.iter().map(|reads| reads.table_bytes).collect();
    tables.dedup();
    for &of in &tables {
        let mut row = vec![(of >> 20).to_string()];
        for &size in &sizes {
            for together in [false, true] {
                let is = |reads: &&NodeReads| {
                    (reads.table_bytes, reads.node_bytes, reads.together) == (of, size, together)
                };
                let found = measured.node_reads.iter().find(is);
                row.push(number(found.map(|reads| reads.nodes_per_second / 1e9)));
            }
        }
        rows.add_row(row);
    }
    table::align(&mut rows, &[]);
    let _ = writeln!(text, "Random node reads, billions a second\n{}\n", table::shown(&rows));

    let per_clock = measured.per_clock(1.0).is_some();
    let mut heads = vec!["arithmetic", "billions a second"];
    if per_clock {
        heads.push("a clock and multiprocessor");
    }
    let mut rows = table(&heads);
    for rate in &measured.rates {
        let mut row = vec![rate.operation.to_string(), number(Some(rate.per_second / 1e9))];
        if per_clock {
            row.push(number(measured.per_clock(rate.per_second)));
        }
        rows.add_row(row);
    }
    table::align(&mut rows, &[0]);
    let _ = write!(text, "{}\n\n", table::shown(&rows));
    text += "alone: a lane reads its node by itself; together: the lanes of a subgroup read the nodes of all, neighbours\n\
             neighbouring pieces of 16 bytes. byte to float: with an addition of each. slab axis: a third of a test of a\n\
             ray against a box.";
    match (measured.multiprocessors, measured.sm_clock_mhz) {
        (Some(count), Some(mhz)) => {
            let _ = write!(text, " {count} multiprocessors at {mhz} MHz.");
        }
        _ => {
            text +=
                " The number of multiprocessors or their clock is not told, so there is nothing by the clock."
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_tell_units_and_fit_a_terminal() {
        let text = text(&record::example_roofline());
        for line in text.lines() {
            assert!(line.chars().count() <= 120, "{line}");
        }
        for words in [
            "GB/s",
            "billions a second",
            "a clock and multiprocessor",
            "64 B",
            "60 multiprocessors at 2000 MHz",
        ] {
            assert!(text.contains(words), "{words} in\n{text}");
        }
        // 1000 billion of each, by 60 multiprocessors at 2 GHz.
        let row = text.lines().find(|line| line.starts_with("byte to float")).unwrap();
        assert!(row.contains("1000") && row.ends_with("8.333"), "{row}");
        let unknown = Roofline { multiprocessors: None, ..record::example_roofline() };
        assert!(!super::text(&unknown).contains("a clock and multiprocessor"));
    }
}
