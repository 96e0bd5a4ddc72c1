//! A table for each scene, with every variant: tables 13 to 17 of the thesis.

use super::input::Shown;
use super::{Cell, Column, Content, Emphasis, Input, Row, Table};
use crate::figure::{Better, Figure};
use crate::select::{Entry, in_order};
use crate::unreliable;
use record::Point;
use std::cmp::Ordering;

/// A column: what is in it, its head, and how many digits after the point the thesis prints.
struct Kind {
    figure: Figure,
    head: &'static str,
    decimals: usize,
    /// Whether ratios to the reference stand beside its values.
    compared: bool,
}

const KINDS: [Kind; 8] = [
    Kind { figure: Figure::Total, head: "Build\ntime\n(ms)", decimals: 1, compared: true },
    Kind { figure: Figure::Children, head: "Avg.\nchildren\nper node", decimals: 1, compared: false },
    Kind { figure: Figure::LeafTriangles, head: "Avg.\nprimitives\nper leaf", decimals: 1, compared: false },
    Kind { figure: Figure::Primary, head: "Primary\nrays\n(MRps)", decimals: 0, compared: true },
    Kind { figure: Figure::Secondary, head: "Secondary\nrays\n(MRps)", decimals: 0, compared: true },
    Kind { figure: Figure::Nodes, head: "Tested\nnodes\nper ray", decimals: 1, compared: true },
    Kind { figure: Figure::Boxes, head: "Tested\nBVs\nper ray", decimals: 1, compared: true },
    Kind { figure: Figure::Triangles, head: "Tested\ntriangles\nper ray", decimals: 1, compared: true },
];

/// The tables.
///
/// # Errors
/// There are none.
pub fn tables(input: &Input) -> anyhow::Result<Vec<Table>> {
    let mut tables = Vec::new();
    for source in &input.sources {
        for scene in in_order(source.entries().map(|entry| source.place(entry))) {
            tables.push(table(input, source, scene));
        }
    }
    Ok(tables)
}

fn table(input: &Input, source: &Shown, scene: &str) -> Table {
    let entries: Vec<&Entry> = source.entries().filter(|entry| source.place(entry) == scene).collect();
    if entries.iter().all(|entry| source.all.reference(entry, &input.reference).is_none()) {
        input.remark(format!(
            "{scene}: no point of {} to be relative to; `--relative-to VARIANT` takes another",
            input.reference
        ));
    }
    let columns: Vec<Vec<Cell>> =
        KINDS.iter().map(|kind| column(kind, &entries, source, &input.reference)).collect();
    // What the scene was given stands in the head.
    let rows = entries.iter().enumerate().map(|(at, entry)| {
        let name = Cell::text(entry.named());
        let cells = std::iter::once(name).chain(columns.iter().map(|column| column[at].clone()));
        let arity = |entry: &Entry| entry.variant().split(' ').next().map(str::to_owned);
        Row::new(cells.collect()).apart(at > 0 && arity(entries[at - 1]) != arity(entry))
    });
    let by_view = entries.iter().any(|entry| Figure::Sampling.of(entry.point).is_some());
    let by_view = if by_view {
        " Of trees by view, the first time is that of the sample rays and the second one that of both builds."
    } else {
        ""
    };
    let unreliable =
        unreliable::sentence(entries.iter().copied(), |entry| entry.point, |entry| entry.named());
    let head = format!("{scene}\n({})", triangles(entries.first().map_or(0, |e| e.point.scene.triangles)));
    Table {
        name: format!("scene-{scene}"),
        caption: format!(
            "Results of all variants for the scene {scene}, on {}. Values in parentheses are relative to {}.{by_view}{unreliable}",
            source.all.record.device.name, input.reference
        ),
        legend: vec![(Emphasis::Best, "the optimum of the column")],
        columns: std::iter::once(Column::words(&head))
            .chain(KINDS.iter().map(|kind| Column::numbers(kind.head)))
            .collect(),
        rows: rows.collect(),
    }
}

fn column(kind: &Kind, entries: &[&Entry], source: &Shown, reference: &str) -> Vec<Cell> {
    let values: Vec<Option<f64>> = entries.iter().map(|entry| kind.figure.of(entry.point)).collect();
    let largest = values.iter().flatten().copied().fold(0.0, f64::max);
    let decimals = decimals(kind.decimals, largest);
    let cells: Vec<Cell> = (entries.iter().zip(&values))
        .map(|(entry, &value)| {
            let cell = match (kind.figure, value) {
                (Figure::Total, Some(_)) => build(entry.point, decimals),
                _ => Cell::number(value, decimals),
            };
            let relative = source.all.relative(entry, reference, kind.figure);
            cell.relative(relative.filter(|_| kind.compared))
        })
        .collect();
    let compare = |a: &f64, b: &f64| match kind.figure.better() {
        Better::High => b.total_cmp(a),
        Better::Low => a.total_cmp(b),
        Better::Neither => Ordering::Equal,
    };
    let best = (values.iter().zip(&cells).filter_map(|(value, cell)| Some(((*value)?, cell))))
        .min_by(|(a, _), (b, _)| compare(a, b))
        .filter(|_| kind.figure.better() != Better::Neither && entries.len() > 1)
        .map(|(_, cell)| cell.to_string());
    // Whoever reads sees what is printed: what prints like the best is as good.
    let is_best = |cell: &Cell| best.as_ref() == Some(&cell.to_string());
    cells.into_iter().map(|cell| if is_best(&cell) { cell.with(Emphasis::Best) } else { cell }).collect()
}

/// The times of sample rays and of all builds, where there are both.
fn build(point: &Point, decimals: usize) -> Cell {
    match (Figure::Sampling.of(point), Figure::Build.of(point)) {
        (Some(sampling), Some(build)) => Content::Sum(sampling, build, decimals).into(),
        (_, build) => Cell::number(build, decimals),
    }
}

/// The thesis's digits, and more where a column's largest value has fewer than two significant ones: on a CPU rates
/// are below one million a second.
fn decimals(published: usize, largest: f64) -> usize {
    let mut decimals = published;
    while decimals < 6 && largest > 0.0 && largest * 10f64.powi(decimals as i32) < 9.5 {
        decimals += 1;
    }
    decimals
}

/// How many triangles there are, in millions where there are many.
fn triangles(count: u64) -> String {
    if count >= 10_000 { format!("{:.2} Mtris", count as f64 / 1e6) } else { format!("{count} tris") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_values_get_more_digits() {
        assert_eq!([1772.0, 226.0, 12.0, 9.6, 0.61].map(|largest| decimals(0, largest)), [0, 0, 0, 0, 2]);
        assert_eq!([66.4, 5.4, 0.31, 0.0].map(|largest| decimals(1, largest)), [1, 1, 2, 1]);
    }

    #[test]
    fn triangles_are_counted_in_millions() {
        assert_eq!(
            [36, 9_999, 262_205, 14_440_000].map(triangles),
            ["36 tris", "9999 tris", "0.26 Mtris", "14.44 Mtris"]
        );
    }
}
