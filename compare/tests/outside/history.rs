//! `compare history` in real repositories.

use crate::common::{compare_in, stderr, stdout, synthetic};
use crate::repository::Repository;
use record::Record;
use serde_json::Value;

/// `Wide4` is faster by this on secondary rays, and `Binary` is not.
fn faster(seed: u64, by: f64) -> Record {
    synthetic(seed, |_, variant, depth| if variant == "Wide4" && depth > 0 { by } else { 1.0 })
}

/// A repository with a commit for each of these gains.
fn course(gains: &[f64]) -> Repository {
    let repository = Repository::new();
    for (index, by) in gains.iter().enumerate() {
        repository.record("out/a record.json", index as u32, &faster(index as u64 + 1, *by));
        repository.commit(&["-m", &format!("Change {index}")]);
    }
    repository
}

#[track_caller]
fn json(repository: &Repository, arguments: &[&str]) -> Value {
    let output = repository.compare(&[&["history", "--json"], arguments].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    serde_json::from_str(stdout(&output)).unwrap()
}

/// Whether each step of a rate is a change point.
fn points(history: &Value, variant: &str, figure: &str) -> Vec<bool> {
    let courses = history["courses"].as_array().unwrap();
    let is = |course: &&Value| course["variant"] == variant && course["figure"] == figure;
    let course = courses.iter().find(is).unwrap();
    course["steps"].as_array().unwrap().iter().map(|step| step["change_point"].as_bool().unwrap()).collect()
}

#[test]
fn change_points_are_marked() {
    let repository = course(&[1.0, 1.0, 1.1, 1.1, 1.02]);
    repository.write("README", b"more\n");
    repository.commit(&["-m", "Words"]);
    let history = json(&repository, &[]);
    assert_eq!(points(&history, "Wide4", "secondary_mrps"), [false, false, true, false, true]);
    assert_eq!(points(&history, "Wide4", "primary_mrps"), [false; 5]);
    assert_eq!(points(&history, "Binary", "secondary_mrps"), [false; 5]);
    assert_eq!(history["versions"].as_array().unwrap().len(), 5, "those that touched it");
    assert_eq!(history["scenes"], serde_json::json!(["sponza", "city", "forest"]));
    let output = repository.compare(&["history", "out/a record.json"]);
    let text = stdout(&output);
    let marked: Vec<_> = text.lines().filter(|line| line.starts_with("  * ")).collect();
    assert_eq!(marked.len(), 2, "{text}");
    assert!(marked[0].contains("Change 2") && marked[0].contains("%"), "{text}");
    assert!(text.contains("Wide4, secondary MRps\n"), "{text}");
}

#[test]
fn pictures_show_the_course() {
    let repository = course(&[1.0, 1.0, 1.1, 1.1, 1.02]);
    let output = repository.compare(&["history", "--plot", "out/history"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stdout(&output).contains("Wide4, secondary MRps"), "{}", stdout(&output));
    let mut marks = Vec::new();
    for name in ["history-binary", "history-wide4"] {
        assert!(repository.top.join(format!("out/history/{name}.png")).exists());
        let svg = std::fs::read_to_string(repository.top.join(format!("out/history/{name}.svg"))).unwrap();
        let history = json(&repository, &[]);
        for version in history["versions"].as_array().unwrap() {
            assert!(svg.contains(&version["hash"].as_str().unwrap()[..9]), "{version}");
        }
        marks.push(svg.matches("fill=\"#D55E00\"").count());
    }
    assert_eq!(marks[1], marks[0] + 2, "two change points, beside what the legend has");
}

#[test]
fn small_steps_add_up() {
    let repository = course(&[1.0, 1.007, 1.014, 1.021]);
    let history = json(&repository, &[]);
    let found = points(&history, "Wide4", "secondary_mrps");
    assert!(!found[1] && found[2..].contains(&true), "{found:?}");
    let text = repository.compare(&["history"]);
    assert!(stdout(&text).contains("% since "), "{}", stdout(&text));
}

#[test]
fn a_new_name_is_followed() {
    let repository = course(&[1.0, 1.0]);
    repository.git(&["mv", "out/a record.json", "other name.json"]);
    repository.commit(&["-m", "Rename"]);
    repository.record("other name.json", 9, &faster(9, 1.2));
    repository.commit(&["-m", "Faster"]);
    for folder in ["", "out"] {
        let folder = repository.top.join(folder);
        std::fs::create_dir_all(&folder).unwrap();
        let path = if folder.ends_with("out") { "../other name.json" } else { "other name.json" };
        let program = env!("CARGO_BIN_EXE_compare");
        let output = repository.output(&folder, program, &["history", path, "--json"], &[]);
        let history: Value = serde_json::from_str(stdout(&output)).unwrap();
        assert_eq!(points(&history, "Wide4", "secondary_mrps"), [false, false, true]);
        assert_eq!(history["versions"][0]["path"], "out/a record.json");
    }
}

#[test]
fn what_cannot_be_read_or_compared_is_told() {
    let repository = course(&[1.0]);
    repository.write("out/a record.json", b"{\"schema\": 1, \"tool\"");
    repository.commit(&["-m", "Break"]);
    let mut driver = faster(3, 1.3);
    driver.device.driver.info = "999.9".into();
    repository.record("out/a record.json", 3, &driver);
    repository.commit(&["-m", "Another driver"]);
    let history = json(&repository, &["out/a record.json"]);
    assert_eq!(points(&history, "Wide4", "secondary_mrps"), [false, false]);
    let problem =
        |index: usize| history["versions"][index]["problem"].as_str().unwrap_or_default().to_owned();
    assert_eq!(problem(0), "");
    assert!(problem(1).contains("is no benchmark record"), "{}", problem(1));
    assert!(problem(2).contains("driver: NVIDIA 570.124 before, NVIDIA 999.9 after"), "{}", problem(2));
    let text = repository.compare(&["history", "out/a record.json"]);
    assert!(stdout(&text).contains("not comparable"), "{}", stdout(&text));
}

#[test]
fn the_filter_chooses_and_scenes_are_those_of_all() {
    let repository = course(&[1.0]);
    let mut fewer = faster(2, 1.1);
    fewer.results.retain(|point| point.scene.name != "city");
    repository.record("out/a record.json", 2, &fewer);
    repository.commit(&["-m", "Fewer"]);
    let history = json(&repository, &["--variant", "Wide*"]);
    assert_eq!(history["scenes"], serde_json::json!(["sponza", "forest"]));
    assert_eq!(history["courses"].as_array().unwrap().len(), 2);
    assert_eq!(points(&history, "Wide4", "secondary_mrps"), [false, true]);
    let nothing = repository.compare(&["history", "--variant", "Wide9"]);
    assert!(stderr(&nothing).contains("variants Binary, Wide4"), "{}", stderr(&nothing));
}

#[test]
fn what_is_not_there_is_an_error() {
    let repository = Repository::new();
    let none = repository.compare(&["history"]);
    assert_eq!(none.status.code(), Some(1));
    assert!(stderr(&none).contains("name one"), "{}", stderr(&none));
    let unknown = repository.compare(&["history", "none.json"]);
    assert!(stderr(&unknown).contains("no commit has"), "{}", stderr(&unknown));
    let text = repository.compare(&["history", "README"]);
    assert!(stderr(&text).contains("no version can be read"), "{}", stderr(&text));
    let folder = repository.beside("outside");
    std::fs::create_dir(&folder).unwrap();
    let outside = compare_in(&folder, &["history"]);
    assert!(stderr(&outside).contains("in the working tree of a git repository"), "{}", stderr(&outside));
}
