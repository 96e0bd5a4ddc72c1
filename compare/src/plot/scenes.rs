//! The variants of one flavour on each scene: figure 27 of the thesis (Cezner 2025) for each flavour.

use super::chart::{Bars, Body, Chart, Group, Series, slug};
use super::names::{arities, arity, flavour, flavours, look_of_arity};
use super::notes::{self, Found};
use super::overall::SHOWN;
use super::ratios::{Pair, Ratios, of_variants, pairs, ratios, settled};
use crate::figure::Figure;
use crate::select::Selection;

/// One chart a flavour, relative to the variant `reference`.
pub fn charts(selection: &Selection, reference: &str) -> Found {
    if let Some(reason) = notes::no_reference(selection, reference) {
        return Found::nothing(reason);
    }
    let variants: Vec<&str> =
        settled(selection).into_iter().filter(|variant| *variant != reference).collect();
    let mut found = Found::default();
    for of in flavours(&variants) {
        let those: Vec<&str> = variants.iter().copied().filter(|variant| flavour(variant) == of).collect();
        let columns: Vec<Vec<Option<Pair>>> =
            those.iter().map(|variant| pairs(selection, reference, variant)).collect();
        let panels = SHOWN.into_iter().filter_map(|(figure, title, unit)| {
            bars(selection, &columns, figure, Shown::Ratio).map(|groups| Bars {
                title: title.to_owned(),
                axis: format!("{unit}, relative"),
                floor: 0.0,
                line: Some(1.0),
                groups,
            })
        });
        let panels: Vec<Bars> = panels.collect();
        let note = format!(
            "Relative to {reference} on the same scene (the line at 1){}. {} {} {}{}",
            notes::mean(selection),
            notes::BETTER,
            notes::error_bars(&panels),
            notes::device(selection),
            notes::unreliable(of_variants(selection, &those, reference))
        );
        found.add(Found::bars(Chart {
            name: format!("scenes-{}", slug(&of)),
            title: format!("{of} variants on each scene, relative to {reference}"),
            note,
            series: series_of_arities(&those),
            body: Body::Bars(panels),
        }));
    }
    if found.charts.is_empty() && found.remarks.is_empty() {
        found.remarks.push(format!("there is nothing to compare with {reference}"));
    }
    found
}

/// How a ratio is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// As it is.
    Ratio,
    /// As the change in percent.
    Change,
}

/// A group a scene, and one for their mean if there are several; a bar a column of pairs. Nothing if there is no bar.
pub fn bars(
    selection: &Selection,
    columns: &[Vec<Option<Pair>>],
    figure: Figure,
    shown: Shown,
) -> Option<Vec<Group>> {
    let all: Vec<Ratios> = columns.iter().map(|pairs| ratios(pairs, figure)).collect();
    let as_shown = |value: super::chart::Value| match shown {
        Shown::Ratio => value,
        Shown::Change => super::chart::Value {
            value: 100.0 * (value.value - 1.0),
            interval: value.interval.map(|ends| ends.map(|end| 100.0 * (end - 1.0))),
        },
    };
    let scenes = selection.scenes();
    let mut groups: Vec<Group> = scenes
        .iter()
        .enumerate()
        .map(|(index, scene)| Group {
            label: (*scene).to_owned(),
            apart: false,
            bars: all.iter().map(|ratios| ratios.each[index].map(as_shown)).collect(),
        })
        .collect();
    if scenes.len() > 1 {
        let bars = all.iter().map(|ratios| ratios.mean.map(as_shown)).collect();
        groups.push(Group { label: "mean".into(), apart: true, bars });
    }
    groups.iter().any(|group| group.bars.iter().any(Option::is_some)).then_some(groups)
}

/// A legend of arities; each of these variants has another one.
pub fn series_of_arities(variants: &[&str]) -> Vec<Series> {
    let arities = arities(variants);
    let look = |name: &&str| {
        let number = arities.iter().position(|other| other == arity(name)).unwrap_or(0);
        Series { label: arity(name).to_owned(), look: look_of_arity(arity(name), number) }
    };
    variants.iter().map(look).collect()
}
