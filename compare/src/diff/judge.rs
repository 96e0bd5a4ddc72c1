//! How sure each change is, and what comes of it.

use super::cell::{FIGURES, cell};
use super::comparison::{Change, Comparison, Line, Section};
use super::pair::{Pair, Pairs};
use super::verdict::{Evidence, Thresholds, Verdict};
use crate::figure::Figure;
use crate::select::{Pass, in_order};
use crate::stats::{Cell, Random, blocks, holm, intervals_of_joined, least_p, p_values, permutations};
use rayon::prelude::*;

impl Comparison {
    /// With the changes of these pairs.
    pub fn judged(mut self, pairs: &Pairs) -> Comparison {
        let scenes: Vec<String> = pairs.scenes().into_iter().map(String::from).collect();
        let mut families = Vec::new();
        for key in in_order(pairs.pairs.iter().map(|(pass, pair)| (pair.old.variant(), pass))) {
            let own = pairs.pairs.iter().filter(|(pass, pair)| (pair.old.variant(), pass) == key);
            let own: Vec<&Pair> = own.map(|(_, pair)| pair).collect();
            for figure in FIGURES {
                let cells = own.iter().filter_map(|pair| Some((pair.old.scene(), cell(figure, pair)?)));
                families.push(Family { variant: key.0, pass: key.1, figure, cells: cells.collect() });
            }
        }
        families.retain(|family| !family.cells.is_empty());
        let most = permutations(families.iter().map(Family::tests).sum());
        let mut measured: Vec<Vec<Evidence>> =
            families.par_iter().map(|family| family.evidence(most)).collect();
        self.tests = correct(&mut measured);
        for (family, evidence) in families.iter().zip(&measured) {
            let line = family.line(evidence, &scenes, self.thresholds, self.tests);
            match self.sections.last_mut() {
                Some(last) if (last.variant.as_str(), &last.pass) == (family.variant, family.pass) => {
                    last.lines.push(line);
                }
                _ => self.sections.push(Section {
                    variant: family.variant.to_owned(),
                    pass: family.pass.clone(),
                    lines: vec![line],
                }),
            }
        }
        self
    }
}

/// One figure of one variant in one pass, on all scenes that both sides have.
struct Family<'p> {
    variant: &'p str,
    pass: &'p Pass,
    figure: Figure,
    cells: Vec<(&'p str, Cell)>,
}

impl Family<'_> {
    /// Whether it has a mean that is not the one cell's.
    fn has_mean(&self) -> bool {
        self.cells.len() > 1
    }

    fn tests(&self) -> usize {
        self.cells.len() + usize::from(self.has_mean())
    }

    /// That of each cell and, behind them, of their mean where there is one.
    fn evidence(&self, most: usize) -> Vec<Evidence> {
        let mut random = Random::named(&format!("{} {} {}", self.variant, self.pass, self.figure.column()));
        let cells: Vec<&Cell> = self.cells.iter().map(|(_, cell)| cell).collect();
        let joined: Vec<Cell> = cells.iter().map(|cell| blocks::joined(cell)).collect();
        let (each, mean) = intervals_of_joined(&cells, &joined, &mut random);
        let p = p_values(&joined, most, &mut random);
        let count = cells.len() as f64;
        let mut evidence: Vec<Evidence> = (0..cells.len())
            .map(|at| Evidence {
                figure: self.figure,
                ratio: cells[at].log_ratio().exp(),
                interval: each[at],
                p: p.as_ref().map(|p| p.cells[at]).filter(|_| each[at].is_some()),
                variance: joined[at].variance(),
                samples: cells[at].least(),
                groups: cells[at].groups.len(),
                least_p: least_p(joined[at].groups.iter()),
            })
            .collect();
        if self.has_mean() {
            let variances: Option<Vec<f64>> = evidence.iter().map(|one| one.variance).collect();
            evidence.push(Evidence {
                figure: self.figure,
                ratio: (cells.iter().map(|cell| cell.log_ratio()).sum::<f64>() / count).exp(),
                interval: mean,
                p: p.map(|p| p.mean).filter(|_| mean.is_some()),
                variance: variances.map(|all| all.iter().sum::<f64>() / (count * count)),
                samples: cells.iter().map(|cell| cell.least()).min().unwrap_or(0),
                groups: cells.iter().map(|cell| cell.groups.len()).sum(),
                least_p: least_p(joined.iter().flat_map(|cell| &cell.groups)),
            });
        }
        evidence
    }

    fn line(&self, evidence: &[Evidence], scenes: &[String], thresholds: Thresholds, tests: usize) -> Line {
        let change = |evidence: &Evidence, cell: Option<&(&str, Cell)>| {
            let (verdict, samples_needed) = evidence.verdict(thresholds, tests);
            let figures = cell.map(|(_, cell)| cell.figures());
            Change {
                scene: cell.map(|(scene, _)| scene.to_string()),
                old: figures.map(|[old, _]| old),
                new: figures.map(|[_, new]| new),
                ratio: evidence.ratio,
                interval: evidence.interval,
                p: evidence.p,
                significant: evidence.significant(thresholds),
                too_few: verdict == Verdict::Unclear && evidence.too_few(tests),
                verdict,
                samples_needed,
            }
        };
        let has = |scene: &String| self.cells.iter().any(|(own, _)| own == scene);
        Line {
            figure: self.figure,
            scenes: self.cells.iter().zip(evidence).map(|(cell, one)| change(one, Some(cell))).collect(),
            mean: evidence.get(self.cells.len()).map(|mean| change(mean, None)),
            missing: scenes.iter().filter(|scene| !has(scene)).cloned().collect(),
        }
    }
}

/// Holm's correction over all p-values there are, and their number.
fn correct(families: &mut [Vec<Evidence>]) -> usize {
    let raw: Vec<f64> = families.iter().flatten().filter_map(|evidence| evidence.p).collect();
    let mut adjusted = holm(&raw).into_iter();
    for evidence in families.iter_mut().flatten().filter(|evidence| evidence.p.is_some()) {
        evidence.p = adjusted.next();
    }
    raw.len()
}
