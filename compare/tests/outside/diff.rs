//! `compare diff` from outside.

use crate::common::{compare_in, stderr, stdout, synthetic};
use record::{Exclusion, Record, Throttling, Verdict};
use serde_json::Value;
use std::process::Output;
use tempfile::{TempDir, tempdir};

/// A folder with two records.
fn folder(old: &Record, new: &Record) -> TempDir {
    let folder = tempdir().unwrap();
    old.write_atomic(folder.path().join("old.json")).unwrap();
    new.write_atomic(folder.path().join("new.json")).unwrap();
    folder
}

fn diff(old: &Record, new: &Record, arguments: &[&str]) -> Output {
    let folder = folder(old, new);
    compare_in(folder.path(), &[&["diff", "old.json", "new.json"], arguments].concat())
}

fn old() -> Record {
    synthetic(1, |_, _, _| 1.0)
}

/// Wide4 gains on secondary rays, and loses on primary ones on one scene.
fn new() -> Record {
    synthetic(2, |scene, variant, depth| match (scene, variant, depth) {
        (_, "Wide4", 1..) => 1.05,
        ("city", "Wide4", 0) => 0.93,
        _ => 1.0,
    })
}

#[test]
fn as_a_commit_message() {
    insta::assert_snapshot!(stdout(&diff(&old(), &new(), &["--format", "commit"])));
}

#[test]
fn as_a_table_on_the_terminal() {
    let output = diff(&old(), &new(), &[]);
    assert!(!stdout(&output).contains('\u{1b}'), "a pipe gets no colours");
    insta::assert_snapshot!(stdout(&output));
}

#[test]
fn as_markdown() {
    insta::assert_snapshot!(stdout(&diff(&old(), &new(), &["--format", "markdown", "--variant", "Wide4"])));
}

#[test]
fn as_json() {
    let arguments = ["--format", "json", "--variant", "Wide4", "--scene", "city", "--scene", "forest"];
    let mut json = serde_json::from_slice(&diff(&old(), &new(), &arguments).stdout).unwrap();
    round(&mut json);
    insta::assert_snapshot!(serde_json::to_string_pretty(&json).unwrap());
}

/// Leaves six decimals: logarithms differ in their last bit from one system to another.
fn round(json: &mut Value) {
    match json {
        Value::Number(number) if number.is_f64() => {
            *json = Value::from((number.as_f64().unwrap() * 1e6).round() / 1e6);
        }
        Value::Array(values) => values.iter_mut().for_each(round),
        Value::Object(fields) => fields.values_mut().for_each(round),
        _ => {}
    }
}

fn verdicts(output: &Output) -> Vec<String> {
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    let mut all = Vec::new();
    for section in json["sections"].as_array().unwrap() {
        for line in section["lines"].as_array().unwrap() {
            for change in line["scenes"].as_array().unwrap().iter().chain([&line["mean"]]) {
                all.push(change["verdict"].as_str().unwrap().to_owned());
            }
        }
    }
    all
}

#[test]
fn a_record_is_the_same_as_itself() {
    let same = diff(&old(), &old(), &["--format", "json"]);
    assert!(verdicts(&same).iter().all(|verdict| verdict == "same"), "{}", stdout(&same));
    let said = diff(&old(), &old(), &["--format", "commit", "--fail-on-regression", "0"]);
    assert_eq!(said.status.code(), Some(0));
    assert!(!stdout(&said).contains('%'), "{}", stdout(&said));
    assert_eq!(stdout(&said).matches(": ~\n").count(), 2 * 3);
}

#[test]
fn two_runs_of_the_same_do_not_differ() {
    for seed in 10..20 {
        let again = diff(&old(), &synthetic(seed, |_, _, _| 1.0), &["--format", "json"]);
        let changed = |verdict: &&String| ["faster", "slower"].contains(&verdict.as_str());
        assert_eq!(verdicts(&again).iter().filter(changed).count(), 0, "{}", stdout(&again));
    }
}

#[test]
fn a_regression_fails_and_an_improvement_never_does() {
    let slower = diff(&old(), &new(), &["--fail-on-regression", "5%"]);
    assert_eq!(slower.status.code(), Some(3));
    assert!(
        stderr(&slower).contains("slower by more than 5%:\n  Wide4, city: pMRps -7."),
        "{}",
        stderr(&slower)
    );
    assert!(stdout(&slower).contains("mean of 3"), "the table is printed all the same");
    let allowed = diff(&old(), &new(), &["--fail-on-regression", "8%"]);
    assert_eq!(allowed.status.code(), Some(0), "{}", stderr(&allowed));
    let unasked = diff(&old(), &new(), &[]);
    assert_eq!(unasked.status.code(), Some(0));
    let faster = synthetic(2, |_, _, _| 1.3);
    let improved = diff(&old(), &faster, &["--fail-on-regression", "0"]);
    assert_eq!(improved.status.code(), Some(0), "{}", stderr(&improved));
    let mut quick = old();
    for repetition in quick.results.iter_mut().flat_map(|point| &mut point.build.repetitions) {
        repetition.milliseconds /= 2.0;
    }
    assert_eq!(diff(&old(), &quick, &["--fail-on-regression", "0"]).status.code(), Some(0));
}

