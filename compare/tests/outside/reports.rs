//! The records of this repository, the older ones among them, make sense.

use compare::diff::{Named, Thresholds, Verdict, compare};
use compare::figure::Figure;
use compare::load::load;
use compare::select::Filter;
use std::fs;
use std::path::Path;

#[test]
fn every_record_of_a_report_is_read() {
    let reports = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../reports"));
    let mut read = 0;
    for folder in
        fs::read_dir(reports).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_dir())
    {
        for file in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if file.extension().is_some_and(|extension| extension == "json") {
                // Some are what stabilize wrote about a run, or `runner resources --json`.
                let text = fs::read_to_string(&file).unwrap();
                if record::Report::read(&file).is_err() && !text.contains("\n  \"multiprocessors\": ") {
                    load(&file).unwrap_or_else(|error| panic!("{error}"));
                    read += 1;
                }
            }
        }
    }
    assert!(read >= 9, "{read}");
}

/// What docs/compare.md says of them.
#[test]
fn two_runs_of_one_program_are_the_same() {
    let path = |name| Path::new(env!("CARGO_MANIFEST_DIR")).join("../reports/h100").join(name);
    let [first, again] = ["first.json", "again.json"].map(|name| load(path(name)).unwrap());
    let compared = |thresholds| {
        let [old, new] = [(&first, "first.json"), (&again, "again.json")]
            .map(|(record, name)| Named::new(Path::new(name), record));
        compare(old, new, &Filter::default(), thresholds).unwrap()
    };
    let largest = |figures: &[Figure]| {
        let comparison = compared(Thresholds::default());
        let own = comparison.changes().filter(|(_, line, _)| figures.contains(&line.figure));
        own.map(|(_, _, change)| change.share().abs()).fold(0.0, f64::max)
    };
    let rounded = |share: f64| format!("{:.1}%", 100.0 * share);
    assert_eq!(rounded(largest(&[Figure::Primary, Figure::Secondary])), "0.4%");
    assert_eq!(rounded(largest(&[Figure::Total])), "4.2%");
    let differ = |thresholds| {
        let differs = |verdict| matches!(verdict, Verdict::Faster | Verdict::Slower);
        compared(thresholds).changes().filter(|(_, _, change)| differs(change.verdict)).count()
    };
    assert_eq!(differ(Thresholds::default()), 0);
    assert_eq!(differ(Thresholds { builds: 0.01, ..Thresholds::default() }), 4, "all of them builds");
}
