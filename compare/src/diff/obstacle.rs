//! Why two records should not be compared: what differs would be mistaken for a change.

use super::comparison::Side;
use super::pair::Pairs;
use crate::select::in_order;
use record::{ClockKind, Point, Record, Run, Source, Verdict};
use std::path::Path;

/// So many points of one sort are named.
const NAMED: usize = 3;

/// Everything that stands against comparing these points; empty where nothing does.
pub fn obstacles(old: &Record, new: &Record, pairs: &Pairs) -> Vec<String> {
    let [before, after] = [old, new].map(|record| Side::of(super::Named::new(Path::new(""), record)));
    let mut found = Vec::new();
    for (what, old, new) in [
        ("device", before.device, after.device),
        ("driver", before.driver, after.driver),
        ("clocks", clocks(&old.run), clocks(&new.run)),
        ("picture", size(&old.run), size(&new.run)),
        ("most rays in a path", old.run.depth.to_string(), new.run.depth.to_string()),
    ] {
        if old != new {
            found.push(format!("{what}: {old} before, {new} after"));
        }
    }
    for scene in in_order(
        pairs
            .pairs
            .iter()
            .filter(|(_, pair)| other_scene(pair.old.point, pair.new.point))
            .map(|(_, pair)| pair.old.scene()),
    ) {
        found.push(format!("scene {scene}: its triangles are not the same ones"));
    }
    for (side, points) in [
        ("before", pairs.pairs.iter().map(|(_, pair)| pair.old.point).collect::<Vec<_>>()),
        ("after", pairs.pairs.iter().map(|(_, pair)| pair.new.point).collect()),
    ] {
        let slowed: Vec<String> = (points.into_iter().filter(|point| throttled(point)))
            .map(|point| format!("{}, {}", point.scene.name, point.variant))
            .collect();
        if !slowed.is_empty() {
            let named = slowed.iter().take(NAMED).cloned().collect::<Vec<_>>().join("; ");
            let more = slowed.len().saturating_sub(NAMED);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            found.push(format!("the device was slowed down {side}: {named}{more}"));
        }
    }
    found
}

/// How the clocks were held, in words.
fn clocks(run: &Run) -> String {
    match (&run.policy, &run.clock) {
        (Some(policy), _) => policy.to_string(),
        (None, Some(clock)) if clock.kind == ClockKind::Locked => format!("locked to {} MHz", clock.mhz),
        _ => "free".into(),
    }
}

fn size(run: &Run) -> String {
    format!("{} × {}", run.width, run.height)
}

/// Whether the scenes of one name differ: in their number of triangles, or in a hash of what both read or made.
fn other_scene(old: &Point, new: &Point) -> bool {
    let hash = |point: &Point| match &point.scene.source {
        Source::File { sha256, .. } => Some(sha256.clone()),
        Source::Generator { sha256, .. } => sha256.clone(),
    };
    let differ = |(a, b): (String, String)| a != b;
    old.scene.triangles != new.scene.triangles || hash(old).zip(hash(new)).is_some_and(differ)
}

/// Whether the device was slowed down: by the verdict over all of the time, or in older records by what it said
/// around a view.
fn throttled(point: &Point) -> bool {
    match point.measurement.as_ref().and_then(|measurement| measurement.verdict.as_ref()) {
        Some(verdict) => matches!(verdict, Verdict::Throttled { .. }),
        None => point.views.iter().any(|view| view.throttled() == Some(true)),
    }
}
