//! The best value of everything that was varied: table 4 of the thesis, and with it table 5.

use super::choice::{Choice, axes, choice, concerned, scenes};
use super::method::Method;
use super::traversal_cost::COST;
use super::workgroup::{SIZES, size};
use super::{Align, Cell, Column, Input, Row, Table};
use crate::select::{Entry, in_order};
use record::Rays;

/// A value that was chosen for a variant.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen<'a> {
    /// The variant.
    pub variant: &'a str,
    /// What it is a value of.
    pub row: String,
    /// The value.
    pub value: String,
}

/// The table: one of all records together.
///
/// # Errors
/// No record varies anything.
pub fn tables(input: &Input) -> anyhow::Result<Vec<Table>> {
    let mut chosen: Vec<Chosen> = Vec::new();
    let mut choices: Vec<(String, Choice)> = Vec::new();
    for source in &input.sources {
        for axis in axes(source) {
            for variant in in_order(source.entries().map(Entry::variant)) {
                let rays = concerned(&axis, input.rays);
                let Some(choice) = choice(input, source, variant, &axis, rays) else { continue };
                let row = named(&axis);
                if chosen.iter().any(|known| known.variant == variant && known.row == row) {
                    input.remark(format!("{variant}, {axis}: in several records; the first one counts"));
                    continue;
                }
                let mut value = choice.values[choice.best].value.clone();
                if let (true, Some(first)) = (is_size(&axis), source.entries().next()) {
                    value = size(source.all.record, first.point, &value);
                }
                choices.push((format!("{variant} ({row})"), choice));
                chosen.push(Chosen { variant, row, value });
            }
        }
    }
    anyhow::ensure!(
        !chosen.is_empty(),
        "no record has an axis with two values that can be compared; `runner sweep` makes one, and `runner merge` \
         makes one of a journal"
    );
    let devices = in_order(input.sources.iter().map(|source| source.all.record.device.name.as_str()));
    let rays = if input.rays == Rays::All { "all".to_owned() } else { input.rays.to_string() };
    let choices: Vec<(&str, Choice)> =
        choices.iter().map(|(of, choice)| (of.as_str(), choice.clone())).collect();
    let caption = format!(
        "The values chosen for each variant, on {}: those with the largest minimum rate over the scenes ({}), of \
         primary and secondary rays for their workgroups and of {rays} rays for what concerns both.",
        devices.join(" and "),
        scenes(&choices)
    );
    Ok(vec![table("best", caption, chosen)])
}

fn is_size(axis: &str) -> bool {
    SIZES.iter().any(|(name, _)| *name == axis)
}

/// The head of an axis's rows.
fn named(axis: &str) -> String {
    match axis {
        "trace.primary_subgroups" => "Primary".into(),
        "trace.secondary_subgroups" => "Secondary".into(),
        COST => "cₜ".into(),
        other => other.into(),
    }
}

/// Values by variant: widths of nodes in rows and the rest in columns, as in the thesis; or a row for each variant
/// where names say something else.
pub fn table(name: &str, caption: String, chosen: Vec<Chosen>) -> Table {
    let methods: Option<Vec<Method>> = chosen.iter().map(|chosen| Method::of(chosen.variant)).collect();
    let rows_of = in_order(chosen.iter().map(|chosen| chosen.row.clone()));
    let value = |variant: Option<&str>, row: &str| {
        let found = chosen.iter().find(|chosen| Some(chosen.variant) == variant && chosen.row == row);
        found.map(|chosen| Cell::text(&chosen.value))
    };
    // A row that no variant of its group has is left out.
    let rows = |head: &str, at: usize, variants: &[Option<&str>]| -> Vec<Row> {
        let own = rows_of.iter().filter(|row| variants.iter().any(|variant| value(*variant, row).is_some()));
        let cells = |row: &String| {
            variants
                .iter()
                .map(|variant| match variant {
                    // Not a gap: there is no such variant.
                    None => Cell::nothing(),
                    Some(_) => value(*variant, row).unwrap_or_else(|| Cell::number(None, 0)),
                })
                .collect::<Vec<_>>()
        };
        (own.enumerate())
            .map(|(nth, row)| {
                let names = [Cell::text(if nth == 0 { head } else { "" }), Cell::text(row)];
                Row::new(names.into_iter().chain(cells(row)).collect()).apart(at > 0 && nth == 0)
            })
            .collect()
    };
    let variants = in_order(chosen.iter().map(|chosen| chosen.variant));
    let (columns, rows): (Vec<Column>, Vec<Row>) = match methods {
        None => (
            vec![Column::new("", Align::Right)],
            variants.iter().enumerate().flat_map(|(at, name)| rows(name, at, &[Some(*name)])).collect(),
        ),
        Some(methods) => {
            let arities = in_order(methods.iter().map(|method| method.arity));
            let mut kinds = in_order(methods.iter().map(|m| (m.quantized, m.by_view, m.slang)));
            kinds.sort_unstable();
            let (by_view, slang) = (kinds.iter().any(|kind| kind.1), kinds.iter().any(|kind| kind.2));
            let head = |&(quantized, own, in_slang): &(bool, bool, bool)| {
                let language = slang.then_some(if in_slang { "Slang" } else { "GLSL" });
                let tree = by_view.then_some(if own { "CBTC" } else { "SAH" });
                let words: Vec<&str> = language.into_iter().chain(tree).collect();
                Column::new(&words.join(" "), Align::Right).within(if quantized {
                    "Quantized"
                } else {
                    "Uncompressed"
                })
            };
            let all = |arity: &str| -> Vec<Option<&str>> {
                let is = |name: &&str, kind: &(bool, bool, bool)| {
                    Method::of(name)
                        .is_some_and(|m| m.arity == arity && (m.quantized, m.by_view, m.slang) == *kind)
                };
                kinds.iter().map(|kind| variants.iter().copied().find(|name| is(name, kind))).collect()
            };
            (
                kinds.iter().map(head).collect(),
                arities.iter().enumerate().flat_map(|(at, arity)| rows(arity, at, &all(arity))).collect(),
            )
        }
    };
    Table {
        name: name.to_owned(),
        caption,
        legend: Vec::new(),
        columns: [Column::words(""), Column::words("")].into_iter().chain(columns).collect(),
        rows,
    }
}
