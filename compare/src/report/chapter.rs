//! What the page says about one record.

use super::standing::Standings;
use super::{Source, origin, plots, points, scene, summary, trust};
use crate::select::{Entry, Selection};
use maud::{Markup, html};

/// One record in the page.
#[derive(Debug)]
pub struct Chapter<'a> {
    /// Its number in the page, from 1: part of every identifier in it.
    pub number: usize,
    /// The record and where it lay.
    pub source: &'a Source<'a>,
    /// The points that are shown.
    pub selection: Selection<'a>,
    /// The variant that others are relative to.
    pub reference: &'a str,
    /// How variants stand to that one.
    pub standings: Standings,
}

/// The parts of a chapter: identifier and title.
pub const PARTS: [(&str, &str); 6] = [
    ("summary", "Summary"),
    ("trust", "Can it be trusted?"),
    ("origin", "What was measured on what"),
    ("points", "All points"),
    ("plots", "Plots"),
    ("scenes", "Scenes, with every sample"),
];

impl<'a> Chapter<'a> {
    /// The chapter with this number.
    pub fn new(
        number: usize,
        source: &'a Source<'a>,
        selection: Selection<'a>,
        reference: &'a str,
    ) -> Chapter<'a> {
        let standings = Standings::new(&selection, reference);
        Chapter { number, source, selection, reference, standings }
    }

    /// The identifier of something in this chapter.
    pub fn id(&self, what: &str) -> String {
        format!("r{}-{what}", self.number)
    }

    /// The identifier of a point's samples.
    pub fn id_of(&self, entry: &Entry) -> String {
        self.id(&format!("p{}", entry.index))
    }

    /// Whether a variant has several points on one scene, so that they have to be told apart.
    pub fn has_passes(&self) -> bool {
        self.selection.entries.iter().any(|entry| !entry.pass.0.is_empty())
    }

    /// The chapter.
    pub fn markup(&self) -> Markup {
        html! {
            section.chapter id=(self.id("record")) {
                h2 { (self.source.name) }
                p.lead { (origin::line(self.selection.record)) }
                @for (part, title) in PARTS {
                    section id=(self.id(part)) {
                        h3 { (title) }
                        @match part {
                            "summary" => (summary::markup(self)),
                            "trust" => (trust::markup(self)),
                            "origin" => (origin::markup(self)),
                            "points" => (points::markup(self)),
                            "plots" => (plots::markup(self)),
                            _ => (scene::markup(self)),
                        }
                    }
                }
            }
        }
    }
}
