//! `runner merge`: joins the journals of several sweeps into one record.

use super::journal::{self, Contents, Header};
use crate::{
    args::{self, Global},
    commands::print,
    progress::remark,
    table,
};
use anyhow::{Context, bail};
use record::{Part, Record};
use std::path::Path;

/// Joins what the command line names.
///
/// # Errors
/// A journal cannot be read, they do not belong together, or points are missing.
pub fn merge(global: &Global, arguments: &args::Merge) -> anyhow::Result<()> {
    let mut read = Vec::new();
    for folder in &arguments.folders {
        let contents = Contents::read(folder)?;
        if contents.torn > 0 {
            remark(
                global.quiet,
                format_args!("{}: the last line is torn and was left out", folder.display()),
            );
        }
        read.push((folder.as_path(), contents));
    }
    let (merged, missing) = joined(&read, arguments.anyway)?;
    if !missing.is_empty() && !arguments.incomplete {
        bail!(
            "{} of {} points are missing: {}\nSweep the rest with the same -o and --shard as before, or let \
             --incomplete join what there is.",
            missing.len(),
            missing.len() + merged.results.len(),
            journal::listed(&missing)
        );
    }
    merged.write_atomic(&arguments.output).context("the record cannot be written")?;
    print(&table::sweep(&merged))?;
    remark(global.quiet, format_args!("record: {}", arguments.output.display()));
    Ok(())
}

/// One record of several journals, and the keys of the points that none of them has.
fn joined(all: &[(&Path, Contents)], anyway: bool) -> anyhow::Result<(Record, Vec<String>)> {
    let Some(((first_folder, first), rest)) = all.split_first() else { bail!("nothing to join") };
    let mut points = first.header.points.clone();
    for (folder, contents) in rest {
        let found = unlike(&first.header, &contents.header);
        if !found.is_empty() && !anyway {
            bail!(
                "{} and {} do not belong together:\n  {}\n--anyway joins them all the same.",
                first_folder.display(),
                folder.display(),
                found.join("\n  ")
            );
        }
        points
            .extend(contents.header.points.iter().filter(|key| !first.header.points.contains(key)).cloned());
    }
    let mut merged = first.header.record.clone();
    if let Some(sweep) = &mut merged.sweep
        && all.len() > 1
    {
        sweep.shard = None;
    }
    let mut missing = Vec::new();
    let mut placed = Vec::new();
    for (part, (folder, contents)) in all.iter().enumerate() {
        for entry in &contents.entries {
            let mut point = entry.point.clone();
            point.parameters = contents.header.record.parameters_of(&point);
            point.parameters.0.retain(|name, value| merged.parameters.get(name) != Some(value));
            if let Some(measurement) = &mut point.measurement {
                measurement.part = part as u32;
            }
            match &entry.key {
                None => merged.references.push(point),
                Some(key) => placed.push((key, *folder, point)),
            }
        }
        merged.parts.push(self::part(contents));
        merged.started = merged.started.min(contents.header.record.started);
    }
    for key in &points {
        let mut found = placed.iter().filter(|(of, ..)| *of == key);
        match (found.next(), found.next()) {
            (None, _) => missing.push(key.clone()),
            (Some((_, one, _)), Some((_, two, _))) if !anyway => bail!(
                "{key} was measured twice, in {} and in {}; leave one out, or let --anyway take the first",
                one.display(),
                two.display()
            ),
            (Some((.., point)), _) => merged.results.push(point.clone()),
        }
    }
    merged.finished =
        if missing.is_empty() { merged.parts.iter().map(|part| part.finished).max() } else { None };
    if merged.results.is_empty() {
        bail!("no point has been measured yet");
    }
    Ok((merged, missing))
}

/// In what two sweeps differ whose points must not be mixed. Devices may be several of the same model.
fn unlike(one: &Header, other: &Header) -> Vec<String> {
    let (one, other) = (&one.record, &other.record);
    let mut found = Vec::new();
    let mut compare = |what: &str, one: String, other: String| {
        if one != other {
            found.push(format!("{what}: {one} and {other}"));
        }
    };
    compare("devices", one.device.name.clone(), other.device.name.clone());
    let driver = |r: &Record| {
        format!("{} {} ({})", r.device.driver.name, r.device.driver.info, r.device.driver.version)
    };
    compare("drivers", driver(one), driver(other));
    let clock = |r: &Record| match &r.run.clock {
        None => "unknown".to_owned(),
        Some(clock) => format!("{} MHz, {:?}", clock.mhz, clock.kind).to_lowercase(),
    };
    compare("clocks", clock(one), clock(other));
    let commit = |r: &Record| r.tool.commit.as_ref().map_or_else(|| "unknown".into(), |c| c.hash.clone());
    let shaders = journal::changed_shaders(one, other);
    if !shaders.is_empty() {
        found.push(format!(
            "shaders: {} differ between commits {} and {}",
            journal::listed(&shaders),
            commit(one),
            commit(other)
        ));
    }
    // Of the clock, what is above is enough.
    let other =
        Record { run: record::Run { clock: one.run.clock.clone(), ..other.run.clone() }, ..other.clone() };
    found.extend(journal::settings(one, &other));
    found
}

