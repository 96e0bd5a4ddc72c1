//! How near each variant comes to what the device can do at best.

use super::input::Shown;
use super::{Cell, Column, Emphasis, Input, Row, Table};
use crate::roofline::{EXPLAINED, Limit, reached};
use crate::select::{Entry, in_order};
use crate::unreliable;
use record::{Rays, Roofline};

/// The tables: one of each record.
///
/// # Errors
/// No roofline was given, or a record does not tell what rays meet.
pub fn tables(input: &Input) -> anyhow::Result<Vec<Table>> {
    let Some(roofline) = &input.roofline else {
        anyhow::bail!(
            "what the device can do at best is in no record: `runner roofline -o FILE` measures it, and --roofline FILE \
             takes it"
        );
    };
    input.sources.iter().map(|source| table(source, roofline)).collect()
}

fn table(source: &Shown, roofline: &Roofline) -> anyhow::Result<Table> {
    let entries: Vec<&Entry> = source.entries().collect();
    anyhow::ensure!(
        entries.iter().any(|entry| reached(entry.point, Rays::All, roofline).is_some()),
        "no point of the record tells what rays meet, which `runner run` and `runner sweep` write"
    );
    let mut rows = Vec::new();
    for scene in in_order(entries.iter().map(|entry| source.place(entry))) {
        for entry in entries.iter().filter(|entry| source.place(entry) == scene) {
            for rays in [Rays::Primary, Rays::Secondary] {
                let found = reached(entry.point, rays, roofline);
                let shares = found.map_or([None; Limit::ALL.len()], |found| found.shares);
                let nearest = shares.iter().flatten().copied().fold(0.0, f64::max);
                let met = |of: fn(&record::PerRay) -> f64| found.map(|found| of(&found.per_ray));
                let mrps = entry.point.rate(rays);
                let head = [Cell::text(scene), Cell::text(entry.named()), Cell::text(rays)];
                let own = [
                    Cell::number(mrps, if mrps.is_some_and(|mrps| mrps < 10.0) { 2 } else { 0 }),
                    Cell::number(met(|met| met.nodes), 1),
                    Cell::number(met(|met| met.boxes), 1),
                    Cell::number(met(|met| met.triangles), 1),
                    Cell::number(found.map(|found| found.bytes), 0),
                ];
                let lanes = found
                    .map_or([None; 2], |found| found.lanes)
                    .map(|share| Cell::number(share.map(|share| 100.0 * share), 0));
                let shares = shares.map(|share| {
                    let cell = Cell::number(share.map(|share| 100.0 * share), 1);
                    cell.with_if(share.is_some_and(|share| share >= nearest), Emphasis::Best)
                });
                let first = rows.is_empty();
                let apart = !first && rays == Rays::Primary;
                rows.push(
                    Row::new(head.into_iter().chain(own).chain(lanes).chain(shares).collect()).apart(apart),
                );
            }
        }
    }
    let unreliable = unreliable::sentence(
        entries.iter().copied(),
        |entry| entry.point,
        |entry| format!("{} on {}", entry.named(), source.place(entry)),
    );
    let heads = ["Nodes", "Boxes", "Triangles", "Bytes"].map(|head| Column::numbers(head).within("Per ray"));
    let lanes = ["Nodes", "Triangles"].map(|head| Column::numbers(head).within("Lanes in a step (%)"));
    let limits = Limit::ALL.map(|limit| Column::numbers(limit.name()).within("Share of the limit (%)"));
    Ok(Table {
        name: "roofline".to_owned(),
        caption: format!(
            "What a ray meets, and how near the kernels come to what {} can do at best: {:.0} GB/s of memory copied, and \
             what `runner roofline` has measured besides. {EXPLAINED}{unreliable}",
            roofline.device.name,
            roofline.copy_bytes_per_second / 1e9,
        ),
        legend: vec![(Emphasis::Best, "the limit that is nearest")],
        columns: [
            Column::words("Scene"),
            Column::words("Variant"),
            Column::words("Rays"),
            Column::numbers("MRps"),
        ]
        .into_iter()
        .chain(heads)
        .chain(lanes)
        .chain(limits)
        .collect(),
        rows,
    })
}
