//! The records of this repository, the older ones among them, make sense.

use compare::load::load;
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
                // Some are what stabilize wrote about a run.
                if record::Report::read(&file).is_err() {
                    load(&file).unwrap_or_else(|error| panic!("{error}"));
                    read += 1;
                }
            }
        }
    }
    assert!(read >= 9, "{read}");
}