#[test]
fn what_differs_for_another_reason_is_refused_or_marked() {
    fn refused(what: &str, change: impl FnOnce(&mut Record)) {
        let mut new = old();
        change(&mut new);
        let output = diff(&old(), &new, &[]);
        assert_eq!(output.status.code(), Some(1), "{what}");
        assert!(output.stdout.is_empty(), "{what}");
        let told = stderr(&output);
        assert!(told.contains(what) && told.contains("--anyway"), "{what}: {told}");
        for format in ["commit", "terminal", "markdown", "json"] {
            let marked = diff(&old(), &new, &["--anyway", "--format", format]);
            assert_eq!(marked.status.code(), Some(0), "{what}");
            let mark = if format == "json" { "\"obstacles\": [\n" } else { "ot comparable" };
            let text = stdout(&marked).replace("NOT COMPARABLE", "Not comparable");
            assert!(text.contains(mark), "{what}: {text}");
        }
    }
    refused("device: Example GPU 4070 before, Example GPU 4090 after", |r| {
        r.device.name = "Example GPU 4090".into();
    });
    refused("driver: NVIDIA 570.124 before, NVIDIA 580.1 after", |r| r.device.driver.info = "580.1".into());
    refused("clocks: graphics clock locked to 2835 MHz", |r| {
        r.run.policy.as_mut().unwrap().graphics.locked_mhz = None;
    });
    refused("clocks: ", |r| r.run.policy = None);
    refused("picture: 640 × 360 before, 1280 × 360 after", |r| r.run.width = 1280);
    refused("method: paths before, replay after", |r| r.run.method = record::Method::Replay);
    refused("most rays in a path: 3 before, 4 after", |r| r.run.depth = 4);
    refused("scene city: its triangles are not the same ones", |r| r.results[2].scene.triangles += 1);
    refused("the device was slowed down after: sponza, Wide4", |r| {
        let by =
            Throttling { reason: record::ThrottleReason::SoftwarePowerCap, milliseconds: 100.0, share: 0.1 };
        r.results[1].measurement.as_mut().unwrap().verdict = Some(Verdict::Throttled { by: vec![by] });
    });
}

#[test]
fn what_only_one_side_has_is_listed() {
    let (mut before, mut after) = (old(), old());
    before.results.retain(|point| point.scene.name != "forest");
    after.results.retain(|point| !(point.scene.name == "city" && point.variant == "Wide4"));
    before.parameters.set("collapse.c_t", 3.0);
    after.parameters.set("ploc.fast", true);
    for sample in &mut after.results[0].views[0].samples {
        sample.excluded = Some(Exclusion::LowClock);
    }
    let output = diff(&before, &after, &["--format", "commit"]);
    insta::assert_snapshot!(stdout(&output));
}

#[test]
fn points_of_a_sweep_are_compared_pass_by_pass() {
    let swept = |values: &[f64]| {
        let mut record = old();
        let points = record.results.clone();
        record.results.clear();
        for &value in values {
            for point in points.iter().filter(|point| point.variant == "Wide4") {
                let mut point = point.clone();
                point.parameters.set("cbtc.threshold", value);
                record.results.push(point);
            }
        }
        record
    };
    let output = diff(&swept(&[4.0, 8.0]), &swept(&[8.0, 16.0]), &["--format", "commit"]);
    insta::assert_snapshot!(stdout(&output));
    let one = diff(&swept(&[8.0]), &swept(&[16.0]), &["--format", "commit"]);
    assert!(stdout(&one).contains("Pass normal"), "what is the same everywhere tells no points apart");
    assert!(stdout(&one).contains("cbtc.threshold: 8 before, 16 after"), "{}", stdout(&one));
}

#[test]
fn of_single_samples_nobody_can_tell() {
    let single = |record: Record| {
        let mut record = record;
        let views = record.results.iter_mut().flat_map(|point| &mut point.views);
        views.for_each(|view| view.samples.truncate(1));
        record
    };
    let output = diff(&single(old()), &single(new()), &["--format", "commit", "--variant", "Wide4"]);
    assert!(stdout(&output).contains("%? in scene"), "{}", stdout(&output));
    assert!(stdout(&output).contains("?: too few samples to tell"), "{}", stdout(&output));
}

#[test]
fn records_without_a_common_point_are_an_error() {
    let mut other = old();
    other.results.iter_mut().for_each(|point| point.scene.name += "2");
    let output = diff(&old(), &other, &[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("old.json and new.json have no point in common"), "{}", stderr(&output));
    let nothing = diff(&old(), &old(), &["--variant", "Wide9"]);
    assert!(stderr(&nothing).contains("variants Binary, Wide4"), "{}", stderr(&nothing));
}

#[test]
fn thresholds_must_be_percentages() {
    for arguments in [["--threshold", "much"], ["--fail-on-regression", "-1%"], ["--format", "poem"]] {
        let output = diff(&old(), &old(), &arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    }
}

#[test]
fn few_samples_hide_no_change() {
    let few = |factor: f64| {
        let mut record = old();
        record.results.truncate(1);
        record.results[0].views.truncate(1);
        record.results[0].build.repetitions.truncate(3);
        let point = &mut record.results[0];
        point.views[0].samples.truncate(3);
        point.build.repetitions.iter_mut().for_each(|one| one.milliseconds *= factor);
        for launch in point.views[0].samples.iter_mut().flat_map(|sample| &mut sample.depths) {
            launch.milliseconds *= factor;
        }
        record
    };
    let output = diff(&few(1.0), &few(2.0), &["--format", "commit", "--fail-on-regression", "2%"]);
    let text = stdout(&output);
    assert!(text.contains("pMRps: -50.00%? in scene sponza"), "{text}");
    assert!(text.contains("build ms: +100.00%? in scene sponza"), "{text}");
    assert!(text.contains("?: too few samples to tell") && !text.contains('~'), "{text}");
    assert_eq!(output.status.code(), Some(0));
    let told = stderr(&output);
    assert!(told.contains("too few samples to tell of 3 changes"), "{told}");
    assert!(stdout(&diff(&few(1.0), &few(2.0), &[])).contains("about 5 samples a view would tell"));
}
