//! Bytes to the reader: it gives a record that makes sense, which reads back as the same, or an error.
#![no_main]

use compare::load::{is_record, parse};
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|text: &[u8]| {
    let _ = is_record(text);
    match parse(text, Path::new("fuzzed")) {
        Ok(record) => {
            let again = serde_json::to_vec(&record).unwrap();
            assert!(is_record(&again));
            assert!(
                parse(&again, Path::new("written")).unwrap() == record,
                "it reads back as another record"
            );
        }
        Err(error) => assert!(error.to_string().contains("fuzzed"), "{error}"),
    }
});
