//! A sweep's journal as a record: what `runner sweep` keeps while it measures, one line for each point.

use record::{Point, Record};
use serde::Deserialize;
use serde::de::IgnoredAny;

/// The number of the format that this version reads.
const FORMAT: u32 = 1;

/// The first line.
#[derive(Deserialize)]
struct Header {
    record: Record,
    /// The keys of all points, in the order of the config.
    points: Vec<String>,
}

/// Every further line.
#[derive(Deserialize)]
struct Entry {
    /// Which point it is; nothing for the reference point.
    key: Option<String>,
    point: Point,
}

/// Why a journal cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// It was written by another version.
    #[error("it has format {0}, and this version reads format {FORMAT}: take the version that wrote it")]
    Format(u32),
    /// A line is damaged, and not the last one, which a power cut may have torn.
    #[error("line {number}")]
    Line {
        /// The line, from 1.
        number: usize,
        /// What is wrong.
        source: serde_json::Error,
    },
}

/// Whether text is a journal, whole or not.
pub fn is_journal(text: &[u8]) -> bool {
    #[derive(Deserialize)]
    struct Probe {
        journal: Option<u32>,
    }
    // The runner writes the number first. A first line that is cut off cannot be read, and tells nevertheless.
    let first = text.split(|&byte| byte == b'\n').next().unwrap_or(text);
    first.starts_with(b"{\"journal\":")
        // Serde takes a list for a struct, too.
        || first.starts_with(b"{")
            && serde_json::from_slice::<Probe>(first).is_ok_and(|probe| probe.journal.is_some())
}

/// The record that a journal amounts to: results in the order of the config. It has no end where points are missing,
/// unless it is one of several shares: what belongs to each only the runner knows.
///
/// # Errors
/// It has another format, or is damaged elsewhere than in its last line.
pub fn parse(text: &[u8]) -> Result<Record, Problem> {
    #[derive(Deserialize)]
    struct Probe {
        journal: u32,
    }
    let mut lines: Vec<&[u8]> = text.split_inclusive(|&byte| byte == b'\n').collect();
    if lines.len() > 1
        && lines
            .last()
            .is_some_and(|last| !last.ends_with(b"\n") || serde_json::from_slice::<IgnoredAny>(last).is_err())
    {
        lines.pop();
    }
    let of = |number: usize| move |source| Problem::Line { number, source };
    let (first, rest) = lines.split_first().map_or((&b""[..], &[][..]), |(first, rest)| (*first, rest));
    let Probe { journal } = serde_json::from_slice(first).map_err(of(1))?;
    if journal != FORMAT {
        return Err(Problem::Format(journal));
    }
    let Header { mut record, points } = serde_json::from_slice(first).map_err(of(1))?;
    let mut entries = Vec::with_capacity(rest.len());
    for (index, line) in rest.iter().enumerate() {
        entries.push(serde_json::from_slice::<Entry>(line).map_err(of(index + 2))?);
    }
    let ends = entries.iter().filter_map(|entry| Some(entry.point.measurement.as_ref()?.finished)).max();
    let missing =
        points.iter().filter(|key| !entries.iter().any(|entry| entry.key.as_ref() == Some(key))).count();
    record.finished =
        ends.filter(|_| missing == 0 || record.sweep.as_ref().is_some_and(|s| s.shard.is_some()));
    let place = |key: &Option<String>| points.iter().position(|point| Some(point) == key.as_ref());
    entries.sort_by_key(|entry| place(&entry.key));
    for entry in entries {
        if entry.key.is_none() {
            record.references.push(entry.point);
        } else if place(&entry.key).is_some() {
            record.results.push(entry.point);
        }
    }
    Ok(record)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn journal(entries: &[Option<&str>]) -> Vec<u8> {
        let mut record = record::example();
        let mut points = std::mem::take(&mut record.results);
        points[1].variant = "Wide4".into();
        (record.finished, record.references, record.sweep.as_mut().unwrap().shard) = (None, Vec::new(), None);
        let mut text = json!({ "record": record, "points": ["b", "a"] });
        text["journal"] = 1.into();
        let mut text = text.to_string() + "\n";
        for key in entries {
            let point = if *key == Some("b") { &points[1] } else { &points[0] };
            text += &format!("{}\n", json!({ "key": key, "point": point }));
        }
        text.into_bytes()
    }

    #[test]
    fn results_are_in_the_order_of_the_config() {
        let text = journal(&[Some("a"), None, Some("b")]);
        assert!(is_journal(&text) && !is_journal(b"{\"schema\":1}") && is_journal(b"{\"journal\":1,\"rec"));
        let record = parse(&text).unwrap();
        let variants: Vec<_> = record.results.iter().map(|point| point.variant.as_str()).collect();
        assert_eq!((variants, record.references.len()), (vec!["Wide4", "Binary"], 1));
        assert!(record.finished.is_some());
        assert_eq!(record.validate(), Ok(()));
    }

    #[test]
    fn a_torn_last_line_is_none_and_a_damaged_one_is_named() {
        let text = journal(&[Some("a"), Some("b")]);
        let torn = parse(&text[..text.len() - 20]).unwrap();
        assert_eq!((torn.results.len(), torn.finished), (1, None));
        let damaged = String::from_utf8(text).unwrap().replacen("\"point\"", "\"poinz\"", 1);
        let error = parse(damaged.as_bytes()).unwrap_err();
        assert!(matches!(error, Problem::Line { number: 2, .. }), "{error}");
        let newer = damaged.replacen("\"journal\":1", "\"journal\":2", 1);
        assert!(matches!(parse(newer.as_bytes()), Err(Problem::Format(2))));
        assert!(matches!(parse(b"{\"journal\":1"), Err(Problem::Line { number: 1, .. })));
    }
}
