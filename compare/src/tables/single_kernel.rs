//! Separate kernels relative to a single one for all stages: table 3 of the thesis.

use super::{Cell, Column, Input, Row, Table};
use crate::select::{Entry, differing, in_order, ratio, text};
use crate::unreliable;
use record::{Point, Rays};
use std::collections::BTreeSet;

/// The parameter that says which it was.
const KERNELS: &str = "trace.kernels";

/// The table: one of all records together.
///
/// # Errors
/// No scene and variant was traced in both ways.
pub fn tables(input: &Input) -> anyhow::Result<Vec<Table>> {
    let entries: Vec<&Entry> = input.sources.iter().flat_map(|source| source.entries()).collect();
    let is = |entry: &Entry, word: &str| entry.parameters.get(KERNELS).is_some_and(|v| v.to_string() == word);
    let pairs: Vec<(&Entry, &Entry)> = (entries.iter())
        .filter(|entry| is(entry, "single"))
        .filter_map(|single| {
            let others = entries.iter().filter(|other| {
                is(other, "separate") && same(other, single) && other.variant() == single.variant()
            });
            // Of several, that with the most parameters in common.
            let differences = |other: &Entry| unlike(single, other).len();
            Some((*single, *others.min_by_key(|other| differences(other))?))
        })
        .collect();
    anyhow::ensure!(
        !pairs.is_empty(),
        "no scene and variant was traced both with {KERNELS}=single and {KERNELS}=separate; `runner sweep \
         configs/single-kernel.toml` makes such a record, and several records may be given"
    );
    let differ: BTreeSet<String> = pairs.iter().flat_map(|(single, other)| unlike(single, other)).collect();
    if !differ.is_empty() {
        let differ: Vec<String> = differ.into_iter().collect();
        input.remark(format!("the two ways were not traced alike in {}", differ.join(", ")));
    }
    let devices = in_order(input.sources.iter().map(|source| source.all.record.device.name.as_str()));
    if devices.len() > 1 {
        input.remark(format!("the records are of several devices: {}", devices.join(", ")));
    }
    let rows = in_order(pairs.iter().map(|(single, _)| single.variant())).into_iter().map(|variant| {
        let own = |rays: Rays| {
            let pairs = pairs.iter().filter(|(single, _)| single.variant() == variant);
            record::mean(pairs.map(|(single, separate)| faster(single.point, separate.point, rays)))
        };
        let cells = [Rays::Primary, Rays::Secondary].map(|rays| Cell::number(own(rays), 2));
        Row::new(std::iter::once(Cell::text(variant)).chain(cells).collect())
    });
    let unreliable = unreliable::sentence(
        pairs.iter().flat_map(|(single, separate)| [*single, *separate]),
        |entry| entry.point,
        |entry| {
            let way = entry.parameters.get(KERNELS).map(text).unwrap_or_default();
            format!("{} on {}, {way}", entry.variant(), entry.scene())
        },
    );
    let scenes = input.sources.iter().flat_map(|source| {
        let paired = |entry: &&Entry| pairs.iter().any(|(single, _)| std::ptr::eq(*single, *entry));
        source.entries().filter(paired).map(|entry| source.place(entry))
    });
    Ok(vec![Table {
        name: "single-kernel".to_owned(),
        caption: format!(
            "Rates of separate kernels relative to a single kernel for all stages, on {}: the mean over the scenes \
             ({}). Above 1, separate kernels are faster.{unreliable}",
            devices.join(" and "),
            in_order(scenes).join(", ")
        ),
        legend: Vec::new(),
        rows: rows.collect(),
        columns: vec![Column::words(""), Column::numbers("Primary rays"), Column::numbers("Secondary rays")],
    }])
}

/// Whether two points are of one scene, of generated ones also of one size.
fn same(a: &Entry, b: &Entry) -> bool {
    a.scene() == b.scene() && a.point.scene.parameters() == b.point.scene.parameters()
}

/// Parameters in which two points differ, but for the one that is compared.
fn unlike(a: &Entry, b: &Entry) -> BTreeSet<String> {
    differing(&a.parameters, &b.parameters).into_iter().filter(|name| name != KERNELS).collect()
}

/// How much faster separate kernels are, from the views that both have.
fn faster(single: &Point, separate: &Point, rays: Rays) -> Option<f64> {
    let common = |point: &Point, other: &Point| {
        let mut point = point.clone();
        point.views.retain(|view| other.views.iter().any(|known| known.name == view.name));
        point.rate(rays)
    };
    ratio(common(separate, single)?, common(single, separate)?)
}
