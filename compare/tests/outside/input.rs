//! Input that nobody expected: an error that names the file and the place, and never a panic.

use crate::common::{compare_in, stderr, stdout, synthetic};
use compare::diff::{Named, Thresholds, compare};
use compare::select::Filter;
use record::Record;
use std::fs;
use std::path::Path;
use tempfile::tempdir;

/// Compares a sound record with what became of its text, and expects to be told `what`.
#[track_caller]
fn told(what: &[&str], damage: impl FnOnce(String) -> String) {
    let folder = tempdir().unwrap();
    let sound = synthetic(1, |_, _, _| 1.0);
    sound.write_atomic(folder.path().join("sound.json")).unwrap();
    let text = serde_json::to_string(&sound).unwrap();
    let damaged = damage(text.clone());
    assert_ne!(damaged, text);
    fs::write(folder.path().join("damaged.json"), damaged).unwrap();
    for order in [["sound.json", "damaged.json"], ["damaged.json", "sound.json"]] {
        let output = compare_in(folder.path(), &["diff", order[0], order[1]]);
        assert_eq!(output.status.code(), Some(1));
        assert_eq!(stdout(&output), "");
        let message = stderr(&output);
        assert!(message.starts_with("compare: damaged.json"), "{message}");
        assert!(!message.contains("panicked"), "{message}");
        for part in what {
            assert!(message.contains(part), "{part}: {message}");
        }
    }
}

/// Replaces the first time in milliseconds of the first sample.
fn first_time(text: String, by: &str) -> String {
    let samples = text.find("\"samples\":[").unwrap();
    let start = samples + text[samples..].find("\"milliseconds\":").unwrap() + "\"milliseconds\":".len();
    let end = start + text[start..].find('}').unwrap();
    format!("{}{by}{}", &text[..start], &text[end..])
}

#[test]
fn times_that_cannot_be() {
    let at = "results[0].views[0].samples[0].depths[0].milliseconds";
    told(&[at, "negative"], |text| first_time(text, "-0.5"));
    told(&[at, "in no time"], |text| first_time(text, "0"));
    told(&[at, "expected value"], |text| first_time(text, "NaN"));
    told(&[at, "out of range"], |text| first_time(text, "1e400"));
    told(&[at, "invalid type: null"], |text| first_time(text, "null"));
    told(&[at, "invalid type: string"], |text| first_time(text, "\"soon\""));
}

#[test]
fn files_that_are_no_records() {
    told(&["EOF while parsing", "results["], |text| text[..text.len() / 2].to_owned());
    told(&["EOF while parsing"], |_| String::new());
    told(&["expected value"], |_| "\u{0}\u{1}\u{2}".into());
    told(&["invalid type"], |_| "[1, 2, 3]".into());
    told(&["has no field \"schema\""], |_| "{}".into());
    told(&["trailing characters"], |text| text + "{}");
    told(&["invalid type: map, expected a sequence"], |text| {
        text.replacen("\"results\":[", "\"results\":{},\"x\":[", 1)
    });
    told(&["sweep.config", "recursion limit"], |text| {
        text.replacen("\"config\":{", &format!("\"config\":{{\"deep\":{}", "[".repeat(100_000)), 1)
    });
}

#[test]
fn records_of_another_time() {
    told(&["follows schema 7", "newer"], |text| text.replacen("\"schema\":2", "\"schema\":7", 1));
    told(&["follows schema 99999999999"], |text| text.replacen("\"schema\":2", "\"schema\":99999999999", 1));
}

#[test]
fn records_that_contradict_themselves() {
    let with = |change: fn(&mut Record)| {
        let mut record = synthetic(1, |_, _, _| 1.0);
        change(&mut record);
        serde_json::to_string(&record).unwrap()
    };
    let empty = with(|record| record.results.clear());
    told(&["results: nothing was measured"], |_| empty);
    let twice = with(|record| record.results.push(record.results[2].clone()));
    told(&["results[6]", "was measured before, with the same parameters, in results[2]"], |_| twice);
    let viewless = with(|record| record.results[1].views.clear());
    told(&["results[1].views: no view was measured"], |_| viewless);
    let many = with(|record| record.results.iter_mut().for_each(|point| point.views[0].samples.clear()));
    told(&["results[0].views[0].samples: no sample was measured", "and 1 more"], |_| many);
}

#[test]
fn fields_that_nobody_knows_are_no_error() {
    let folder = tempdir().unwrap();
    let text = serde_json::to_string(&synthetic(1, |_, _, _| 1.0)).unwrap();
    fs::write(folder.path().join("a.json"), &text).unwrap();
    fs::write(folder.path().join("b.json"), text.replacen('{', "{\"later\": {\"a\": [1]},", 1)).unwrap();
    let output = compare_in(folder.path(), &["diff", "a.json", "b.json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let missing = compare_in(folder.path(), &["diff", "a.json", "none.json"]);
    assert_eq!(missing.status.code(), Some(1));
    assert!(stderr(&missing).contains("cannot read none.json: No such file"), "{}", stderr(&missing));
}

/// Bytes that change, vanish or come twice, at random: whatever is left is compared or refused.
#[test]
fn nothing_makes_it_panic() {
    let sound = serde_json::to_vec(&record::example()).unwrap();
    let path = Path::new("damaged.json");
    let mut state = 1u64;
    let mut random = |end: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % end
    };
    let mut compared = 0;
    for _ in 0..20_000 {
        let mut text = sound.clone();
        for _ in 0..=random(3) {
            let at = random(text.len());
            let until = (at + random(30)).min(text.len());
            match random(5) {
                0 => drop(text.drain(at..until)),
                1 => text.splice(at..at, text[at..until].to_vec()).for_each(drop),
                2 => text[at] = b'0' + random(10) as u8,
                3 => text.splice(at..at, *b"9999999999").for_each(drop),
                _ => text[at] = b" -,.:[]{}eE\"0\xff"[random(14)],
            }
        }
        let Ok(damaged) = Record::parse(&text, path) else { continue };
        if damaged.validate().is_ok() && random(20) == 0 {
            let side = Named::new(path, &damaged);
            let _ = compare(side, side, &Filter::default(), Thresholds::default());
            compared += 1;
        }
    }
    assert!(compared > 50, "{compared}");
}
