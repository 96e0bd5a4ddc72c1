//! What kernels take from the device: table 2 of the thesis.

use super::{Align, Cell, Column, Emphasis, Input, Row, Table};
use crate::select::in_order;
use record::Kernel;

/// Bytes of shared memory that a workgroup takes when the compiler put registers there: traversal kernels ask for a
/// few bytes themselves. The thesis marks 1808 and 3344, and not 140.
const SPILLED: u64 = 1024;

/// Occupancies below this stand out: half of what the multiprocessor could hold is not there to hide latency.
const FULL_ENOUGH: f64 = 0.5;

/// The table: one of all records together, each kernel once.
///
/// # Errors
/// No record says what its kernels take.
pub fn tables(input: &Input) -> anyhow::Result<Vec<Table>> {
    // Variants that go by view are traced by the kernels of their counterparts, and so are all scenes.
    let mut kernels: Vec<(&str, &Kernel)> = Vec::new();
    for source in &input.sources {
        for entry in source.entries() {
            for kernel in &entry.point.kernels {
                if !kernels.iter().any(|(_, known)| *known == kernel) {
                    kernels.push((entry.variant(), kernel));
                }
            }
        }
    }
    anyhow::ensure!(
        !kernels.is_empty(),
        "no record says what its kernels take; newer versions of `runner` write that"
    );
    let tells = |of: fn(&Kernel) -> bool| kernels.iter().any(|(_, kernel)| of(kernel));
    let spills = tells(|kernel| kernel.spills.is_some());
    let mut columns = vec![
        Column::words("Method"),
        Column::words("Rays"),
        Column::new("Workgroup", Align::Right),
        Column::numbers("Register\ncount"),
        Column::numbers("Local memory\n(bytes)"),
        Column::numbers("Shared memory\n(bytes)"),
        Column::numbers("Occupancy\n(%)"),
    ];
    if spills {
        columns.insert(6, Column::numbers("Spills"));
    }
    let rows = kernels.iter().enumerate().map(|(at, (variant, kernel))| {
        let new = at == 0 || kernels[at - 1].0 != *variant;
        let mut cells = vec![
            Cell::text(match new {
                false => String::new(),
                true if kernel.purpose == "all" => format!("{variant} (single)"),
                true => (*variant).to_owned(),
            }),
            Cell::text(&kernel.purpose),
            Cell::text(workgroup(kernel)),
            whole(kernel.registers.map(u64::from)),
            whole(kernel.local_bytes),
            whole(kernel.shared_bytes)
                .with_if(kernel.shared_bytes.is_some_and(|bytes| bytes > SPILLED), Emphasis::Poor),
            Cell::number(kernel.occupancy.map(|share| 100.0 * share), 1)
                .with_if(kernel.occupancy.is_some_and(|share| share < FULL_ENOUGH), Emphasis::Poor),
        ];
        if spills {
            let spilled = kernel.spills.is_some_and(|count| count > 0);
            cells.insert(6, whole(kernel.spills).with_if(spilled, Emphasis::Poor));
        }
        Row::new(cells).apart(at > 0 && new)
    });
    let devices = in_order(input.sources.iter().map(|source| source.all.record.device.name.as_str()));
    Ok(vec![Table {
        name: "resources".to_owned(),
        caption: format!(
            "What the traversal kernels take on {}: registers and local memory of an invocation, shared memory of a \
             workgroup. Trees by view are traced by the kernels of their counterparts.",
            devices.join(" and ")
        ),
        legend: vec![(
            Emphasis::Poor,
            "registers spilled, to more than 1 KiB of shared memory where the driver does not count them, or an \
             occupancy below one half",
        )],
        rows: rows.collect(),
        columns,
    }])
}

fn whole(count: Option<u64>) -> Cell {
    Cell::number(count.map(|count| count as f64), 0)
}

/// The size of a workgroup, in whole subgroups where it has some.
fn workgroup(kernel: &Kernel) -> String {
    let (all, wide) = (kernel.workgroup_size, kernel.subgroup_size);
    match all.checked_rem(wide) {
        Some(0) => format!("{wide} × {}", all / wide),
        _ => all.to_string(),
    }
}
