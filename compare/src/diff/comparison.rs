//! What a comparison holds; every format is made of it.

use super::Named;
use super::verdict::{Thresholds, Verdict};
use crate::figure::{Better, Figure};
use crate::select::Pass;
use crate::stats::Interval;
use serde::Serialize;

/// What changed from one record to another.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// The record from before.
    pub old: Side,
    /// The record from after.
    pub new: Side,
    /// Which changes are as good as none.
    pub thresholds: Thresholds,
    /// Why the two should not be compared; empty where they may.
    pub obstacles: Vec<String>,
    /// What else to know.
    pub remarks: Vec<String>,
    /// Tests over which Holm's correction was made.
    pub tests: usize,
    /// The changes, by variant and pass.
    pub sections: Vec<Section>,
}

/// A record, in short.
#[derive(Clone, Debug, Serialize)]
pub struct Side {
    /// Its file.
    pub file: String,
    /// The program that measured.
    pub tool: String,
    /// The commit it was built from, where that is known; ends in `-dirty` if something had been changed since.
    pub commit: Option<String>,
    /// When the run began.
    pub started: String,
    /// Name of the device.
    pub device: String,
    /// Its driver.
    pub driver: String,
}

/// The changes of one variant in one pass.
#[derive(Clone, Debug, Serialize)]
pub struct Section {
    /// Name of the variant.
    pub variant: String,
    /// What sets its points apart from others of the same variant.
    pub pass: Pass,
    /// One for each figure that both sides have.
    pub lines: Vec<Line>,
}

/// The changes of one figure.
#[derive(Clone, Debug, Serialize)]
pub struct Line {
    /// The figure, by the name of its column.
    pub figure: Figure,
    /// The changes, scene by scene.
    pub scenes: Vec<Change>,
    /// The geometric mean over these scenes; absent where there is only one.
    pub mean: Option<Change>,
    /// Scenes that the records have and this mean does not.
    pub missing: Vec<String>,
}

/// One change.
#[derive(Clone, Debug, Serialize)]
pub struct Change {
    /// The scene; absent of a mean over scenes.
    pub scene: Option<String>,
    /// The old value; absent of a mean over scenes.
    pub old: Option<f64>,
    /// The new value; absent of a mean over scenes.
    pub new: Option<f64>,
    /// New over old.
    pub ratio: f64,
    /// The 95% confidence interval of the ratio; absent where there are too few samples to tell.
    pub interval: Option<Interval>,
    /// How probable so large a change is by chance, after Holm's correction over the whole table; absent where
    /// there are too few samples to tell.
    pub p: Option<f64>,
    /// Whether chance is a poor explanation.
    pub significant: bool,
    /// Whether it is unclear because there are too few samples, so that nothing could be significant.
    pub too_few: bool,
    /// What comes of it.
    pub verdict: Verdict,
    /// Of what is unclear, about how many samples of each view would tell; absent where none or too many would.
    pub samples_needed: Option<usize>,
}

impl Side {
    /// A record, in short.
    pub fn of(named: Named) -> Side {
        let record = named.record;
        let commit = record.tool.commit.as_ref().map(|commit| {
            let dirty = if commit.dirty { "-dirty" } else { "" };
            format!("{}{dirty}", commit.hash)
        });
        let driver = &record.device.driver;
        let known = if driver.info.is_empty() { &driver.version } else { &driver.info };
        Side {
            file: named.path.display().to_string(),
            tool: format!("{} {}", record.tool.name, record.tool.version),
            commit,
            started: record.started.to_string(),
            device: record.device.name.clone(),
            driver: format!("{} {known}", driver.name),
        }
    }
}

impl Change {
    /// How much more, as a share; below 0 for less.
    pub fn share(&self) -> f64 {
        self.ratio - 1.0
    }
}

impl Line {
    /// All changes, that of the mean last.
    pub fn changes(&self) -> impl Iterator<Item = &Change> {
        self.scenes.iter().chain(&self.mean)
    }

    /// The best change and the worst; nothing without scenes.
    pub fn extremes(&self) -> Option<(&Change, &Change)> {
        let by_ratio = |a: &&Change, b: &&Change| a.ratio.total_cmp(&b.ratio);
        let (least, most) = (self.scenes.iter().min_by(by_ratio)?, self.scenes.iter().max_by(by_ratio)?);
        Some(if self.figure.better() == Better::High { (most, least) } else { (least, most) })
    }
}

impl Comparison {
    /// All changes with where they belong.
    pub fn changes(&self) -> impl Iterator<Item = (&Section, &Line, &Change)> {
        let lines = |section| -> Vec<_> { section_lines(section).collect() };
        self.sections.iter().flat_map(lines)
    }

    /// Of how many changes for the worse, by more than a share, there are too few samples to tell.
    pub fn undecided(&self, allowed: f64) -> usize {
        self.changes().filter(|(_, line, change)| change.too_few && loss(line, change) > allowed).count()
    }

    /// What became significantly slower by more than a share, in words.
    pub fn regressions(&self, allowed: f64) -> Vec<String> {
        let slower =
            self.changes().filter(|(_, line, change)| change.significant && loss(line, change) > allowed);
        slower
            .map(|(section, line, change)| {
                let scene = change.scene.as_deref().unwrap_or("mean over scenes");
                let variant = match section.pass.0.is_empty() {
                    true => section.variant.clone(),
                    false => format!("{}, {}", section.variant, section.pass),
                };
                format!("{variant}, {scene}: {} {:+.2}%", label(line.figure), 100.0 * change.share())
            })
            .collect()
    }
}

/// By what share it became worse.
fn loss(line: &Line, change: &Change) -> f64 {
    match line.figure.better() {
        Better::High => -change.share(),
        _ => change.share(),
    }
}

fn section_lines(section: &Section) -> impl Iterator<Item = (&Section, &Line, &Change)> {
    section.lines.iter().flat_map(move |line| line.changes().map(move |change| (section, line, change)))
}

/// What a figure is called in a message.
pub fn label(figure: Figure) -> &'static str {
    match figure {
        Figure::Primary => "pMRps",
        Figure::Secondary => "sMRps",
        _ => "build ms",
    }
}

/// A change in a few characters: `~` where chance explains it, and a `?` behind it where nobody can tell.
pub fn shown(change: &Change) -> String {
    let percent = 100.0 * change.share();
    match change {
        _ if change.too_few => format!("{percent:+.2}%?"),
        _ if !change.significant => "~".into(),
        _ => format!("{percent:+.2}%"),
    }
}
