//! All variants over all scenes, by arity: figure 26 of the thesis (Cezner 2025).

use super::chart::{Bars, Body, Chart, Group, Series, Value};
use super::names::{arities, arity, flavour, flavours, look_of_flavour};
use super::notes::{self, Found};
use super::ratios::{of_variants, pairs, ratios, settled};
use crate::figure::Figure;
use crate::select::Selection;

/// What is shown of a variant, with its title and its axis.
pub const SHOWN: [(Figure, &str, &str); 6] = [
    (Figure::Primary, "Primary rays", "MRps"),
    (Figure::Secondary, "Secondary rays", "MRps"),
    (Figure::Total, "Build time, with sample rays", "time"),
    (Figure::Nodes, "Nodes visited", "nodes per ray"),
    (Figure::Boxes, "Boxes tested", "boxes per ray"),
    (Figure::Triangles, "Triangles tested", "triangles per ray"),
];

/// The chart, relative to the variant `reference`.
pub fn charts(selection: &Selection, reference: &str) -> Found {
    let variants: Vec<&str> =
        settled(selection).into_iter().filter(|variant| *variant != reference).collect();
    if let Some(reason) = notes::no_reference(selection, reference) {
        return Found::nothing(reason);
    }
    if variants.is_empty() {
        return Found::nothing(format!("there is nothing to compare with {reference}"));
    }
    let (arities, flavours) = (arities(&variants), flavours(&variants));
    let bar = |figure: Figure, of: &str, with: &str| -> Option<Value> {
        let variant = variants.iter().find(|name| arity(name) == of && flavour(name) == with)?;
        ratios(&pairs(selection, reference, variant), figure).mean
    };
    let panel = |(figure, title, unit): (Figure, &str, &str)| {
        let group = |of: &String| Group {
            label: of.clone(),
            apart: false,
            bars: flavours.iter().map(|with| bar(figure, of, with)).collect(),
        };
        let groups: Vec<Group> = arities.iter().map(group).collect();
        groups.iter().any(|group| group.bars.iter().any(Option::is_some)).then(|| Bars {
            title: title.to_owned(),
            axis: format!("{unit}, relative"),
            floor: 0.0,
            line: Some(1.0),
            groups,
        })
    };
    let panels: Vec<Bars> = SHOWN.into_iter().filter_map(panel).collect();
    let series = flavours
        .iter()
        .enumerate()
        .map(|(number, label)| Series { label: label.clone(), look: look_of_flavour(label, number) });
    let scenes = selection.scenes();
    let note = format!(
        "Relative to {reference} (the line at 1){}. {} {} {}{}",
        match scenes.len() {
            1 => format!(", {}", scenes[0]),
            count => format!(", geometric mean over {count} scenes: {}", scenes.join(", ")),
        },
        notes::BETTER,
        notes::error_bars(&panels),
        notes::device(selection),
        notes::unreliable(of_variants(selection, &variants, reference))
    );
    Found::bars(Chart {
        name: "overall".into(),
        title: format!("All variants, relative to {reference}"),
        note,
        series: series.collect(),
        body: Body::Bars(panels),
    })
}
