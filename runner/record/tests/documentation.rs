//! Holds the examples in the pages about files against the types, so that they cannot grow stale.

use serde_json::Value;
use std::collections::BTreeMap;

/// The JSON blocks of a page by the place in the file that the comment before them names.
fn blocks(page: &str) -> BTreeMap<String, Value> {
    let mut blocks = BTreeMap::new();
    for part in page.split("<!-- ").skip(1) {
        let (place, rest) = part.split_once(" -->\n```json\n").expect("a JSON block");
        let json = rest.split("\n```").next().unwrap();
        let value = serde_json::from_str(json).unwrap_or_else(|error| panic!("{place}: {error}"));
        blocks.insert(place.trim_end_matches('/').to_string(), value);
    }
    assert_eq!(blocks.len(), page.matches("```json").count(), "a block without its place");
    blocks
}

#[test]
fn the_page_about_records_shows_all_of_the_example() {
    let page = include_str!("../../../docs/record.md");
    assert!(blocks(page).contains_key("/results/0"));
    shows_all(page, &serde_json::to_value(record::example()).unwrap());
}

#[test]
fn the_page_about_stabilize_shows_all_of_the_example() {
    let page = include_str!("../../../docs/stabilize.md");
    assert!(blocks(page).contains_key("/gpus/0"));
    shows_all(page, &serde_json::to_value(record::example_report()).unwrap());
}

fn shows_all(page: &str, example: &Value) {
    let blocks = blocks(page);
    assert!(blocks.contains_key(""));
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
