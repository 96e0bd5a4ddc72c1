use super::*;
use record::example;

/// `Binary` and `Wide4` on two scenes, the second with several values of a parameter on the first scene.
fn swept() -> Record {
    let mut record = example();
    let point = record.results[0].clone();
    let mut points = Vec::new();
    for (scene, variant, threshold) in [
        ("sponza", "Binary", None),
        ("sponza", "Wide4", Some(4u32)),
        ("sponza", "Wide4", Some(8u32)),
        ("city", "Wide4", Some(8u32)),
        ("city", "Binary", None),
    ] {
        let mut point = point.clone();
        point.scene.name = scene.into();
        point.variant = variant.into();
        if let Some(threshold) = threshold {
            point.parameters.set("cbtc.threshold", threshold);
        }
        points.push(point);
    }
    record.results = points;
    record
}

#[test]
fn points_are_found_by_scene_variant_and_pass() {
    let record = swept();
    assert_eq!(record.validate(), Ok(()));
    let selection = Selection::new(&record);
    assert_eq!(selection.scenes(), ["sponza", "city"]);
    assert_eq!(selection.variants(), ["Binary", "Wide4"]);
    let passes: Vec<String> = selection.passes("Wide4").iter().map(ToString::to_string).collect();
    assert_eq!(passes, ["cbtc.threshold=4", "cbtc.threshold=8"]);
    assert_eq!(selection.passes("Binary"), [&Pass::default()]);
    let pass = selection.passes("Wide4")[1].clone();
    assert_eq!(selection.entry("sponza", "Wide4", &pass).unwrap().index, 2);
    assert_eq!(selection.entry("city", "Wide4", &pass).unwrap().index, 3);
    assert!(selection.entry("city", "Wide4", selection.passes("Wide4")[0]).is_none());
}

#[test]
fn what_is_relative_has_a_reference_on_the_same_scene() {
    let mut record = swept();
    for sample in &mut record.results[2].views[0].samples {
        sample.depths[0].milliseconds /= 2.0;
    }
    let selection = Selection::new(&record);
    let relative = |index: usize| selection.relative(&selection.entries[index], REFERENCE, Figure::Primary);
    assert_eq!(relative(0), Some(1.0));
    assert!((relative(2).unwrap() - 2.0).abs() < 1e-12);
    assert_eq!(selection.relative(&selection.entries[0], "Wide6", Figure::Primary), None);
    assert_eq!(selection.relative(&selection.entries[0], REFERENCE, Figure::Sampling), None);
    let among = selection.reference(&selection.entries[1], "Wide4").unwrap();
    assert_eq!(among.index, 1, "of several points the one of the same pass");
    assert!(selection.reference(&selection.entries[0], "Wide4").is_none());
}

#[test]
fn filters_choose_and_an_empty_choice_says_what_there_is() {
    let record = swept();
    let filter = |scenes: &[&str], variants: &[&str]| Filter {
        scenes: scenes.iter().map(ToString::to_string).collect(),
        variants: variants.iter().map(ToString::to_string).collect(),
    };
    let chosen = Selection::filtered(&record, &filter(&["c*"], &[])).unwrap();
    assert_eq!(chosen.scenes(), ["city"]);
    assert_eq!(chosen.passes("Wide4"), [&Pass::default()], "the one that is left needs no name");
    let error = Selection::filtered(&record, &filter(&[], &["Wide6"])).unwrap_err().to_string();
    assert!(error.contains("scenes sponza, city") && error.contains("variants Binary, Wide4"), "{error}");
}

#[test]
fn stars_stand_for_any_text() {
    for (pattern, name) in
        [("*", ""), ("Wide4*", "Wide4"), ("*CBTC", "Wide4 CBTC"), ("W*Q*C", "Wide4 Q CBTC")]
    {
        assert!(matches(pattern, name), "{pattern} {name}");
    }
    for (pattern, name) in [("Wide4", "Wide4 CBTC"), ("*Q", "Wide4"), ("", "x"), ("é*", "e")] {
        assert!(!matches(pattern, name), "{pattern} {name}");
    }
}

#[test]
fn whole_numbers_are_the_same_however_they_are_written() {
    let [mut a, mut b] = [Parameters::default(), Parameters::default()];
    a.set("x", 2u32);
    b.set("x", 2.0);
    assert!(differing(&a, &b).is_empty());
    b.set("y", "none");
    assert_eq!(differing(&a, &b), BTreeSet::from(["y".to_string()]));
}

#[test]
fn geometric_means_need_positive_numbers() {
    assert!((geometric_mean([2.0, 0.5, 8.0]).unwrap() - 2.0).abs() < 1e-12);
    assert_eq!(geometric_mean([]), None);
    assert_eq!(geometric_mean([1.0, 0.0]), None);
    assert_eq!(ratio(1.0, 0.0), None);
}
