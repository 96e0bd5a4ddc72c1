//! Several records as one.

use crate::diff::Named;
use crate::diff::obstacle::{device_obstacle, run_obstacles, scene_obstacles};
use crate::select::{Entry, Filter, Selection};
use record::Record;

/// What stands against drawing the points that a filter admits of these records together; empty where nothing does,
/// as with a single record.
pub fn obstacles(records: &[Named], filter: &Filter) -> Vec<String> {
    let chosen = records.iter().filter_map(|record| {
        Some((format!("in {}", record.path.display()), Selection::filtered(record.record, filter).ok()?))
    });
    let chosen: Vec<(String, Selection)> = chosen.collect();
    let mut found = Vec::new();
    for (at, (name, selection)) in chosen.iter().enumerate() {
        for (other, before) in &chosen[..at] {
            found.extend(run_obstacles([before.record, selection.record], [other, name]));
            let same = |a: &Entry, b: &Entry| {
                a.scene() == b.scene() && a.point.scene.parameters() == b.point.scene.parameters()
            };
            let pairs = selection.entries.iter().filter_map(|entry| {
                Some([before.entries.iter().find(|known| same(known, entry))?.point, entry.point])
            });
            found.extend(scene_obstacles(pairs).iter().map(|what| format!("{what} {other} and {name}")));
        }
        if chosen.len() > 1 {
            found.extend(device_obstacle(selection.entries.iter().map(|entry| entry.point), name));
        }
    }
    found
}

/// All points of several records; each point keeps the parameters that held for it. Of a point that several have,
/// the first one counts. Whether they belong together is what [`obstacles`] says.
///
/// # Errors
/// There is no record.
pub fn join(records: &[Record]) -> anyhow::Result<Record> {
    let Some((first, others)) = records.split_first() else {
        anyhow::bail!("there is no record");
    };
    let mut joined = first.clone();
    for other in others {
        for point in &other.results {
            let mut point = point.clone();
            point.parameters = other.parameters_of(&point);
            let known = joined.results.iter().any(|old| {
                old.scene.name == point.scene.name
                    && old.scene.parameters() == point.scene.parameters()
                    && old.variant == point.variant
                    && joined.parameters_of(old) == joined.parameters_of(&point)
            });
            if !known {
                joined.results.push(point);
            }
        }
        joined.references.extend(other.references.iter().cloned());
    }
    Ok(joined)
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::example;
    use std::path::Path;

    #[test]
    fn scenes_of_several_records_come_together() {
        let mut other = example();
        other.results.truncate(1);
        other.results[0].scene.name = "city".into();
        other.parameters.set("ploc.radius", 16u32);
        let joined = join(&[example(), other.clone(), other]).unwrap();
        assert_eq!(joined.results.len(), 3);
        assert_eq!(joined.results[2].parameters.get("ploc.radius"), Some(&16u32.into()));
    }

    #[test]
    fn nothing_is_no_record() {
        assert!(join(&[]).is_err());
    }

    /// What stands against drawing the example with one that was changed.
    fn against(filter: &Filter, change: impl Fn(&mut Record)) -> Vec<String> {
        let (one, mut other) = (example(), example());
        change(&mut other);
        let [a, b] =
            [("a.json", &one), ("b.json", &other)].map(|(path, record)| Named::new(Path::new(path), record));
        assert!(obstacles(&[b], filter).is_empty(), "one record alone is what it is");
        obstacles(&[a, b], filter)
    }

    #[test]
    fn what_does_not_belong_together_is_told_with_its_files() {
        let all = Filter::default();
        assert!(against(&all, |_| {}).is_empty());
        type Change = fn(&mut Record);
        let changes: [(Change, &str); 7] = [
            (|record| record.device.name = "Another".into(), "device: "),
            (|record| record.device.driver.info = "1.2".into(), "driver: "),
            (|record| record.run.width += 1, "picture: "),
            (|record| record.run.method = record::Method::Replay, "method: "),
            (|record| record.run.depth += 1, "most rays in a path: "),
            (|record| record.results[0].scene.triangles += 1, "scene sponza: its triangles"),
            (
                |record| {
                    record.results[0].measurement = None;
                    if let record::Telemetry::Available(reading) = &mut record.results[0].views[0].after {
                        reading.throttle_reasons = Some([record::ThrottleReason::SoftwarePowerCap].into());
                    }
                },
                "the device was slowed down in b.json: sponza, Binary",
            ),
        ];
        for (change, expected) in changes {
            let [found] = &against(&all, change)[..] else {
                panic!("{expected}: {:?}", against(&all, change))
            };
            assert!(found.starts_with(expected) && found.contains("in b.json"), "{found}");
        }
        let other = Filter { variants: vec!["Wide4*".into()], ..Filter::default() };
        assert!(against(&other, changes[6].0).is_empty(), "only what is drawn counts");
    }
}
