//! What the traversal kernels take from a multiprocessor (thesis 5.1): tables for people, JSON, the record.

use crate::{
    args::{Global, Tuning},
    commands::print,
    params::Params,
    session::Session,
    table::{self, table, thousands},
    variant::Variant,
};
use anyhow::bail;
use comfy_table::Table;
use serde::Serialize;
use tracer::{
    gpu::{DeviceInfo, Kernel, Limit, MultiprocessorLimits, Resources, Statistic, UnknownLimits},
    traverse::{Counting, Traversal, Tree, Wave},
};

/// The kernels of a variant, and what each is launched for.
const PURPOSES: [(Wave, &str); 2] = [(Wave::Primary, "primary"), (Wave::Secondary, "secondary")];

/// The kernels that traced a point's rays, for the record; none where the driver did.
pub fn recorded(traversal: &Traversal) -> Vec<record::Kernel> {
    let kernel = |&(wave, purpose)| Some(recorded_as(traversal.kernel(wave)?, purpose));
    PURPOSES.iter().filter_map(kernel).collect()
}

/// One kernel for the record.
pub fn recorded_as(kernel: &Kernel, purpose: &str) -> record::Kernel {
    of_record(kernel.name(), purpose, &kernel.resources())
}

fn of_record(name: &str, purpose: &str, takes: &Resources) -> record::Kernel {
    record::Kernel {
        name: name.into(),
        purpose: purpose.into(),
        workgroup_size: takes.workgroup_size,
        subgroup_size: takes.subgroup_size,
        registers: takes.registers,
        local_bytes: takes.local_bytes,
        shared_bytes: takes.shared_bytes,
        spills: takes.spills,
        code_bytes: takes.code_bytes,
        occupancy: takes.occupancy.map(|o| o.share()),
        limited_by: takes.occupancy.map(|o| match o.limited_by {
            Limit::Subgroups => record::OccupancyLimit::Subgroups,
            Limit::Workgroups => record::OccupancyLimit::Workgroups,
            Limit::Registers => record::OccupancyLimit::Registers,
            Limit::SharedMemory => record::OccupancyLimit::SharedMemory,
        }),
    }
}

/// `runner resources`.
pub fn resources(global: &Global, variants: &[String], tuning: &Tuning, json: bool) -> anyhow::Result<()> {
    let session = Session::open(global)?;
    let info = session.gpu.info();
    let mut report = Report::new(info);
    // Those that go by view are traced by the same kernels.
    for variant in Variant::select(variants)?.into_iter().filter(|v| !v.by_view) {
        // What the driver traces with it keeps to itself.
        if variant.is_driver() {
            continue;
        }
        let params = Params::with(variant, &tuning.set)?;
        let no_tree = Tree {
            nodes: 0,
            triangles: 0,
            indices: 0,
            test: params.triangle.test,
            structure: variant.structure,
            listed: 0,
            stride: variant.layout().map_or(0, |layout| layout.stride(&params.layout)),
            stack: 0,
            extent: 0.0,
        };
        let traversal = session.traversal(&no_tree, variant, &params, Counting::Nothing)?;
        for (wave, purpose) in PURPOSES {
            let Some(kernel) = traversal.kernel(wave) else { continue };
            report.kernels.push(Row {
                variant: variant.to_string(),
                rays: purpose,
                kernel: kernel.name(),
                takes: kernel.resources(),
                statistics: kernel.statistics(),
            });
        }
    }
    if report.kernels.is_empty() {
        bail!("the driver does not tell what its own ray tracing takes: choose another --variant");
    }
    print(&if json { serde_json::to_string_pretty(&report)? } else { report.text() })?;
    session.finish()
}

/// Everything that is known.
#[derive(Serialize)]
struct Report {
    device: String,
    /// How many the device has; 0 where the driver does not tell.
    multiprocessors: u32,
    multiprocessor: Option<MultiprocessorLimits>,
    /// Why something is not known.
    unknown: Option<String>,
    kernels: Vec<Row>,
}

/// One kernel of one variant.
#[derive(Serialize)]
struct Row {
    variant: String,
    rays: &'static str,
    kernel: &'static str,
    #[serde(flatten)]
    takes: Resources,
    /// All that the driver says, under its own names.
    statistics: Vec<Statistic>,
}

impl Report {
    fn new(info: &DeviceInfo) -> Self {
        let limits = MultiprocessorLimits::of(info);
        Self {
            device: info.name.clone(),
            multiprocessors: info.multiprocessors,
            multiprocessor: limits.ok(),
            unknown: unknown(&info.name, info.tells_statistics(), limits.err()),
            kernels: Vec::new(),
        }
    }

