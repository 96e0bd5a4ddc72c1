//! What changed from one record to another: figures 19 to 21 of the thesis (Cezner 2025), where the same variants
//! were measured with two versions of a compiler.

use super::chart::{Bars, Body, Chart, slug};
use super::names::{flavour, flavours};
use super::notes::{self, Found};
use super::pairs::SHOWN;
use super::ratios::{Pair, only, settled};
use super::scenes::{Shown, bars, series_of_arities};
use crate::diff::obstacle::obstacles;
use crate::diff::pair as compared;
use crate::select::Selection;

/// One chart a flavour, of the points that both have. What stands against comparing the two is said in their notes.
pub fn charts(old: &Selection, new: &Selection) -> Found {
    let both: Vec<&str> = settled(old).into_iter().filter(|variant| settled(new).contains(variant)).collect();
    let obstacles = obstacles(old.record, new.record, &compared::pairs(old, new));
    let mut found = Found::default();
    for of in flavours(&both) {
        let those: Vec<&str> = both.iter().copied().filter(|variant| flavour(variant) == of).collect();
        let pair = |scene: &str, variant: &str| -> Option<Pair> {
            Some([only(old, scene, variant)?.point, only(new, scene, variant)?.point])
        };
        let columns: Vec<Vec<Option<Pair>>> = those
            .iter()
            .map(|variant| new.scenes().iter().map(|scene| pair(scene, variant)).collect())
            .collect();
        if columns.iter().flatten().all(Option::is_none) {
            continue;
        }
        let panels = SHOWN.into_iter().filter_map(|(figure, title, axis)| {
            let groups = bars(new, &columns, figure, Shown::Change)?;
            Some(Bars { title: title.into(), axis: axis.into(), floor: 0.0, line: None, groups })
        });
        let panels: Vec<Bars> = panels.collect();
        let note = format!(
            "From the record of {} to that of {}{}. {} {}{}",
            old.record.started,
            new.record.started,
            notes::mean(new),
            notes::error_bars(&panels),
            notes::device(new),
            notes::unreliable(columns.iter().flatten().flatten().flatten().copied())
        );
        let mut bars = Found::bars(Chart {
            name: format!("records-{}", slug(&of)),
            title: format!("{of} variants: second record against the first"),
            note,
            series: series_of_arities(&those),
            body: Body::Bars(panels),
        });
        bars.charts.iter_mut().for_each(|chart| notes::mark(chart, &obstacles));
        found.add(bars);
    }
    if found.charts.is_empty() {
        found.remarks.push("the two records have no scene and variant in common".into());
    }
    found
}
