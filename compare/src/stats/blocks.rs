//! Samples that resemble their neighbours are joined.
//!
//! Resampling takes values for exchangeable: that a value came right after another must not matter. Where it does,
//! values are cut into runs of neighbours, and the middles of these runs are resampled in their place (Carlstein
//! 1986: blocks that do not overlap). That also bounds the time that a record of many samples takes.

use super::{Cell, Group, Middle};

/// So many blocks of a group and side are enough: with more, an interval is hardly narrower (Student's t of 30
/// degrees of freedom is 4% above the normal distribution), and resampling takes longer.
const MOST: usize = 16;

/// A group and side keeps at least so many blocks, if it has so many values.
const FEWEST: usize = 3;

/// The cell with blocks for values, where neighbours are correlated or there are many values.
pub fn joined(cell: &Cell) -> Cell {
    let wanted = length(correlation(&cell.groups));
    let join = |group: &Group| {
        // Both sides are cut into pieces of the same length, or else they would not scatter alike.
        let least = group.old.len().min(group.new.len());
        let length = wanted.min(least / FEWEST).max(least.div_ceil(MOST)).max(1);
        let cut = |values: &[f64]| cut(values, length).map(|block| cell.middle.of(block)).collect();
        Group { weight: group.weight, old: cut(&group.old), new: cut(&group.new) }
    };
    Cell { middle: cell.middle, groups: cell.groups.iter().map(join).collect() }
}

/// The same of groups that have one side: each with blocks for its values.
pub fn alone(groups: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let groups = groups.into_iter().map(|values| Group::against(1.0, 1.0, values)).collect();
    joined(&Cell { middle: Middle::Mean, groups }).groups.into_iter().map(|group| group.new).collect()
}

/// Cuts values into as many pieces of this length as there can be, some of them longer by what is left.
fn cut(values: &[f64], length: usize) -> impl Iterator<Item = &[f64]> {
    let pieces = (values.len() / length).max(1);
    let at = move |piece: usize| piece * values.len() / pieces;
    (0..pieces).map(move |piece| &values[at(piece)..at(piece + 1)])
}

/// How long blocks must be for neighbours of such a correlation. If each value depends on the one before by r and
/// on nothing else, the mean of many is as unsure as if there were (1 + r) / (1 - r) times fewer; blocks of about
/// twice that length are nearly independent.
fn length(correlation: f64) -> usize {
    if correlation > 0.0 {
        (2.0 * (1.0 + correlation) / (1.0 - correlation).max(1e-3)).ceil() as usize
    } else {
        1
    }
}

/// The correlation of a value with the next one, over all groups and both sides together because each has few;
/// 0 unless it is larger than chance explains (95%, one-sided).
fn correlation(groups: &[Group]) -> f64 {
    let (mut products, mut squares, mut pairs, mut bias) = (0.0, 0.0, 0.0, 0.0);
    for values in groups.iter().flat_map(|group| [&group.old, &group.new]) {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        products += values.windows(2).map(|pair| (pair[0] - mean) * (pair[1] - mean)).sum::<f64>();
        let own = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        squares += own;
        // Values that are all the same, such as those of a side that is 1 by definition, tell nothing.
        pairs += if own > 0.0 { n - 1.0 } else { 0.0 };
        // Around their own mean, n independent values correlate by -1 / n.
        bias += own / n;
    }
    if squares <= 0.0 || pairs < 1.0 {
        return 0.0;
    }
    let correlation = (products + bias) / squares;
    if correlation > 1.645 / f64::sqrt(pairs) { correlation } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::super::Random;
    use super::*;

    fn cell(old: Vec<f64>, new: Vec<f64>) -> Cell {
        Cell { middle: Middle::Mean, groups: vec![Group { weight: 1.0, old, new }] }
    }

    #[test]
    fn independent_values_stay_apart() {
        let mut random = Random::named("independent");
        let mut noise = |n: usize| (0..n).map(|_| 100.0 + random.normal()).collect::<Vec<_>>();
        let few = cell(noise(15), noise(3));
        assert_eq!(joined(&few), few);
    }

    #[test]
    fn neighbours_that_sink_together_are_joined() {
        let wave = |n: usize| (0..n).map(|i| 100.0 + (i as f64 / 3.0).sin()).collect::<Vec<_>>();
        let blocks = joined(&cell(wave(40), wave(20)));
        let lengths = [blocks.groups[0].old.len(), blocks.groups[0].new.len()];
        assert_eq!(lengths, [6, 3]);
        let [whole, joined] = [cell(wave(40), wave(20)), blocks].map(|cell| cell.figures()[0]);
        assert!((whole - joined).abs() < 0.05, "blocks differ in length by one");
    }

    #[test]
    fn a_side_that_is_always_the_same_tells_nothing_of_neighbours() {
        let values: Vec<f64> = (0..15).map(|i| 100.0 + (f64::from(i) / 2.0).sin()).collect();
        let both = correlation(&cell(values.clone(), values.clone()).groups);
        let one = correlation(&cell(vec![1.0; 15], values).groups);
        assert!(both > 0.0 && (one - both).abs() < 1e-12, "{both}, {one}");
        // So weak a correlation of 15 values is chance, whatever stands on the other side.
        let mut random = Random::named("weak 3");
        let noise: Vec<f64> = (0..15).map(|_| 100.0 + random.normal()).collect();
        assert_eq!(alone(vec![noise.clone()]), [noise]);
    }

    #[test]
    fn many_values_become_few_blocks() {
        let mut random = Random::named("many");
        let mut noise = |n: usize| (0..n).map(|_| 100.0 + random.normal()).collect::<Vec<_>>();
        let group = &joined(&cell(noise(1000), noise(100))).groups[0];
        assert_eq!((group.old.len(), group.new.len()), (142, 14));
    }

    #[test]
    fn every_value_is_in_one_block() {
        let values: Vec<f64> = (0..23).map(f64::from).collect();
        for length in 1..=30 {
            let pieces: Vec<&[f64]> = cut(&values, length).collect();
            assert_eq!(pieces.concat(), values);
            let [least, most] = [pieces.iter().map(|p| p.len()).min(), pieces.iter().map(|p| p.len()).max()];
            assert!(pieces.len() == 1 || least >= Some(length));
            assert!(most.unwrap() <= 2 * length.max(12));
        }
    }
}
