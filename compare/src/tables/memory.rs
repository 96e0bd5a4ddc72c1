//! Bytes of nodes for each triangle of the scene: table 6 of Ylitie, Karras and Laine 2017.

use super::input::Shown;
use super::rows::Rows;
use super::{Cell, Column, Input, Table};
use record::Point;

/// The tables: one of each record.
///
/// # Errors
/// A record has no point of the variant that others should be relative to.
pub fn tables(input: &Input) -> anyhow::Result<Vec<Table>> {
    input.sources.iter().map(|source| table(input, source)).collect()
}

fn table(input: &Input, source: &Shown) -> anyhow::Result<Table> {
    let rows = Rows::new(input, source)?;
    let (means, _) = rows.ratios("memory", bytes);
    let cells = |at: usize| {
        let scenes = rows.scenes.iter().map(move |scene| (scene, at));
        let scenes = scenes.map(|(scene, at)| {
            let [own, relative] = rows.on(at, scene, bytes);
            Cell::number(own, 1).relative(relative)
        });
        scenes.chain([Cell::number(means[at], 2)]).collect::<Vec<_>>()
    };
    let heads = rows.scenes.iter().map(|scene| Column::numbers(scene).within("Bytes per triangle"));
    Ok(Table {
        name: "memory".to_owned(),
        caption: format!(
            "Bytes of nodes for each triangle of the scene, what triangles themselves take left out. Values in \
             parentheses and their geometric mean over the scenes are relative to {}.{}",
            rows.reference(),
            rows.explained()
        ),
        legend: Vec::new(),
        rows: rows.rows(cells),
        columns: rows.heads().into_iter().chain(heads).chain([Column::numbers("Geometric\nmean")]).collect(),
    })
}

fn bytes(point: &Point) -> Option<f64> {
    Some(point.of_trees(|tree| tree.node_bytes.map(|bytes| bytes as f64))? / point.scene.triangles as f64)
        .filter(|&bytes| bytes > 0.0)
}
