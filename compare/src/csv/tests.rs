use super::*;
use ::csv::Reader;

fn asked(text: &[&str]) -> Arguments {
    use clap::Parser;
    let line = ["compare", "csv", "record.json"].iter().chain(text);
    match crate::Cli::try_parse_from(line).unwrap().command {
        crate::Command::Csv(arguments) => arguments,
        other => panic!("{other:?}"),
    }
}

/// The example on one scene, with a variant more and a name that must be quoted.
fn record() -> record::Record {
    let mut record = record::example();
    record.results[1].scene = record.results[0].scene.clone();
    for (at, cost) in [(0, 3.0), (1, 2.0)] {
        let mut point = record.results[at].clone();
        point.parameters.set("collapse.c_t", cost);
        record.results.push(point);
    }
    for point in &mut record.results {
        point.scene.name = "hall, \"large\"".into();
    }
    record
}

#[track_caller]
fn written(text: &[&str]) -> String {
    csv(&record(), &asked(text)).unwrap()
}

#[test]
fn values_are_written_long_and_wide() {
    insta::assert_snapshot!("long", written(&["--figure", "*_mrps", "--figure", "build_ms"]));
    insta::assert_snapshot!("relative", written(&["--figure", "*_mrps", "--relative-to", "Binary"]));
    insta::assert_snapshot!("wide-figure", written(&["--wide", "figure", "--parameter", "collapse.c_i"]));
    insta::assert_snapshot!(
        "wide-figure-relative",
        written(&["--wide", "figure", "--relative-to", "Binary"])
    );
    insta::assert_snapshot!("wide-scene", written(&["--wide", "scene", "--figure", "*_mrps"]));
    insta::assert_snapshot!("wide-variant", written(&["--wide", "variant", "--figure", "*_mrps"]));
    insta::assert_snapshot!("wide-parameter", written(&["--wide", "collapse.c_t", "--figure", "*_mrps"]));
}

#[test]
fn values_keep_all_their_digits() {
    let record = record();
    let text = written(&["--figure", "secondary_mrps"]);
    let mut reader = Reader::from_reader(text.as_bytes());
    let first = reader.records().next().unwrap().unwrap();
    assert_eq!(&first[0], "hall, \"large\"");
    let value: f64 = first[5].parse().unwrap();
    assert_eq!(Some(value), record.results[0].secondary_mrps());
}

#[test]
fn wrong_names_list_the_right_ones() {
    for (text, expected) in [
        (["--wide", "colour"], "figure, scene, variant, collapse.c_t"),
        (["--figure", "speed"], "primary_mrps, secondary_mrps"),
        (["--parameter", "collapse.x"], "collapse.c_i"),
        (["--relative-to", "Wide9"], "Binary, Wide4 CBTC"),
        (["--scene", "x"], "hall"),
    ] {
        let error = csv(&record(), &asked(&text)).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn columns_of_numbers_are_in_their_order() {
    let mut record = record();
    let template = record.results[0].clone();
    record.results.clear();
    for cost in ["8", "0", "1", "auto", "2", "16", "-1"] {
        let mut point = template.clone();
        match cost.parse::<f64>() {
            Ok(number) => point.parameters.set("collapse.c_t", number),
            Err(_) => point.parameters.set("collapse.c_t", cost),
        }
        record.results.push(point);
    }
    let text = csv(&record, &asked(&["--wide", "collapse.c_t", "--figure", "primary_mrps"])).unwrap();
    let head = text.lines().next().unwrap();
    let columns: Vec<&str> = head.split(',').filter_map(|name| name.strip_prefix("collapse.c_t=")).collect();
    assert_eq!(columns, ["-1", "0", "1", "2", "8", "16", "auto"]);
}

#[test]
fn points_of_too_few_samples_are_marked() {
    let mut record = record();
    let measurement = record::example().results.into_iter().find_map(|point| point.measurement).unwrap();
    record.results.iter_mut().for_each(|point| point.measurement = None);
    record.results[0].measurement = Some(record::Measurement { unreliable: true, ..measurement });
    let marks = |text: &[&str]| -> Vec<bool> {
        let text = csv(&record, &asked(text)).unwrap();
        let mut reader = Reader::from_reader(text.as_bytes());
        let at = reader.headers().unwrap().iter().position(|name| name == "unreliable").unwrap();
        reader.records().map(|row| row.unwrap()[at].parse().unwrap()).collect()
    };
    assert_eq!(marks(&["--figure", "primary_mrps"]), [true, false, false, false]);
    assert_eq!(marks(&["--wide", "figure"]), [true, false, false, false]);
    // What is relative to it is no better, and neither is a row that has it.
    assert_eq!(
        marks(&["--figure", "primary_mrps", "--variant", "Binary", "--wide", "variant"]),
        [true, false]
    );
    let second = &record.results[1].variant;
    let of_second = ["--figure", "primary_mrps", "--variant", second, "--relative-to", "Binary"];
    assert_eq!(marks(&of_second), [false, true]);
}
