//! From the rows of one scene to points.

use crate::printed::{Cell, unrounded};
use crate::row::Row;
use anyhow::ensure;
use record::{
    Adaptation, Build, Count, Counters, Launch, Parameters, Phase, Point, Repetition, Sample, Scene, Source,
    Telemetry, Tree, View,
};

/// Primary rays of one sample at 1920 × 1080. How many rays bounced is not printed: as many as that, here.
const RAYS: u64 = 1920 * 1080;

/// So many rays are said to have been counted; only what one ray met is printed.
const COUNTED: u64 = 1_000_000;

/// Values of one scene's rows.
struct Columns {
    build: Vec<f64>,
    primary: Vec<f64>,
    secondary: Vec<f64>,
    nodes: Vec<f64>,
    boxes: Vec<f64>,
    triangles: Vec<f64>,
}

/// The points of one scene, whose first row is `Binary`.
///
/// # Errors
/// The rows contradict each other.
pub fn points(table: u32, rows: &[Row]) -> anyhow::Result<Vec<Point>> {
    ensure!(rows[0].variant == "Binary" && rows[0].build_rel == 1.0, "its first row is not Binary");
    let column = |of: fn(&Row) -> (f64, f64, f64)| {
        let cells: Vec<Cell> =
            (rows.iter().map(of)).map(|(value, off, relative)| Cell { value, off, relative }).collect();
        unrounded(&cells)
    };
    let columns = Columns {
        // Two printed numbers, each off by 0.05, and the ratio of their sum.
        build: column(|row| match row.sample_ms {
            Some(sample) => (sample + row.build_ms, 0.1, row.build_rel),
            None => (row.build_ms, 0.05, row.build_rel),
        })?,
        primary: column(|row| (row.primary_mrps, 0.5, row.primary_rel))?,
        secondary: column(|row| (row.secondary_mrps, 0.5, row.secondary_rel))?,
        nodes: column(|row| (row.nodes_per_ray, 0.05, row.nodes_rel))?,
        boxes: column(|row| (row.bvs_per_ray, 0.05, row.bvs_rel))?,
        triangles: column(|row| (row.tris_per_ray, 0.05, row.tris_rel))?,
    };
    Ok(rows.iter().enumerate().map(|(index, row)| point(table, row, &columns, index)).collect())
}

fn point(table: u32, row: &Row, columns: &Columns, index: usize) -> Point {
    let launch = |mrps: f64| Launch { rays: RAYS, milliseconds: RAYS as f64 / (mrps * 1e3) };
    let counted = |per_ray: f64| (per_ray * COUNTED as f64).round() as u64;
    let tree = Tree {
        nodes: Some(0),
        // Not printed, and a tree without a leaf would not be sound.
        leaves: Some(1),
        node_bytes: Some(0),
        triangle_bytes: Some(0),
        average_children: Some(row.avg_children),
        average_triangles_per_leaf: Some(0.0),
        depth: Some(0),
        sah_cost: Some(0.0),
        bytes: None,
    };
    let total = columns.build[index];
    let (first, adaptation) = match row.sample_ms {
        None => (total, None),
        Some(printed) => {
            // The sample rays go through Binary's tree, whose build is the first of two (thesis, table 13).
            let first = columns.build[0];
            let sampling = printed + (total - (printed + row.build_ms)) / 2.0;
            let build = took(total - sampling - first);
            (first, Some(Adaptation { sampling_milliseconds: vec![sampling], build, tree: tree.clone() }))
        }
    };
    let unknown = Telemetry::unavailable("imported: the thesis prints means over 8 views and 15 samples");
    Point {
        scene: scene(table, row),
        variant: row.variant.clone(),
        parameters: Parameters::default(),
        adopted: None,
        build: took(first),
        tree,
        kernels: Vec::new(),
        views: vec![View {
            name: "mean of 8 views".into(),
            adaptation,
            samples: vec![Sample {
                depths: vec![launch(columns.primary[index]), launch(columns.secondary[index])],
                ..Sample::default()
            }],
            counters: Some(Counters {
                depths: vec![Count {
                    rays: COUNTED,
                    nodes: counted(columns.nodes[index]),
                    boxes: counted(columns.boxes[index]),
                    triangles: counted(columns.triangles[index]),
                    utilization: None,
                }],
            }),
            before: unknown.clone(),
            after: unknown,
            pictures: Vec::new(),
        }],
        measurement: None,
    }
}

fn took(milliseconds: f64) -> Build {
    let phases = vec![Phase { name: "all".into(), milliseconds }];
    Build { repetitions: vec![Repetition { milliseconds, phases, launches: None }] }
}

fn scene(table: u32, row: &Row) -> Scene {
    let mut parameters = Parameters::default();
    parameters.set("document", "Cezner 2025");
    parameters.set("table", table);
    Scene {
        name: row.scene.clone(),
        source: Source::Generator { name: "imported".into(), parameters, sha256: None },
        triangles: (row.mtris * 1e6).round() as u64,
        skipped: Default::default(),
        load_milliseconds: 0.0,
    }
}