    fn text(&self) -> String {
        let mut parts = Vec::new();
        if let Some(limits) = &self.multiprocessor {
            parts.push(format!("{}: {} multiprocessors, each with", self.device, self.multiprocessors));
            parts.push(limits_text(limits) + "\n");
        }
        parts.push(table::shown(&rows(&self.kernels)));
        if let Some(reason) = &self.unknown {
            parts.push(format!("\n{reason}"));
        }
        if self.kernels.iter().any(|row| !row.statistics.is_empty()) {
            parts.push(
                "\nregisters and local B (stacks, and what was spilled there) are an invocation's, shared B a workgroup's,\n\
                 as the driver tells them; a dash is not told, and --json has all that is, under the driver's own names.\n\
                 A tree deeper than trace.stack gets kernels with a larger stack in `runner run`; its record has those."
                    .into(),
            );
        }
        if self.kernels.iter().any(|row| row.takes.occupancy.is_some()) {
            parts.push(
                "\noccupancy: subgroups that a multiprocessor holds at once, of those it could hold, and what it runs\n\
                 out of first. The shared memory counted is what Vulkan gives a workgroup; the chip has more."
                    .into(),
            );
        }
        parts.join("\n")
    }
}

/// Why something is not known, in one sentence.
fn unknown(device: &str, told: bool, limits: Option<UnknownLimits>) -> Option<String> {
    if !told {
        return Some(format!(
            "the driver of {device} does not tell: it lacks VK_KHR_pipeline_executable_properties"
        ));
    }
    limits.map(|why| format!("the occupancy is not known: {why}"))
}

/// The thesis's table 1.
fn limits_text(limits: &MultiprocessorLimits) -> String {
    let MultiprocessorLimits { register_granularity, shared_granularity, subgroup_granularity, .. } = limits;
    let number = |n: u32| thousands(n.into());
    let lines = [
        ("registers", number(limits.registers), String::new()),
        (
            "  of an invocation",
            format!("at most {}", limits.invocation_registers),
            format!("rounded up to a multiple of {register_granularity}"),
        ),
        ("  at full occupancy", number(limits.full_registers()), "at most, an invocation".into()),
        (
            "subgroups at once",
            number(limits.subgroups),
            format!(
                "of {} invocations, {} together; by registers a multiple of {subgroup_granularity}",
                limits.subgroup_size,
                number(limits.invocations())
            ),
        ),
        (
            "workgroups at once",
            number(limits.workgroups),
            format!("of at most {} invocations each", number(limits.workgroup_size)),
        ),
        (
            "shared memory",
            format!("{} B", number(limits.shared_bytes)),
            format!("a workgroup's part is rounded up to a multiple of {shared_granularity} B"),
        ),
        ("  at full occupancy", format!("{} B", limits.full_shared_bytes()), "at most, an invocation".into()),
    ];
    let lines =
        lines.map(|(name, value, note)| format!("  {name:<22}{value:>12}  {note}").trim_end().to_owned());
    lines.join("\n")
}

