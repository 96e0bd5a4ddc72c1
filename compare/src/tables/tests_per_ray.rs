//! What a ray is tested against, and what it fetches for that: tables 1, 2 and 7 of Ylitie, Karras and Laine 2017.

use super::input::Shown;
use super::rows::Rows;
use super::{Cell, Column, Input, Table};
use crate::figure::Figure;
use record::{Count, Point, Tree};

/// The bounces that the paper tells them of.
const OF: [usize; 3] = [0, 1, 4];

/// The tables: two of each record, one of tests and one of bytes.
///
/// # Errors
/// A record has no point of the variant that somebody asked for, or none with counters.
pub fn tables(input: &Input) -> anyhow::Result<Vec<Table>> {
    let tables: Vec<[Table; 2]> =
        input.sources.iter().map(|source| both(input, source)).collect::<anyhow::Result<_>>()?;
    Ok(tables.into_iter().flatten().collect())
}

fn both(input: &Input, source: &Shown) -> anyhow::Result<[Table; 2]> {
    let rows = Rows::new(input, source)?;
    anyhow::ensure!(
        source.entries().any(|entry| entry.point.counters().is_some()),
        "no point of the record has counters, which `runner run` and `runner sweep` write"
    );
    // A figure of each bounce, in columns below one head.
    let by_bounce = |head: &str, digits: usize, figure: &dyn Fn(&Point, &Count) -> Option<f64>| {
        OF.map(|bounce| {
            let of = |point: &Point| figure(point, point.counters()?.depths.get(bounce)?);
            let values = rows.averages(&format!("bounce {bounce}"), of);
            (Column::numbers(&bounce.to_string()).within(head), values, digits)
        })
    };
    let of_trees = |head: &str, what: &str, figure: &dyn Fn(&Point) -> Option<f64>| {
        (Column::numbers(head).within("Tree"), rows.averages(what, figure), 2)
    };
    let mut tests = Vec::new();
    tests.extend(by_bounce("Ray-node tests, bounce", 2, &|_, met| Some(met.per_ray()?.nodes)));
    tests.extend(by_bounce("Ray-triangle tests, bounce", 2, &|_, met| Some(met.per_ray()?.triangles)));
    for (head, figure) in
        [("Children\nper node", Figure::Children), ("Triangles\nper leaf", Figure::LeafTriangles)]
    {
        tests.push(of_trees(head, figure.column(), &|point| figure.of(point)));
    }
    tests.push(of_trees("Reference\nduplication", "references", &duplication));
    let mut bytes = Vec::new();
    for (head, of) in [
        ("Node bytes fetched, bounce", &(|[nodes, _]: [f64; 2]| nodes) as &dyn Fn([f64; 2]) -> f64),
        ("Triangle bytes fetched, bounce", &|[_, triangles]| triangles),
        ("Total bytes fetched, bounce", &|[nodes, triangles]| nodes + triangles),
    ] {
        bytes.extend(by_bounce(head, 0, &|point, met| point.bytes_per_ray(met).map(of)));
    }
    let captions = [
        ("tests", "Nodes and triangles that a ray is tested against", tests),
        ("bytes", "Bytes of nodes and triangles that a ray asks for, whichever cache they come from", bytes),
    ];
    Ok(captions.map(|(name, caption, numbers)| {
        let cells =
            |at: usize| numbers.iter().map(move |(_, values, digits)| Cell::number(values[at], *digits));
        Table {
            name: name.to_owned(),
            caption: format!(
                "{caption}, by bounce: the arithmetic mean over the scenes ({}).{}",
                rows.scenes.join(", "),
                rows.explained()
            ),
            legend: Vec::new(),
            rows: rows.rows(cells),
            columns: rows.heads().into_iter().chain(numbers.iter().map(|(head, ..)| head.clone())).collect(),
        }
    }))
}

/// How often a triangle is in the tree: above 1 where triangles were split.
fn duplication(point: &Point) -> Option<f64> {
    let references = point.of_trees(Tree::references)?;
    Some(references / point.scene.triangles as f64).filter(|&share| share > 0.0)
}
