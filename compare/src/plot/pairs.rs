//! What one word of a variant's name changes: figures 19 to 21 and 28 to 30 of the thesis (Cezner 2025), such as
//! quantized trees against exact ones.

use super::chart::{Bars, Body, Chart, slug};
use super::names::{flavour, flavours, without, words};
use super::notes::{self, Found};
use super::ratios::{Pair, pairs, settled};
use super::scenes::{Shown, bars, series_of_arities};
use crate::figure::Figure;
use crate::select::{Selection, in_order};

/// What is shown, with its title and its axis.
pub const SHOWN: [(Figure, &str, &str); 3] = [
    (Figure::Primary, "Primary rays", "change of MRps (%)"),
    (Figure::Secondary, "Secondary rays", "change of MRps (%)"),
    (Figure::Total, "Build time, with sample rays", "change of time (%)"),
];

/// One chart for each word and each flavour that has it, if the record has the same variants without it.
pub fn charts(selection: &Selection) -> Found {
    let variants = settled(selection);
    let mut found = Found::default();
    for word in in_order(variants.iter().flat_map(|variant| words(variant))) {
        let with: Vec<&str> = variants
            .iter()
            .copied()
            .filter(|variant| without(variant, word).is_some_and(|other| variants.contains(&other.as_str())))
            .collect();
        for of in flavours(&with) {
            let those: Vec<&str> = with.iter().copied().filter(|variant| flavour(variant) == of).collect();
            found.add(chart(selection, word, &of, &those));
        }
    }
    if found.charts.is_empty() {
        found.remarks.push("no two variants differ by one word of their names, such as Quantized".into());
    }
    found
}

fn chart(selection: &Selection, word: &str, of: &str, variants: &[&str]) -> Found {
    let old = |variant: &str| without(variant, word).unwrap_or_default();
    let columns: Vec<Vec<Option<Pair>>> =
        variants.iter().map(|variant| pairs(selection, &old(variant), variant)).collect();
    let panels = SHOWN.into_iter().filter_map(|(figure, title, axis)| {
        bars(selection, &columns, figure, Shown::Change).map(|groups| Bars {
            title: title.to_owned(),
            axis: axis.to_owned(),
            floor: 0.0,
            line: None,
            groups,
        })
    });
    let panels: Vec<Bars> = panels.collect();
    let base = flavour(&old(variants[0]));
    let note = format!(
        "Each variant against the same without {word}, on the same scene{}. {} {}{}",
        notes::mean(selection),
        notes::error_bars(&panels),
        notes::device(selection),
        notes::unreliable(columns.iter().flatten().flatten().flatten().copied())
    );
    Found::bars(Chart {
        name: format!("pairs-{}-against-{}", slug(of), slug(&base)),
        title: format!("{of} against {base} variants"),
        note,
        series: series_of_arities(variants),
        body: Body::Bars(panels),
    })
}
