//! Against SciPy and statsmodels, on fixed data: `tests/data/statistics.py` made the values.

use super::interval::with_resamples;
use super::*;
use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Deserialize)]
struct Values {
    cases: BTreeMap<String, Case>,
    holm: Corrected,
    samples: Vec<Plan>,
}

#[derive(Deserialize)]
struct Case {
    groups: Vec<Sides>,
    log_ratio: f64,
    variance: f64,
    p: Option<f64>,
    exact: bool,
    interval: [f64; 2],
}

#[derive(Deserialize)]
struct Sides {
    old: Vec<f64>,
    new: Vec<f64>,
}

#[derive(Deserialize)]
struct Corrected {
    p: Vec<f64>,
    adjusted: Vec<f64>,
}

#[derive(Deserialize)]
struct Plan {
    effect: f64,
    tests: usize,
    number: f64,
}

impl Case {
    fn cell(&self) -> Cell {
        let weight = 1.0 / self.groups.len() as f64;
        let group = |sides: &Sides| Group { weight, old: sides.old.clone(), new: sides.new.clone() };
        Cell { middle: Middle::Mean, groups: self.groups.iter().map(group).collect() }
    }
}

fn values() -> Values {
    serde_json::from_str(include_str!("../../tests/data/statistics.json")).unwrap()
}

#[track_caller]
fn near(found: f64, expected: f64, tolerance: f64, name: &str) {
    assert!((found - expected).abs() <= tolerance, "{name}: {found} is not {expected}");
}

#[test]
fn ratios_and_their_variance() {
    for (name, case) in values().cases {
        let cell = case.cell();
        near(cell.log_ratio(), case.log_ratio, 1e-12, &name);
        near(cell.variance().unwrap(), case.variance, 1e-9 * case.variance, &name);
    }
}

#[test]
fn p_values() {
    let mut exact = 0;
    for (name, case) in values().cases {
        let found = super::p_values(&[case.cell()], 20_000, &mut Random::named(&name)).unwrap().cells[0];
        match case.p {
            Some(p) if case.exact => {
                exact += 1;
                near(found, p, 1e-12, &name);
            }
            // Both sampled: five deviations, of ours as of theirs.
            Some(p) => near(found, p, 5.0 * (2.0 * p / 20_000.0).sqrt(), &name),
            None => assert!(found > 0.0 && found < 0.05, "{name}: {found}"),
        }
    }
    assert!(exact >= 5);
}

#[test]
fn intervals() {
    for (name, case) in values().cases {
        let (each, mean) = with_resamples(100_000, &[case.cell()], &mut Random::named(&name));
        let [low, high] = case.interval;
        let found = each[0].unwrap();
        // Ends of both are random by about 0.3% of the width.
        near(found.low, low, 0.015 * (high - low), &name);
        near(found.high, high, 0.015 * (high - low), &name);
        assert_eq!(mean, each[0], "{name}");
    }
}

#[test]
fn corrections_for_many_tests() {
    let Corrected { p, adjusted } = values().holm;
    for (found, expected) in holm(&p).into_iter().zip(adjusted) {
        near(found, expected, 1e-12, "holm");
    }
}

#[test]
fn numbers_of_samples() {
    for Plan { effect, tests, number } in values().samples {
        let now = 10;
        let found = samples(Goal::Change { tests, groups: 1 }, effect, 2.0 / now as f64, now).unwrap();
        // statsmodels counts the chance of a significant change in the wrong direction too, which is next to none.
        near(found as f64, number.ceil(), 1.0, "samples");
    }
}
