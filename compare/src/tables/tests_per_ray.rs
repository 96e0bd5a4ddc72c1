//! What a ray is tested against, what it fetches for that, and how well subgroups are used meanwhile: tables 1, 2, 7
//! and 10 of Ylitie, Karras and Laine 2017.

use super::input::Shown;
use super::rows::Rows;
use super::{Cell, Column, Input, Table};
use crate::figure::Figure;
use record::{Count, Point, Tree, Utilization};

/// A column's head, what stands in its rows, and how many digits of that behind the point.
type Figures = (Column, Vec<Option<f64>>, usize);

/// The bounces that the paper tells them of.
const OF: [usize; 3] = [0, 1, 4];

/// The tables of each record: of tests, of bytes and, where steps of subgroups were counted, of SIMD utilization.
///
/// # Errors
/// A record has no point of the variant that somebody asked for, or none with counters.
pub fn tables(input: &Input) -> anyhow::Result<Vec<Table>> {
    let tables: Vec<Vec<Table>> =
        input.sources.iter().map(|source| of_record(input, source)).collect::<anyhow::Result<_>>()?;
    Ok(tables.into_iter().flatten().collect())
}

fn of_record(input: &Input, source: &Shown) -> anyhow::Result<Vec<Table>> {
    let rows = Rows::new(input, source)?;
    anyhow::ensure!(
        source.entries().any(|entry| entry.point.counters().is_some()),
        "no point of the record has counters, which `runner run` and `runner sweep` write"
    );
    // A figure of each bounce, in columns below one head.
    let by_bounce =
        |what: &str, head: &str, digits: usize, figure: &dyn Fn(&Point, &Count) -> Option<f64>| {
            OF.map(|bounce| {
                let of = |point: &Point| figure(point, point.counters()?.depths.get(bounce)?);
                let values = rows.averages(&format!("{what} {bounce}"), of);
                (Column::numbers(&bounce.to_string()).within(head), values, digits)
            })
        };
    let of_trees = |head: &str, what: &str, figure: &dyn Fn(&Point) -> Option<f64>| {
        (Column::numbers(head).within("Tree"), rows.averages(what, figure), 2)
    };
    let mut tests = Vec::new();
    tests.extend(by_bounce("bounce", "Ray-node tests, bounce", 2, &|_, met| Some(met.per_ray()?.nodes)));
    tests.extend(by_bounce("bounce", "Ray-triangle tests, bounce", 2, &|_, met| {
        Some(met.per_ray()?.triangles)
    }));
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
        bytes.extend(by_bounce("bounce", head, 0, &|point, met| point.bytes_per_ray(met).map(of)));
    }
    let mut captions = vec![
        ("tests", "Nodes and triangles that a ray is tested against", tests),
        ("bytes", "Bytes of nodes and triangles that a ray asks for, whichever cache they come from", bytes),
    ];
    // Records from before steps were counted have none, which is nothing to remark.
    let counted = |point: &Point| Some(point.counters()?.depths.iter().any(|met| met.utilization.is_some()));
    if source.entries().any(|entry| counted(entry.point) == Some(true)) {
        let mut lanes = Vec::new();
        for (head, of) in [
            ("Node tests, bounce", Utilization::of_nodes as fn(&Utilization) -> Option<f64>),
            ("Triangle tests, bounce", Utilization::of_triangles),
            ("Ray initialization, bounce", Utilization::of_fetches),
        ] {
            lanes.extend(by_bounce("SIMD utilization of bounce", head, 1, &|_, met| {
                Some(100.0 * of(met.utilization.as_ref()?)?)
            }));
        }
        let caption = "SIMD utilization: lanes of a subgroup that take part in a step, in percent";
        captions.push(("utilization", caption, lanes));
    }
    let table = |(name, caption, numbers): (&str, &str, Vec<Figures>)| {
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
    };
    Ok(captions.into_iter().map(table).collect())
}

/// How often a triangle is in the tree: above 1 where triangles were split.
fn duplication(point: &Point) -> Option<f64> {
    let references = point.of_trees(Tree::references)?;
    Some(references / point.scene.triangles as f64).filter(|&share| share > 0.0)
}
