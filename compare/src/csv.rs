//! `compare csv`: values for spreadsheets, pandas and R. docs/compare.md says what the columns are.

use crate::estimate::estimate;
use crate::figure::Figure;
use crate::select::{Entry, Filter, Selection, in_order, text};
use crate::tables::check_reference;
use crate::unreliable::unreliable;
use crate::{Exit, load::load, output::print};
use anyhow::{Context, bail};
use record::Rays;
use std::cmp::Ordering;
use std::collections::{BTreeSet, HashMap};
use std::path::PathBuf;

/// What the command takes.
#[derive(Clone, Debug, clap::Args)]
pub struct Arguments {
    /// A record that `runner` wrote
    pub record: PathBuf,
    /// Which points.
    #[command(flatten)]
    pub filter: Filter,
    /// Values as multiples of those of this variant, on the same scene
    #[arg(long, value_name = "VARIANT")]
    pub relative_to: Option<String>,
    /// A column for each value of this: `figure`, `scene`, `variant` or a parameter that was varied; without it,
    /// each value has a line
    #[arg(long, value_name = "AXIS")]
    pub wide: Option<String>,
    /// Only this figure, such as `secondary_mrps`; `*` stands for any text [may be given several times]
    #[arg(long = "figure", value_name = "FIGURE")]
    pub figures: Vec<String>,
    /// A column with this parameter, although it was not varied, such as collapse.c_t [may be given several times]
    #[arg(long = "parameter", value_name = "NAME")]
    pub parameters: Vec<String>,
}

/// `compare csv`.
///
/// # Errors
/// The record cannot be read, or has nothing of what was asked for.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let record = load(&arguments.record)?;
    print(&csv(&record, arguments)?)?;
    Ok(Exit::Done)
}

/// A value and what it is a value of.
struct Line {
    /// By key: scene, triangles, variant, parameters.
    keys: Vec<String>,
    figure: &'static str,
    value: Option<f64>,
    half_width: Option<f64>,
    /// Whether too few samples count of the point, or of the one that the value is relative to.
    unreliable: bool,
}

/// A record's values as CSV.
///
/// # Errors
/// The record has nothing of what was asked for.
pub fn csv(record: &record::Record, arguments: &Arguments) -> anyhow::Result<String> {
    let all = Selection::new(record);
    let chosen: BTreeSet<usize> =
        (Selection::filtered(record, &arguments.filter)?.entries.iter()).map(|entry| entry.index).collect();
    let entries: Vec<&Entry> = all.entries.iter().filter(|entry| chosen.contains(&entry.index)).collect();
    if let Some(reference) = &arguments.relative_to {
        check_reference(std::iter::once(&all), reference)?;
    }
    let parameters = parameters(&all, &entries, arguments)?;
    let keys: Vec<String> = ["scene", "scene_triangles", "variant"]
        .map(String::from)
        .into_iter()
        .chain(parameters.clone())
        .collect();
    let lines: Vec<Line> = (figures(arguments)?.iter())
        .flat_map(|&figure| entries.iter().map(move |entry| (figure, *entry)))
        .map(|(figure, entry)| line(&all, entry, figure, &parameters, arguments))
        .collect();
    let rows = match &arguments.wide {
        None => long(&keys, &lines, arguments.relative_to.as_deref()),
        Some(axis) => wide(&keys, &lines, axis, arguments.relative_to.as_deref())?,
    };
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.write_record(row)?;
    }
    Ok(String::from_utf8(writer.into_inner().context("cannot write CSV")?)?)
}

/// The parameters that have a column: those that were varied, and those that somebody asked for.
fn parameters(all: &Selection, entries: &[&Entry], arguments: &Arguments) -> anyhow::Result<Vec<String>> {
    let variants = in_order(entries.iter().map(|entry| entry.variant()));
    let mut names: BTreeSet<String> = variants.into_iter().flat_map(|variant| all.axes(variant)).collect();
    for name in &arguments.parameters {
        if !entries.iter().any(|entry| entry.parameters.get(name).is_some()) {
            let known: BTreeSet<&str> =
                entries.iter().flat_map(|entry| entry.parameters.0.keys().map(String::as_str)).collect();
            let known: Vec<&str> = known.into_iter().collect();
            bail!("no parameter is called {name:?}; there are {}", known.join(", "));
        }
        names.insert(name.clone());
    }
    Ok(names.into_iter().collect())
}

fn figures(arguments: &Arguments) -> anyhow::Result<Vec<Figure>> {
    let asked = |figure: &Figure| {
        arguments.figures.is_empty()
            || arguments.figures.iter().any(|pattern| crate::select::matches(pattern, figure.column()))
    };
    let found: Vec<Figure> = Figure::ALL.into_iter().filter(asked).collect();
    if found.is_empty() {
        bail!("no figure is called so; there are {}", Figure::ALL.map(Figure::column).join(", "));
    }
    Ok(found)
}

