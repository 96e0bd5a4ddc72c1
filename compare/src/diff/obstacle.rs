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
    let sides = ["before", "after"];
    let both = pairs.pairs.iter().map(|(_, pair)| [pair.old.point, pair.new.point]);
    let mut found = run_obstacles([old, new], sides);
    found.extend(scene_obstacles(both.clone()));
    found.extend(device_obstacle(both.clone().map(|[old, _]| old), sides[0]));
    found.extend(device_obstacle(both.map(|[_, new]| new), sides[1]));
    found
}

/// What sets two runs apart as a whole. Each side is called as it is here, such as "before".
pub fn run_obstacles(records: [&Record; 2], called: [&str; 2]) -> Vec<String> {
    let of = |record: &Record| {
        let side = Side::of(super::Named::new(Path::new(""), record));
        let run = &record.run;
        [
            ("device", side.device),
            ("driver", side.driver),
            ("clocks", clocks(run)),
            ("picture", size(run)),
            ("method", run.method.to_string()),
            ("most rays in a path", run.depth.to_string()),
        ]
    };
    let [old, new] = records.map(of);
    let differ = old.into_iter().zip(new).filter(|((_, old), (_, new))| old != new);
    differ
        .map(|((what, old), (_, new))| format!("{what}: {old} {}, {new} {}", called[0], called[1]))
        .collect()
}

/// The scenes that only have the same name.
pub fn scene_obstacles<'r>(pairs: impl Iterator<Item = [&'r Point; 2]>) -> Vec<String> {
    let other = pairs.filter(|[old, new]| other_scene(old, new)).map(|[old, _]| old.scene.name.as_str());
    let scenes = in_order(other).into_iter();
    scenes.map(|scene| format!("scene {scene}: its triangles are not the same ones")).collect()
}

/// That the device was slowed down meanwhile, where it was.
pub fn device_obstacle<'r>(points: impl Iterator<Item = &'r Point>, called: &str) -> Option<String> {
    let slowed: Vec<String> = points
        .filter(|point| throttled(point))
        .map(|point| format!("{}, {}", point.scene.name, point.variant))
        .collect();
    let named = slowed.iter().take(NAMED).cloned().collect::<Vec<_>>().join("; ");
    let more = slowed.len().saturating_sub(NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    (!slowed.is_empty()).then(|| format!("the device was slowed down {called}: {named}{more}"))
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
