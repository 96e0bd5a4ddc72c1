//! What tables are made of.

use crate::select::{Entry, Filter, REFERENCE, Selection, differing, text};
use record::{Launches, OF_SCENE, Parameters, Point, Rays, Record, Roofline};
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

/// Points of some records, and how they are to be looked at.
#[derive(Debug)]
pub struct Input<'r> {
    /// Each record with the points that were chosen of it.
    pub sources: Vec<Shown<'r>>,
    /// The variant that others are relative to.
    pub reference: String,
    /// Whether somebody asked for that one.
    pub asked: bool,
    /// Which launches speak for a bounce.
    pub launches: Launches,
    /// Rays that decide where both kinds are concerned.
    pub rays: Rays,
    /// What the device can do at best, where somebody has it.
    pub roofline: Option<Roofline>,
    /// What whoever reads the tables should know about how they came to be.
    pub remarks: RefCell<Vec<String>>,
}

/// The points of a record and those that are to be shown.
#[derive(Debug)]
pub struct Shown<'r> {
    /// All points: what others are relative to is among them even where it is not shown.
    pub all: Selection<'r>,
    chosen: BTreeSet<usize>,
    /// The scene of each point, as [`Shown::place`] says it.
    places: Vec<String>,
}

impl<'r> Shown<'r> {
    /// Points of a record that a filter admits.
    ///
    /// # Errors
    /// There are none.
    pub fn new(record: &'r Record, filter: &Filter) -> anyhow::Result<Shown<'r>> {
        let chosen = Selection::filtered(record, filter)?.entries.iter().map(|entry| entry.index).collect();
        let all = Selection::new(record);
        let mut varied: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
        let mut first: BTreeMap<&str, Parameters> = BTreeMap::new();
        for point in &record.results {
            let own = point.scene.parameters();
            let other = first.entry(&point.scene.name).or_insert_with(|| own.clone());
            varied.entry(&point.scene.name).or_default().extend(differing(other, &own));
        }
        let places =
            record.results.iter().map(|point| named(point, &varied[point.scene.name.as_str()])).collect();
        Ok(Shown { all, chosen, places })
    }

    /// The scene of a point and, where the record has several of its name, what its generator was given.
    pub fn place(&self, entry: &Entry) -> &str {
        &self.places[entry.index]
    }

    /// The points to be shown, in the record's order.
    pub fn entries(&self) -> impl Iterator<Item = &Entry<'r>> {
        self.all.entries.iter().filter(|entry| self.chosen.contains(&entry.index))
    }
}

impl<'r> Input<'r> {
    /// Points of some records. A record in which the filter finds none is left out where another has some.
    ///
    /// # Errors
    /// No record has such a point, or somebody asked for values relative to a variant that no record has.
    pub fn new(records: &'r [Record], filter: &Filter, reference: Option<&str>) -> anyhow::Result<Input<'r>> {
        let (found, failed): (Vec<_>, Vec<_>) =
            records.iter().map(|record| Shown::new(record, filter)).partition(Result::is_ok);
        let sources: Vec<Shown> = found.into_iter().flatten().collect();
        if sources.is_empty() {
            match failed.into_iter().next() {
                Some(Err(error)) => return Err(error),
                _ => anyhow::bail!("there is no record"),
            }
        }
        if let Some(name) = reference {
            check_reference(sources.iter().map(|source| &source.all), name)?;
        }
        Ok(Input {
            sources,
            asked: reference.is_some(),
            reference: reference.unwrap_or(REFERENCE).to_owned(),
            launches: Launches::default(),
            rays: Rays::All,
            roofline: None,
            remarks: RefCell::default(),
        })
    }

    /// Says something once.
    pub fn remark(&self, text: String) {
        let mut remarks = self.remarks.borrow_mut();
        if !remarks.contains(&text) {
            remarks.push(text);
        }
    }
}

/// A scene with those of its generator's parameters that are to be told.
fn named(point: &Point, told: &BTreeSet<String>) -> String {
    let own = point.scene.parameters();
    let given = told.iter().filter_map(|name| Some((name.strip_prefix(OF_SCENE)?, text(own.get(name)?))));
    let given: Vec<String> = given.map(|(name, value)| format!("{name}={value}")).collect();
    let name = &point.scene.name;
    if given.is_empty() { name.clone() } else { format!("{name} ({})", given.join(", ")) }
}

/// Makes sure that a variant which others are to be relative to is there.
///
/// # Errors
/// It is not; the error lists those that are.
pub fn check_reference<'a>(
    mut records: impl Iterator<Item = &'a Selection<'a>> + Clone,
    name: &str,
) -> anyhow::Result<()> {
    let known: BTreeSet<&str> = records.clone().flat_map(Selection::variants).collect();
    if records.any(|selection| selection.variants().contains(&name)) {
        return Ok(());
    }
    let known: Vec<&str> = known.into_iter().collect();
    anyhow::bail!(
        "no point is of the variant {name:?}, to which others should be relative; there are {}",
        known.join(", ")
    )
}
