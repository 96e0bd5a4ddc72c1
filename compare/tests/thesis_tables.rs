//! The tables that the thesis printed come out of its record, cell by cell.

use compare::load::load;
use compare::select::Filter;
use compare::tables::{Input, Kind, latex, markdown};
use serde::Deserialize;
use std::fs;
use std::path::Path;

/// A row of the thesis's tables 13 to 17 as printed; see the README of `reports/reference`.
#[derive(Debug, Deserialize)]
struct Printed {
    scene: String,
    mtris: f64,
    variant: String,
    sample_ms: Option<f64>,
    build_ms: f64,
    build_rel: f64,
    avg_children: f64,
    primary_mrps: f64,
    primary_rel: f64,
    secondary_mrps: f64,
    secondary_rel: f64,
    nodes_per_ray: f64,
    nodes_rel: f64,
    bvs_per_ray: f64,
    bvs_rel: f64,
    tris_per_ray: f64,
    tris_rel: f64,
}

impl Printed {
    /// The cells of its row; the primitives per leaf are missing in the record.
    fn cells(&self) -> [String; 9] {
        let cell = |value: f64, decimals: usize, relative: f64| format!("{value:.decimals$} ({relative:.2})");
        let build = cell(self.build_ms, 1, self.build_rel);
        [
            self.variant.clone(),
            self.sample_ms.map_or(build.clone(), |sampling| format!("{sampling:.1} + {build}")),
            format!("{:.1}", self.avg_children),
            "–".to_owned(),
            cell(self.primary_mrps, 0, self.primary_rel),
            cell(self.secondary_mrps, 0, self.secondary_rel),
            cell(self.nodes_per_ray, 1, self.nodes_rel),
            cell(self.bvs_per_ray, 1, self.bvs_rel),
            cell(self.tris_per_ray, 1, self.tris_rel),
        ]
    }
}

fn path(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn printed() -> Vec<Printed> {
    let mut reader = csv::Reader::from_path(path("tests/data/cezner2025_tables13-17.csv")).unwrap();
    reader.deserialize().collect::<Result<_, _>>().unwrap()
}

#[test]
fn every_cell_of_tables_13_to_17_is_as_published() {
    let records = [load(path("../reports/reference/cezner2025.json")).unwrap()];
    let input = Input::new(&records, &Filter::default(), None).unwrap();
    let tables = Kind::Scene.tables(&input).unwrap();
    let printed = printed();
    assert_eq!((tables.len(), printed.len()), (5, 130));
    let mut rows = printed.iter();
    for table in &tables {
        let mut own = table.rows.iter().zip(rows.by_ref().take(26));
        for (row, printed) in own.by_ref() {
            let cells: Vec<String> = row.cells.iter().map(ToString::to_string).collect();
            assert_eq!(cells, printed.cells(), "{}", printed.scene);
            let head = [printed.scene.clone(), format!("({:.2} Mtris)", printed.mtris)];
            assert_eq!(table.columns[0].head, head);
        }
        assert_eq!(table.rows.len(), 26);
    }
    assert!(input.remarks.borrow().is_empty());
}

/// The same through the writers: what is around a cell changes, the cell does not.
#[test]
fn every_cell_is_in_what_is_written() {
    let records = [load(path("../reports/reference/cezner2025.json")).unwrap()];
    let input = Input::new(&records, &Filter::default(), None).unwrap();
    let tables = Kind::Scene.tables(&input).unwrap();
    let bare = |line: &str| {
        let line = line.trim_start_matches("| ").trim_end_matches(" |").trim_end_matches(" \\\\");
        line.replace("**", "").replace("\\textbf{", "").replace('}', "").replace("--", "–")
    };
    let latex: Vec<String> = latex::fragment(&tables).lines().map(bare).collect();
    let markdown: Vec<String> = markdown::page(&tables).lines().map(bare).collect();
    for row in printed() {
        let cells = row.cells();
        assert!(latex.contains(&cells.join(" & ")), "{} {}", row.scene, row.variant);
        assert!(markdown.contains(&cells.join(" | ")), "{} {}", row.scene, row.variant);
    }
}

#[test]
fn the_optimum_of_a_column_is_bold() {
    let records = [load(path("../reports/reference/cezner2025.json")).unwrap()];
    let input = Input::new(&records, &Filter::default(), None).unwrap();
    let text = latex::fragment(&Kind::Scene.tables(&input).unwrap()[..1]);
    let bold: Vec<&str> = text.split("\\textbf{").skip(1).filter_map(|rest| rest.split('}').next()).collect();
    let expected = [
        "11.6 (1.00)", // build: Binary, and Binary Slang prints the same
        "11.6 (1.00)",
        "1850 (1.04)",  // primary rays: Wide4 CBTC
        "311 (1.37)",   // secondary rays: Wide4 Quantized
        "63.5 (0.96)",  // triangles: Wide4 Slang
        "111.2 (0.93)", // boxes: Wide4 Slang CBTC
        "19.3 (0.32)",  // nodes: Wide8 CBTC and Wide8 Slang CBTC
        "19.3 (0.32)",
    ];
    assert_eq!(bold, expected);
}

/// So that the data for this test stays what the record was made of.
#[test]
fn the_printed_values_are_sound() {
    let text = fs::read_to_string(path("tests/data/cezner2025_tables13-17.csv")).unwrap();
    assert_eq!(text.lines().count(), 131);
    assert!(printed().iter().all(|row| row.variant != "Binary" || row.secondary_rel == 1.0));
}
