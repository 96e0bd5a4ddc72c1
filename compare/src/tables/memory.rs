//! Bytes of nodes for each triangle of the scene: table 6 of Ylitie, Karras and Laine 2017. And what nodes take beside
//! triangles: figure 8 of Lewis 2024.

use super::input::Shown;
use super::rows::Rows;
use super::{Cell, Column, Input, Table};
use record::Point;

/// The tables: two of each record.
///
/// # Errors
/// A record has no point of the variant that others should be relative to.
pub fn tables(input: &Input) -> anyhow::Result<Vec<Table>> {
    let mut tables = Vec::new();
    for source in &input.sources {
        tables.push(table(input, source)?);
        tables.push(beside_triangles(input, source)?);
    }
    Ok(tables)
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

fn beside_triangles(input: &Input, source: &Shown) -> anyhow::Result<Table> {
    let rows = Rows::new(input, source)?;
    let cells = |at: usize| {
        let of = |scene: &String| {
            let [triangles, _] = rows.on(at, scene, triangle_bytes);
            let [nodes, _] = rows.on(at, scene, node_bytes);
            match (triangles, nodes) {
                (Some(triangles), Some(nodes)) => {
                    let percent = 100.0 * nodes / triangles;
                    Cell::text(format!("{triangles:.0} + {nodes:.0} ({percent:.1}%)"))
                }
                _ => Cell::number(None, 0),
            }
        };
        rows.scenes.iter().map(of).collect::<Vec<_>>()
    };
    let heads = rows.scenes.iter().map(|scene| Column::numbers(scene).within("Bytes"));
    Ok(Table {
        name: "space".to_owned(),
        caption: format!(
            "Bytes of triangles as the traversal reads them, and of nodes; in parentheses the nodes' relative to the \
             triangles'.{}",
            rows.explained()
        ),
        legend: Vec::new(),
        rows: rows.rows(cells),
        columns: rows.heads().into_iter().chain(heads).collect(),
    })
}

fn triangle_bytes(point: &Point) -> Option<f64> {
    point.of_trees(|tree| tree.triangle_bytes.map(|bytes| bytes as f64))
}

fn node_bytes(point: &Point) -> Option<f64> {
    point.of_trees(|tree| tree.node_bytes.map(|bytes| bytes as f64))
}

fn bytes(point: &Point) -> Option<f64> {
    Some(node_bytes(point)? / point.scene.triangles as f64).filter(|&bytes| bytes > 0.0)
}
