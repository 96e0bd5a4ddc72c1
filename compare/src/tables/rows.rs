//! What stands in the rows of tables over all scenes: a variant with one set of parameters.

use super::input::Shown;
use super::{Cell, Column, Input, Row};
use crate::select::{Entry, Pass, geometric_mean, in_order, ratio};
use crate::unreliable;
use record::{Point, mean};
use std::collections::BTreeMap;

/// A variant with one set of parameters, on every scene that has it.
#[derive(Clone, Debug)]
pub struct Series<'r> {
    variant: &'r str,
    /// What was varied of the variant.
    pass: Pass,
    /// In what it differs from the first one of its variant.
    differs: Pass,
    /// By scene.
    points: BTreeMap<String, &'r Point>,
}

/// The rows of a record, and what they are relative to.
#[derive(Debug)]
pub struct Rows<'i, 'r> {
    input: &'i Input<'r>,
    /// The scenes that are shown, in order of first appearance.
    pub scenes: Vec<String>,
    /// Those that are shown, in the record's order.
    series: Vec<Series<'r>>,
    /// What they are relative to: the first one, or the first one of the variant that somebody asked for.
    reference: Series<'r>,
}

impl<'i, 'r> Rows<'i, 'r> {
    /// The rows of a record.
    ///
    /// # Errors
    /// The record has no point of the variant that somebody asked for.
    pub fn new(input: &'i Input<'r>, source: &Shown<'r>) -> anyhow::Result<Rows<'i, 'r>> {
        let mut all: Vec<Series> = Vec::new();
        for entry in &source.all.entries {
            let (variant, pass) = (entry.point.variant.as_str(), entry.pass.of_variant());
            let at = all.iter().position(|one| one.variant == variant && one.pass == pass);
            let at = at.unwrap_or_else(|| {
                let first = all.iter().find(|one| one.variant == variant);
                let differs = first.map_or_else(Pass::default, |first| pass.beside(&first.pass));
                all.push(Series { variant, pass, differs, points: BTreeMap::new() });
                all.len() - 1
            });
            all[at].points.insert(source.place(entry).to_owned(), entry.point);
        }
        let variants = in_order(source.entries().map(Entry::variant));
        let shown = all.iter().filter(|one| variants.contains(&one.variant)).cloned();
        let series: Vec<Series> = shown.collect();
        let first = match input.asked {
            true => all.into_iter().find(|one| one.variant == input.reference),
            false => series.first().cloned(),
        };
        let Some(reference) = first else {
            anyhow::bail!(
                "no point is of the variant {:?}, to which others should be relative",
                input.reference
            )
        };
        let scenes = in_order(source.entries().map(|entry| source.place(entry).to_owned()));
        Ok(Rows { input, scenes, series, reference })
    }

    /// A column for methods and, where parameters were varied, one for those.
    pub fn heads(&self) -> Vec<Column> {
        let words = if self.are_varied() { &["Method", "Parameters"][..] } else { &["Method"] };
        words.iter().map(|word| Column::words(word)).collect()
    }

    /// The rows, with cells after those that name them.
    pub fn rows<C: IntoIterator<Item = Cell>>(&self, cells: impl Fn(usize) -> C) -> Vec<Row> {
        let row = |at: usize| {
            Row::new(self.labels(at).into_iter().chain(cells(at)).collect()).apart(self.apart(at))
        };
        (0..self.series.len()).map(row).collect()
    }

    /// The cells that name a row: a variant's name once, and what sets the row apart from the variant's first.
    fn labels(&self, at: usize) -> Vec<Cell> {
        let own = &self.series[at];
        let name = Cell::text(if self.begins(at) { own.variant } else { "" });
        let differs = self.are_varied().then(|| Cell::text(own.parameters()));
        std::iter::once(name).chain(differs).collect()
    }

    /// Whether a row stands apart from the one above: its variant is another, or it differs in other parameters.
    fn apart(&self, at: usize) -> bool {
        let names = |at: usize| self.series[at].differs.0.keys().collect::<Vec<_>>();
        at > 0 && (self.begins(at) || (names(at) != names(at - 1) && !names(at - 1).is_empty()))
    }

    fn begins(&self, at: usize) -> bool {
        at == 0 || self.series[at - 1].variant != self.series[at].variant
    }

    fn are_varied(&self) -> bool {
        self.series.iter().any(|one| !one.differs.0.is_empty())
    }

