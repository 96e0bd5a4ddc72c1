//! How near each variant comes to what the device can do at best.

use super::chart::{Bars, Body, Chart, Group, Series, Value, slug};
use super::notes::{self, Found};
use super::ratios::{only, settled};
use super::theme::Look;
use crate::roofline::{EXPLAINED, Limit, reached};
use crate::select::Selection;
use record::{Rays, Roofline};

/// One chart a scene, with a panel for primary and one for secondary rays.
pub fn charts(selection: &Selection, roofline: &Roofline) -> Found {
    let mut found = Found::default();
    let variants = settled(selection);
    for scene in selection.scenes() {
        let points: Vec<_> = variants.iter().filter_map(|variant| only(selection, scene, variant)).collect();
        let panels = [Rays::Primary, Rays::Secondary].into_iter().filter_map(|rays| {
            let groups = points.iter().filter_map(|entry| {
                let shares = reached(entry.point, rays, roofline)?.shares;
                let bar = |share: Option<f64>| share.map(|share| Value::bare(100.0 * share));
                Some(Group {
                    label: entry.variant().to_owned(),
                    apart: false,
                    bars: shares.map(bar).to_vec(),
                })
            });
            let groups: Vec<Group> = groups.collect();
            (!groups.is_empty()).then(|| Bars {
                title: format!("{rays} rays"),
                axis: "share of the limit (%)".to_owned(),
                floor: 0.0,
                line: Some(100.0),
                groups,
            })
        });
        let panels: Vec<Bars> = panels.collect();
        if panels.is_empty() {
            continue;
        }
        let series = Limit::ALL.iter().enumerate();
        found.add(Found::bars(Chart {
            name: format!("roofline-{}", slug(scene)),
            title: format!("How near to what the device can do at best: {scene}"),
            note: format!(
                "{EXPLAINED} {}{}",
                notes::device(selection),
                notes::unreliable(points.iter().map(|entry| entry.point))
            ),
            series: series
                .map(|(at, limit)| Series { label: limit.name().to_owned(), look: Look::numbered(at) })
                .collect(),
            body: Body::Bars(panels),
        }));
    }
    if found.charts.is_empty() && found.remarks.is_empty() {
        found.remarks.push("no variant with one set of parameters tells what its rays meet".into());
    }
    found
}