/// The thesis's table 2.
fn rows(kernels: &[Row]) -> Table {
    let mut rows = table(&[
        "variant",
        "rays",
        "workgroup",
        "registers",
        "local B",
        "shared B",
        "spills",
        "occupancy",
        "limited by",
    ]);
    let told = |value: Option<u64>| value.map_or_else(|| "–".to_owned(), thousands);
    for Row { variant, rays, takes, .. } in kernels {
        rows.add_row([
            variant.clone(),
            (*rays).to_owned(),
            // As the thesis writes it: the subgroup's size by the number of subgroups.
            format!("{} × {}", takes.subgroup_size, takes.workgroup_size.div_ceil(takes.subgroup_size)),
            told(takes.registers.map(u64::from)),
            told(takes.local_bytes),
            told(takes.shared_bytes),
            told(takes.spills),
            takes.occupancy.map_or_else(|| "–".to_owned(), |o| format!("{:.1}%", o.share() * 100.0)),
            takes.occupancy.map_or_else(|| "–".to_owned(), |o| o.limited_by.to_string()),
        ]);
    }
    table::align(&mut rows, &[0, 1, 8]);
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The thesis's binary traversal inside a single kernel, on its GPU.
    fn report() -> Report {
        let limits = MultiprocessorLimits {
            registers: 65_536,
            invocation_registers: 255,
            register_granularity: 8,
            subgroup_size: 32,
            subgroups: 48,
            subgroup_granularity: 4,
            workgroups: 24,
            workgroup_size: 1024,
            shared_bytes: 49_152,
            shared_granularity: 128,
        };
        let takes = Resources {
            workgroup_size: 64,
            subgroup_size: 32,
            registers: Some(48),
            local_bytes: Some(256),
            shared_bytes: Some(3344),
            spills: None,
            code_bytes: Some(9472),
            occupancy: limits.occupancy(48, 3344, 64),
        };
        Report {
            device: "NVIDIA GeForce RTX 4070 Ti".into(),
            multiprocessors: 60,
            multiprocessor: Some(limits),
            unknown: None,
            kernels: vec![Row {
                // As long as the thesis's names get.
                variant: "Wide4 Slang Quantized CBTC".into(),
                rays: "secondary",
                kernel: "traverse/binary",
                takes,
                statistics: vec![Statistic { name: "Register Count".into(), value: 48.0 }],
            }],
        }
    }

    #[test]
    fn the_tables_hold_the_figures_and_fit_a_terminal() {
        let text = report().text();
        for line in text.lines() {
            assert!(line.chars().count() <= 120, "{line}");
        }
        let limits: Vec<_> = text.lines().skip(1).take(7).collect();
        for (line, value) in limits.iter().zip(["65,536", "255", "40", "48", "24", "49,152 B", "32 B"]) {
            assert!(line.contains(value), "{value} in {line}");
        }
        let row = text.lines().find(|line| line.starts_with("Wide4")).unwrap();
        let cells: Vec<_> = row.split("  ").map(str::trim).filter(|cell| !cell.is_empty()).collect();
        assert!(row.contains("secondary") && row.contains("32 × 2 "), "{row}");
        assert!(cells.ends_with(&["48", "256", "3,344", "–", "58.3%", "shared memory"]), "{cells:?}");
    }

    #[test]
    fn what_is_not_told_is_a_dash_and_the_reason_is_given_once() {
        let mut report = report();
        report.multiprocessor = None;
        report.unknown = unknown("llvmpipe", false, Some(UnknownLimits::Vendor));
        report.kernels[0].statistics.clear();
        let takes = &mut report.kernels[0].takes;
        (takes.registers, takes.local_bytes, takes.shared_bytes, takes.occupancy) = (None, None, None, None);
        let text = report.text();
        assert_eq!(text.matches("does not tell").count(), 1, "{text}");
        assert!(!text.contains("multiprocessor"), "{text}");
        assert!(text.lines().any(|line| line.starts_with("Wide4") && line.contains("32 × 2 ")), "{text}");
        assert_eq!(text.matches('–').count(), 6, "{text}");
    }

    #[test]
    fn the_reason_fits_what_is_missing() {
        assert_eq!(unknown("x", true, None), None);
        for why in [UnknownLimits::Vendor, UnknownLimits::Subgroups, UnknownLimits::Chip(0x3000)] {
            let reason = unknown("x", true, Some(why)).unwrap();
            assert!(reason.contains("occupancy") && reason.contains(&why.to_string()), "{reason}");
            assert!(reason.len() <= 120, "{reason}");
        }
        let reason = unknown("x", false, None).unwrap();
        assert!(reason.contains("VK_KHR_pipeline_executable_properties"), "{reason}");
    }

    #[test]
    fn the_record_holds_the_same_figures() {
        let takes = report().kernels[0].takes.clone();
        let kernel = of_record("traverse/binary", "secondary", &takes);
        assert_eq!(
            (kernel.registers, kernel.local_bytes, kernel.shared_bytes),
            (Some(48), Some(256), Some(3344))
        );
        assert_eq!((kernel.workgroup_size, kernel.subgroup_size, kernel.spills), (64, 32, None));
        assert_eq!(kernel.occupancy, Some(28.0 / 48.0));
        assert_eq!(kernel.limited_by, Some(record::OccupancyLimit::SharedMemory));
        // Both write the reasons in the same words.
        let words = |limit: Limit, recorded: record::OccupancyLimit| {
            assert_eq!(serde_json::to_value(limit).unwrap(), serde_json::to_value(recorded).unwrap());
        };
        words(Limit::SharedMemory, record::OccupancyLimit::SharedMemory);
        words(Limit::Subgroups, record::OccupancyLimit::Subgroups);
    }
}
