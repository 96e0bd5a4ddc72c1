//! Rates of single bounces, over all scenes: tables 8 to 10 of Ylitie, Karras and Laine 2017.

use super::input::Shown;
use super::rows::Rows;
use super::{Cell, Column, Input, Table};
use crate::figure::Figure;
use crate::report::number::short;
use record::{BOUNCES, Method, Point};

/// Columns of numbers: a head, the values row by row, and how many digits after the point they have.
type Numbers = (Column, Vec<Option<f64>>, usize);

/// The tables: one of each record.
///
/// # Errors
/// A record has no point of the variant that others should be relative to.
pub fn tables(input: &Input) -> anyhow::Result<Vec<Table>> {
    input.sources.iter().map(|source| table(input, source)).collect()
}

fn table(input: &Input, source: &Shown) -> anyhow::Result<Table> {
    let rows = Rows::new(input, source)?;
    let record = source.all.record;
    let mut numbers: Vec<Numbers> = Vec::new();
    let mut whole: Vec<String> = Vec::new();
    for bounce in BOUNCES {
        let what = format!("bounce {bounce}");
        let (ratios, own) = rows.ratios(&what, |point| point.bounce(bounce, input.launches));
        let head = Column::numbers(&bounce.to_string()).within("Mrays/s for bounce (%)");
        numbers.push((head, percent(ratios), 1));
        whole.extend(own.map(|own| format!("{} for {what}", short(own))));
    }
    anyhow::ensure!(
        !whole.is_empty(),
        "on no scene has every row rates; `runner run --method replay` measures all variants on all scenes"
    );
    numbers.extend(trees(&rows));
    let of = match record.run.method {
        Method::Replay => "launch",
        Method::Paths => "sample",
    };
    let cells = |at: usize| numbers.iter().map(move |(_, values, digits)| Cell::number(values[at], *digits));
    Ok(Table {
        name: "bounces".to_owned(),
        caption: format!(
            "Rates by bounce relative to {}, on {}: of the {} {of} of each view, the mean over the views and the \
             geometric mean over the scenes ({}). 100% are {} Mrays/s.{}",
            rows.reference(),
            record.device.name,
            input.launches,
            rows.scenes.join(", "),
            whole.join(", "),
            rows.explained()
        ),
        legend: Vec::new(),
        rows: rows.rows(cells),
        columns: rows.heads().into_iter().chain(numbers.iter().map(|(head, ..)| head.clone())).collect(),
    })
}

/// What there is to say of the trees; nothing where they are all alike, because only kernels differ.
fn trees(rows: &Rows) -> Vec<Numbers> {
    let nodes = |point: &Point| {
        point.of_trees(|tree| tree.nodes.map(|nodes| nodes as f64)).filter(|&nodes| nodes > 0.0)
    };
    let (nodes, _) = rows.ratios("nodes", nodes);
    if nodes.iter().flatten().all(|ratio| (ratio - 1.0).abs() < 1e-9) {
        return Vec::new();
    }
    let figure = |figure: Figure| rows.averages(figure.column(), |point| figure.of(point));
    let head = |text: &str| Column::numbers(text).within("Tree");
    vec![
        (head("Nodes\n(%)"), percent(nodes), 0),
        (head("Triangles\nper leaf"), figure(Figure::LeafTriangles), 2),
        (head("Children\nper node"), figure(Figure::Children), 2),
    ]
}

fn percent(ratios: Vec<Option<f64>>) -> Vec<Option<f64>> {
    ratios.into_iter().map(|ratio| ratio.map(|ratio| 100.0 * ratio)).collect()
}