    /// A figure in each row, averaged over the scenes.
    pub fn averages(&self, what: &str, figure: impl Fn(&Point) -> Option<f64>) -> Vec<Option<f64>> {
        let scenes = self.comparable(what, &figure);
        let of = |one: &Series| mean(scenes.iter().map(|scene| figure(one.points.get(*scene)?)));
        self.series.iter().map(of).collect()
    }

    /// A figure in each row as a multiple of the reference's, as the geometric mean over the scenes; and what the
    /// reference has, as that too.
    pub fn ratios(
        &self,
        what: &str,
        figure: impl Fn(&Point) -> Option<f64>,
    ) -> (Vec<Option<f64>>, Option<f64>) {
        let scenes = self.comparable(what, &figure);
        let of = |one: &Series, scene: &str| figure(one.points.get(scene)?);
        let ratios = |one: &Series| {
            let each = scenes.iter().map(|scene| ratio(of(one, scene)?, of(&self.reference, scene)?));
            geometric_mean(each.collect::<Option<Vec<f64>>>()?)
        };
        let own = scenes.iter().filter_map(|scene| of(&self.reference, scene));
        (self.series.iter().map(ratios).collect(), geometric_mean(own))
    }

    /// A figure of one row on one scene, and what it is of the reference's there.
    pub fn on(&self, at: usize, scene: &str, figure: impl Fn(&Point) -> Option<f64>) -> [Option<f64>; 2] {
        let of = |one: &Series| one.points.get(scene).and_then(|point| figure(point));
        let own = of(&self.series[at]);
        [own, own.zip(of(&self.reference)).and_then(|(own, other)| ratio(own, other))]
    }

    /// The scenes on which every row and the reference have a figure, but for those that have it nowhere, as the
    /// driver's trees have none; that other scenes are left out is remarked.
    fn comparable(&self, what: &str, figure: &impl Fn(&Point) -> Option<f64>) -> Vec<&str> {
        let has =
            |one: &Series, scene: &str| one.points.get(scene).is_some_and(|point| figure(point).is_some());
        let knows = |one: &&Series| self.scenes.iter().any(|scene| has(one, scene));
        let those: Vec<&Series> = self.series.iter().chain([&self.reference]).filter(knows).collect();
        // What no row has anywhere, such as bounces beyond the longest path, needs no remark.
        if those.is_empty() {
            return Vec::new();
        }
        let (whole, part): (Vec<&str>, Vec<&str>) = (self.scenes.iter().map(String::as_str))
            .partition(|scene| those.iter().all(|one| has(one, scene)));
        if !part.is_empty() {
            let part = part.join(", ");
            self.input.remark(format!("{part}: left out for {what}, because not every row has that there"));
        }
        whole
    }

    /// What a caption says of the rows, each sentence with a space before it: what the first ones are, and which are
    /// unreliable.
    pub fn explained(&self) -> String {
        let mut text = String::new();
        if self.are_varied() {
            let firsts: Vec<&Series> = (0..self.series.len())
                .filter(|&at| self.begins(at) && !self.series[at].pass.0.is_empty())
                .map(|at| &self.series[at])
                .collect();
            let passes = in_order(firsts.iter().map(|first| &first.pass));
            let of = |pass: &Pass| -> String {
                let own = firsts.iter().filter(|first| first.pass == *pass);
                let names: Vec<&str> = own.map(|first| first.variant).collect();
                if passes.len() > 1 { format!("{pass} of {}", names.join(", ")) } else { pass.to_string() }
            };
            let all: Vec<String> = passes.iter().map(|pass| of(pass)).collect();
            text += &format!(
                " Parameters that a row does not name are those of the first row of its method: {}.",
                all.join("; ")
            );
        }
        let points = self
            .series
            .iter()
            .flat_map(|one| one.points.iter().map(move |(scene, point)| (one, scene, point)));
        let shown = points.filter(|(_, scene, _)| self.scenes.contains(scene));
        text + &unreliable::sentence(
            shown,
            |(_, _, point)| **point,
            |(one, scene, _)| format!("{} on {scene}", one.name()),
        )
    }

    /// What values are relative to, for a caption.
    pub fn reference(&self) -> String {
        self.reference.name()
    }
}

impl Series<'_> {
    /// The variant, and what sets it apart from the first one of that.
    fn name(&self) -> String {
        match self.parameters() {
            own if own.is_empty() => self.variant.to_owned(),
            own => format!("{} ({own})", self.variant),
        }
    }

    fn parameters(&self) -> String {
        if self.differs.0.is_empty() { String::new() } else { self.differs.to_string() }
    }
}
