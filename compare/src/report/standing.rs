//! How each variant stands to the reference, on each scene and over all.

use crate::figure::Figure;
use crate::plot::chart::Value;
use crate::plot::ratios::{Pair, ratios};
use crate::select::{Entry, Pass, Selection, geometric_mean};
use std::collections::BTreeMap;

/// The figures that are compared.
pub const COMPARED: [Figure; 5] =
    [Figure::Primary, Figure::Secondary, Figure::Total, Figure::Nodes, Figure::Bytes];

/// A variant with one set of parameters, over all scenes that it was measured on.
#[derive(Clone, Debug)]
pub struct Standing {
    /// The variant.
    pub variant: String,
    /// What sets it apart from others of the variant.
    pub pass: Pass,
    /// Scenes that it was measured on.
    pub scenes: usize,
    /// The geometric mean over these scenes of each of [`COMPARED`]; a gap where one scene has none.
    pub means: [Option<f64>; COMPARED.len()],
    /// The geometric mean of the ratios to the reference, with its interval where there is one.
    pub ratios: [Option<Value>; COMPARED.len()],
}

/// All of them.
#[derive(Clone, Debug, Default)]
pub struct Standings {
    /// In the record's order.
    pub all: Vec<Standing>,
    /// Scenes of the record.
    pub scenes: usize,
    ratios: BTreeMap<(usize, Figure), Value>,
}

impl Standings {
    /// Compares all points with those of the variant `reference` on the same scene.
    pub fn new(selection: &Selection, reference: &str) -> Standings {
        let scenes = selection.scenes();
        let mut standings = Standings { scenes: scenes.len(), ..Standings::default() };
        for variant in selection.variants() {
            for pass in selection.passes(variant) {
                let entries: Vec<&Entry> =
                    scenes.iter().filter_map(|scene| selection.entry(scene, variant, pass)).collect();
                let pairs: Vec<Option<Pair>> = entries
                    .iter()
                    .map(|entry| Some([selection.reference(entry, reference)?.point, entry.point]))
                    .collect();
                let mut compared = COMPARED.map(|figure| ratios(&pairs, figure));
                if variant == reference {
                    // A point is exactly once itself, however its samples scatter.
                    for of in &mut compared {
                        of.each.iter_mut().chain([&mut of.mean]).flatten().for_each(|v| v.interval = None);
                    }
                }
                for (figure, of) in COMPARED.into_iter().zip(&compared) {
                    for (entry, ratio) in entries.iter().zip(&of.each) {
                        if let Some(ratio) = ratio {
                            standings.ratios.insert((entry.index, figure), *ratio);
                        }
                    }
                }
                let mean = |figure: Figure| {
                    let values: Option<Vec<f64>> =
                        entries.iter().map(|entry| figure.of(entry.point)).collect();
                    geometric_mean(values?)
                };
                standings.all.push(Standing {
                    variant: variant.to_owned(),
                    pass: pass.clone(),
                    scenes: entries.len(),
                    means: COMPARED.map(mean),
                    ratios: compared.map(|of| of.mean),
                });
            }
        }
        standings
    }

    /// A figure of a point as a multiple of the reference's.
    pub fn ratio(&self, entry: &Entry, figure: Figure) -> Option<&Value> {
        self.ratios.get(&(entry.index, figure))
    }

    /// How one stands to another, over the scenes that both were measured on.
    pub fn against(
        &self,
        selection: &Selection,
        old: &Standing,
        new: &Standing,
        figure: Figure,
    ) -> Option<Value> {
        let of = |scene: &str, standing: &Standing| {
            selection.entry(scene, &standing.variant, &standing.pass).map(|entry| entry.point)
        };
        let pair = |scene: &&str| -> Option<Pair> { Some([of(scene, old)?, of(scene, new)?]) };
        let pairs: Vec<Option<Pair>> = selection.scenes().iter().map(pair).collect();
        ratios(&pairs, figure).mean
    }

    /// Those that were measured on all scenes and have the figure, the best first.
    pub fn ranked(&self, of: usize) -> Vec<&Standing> {
        let mut complete: Vec<(f64, &Standing)> = self
            .all
            .iter()
            .filter(|standing| standing.scenes == self.scenes)
            .filter_map(|standing| Some((standing.means[of]?, standing)))
            .collect();
        complete.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        if COMPARED[of].better() == crate::figure::Better::High {
            complete.reverse();
        }
        complete.into_iter().map(|(_, standing)| standing).collect()
    }
}
