//! The record as a table on the terminal.

use comfy_table::{CellAlignment, Table};
use record::{Point, Record};
use std::fmt::Write;

/// Rates, costs and build times of every point, and what the columns mean.
pub fn summary(record: &Record) -> String {
    let mut rates = table(&[
        "scene",
        "triangles",
        "variant",
        "build ms",
        "pMRps",
        "sMRps",
        "nodes",
        "boxes",
        "tris",
        "SAH",
        "MiB",
    ]);
    for point in &record.results {
        let cost = point.counters().and_then(|c| c.all().per_ray());
        rates.add_row([
            point.scene.name.clone(),
            thousands(point.scene.triangles),
            point.variant.clone(),
            number(point.build.median_milliseconds()),
            number(point.primary_mrps()),
            number(point.secondary_mrps()),
            number(cost.map(|c| c.nodes)),
            number(cost.map(|c| c.boxes)),
            number(cost.map(|c| c.triangles)),
            number(Some(point.tree.sah_cost)),
            number(Some((point.tree.node_bytes + point.tree.triangle_bytes) as f64 / 1048576.0)),
        ]);
    }
    align(&mut rates, &[0, 2]);

    let mut text = shown(&rates);
    let names: Vec<String> = record
        .results
        .first()
        .map(|p| p.build.mean_phases().iter().map(|(name, _)| (*name).to_owned()).collect())
        .unwrap_or_default();
    if !names.is_empty() {
        let mut header = vec!["scene", "variant"];
        header.extend(names.iter().map(String::as_str));
        let mut build = table(&header);
        for point in &record.results {
            build.add_row(phases(point, &names));
        }
        align(&mut build, &[0, 1]);
        let _ = write!(text, "\n\nBuild by phase, ms\n{}", shown(&build));
    }
    let _ = write!(
        text,
        "\n\npMRps, sMRps: million primary and secondary rays a second by the traversal kernel's time alone; mean of\n\
         {} a view. nodes, boxes, tris: inner nodes visited, boxes and triangles tested a ray, over\n\
         all rays of a path. SAH: the tree's cost by the surface area heuristic. MiB: its nodes and triangles.\n\
         build ms: median, from triangles in device memory to nodes that can be traversed.\n\
         {} × {} pixels, at most {} rays a path, on {}.",
        match record.run.samples {
            1 => "one sample".to_owned(),
            n => format!("{n} samples"),
        },
        record.run.width,
        record.run.height,
        record.run.depth,
        record.device.name
    );
    text
}

fn phases(point: &Point, names: &[String]) -> Vec<String> {
    let mut row = vec![point.scene.name.clone(), point.variant.clone()];
    let means = point.build.mean_phases();
    row.extend(names.iter().map(|name| number(means.iter().find(|(n, _)| n == name).map(|(_, ms)| *ms))));
    row
}

/// A table whose only line is below the header, as all of ours are.
pub fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_preset("     ──            ").set_header(header);
    for column in table.column_iter_mut() {
        column.set_padding((0, 1));
    }
    table
}

/// The table without blanks at the ends of its lines.
pub fn shown(table: &Table) -> String {
    table.trim_fmt()
}

/// Numbers to the right, the columns `texts` to the left.
pub fn align(table: &mut Table, texts: &[usize]) {
    for (i, column) in table.column_iter_mut().enumerate() {
        if !texts.contains(&i) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
}

/// Four significant digits, or a dash.
fn number(value: Option<f64>) -> String {
    match value {
        None => "–".into(),
        Some(x) => {
            let digits = (3 - x.abs().max(1e-3).log10().floor() as i32).clamp(0, 6);
            format!("{x:.*}", digits as usize)
        }
    }
}

/// `2452458` as `2,452,458`.
pub fn thousands(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_four_digits() {
        assert_eq!(number(Some(1234.567)), "1235");
        assert_eq!(number(Some(0.98765)), "0.9877");
        assert_eq!(number(Some(12.3)), "12.30");
        assert_eq!(number(Some(0.0)), "0.000000");
        assert_eq!(number(None), "–");
        assert_eq!(thousands(2452458), "2,452,458");
        assert_eq!(thousands(999), "999");
    }

    #[test]
    fn every_point_has_its_row() {
        let record = record::example();
        let text = summary(&record);
        for point in &record.results {
            assert!(text.contains(&point.scene.name) && text.contains(&point.variant), "{text}");
        }
        assert!(text.contains("pMRps"));
        for line in text.lines() {
            assert!(line.chars().count() <= 120, "{line}");
            assert!(!line.ends_with("──") || line.starts_with('─'), "{line}");
        }
    }
}
