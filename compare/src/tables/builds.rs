//! How fast trees are built, and how good they are.

use super::input::Shown;
use super::{Cell, Column, Emphasis, Input, Row, Table};
use crate::figure::Figure;
use crate::select::{Entry, in_order};
use crate::unreliable;

/// The tables: one of each record.
///
/// # Errors
/// A record does not tell how long builds took.
pub fn tables(input: &Input) -> anyhow::Result<Vec<Table>> {
    input.sources.iter().map(table).collect()
}

fn table(source: &Shown) -> anyhow::Result<Table> {
    let entries: Vec<&Entry> = source.entries().collect();
    anyhow::ensure!(
        entries.iter().any(|entry| entry.point.build_milliseconds().is_some()),
        "no point of the record tells how long its tree took to build, which `runner run` and `runner sweep` write"
    );
    let phases =
        in_order(entries.iter().flat_map(|entry| entry.point.build.mean_phases()).map(|(name, _)| name));
    let mut rows = Vec::new();
    for scene in in_order(entries.iter().map(|entry| source.place(entry))) {
        let here: Vec<&Entry> =
            entries.iter().copied().filter(|entry| source.place(entry) == scene).collect();
        let rates: Vec<Option<f64>> = here.iter().map(|entry| entry.point.build_mtris()).collect();
        let fastest = rates.iter().flatten().copied().fold(0.0, f64::max);
        let costs: Vec<Option<f64>> = here.iter().map(|entry| Figure::SahCost.of(entry.point)).collect();
        for (at, entry) in here.iter().enumerate() {
            let point = entry.point;
            let own = point.build.mean_phases();
            let took = |name: &str| own.iter().find(|(own, _)| *own == name).map(|(_, ms)| *ms);
            let best = here.len() > 1;
            let cells = [
                Cell::text(scene),
                Cell::text(entry.named()),
                Cell::number(point.build.launches().map(f64::from), 0),
                Cell::number(point.build_milliseconds(), 3),
                Cell::number(rates[at], 1)
                    .with_if(best && rates[at].is_some_and(|rate| rate >= fastest), Emphasis::Best),
            ];
            let cells = cells.into_iter().chain(phases.iter().map(|name| Cell::number(took(name), 3)));
            let tree = [
                Cell::number(costs[at], 1),
                Cell::number(Figure::Nodes.of(point), 1),
                Cell::number(Figure::Secondary.of(point), 1),
            ];
            let first = rows.is_empty();
            rows.push(Row::new(cells.chain(tree).collect()).apart(at == 0 && !first));
        }
    }
    let unreliable = unreliable::sentence(
        entries.iter().copied(),
        |entry| entry.point,
        |entry| format!("{} on {}", entry.named(), source.place(entry)),
    );
    let phases = phases.into_iter().map(|name| Column::numbers(name).within("Phase (ms)"));
    Ok(Table {
        name: "builds".to_owned(),
        caption: format!(
            "How trees are built on {}, from triangles in device memory to nodes that can be traversed: launches of the \
             last build, the median of all builds, and the mean of each phase; and how good the trees are: SAH cost, nodes \
             a ray visits, and the rate of secondary rays. SAH costs and nodes of different variants count nodes of \
             different size.{unreliable}",
            source.all.record.device.name
        ),
        legend: vec![(Emphasis::Best, "the fastest build of the scene")],
        columns: [
            Column::words("Scene"),
            Column::words("Variant"),
            Column::numbers("Launches"),
            Column::numbers("Build\n(ms)"),
            Column::numbers("Million\ntriangles/s"),
        ]
        .into_iter()
        .chain(phases)
        .chain([
            Column::numbers("SAH\ncost"),
            Column::numbers("Nodes\nper ray"),
            Column::numbers("Secondary\nrays\n(MRps)"),
        ])
        .collect(),
        rows,
    })
}