fn part(contents: &Contents) -> Part {
    let record = &contents.header.record;
    let ended = contents.entries.iter().filter_map(|entry| Some(entry.point.measurement.as_ref()?.finished));
    Part {
        host: record.host.clone(),
        device: record.device.name.clone(),
        device_uuid: record.device.uuid.clone(),
        driver: record.device.driver.version.clone(),
        command_line: record.command_line.clone(),
        started: record.started,
        finished: ended.max().unwrap_or(record.started),
        shard: record.sweep.as_ref().and_then(|sweep| sweep.shard.clone()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::journal::Entry;

    fn contents(shard: &str, keys: &[Option<&str>]) -> Contents {
        let mut record = record::example();
        let point = record.results.remove(0);
        record.results.clear();
        record.references.clear();
        record.parts.clear();
        record.finished = None;
        record.sweep.as_mut().unwrap().shard = Some(shard.into());
        let all = ["a", "b", "c"].map(String::from).to_vec();
        let entries = keys.iter().map(|key| {
            let mut point = point.clone();
            point.variant = key.unwrap_or("reference").into();
            Entry { key: key.map(String::from), point }
        });
        Contents { header: Header::new(record, all), entries: entries.collect(), torn: 0 }
    }

    fn join(all: &[Contents], anyway: bool) -> anyhow::Result<(Record, Vec<String>)> {
        let named: Vec<_> = all.iter().map(|one| (Path::new("folder"), one.clone())).collect();
        joined(&named, anyway)
    }

    #[test]
    fn shards_become_one_record() {
        let all = [contents("1/2", &[None, Some("c")]), contents("2/2", &[Some("b"), Some("a"), None])];
        let (merged, missing) = join(&all, false).unwrap();
        assert_eq!(missing, Vec::<String>::new());
        assert_eq!(merged.validate(), Ok(()));
        let order: Vec<_> = merged.results.iter().map(|point| point.variant.as_str()).collect();
        assert_eq!(order, ["a", "b", "c"]);
        let parts = merged.results.iter().map(|point| point.measurement.as_ref().unwrap().part);
        assert_eq!(parts.collect::<Vec<_>>(), [1, 1, 0]);
        assert_eq!((merged.parts.len(), merged.references.len()), (2, 2));
        assert_eq!(merged.parts[1].shard.as_deref(), Some("2/2"));
        assert_eq!(merged.sweep.as_ref().unwrap().shard, None);
        assert!(merged.finished.is_some());
    }

    #[test]
    fn what_is_missing_or_twice_is_told() {
        let (merged, missing) = join(&[contents("1/2", &[Some("c")])], false).unwrap();
        assert_eq!(missing, ["a", "b"]);
        assert_eq!(merged.finished, None);
        let twice = [contents("1/2", &[Some("a")]), contents("2/2", &[Some("a"), Some("b"), Some("c")])];
        let error = join(&twice, false).unwrap_err().to_string();
        assert!(error.contains("a was measured twice"), "{error}");
        assert_eq!(join(&twice, true).unwrap().0.results.len(), 3);
        assert!(join(&[contents("1/1", &[None])], false).is_err(), "a reference alone is no result");
    }

    #[test]
    fn what_does_not_belong_together_is_refused_unless_told() {
        let refused = |change: &dyn Fn(&mut Record)| {
            let one = contents("1/2", &[Some("a"), Some("b")]);
            let mut other = contents("2/2", &[Some("c")]);
            change(&mut other.header.record);
            let all = [one, other];
            assert_eq!(join(&all, true).unwrap().0.results.len(), 3);
            join(&all, false).unwrap_err().to_string()
        };
        assert!(
            refused(&|r| r.device.name = "Other GPU".into()).contains("devices: Example GPU 4070 and Other")
        );
        assert!(
            refused(&|r| r.device.driver.version = "1.2".into())
                .contains("drivers: NVIDIA 570.124 (570.124.0) and")
        );
        assert!(refused(&|r| r.run.clock = None).contains("clocks: 2835 mhz, locked and unknown"));
        assert!(refused(&|r| r.shaders.clear()).contains("shaders: traverse/binary differ"));
        assert!(refused(&|r| r.run.depth = 2).contains("run.depth was 3, now 2"));
        // Another card of the same model is no difference.
        let one = contents("1/2", &[Some("a"), Some("b")]);
        let mut other = contents("2/2", &[Some("c")]);
        other.header.record.device.uuid = "0".into();
        join(&[one, other], false).unwrap();
    }
}
