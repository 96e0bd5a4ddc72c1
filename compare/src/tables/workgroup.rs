//! Rates with each size of workgroup: tables 7 to 12 of the thesis.

use super::choice::{Choice, Relative, choice, scenes};
use super::input::Shown;
use super::{Align, Cell, Column, Emphasis, Input, Row, Table};
use crate::select::{Entry, in_order};
use record::{Point, Rays, Record};

/// Rates below this share of the best one stand out, as in the thesis.
const POOR: f64 = 0.9;

/// The parameters that say how many subgroups a workgroup has, and for which rays.
pub const SIZES: [(&str, Rays); 2] =
    [("trace.primary_subgroups", Rays::Primary), ("trace.secondary_subgroups", Rays::Secondary)];

/// The tables: one for each kind of rays.
///
/// # Errors
/// No record varies the size of workgroups.
pub fn tables(input: &Input) -> anyhow::Result<Vec<Table>> {
    let mut tables = Vec::new();
    for source in &input.sources {
        for (axis, rays) in SIZES {
            tables.extend(table(input, source, axis, rays));
        }
    }
    anyhow::ensure!(
        !tables.is_empty(),
        "no record has two sizes of workgroup that can be compared; `runner sweep configs/workgroup.toml` makes one, \
         and `runner merge` makes one of a journal"
    );
    Ok(tables)
}

fn table(input: &Input, source: &Shown, axis: &str, rays: Rays) -> Option<Table> {
    let choices: Vec<(&str, Choice)> = in_order(source.entries().map(Entry::variant))
        .into_iter()
        .filter_map(|variant| Some((variant, choice(input, source, variant, axis, rays)?)))
        .collect();
    let mut sizes = in_order(choices.iter().flat_map(|(_, c)| c.values.iter().map(|t| t.value.clone())));
    sizes.sort_by_key(|size| size.parse::<u64>().unwrap_or(u64::MAX));
    let first = source.entries().next()?;
    let rows = choices.iter().enumerate().flat_map(|(at, (variant, choice))| {
        let row = |name: &str, what: &str, of: fn(&Relative) -> f64| {
            let cells = sizes.iter().map(|size| cell(choice, size, of));
            Row::new([Cell::text(name), Cell::text(what)].into_iter().chain(cells).collect())
        };
        [row(variant, "min", |r| r.minimum).apart(at > 0), row("", "avg", |r| r.mean)]
    });
    let rows: Vec<Row> = rows.collect();
    (!rows.is_empty()).then(|| Table {
        name: format!("workgroup-{rays}"),
        caption: format!(
            "Rates of {rays} rays with different sizes of workgroup, relative to the chosen size, on {}: the minimum \
             over the scenes ({}) and the mean. Chosen is the size with the largest minimum.",
            source.all.record.device.name,
            scenes(&choices)
        ),
        legend: vec![(Emphasis::Best, "the chosen size"), (Emphasis::Poor, "less than 0.9")],
        columns: [Column::words(&capital(&format!("{rays} rays"))), Column::words("")]
            .into_iter()
            .chain(sizes.iter().map(|value| {
                Column::new(&size(source.all.record, first.point, value), Align::Right)
            }))
            .collect(),
        rows,
    })
}

fn cell(choice: &Choice, size: &str, of: fn(&Relative) -> f64) -> Cell {
    let Some(at) = choice.values.iter().position(|tried| tried.value == size) else {
        return Cell::number(None, 2);
    };
    let value = choice.values[at].relative.as_ref().map(of);
    Cell::number(value, 2)
        .with_if(value.is_some_and(poor), Emphasis::Poor)
        .with_if(at == choice.best, Emphasis::Best)
}

/// Whether a share, as it is printed, is below [`POOR`].
fn poor(share: f64) -> bool {
    (100.0 * share).round() < 100.0 * POOR
}

/// A size of workgroups as the thesis writes it, such as 32 × 8: invocations of a subgroup, and subgroups.
pub fn size(record: &Record, point: &Point, subgroups: &str) -> String {
    let kernel = point.kernels.first().map(|kernel| kernel.subgroup_size);
    match kernel.unwrap_or(record.device.limits.subgroup_size) {
        0 => format!("{subgroups} subgroups"),
        wide => format!("{wide} × {subgroups}"),
    }
}

/// A text that begins with a capital letter.
fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
