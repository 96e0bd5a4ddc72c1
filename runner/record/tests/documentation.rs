//! Holds the examples in docs/record.md against the types, so that the page cannot grow stale.

use serde_json::Value;
use std::collections::BTreeMap;

const PAGE: &str = include_str!("../../../docs/record.md");

/// The JSON blocks of the page by the place in the record that the comment before them names.
fn blocks() -> BTreeMap<String, Value> {
    let mut blocks = BTreeMap::new();
    for part in PAGE.split("<!-- ").skip(1) {
        let (place, rest) = part.split_once(" -->\n```json\n").expect("a JSON block");
        let json = rest.split("\n```").next().unwrap();
        let value = serde_json::from_str(json).unwrap_or_else(|error| panic!("{place}: {error}"));
        blocks.insert(place.trim_end_matches('/').to_string(), value);
    }
    assert_eq!(blocks.len(), PAGE.matches("```json").count(), "a block without its place");
    blocks
}

#[test]
fn the_page_shows_the_example_and_all_of_it() {
    let example = serde_json::to_value(record::example()).unwrap();
    let blocks = blocks();
    assert!(blocks.contains_key("") && blocks.contains_key("/results/0"));
    for (place, shown) in &blocks {
        let real = example.pointer(place).unwrap_or_else(|| panic!("nothing at {place}"));
        let (shown, real) = (shown.as_object().unwrap(), real.as_object().unwrap());
        for (name, value) in shown {
            assert_eq!(real.get(name), Some(value), "{place}/{name}");
        }
        for name in real.keys().filter(|name| !shown.contains_key(*name)) {
            let field = format!("{place}/{name}");
            let elsewhere = blocks.keys().any(|place| {
                place.strip_prefix(&field).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
            });
            assert!(elsewhere, "{field} is explained nowhere");
        }
    }
}
