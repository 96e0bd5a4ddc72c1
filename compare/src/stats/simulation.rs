//! How often the statistics are wrong, and how often they see what is there, on simulated measurements.

use super::*;
use rayon::prelude::*;

/// Rates of several views on two sides, of which the new one is faster by `change`. Each view has a rate and a
/// scatter of its own; a value depends on the one before by `memory`.
fn simulated(random: &mut Random, views: usize, samples: usize, change: f64, memory: f64) -> Cell {
    let group = |view: usize| {
        let rate = 100.0 * (1.0 + view as f64);
        let mut side = |rate: f64| -> Vec<f64> {
            let mut noise = random.normal();
            let mut next = || {
                noise = memory * noise + (1.0 - memory * memory).sqrt() * random.normal();
                rate * (1.0 + 0.01 * noise)
            };
            (0..samples).map(|_| next()).collect()
        };
        Group { weight: 1.0 / views as f64, old: side(rate), new: side(rate * (1.0 + change)) }
    };
    let groups = (0..views).map(group).collect();
    blocks::joined(&Cell { middle: Middle::Mean, groups })
}

/// The share of 1 to `count` for which something happens.
fn share(count: usize, happens: impl Fn(&mut Random) -> bool + Sync) -> f64 {
    let times =
        (0..count).into_par_iter().filter(|one| happens(&mut Random::named(&format!("simulated {one}"))));
    times.count() as f64 / count as f64
}

/// A share this much above another is no chance: three deviations.
fn beyond(level: f64, count: usize) -> f64 {
    level + 3.0 * (level * (1.0 - level) / count as f64).sqrt()
}

fn p(cells: &[Cell], random: &mut Random) -> PValues {
    p_values(cells, 1000, random).unwrap()
}

#[test]
fn of_ten_thousand_comparisons_of_equals_at_most_five_percent_look_changed() {
    for (views, samples) in [(1, 5), (2, 3), (3, 5)] {
        let wrong = share(10_000, |random| {
            let cells = [simulated(random, views, samples, 0.0, 0.0)];
            // As a verdict has it: the interval is asked too.
            p(&cells, random).cells[0] < 0.05
                && intervals(&cells, random)
                    .1
                    .is_some_and(|interval| interval.low > 1.0 || interval.high < 1.0)
        });
        println!("{views} views, {samples} samples: {wrong}");
        assert!(wrong <= 0.05, "{views} views, {samples} samples: {wrong}");
    }
}

#[test]
fn of_ten_thousand_tables_of_equals_at_most_five_percent_have_any_change() {
    let wrong = share(10_000, |random| {
        // Two variants on three scenes, and the mean of each over the scenes.
        let mut all = Vec::new();
        for _ in 0..2 {
            let scenes: Vec<Cell> = (0..3).map(|_| simulated(random, 3, 4, 0.0, 0.0)).collect();
            let found = p(&scenes, random);
            all.extend(found.cells);
            all.push(found.mean);
        }
        holm(&all).into_iter().any(|p| p < 0.05)
    });
    println!("{wrong}");
    assert!(wrong <= 0.05, "{wrong}");
}

/// Without blocks, 15% would look changed with a memory of 0.3, and 34% with one of 0.6.
#[test]
fn memory_from_one_sample_to_the_next_is_taken_into_account() {
    let wrong = |memory| {
        share(2000, |random| {
            let cell = simulated(random, 8, 15, 0.0, memory);
            p(&[cell], random).cells[0] < 0.05
        })
    };
    for (memory, at_most) in [(0.0, 0.06), (0.3, 0.09), (0.6, 0.13)] {
        let wrong = wrong(memory);
        println!("memory {memory}: {wrong}");
        assert!(wrong < at_most, "memory {memory}: {wrong}");
    }
}

#[test]
fn ninety_five_of_a_hundred_intervals_contain_the_truth() {
    for (views, samples) in [(8, 3), (8, 15), (1, 5), (1, 15)] {
        let wrong = share(2000, |random| {
            let cell = simulated(random, views, samples, 0.02, 0.0);
            // There is none where neighbours look alike and few blocks of one view are left.
            intervals(&[cell], random).1.is_some_and(|interval| interval.low > 1.02 || interval.high < 1.02)
        });
        println!("{views} views, {samples} samples: {wrong}");
        assert!(wrong < beyond(0.05, 2000), "{views} views, {samples} samples: {wrong}");
    }
}

/// Samples that scatter by 1%, as primary rates on a GPU do; of secondary ones it is less.
#[test]
fn changes_are_seen() {
    // Among 50 tests, Holm's correction asks for a p of a thousandth at first.
    let seen = |views, samples, change| {
        let p: Vec<f64> = (0..1000)
            .into_par_iter()
            .map(|one| {
                let random = &mut Random::named(&format!("changed {one}"));
                let cell = simulated(random, views, samples, change, 0.0);
                p_values(&[cell], 2000, random).unwrap().cells[0]
            })
            .collect();
        [0.05, 0.001].map(|level| p.iter().filter(|p| **p < level).count() as f64 / 1000.0)
    };
    for (views, samples, change, alone, among_fifty) in [
        (8, 3, 0.01, 0.75, 0.2),
        (8, 5, 0.01, 0.95, 0.5),
        (8, 15, 0.01, 0.99, 0.99),
        (8, 3, 0.02, 0.99, 0.85),
        (8, 5, 0.02, 0.99, 0.99),
        (8, 3, 0.05, 0.99, 0.99),
        (1, 5, 0.05, 0.99, 0.0),
    ] {
        let seen = seen(views, samples, change);
        println!("{views} views, {samples} samples, {change}: {seen:?}");
        assert!(seen[0] > alone && seen[1] >= among_fifty, "{views}, {samples}, {change}: {seen:?}");
    }
}