fn line(
    all: &Selection,
    entry: &Entry,
    figure: Figure,
    parameters: &[String],
    arguments: &Arguments,
) -> Line {
    let point = entry.point;
    let fixed = [entry.scene().to_owned(), point.scene.triangles.to_string(), entry.variant().to_owned()];
    let varied = parameters.iter().map(|name| entry.parameters.get(name).map(text).unwrap_or_default());
    let rays = match figure {
        Figure::Primary => Some(Rays::Primary),
        Figure::Secondary => Some(Rays::Secondary),
        _ => None,
    };
    Line {
        keys: fixed.into_iter().chain(varied).collect(),
        figure: figure.column(),
        value: match &arguments.relative_to {
            None => figure.of(point),
            Some(reference) => all.relative(entry, reference, figure),
        },
        unreliable: unreliable(point)
            || (arguments.relative_to.as_ref())
                .and_then(|reference| all.reference(entry, reference))
                .is_some_and(|other| unreliable(other.point)),
        half_width: rays.and_then(|rays| estimate(point, rays)).map(|estimate| estimate.half_width()),
    }
}

/// A number as CSV has it: all its digits, or nothing.
fn cell(value: Option<f64>) -> String {
    value.filter(|value| value.is_finite()).map(|value| value.to_string()).unwrap_or_default()
}

/// One value a line, the points in the record's order within each figure.
fn long(keys: &[String], lines: &[Line], reference: Option<&str>) -> Vec<Vec<String>> {
    let last = match reference {
        None => ["value", "half_width_95"],
        Some(_) => ["relative_to", "ratio"],
    };
    let head =
        keys.iter().cloned().chain(["figure", last[0], last[1], "unreliable"].map(String::from)).collect();
    let row = |line: &Line| {
        let last = match reference {
            None => [cell(line.value), cell(line.half_width)],
            Some(reference) => [reference.to_owned(), cell(line.value)],
        };
        let figure = [line.figure.to_owned()];
        line.keys.iter().cloned().chain(figure).chain(last).chain([line.unreliable.to_string()]).collect()
    };
    std::iter::once(head).chain(lines.iter().map(row)).collect()
}

/// A column for each value of one axis, and a line for each combination of the others.
fn wide(
    keys: &[String],
    lines: &[Line],
    axis: &str,
    reference: Option<&str>,
) -> anyhow::Result<Vec<Vec<String>>> {
    let place = keys.iter().position(|key| key == axis).filter(|_| axis != "scene_triangles");
    if place.is_none() && axis != "figure" {
        let known = keys.iter().filter(|key| *key != "scene_triangles").map(String::as_str);
        let known: Vec<&str> = std::iter::once("figure").chain(known).collect();
        bail!("{axis:?} was not varied; `--wide` takes one of {}", known.join(", "));
    }
    let spread = |line: &Line| place.map_or_else(|| line.figure.to_owned(), |at| line.keys[at].clone());
    // A scene takes its triangles along.
    let stays = |at: usize| Some(at) != place && !(axis == "scene" && keys[at] == "scene_triangles");
    let stay = |line: &Line| -> Vec<String> {
        let keys = line.keys.iter().enumerate().filter(|(at, _)| stays(*at)).map(|(_, key)| key.clone());
        keys.chain(place.map(|_| line.figure.to_owned())).collect()
    };
    let mut columns = in_order(lines.iter().map(spread));
    if place.is_some_and(|at| at > 2) {
        columns.sort_by(|a, b| numbers_first(a, b));
    }
    let name = |column: &String| match (place, reference) {
        (None, Some(_)) => format!("{column}_ratio"),
        // A number alone would not be a name.
        (Some(at), _) if at > 2 => format!("{axis}={column}"),
        _ => column.clone(),
    };
    let mut head: Vec<String> = (0..keys.len()).filter(|at| stays(*at)).map(|at| keys[at].clone()).collect();
    head.extend(place.map(|_| "figure".to_owned()));
    head.push("unreliable".to_owned());
    head.extend(reference.map(|_| "relative_to".to_owned()));
    head.extend(columns.iter().map(name));
    // Rows in order of first appearance.
    let mut places: HashMap<Vec<String>, usize> = HashMap::new();
    let mut kept: Vec<(Vec<String>, bool, Vec<String>)> = Vec::new();
    let column: HashMap<&String, usize> = columns.iter().enumerate().map(|(at, name)| (name, at)).collect();
    for line in lines {
        let own = stay(line);
        let row = *places.entry(own.clone()).or_insert_with(|| {
            kept.push((own, false, vec![String::new(); columns.len()]));
            kept.len() - 1
        });
        kept[row].1 |= line.unreliable;
        kept[row].2[column[&spread(line)]] = cell(line.value);
    }
    let row = |(keys, unreliable, values): (Vec<String>, bool, Vec<String>)| -> Vec<String> {
        let keys = keys.into_iter().chain([unreliable.to_string()]);
        keys.chain(reference.map(str::to_owned)).chain(values).collect()
    };
    Ok(std::iter::once(head).chain(kept.into_iter().map(row)).collect())
}

/// Numbers in their order, then all else as it is.
fn numbers_first(a: &str, b: &str) -> Ordering {
    match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(a), Ok(b)) => a.total_cmp(&b),
        (a, b) => b.is_ok().cmp(&a.is_ok()),
    }
}

#[cfg(test)]
mod tests;
