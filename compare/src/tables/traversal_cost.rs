//! Rates with each traversal cost, and the best cost: tables 6 and 5 of the thesis.

use super::best::{self, Chosen};
use super::choice::{Choice, choice, scenes};
use super::input::Shown;
use super::{Cell, Column, Emphasis, Input, Row, Table};
use crate::select::{Entry, in_order, text};
use record::Rays;

/// The parameter that says what visiting a node costs when leaves are merged.
pub const COST: &str = "collapse.c_t";

/// The tables: for each record the rates, then the choice.
///
/// # Errors
/// No record varies the cost.
pub fn tables(input: &Input) -> anyhow::Result<Vec<Table>> {
    let mut tables = Vec::new();
    for source in &input.sources {
        let choices: Vec<(&str, Choice)> = in_order(source.entries().map(Entry::variant))
            .into_iter()
            .filter_map(|variant| Some((variant, choice(input, source, variant, COST, input.rays)?)))
            .collect();
        if choices.is_empty() {
            continue;
        }
        tables.push(rates(input, source, &choices));
        let chosen = choices.iter().map(|(variant, choice)| Chosen {
            variant,
            row: "cₜ".to_owned(),
            value: choice.values[choice.best].value.clone(),
        });
        let caption = format!(
            "The traversal cost cₜ chosen for each variant, on {}: that with the largest minimum over the scenes \
             ({}).",
            source.all.record.device.name,
            scenes(&choices)
        );
        tables.push(best::table("traversal-cost-chosen", caption, chosen.collect()));
    }
    anyhow::ensure!(
        !tables.is_empty(),
        "no record has two traversal costs that can be compared; `runner sweep configs/traversal-cost.toml` makes one, \
         and `runner merge` makes one of a journal"
    );
    Ok(tables)
}

fn rates(input: &Input, source: &Shown, choices: &[(&str, Choice)]) -> Table {
    let mut costs = in_order(choices.iter().flat_map(|(_, c)| c.values.iter().map(|t| t.value.clone())));
    let number = |cost: &str| cost.parse::<f64>().unwrap_or(f64::INFINITY);
    costs.sort_by(|a, b| number(a).total_cmp(&number(b)));
    let rows = choices.iter().map(|(variant, choice)| {
        let cells = costs.iter().map(|cost| {
            let at = choice.values.iter().position(|tried| tried.value == *cost);
            let mean = at.and_then(|at| choice.values[at].relative).map(|relative| relative.mean);
            Cell::number(mean, 2).with_if(at == Some(choice.best), Emphasis::Best)
        });
        Row::new(std::iter::once(Cell::text(variant)).chain(cells).collect())
    });
    let intersection = in_order(source.entries().map(|entry| entry.parameters.get("collapse.c_i").map(text)));
    let head = match &intersection[..] {
        [Some(cost)] => format!("cᵢ = {cost}, cₜ ="),
        _ => "cₜ =".to_owned(),
    };
    let of = match input.rays {
        Rays::All => "all rays".to_owned(),
        rays => format!("{rays} rays"),
    };
    Table {
        name: "traversal-cost".to_owned(),
        caption: format!(
            "Rates of {of} with different traversal costs cₜ, relative to the chosen cost, on {}: the mean over the \
             scenes ({}).",
            source.all.record.device.name,
            scenes(choices)
        ),
        legend: vec![(Emphasis::Best, "the chosen cost")],
        columns: std::iter::once(Column::words(&head))
            .chain(costs.iter().map(|cost| Column::numbers(cost)))
            .collect(),
        rows: rows.collect(),
    }
}
