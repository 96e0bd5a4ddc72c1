//! What a file says: the one definition of its keys, of which parser, checks and JSON Schema are made.

use super::{schema, units};
use crate::size::Size;
use record::Method;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{
    Deserialize, Deserializer,
    de::{self, MapAccess, value::MapAccessDeserializer},
};
use serde_json::Value;
use std::{collections::BTreeMap, fmt, path::PathBuf, str::FromStr};
use toml::Spanned;

/// Warm-up samples where nothing is said.
pub const WARM_UP: u32 = 1;
/// Precision that is aimed at where nothing is said.
pub const HALF_WIDTH: &str = "1%";
/// Time for the samples of a point where nothing is said.
pub const TIME: &str = "60 s";
/// Clock below which a sample does not count where nothing is said.
pub const LEAST_CLOCK: &str = "95%";
/// Points between two repetitions of the reference point where nothing is said.
pub const REFERENCE_EVERY: u32 = 20;

/// An experiment for `runner sweep`: what is measured, and for which values of which parameters.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Document {
    /// What the experiment is about, in a line. The file's name when left out.
    pub title: Option<String>,
    /// Other configs, relative to this file. What they say holds where this file says nothing, a later one
    /// before an earlier one; their `set` entries come before this file's.
    #[schemars(with = "Option<Vec<PathBuf>>", extend("examples" = [["tuned/device.toml"]]))]
    pub include: Option<Vec<Spanned<PathBuf>>>,
    /// Scenes: names, generators such as "city:triangles=1000000,seed=3", or paths, which are relative to the
    /// folder that runner is started in.
    #[schemars(with = "Option<Vec<String>>", length(min = 1), extend("examples" = [["sponza", "city"]]))]
    pub scenes: Option<Vec<Spanned<String>>>,
    /// Variants; `*` stands for any text, `all` for every variant.
    #[schemars(with = "Option<Vec<String>>", length(min = 1), extend("examples" = [["all"], ["Wide4*", "Binary"]]))]
    pub variants: Option<Vec<Spanned<String>>>,
    /// Views, by number or name, such as "0,3" or "0-3". All when left out.
    #[schemars(with = "Option<String>", extend("examples" = ["0-3"]))]
    pub views: Option<Spanned<String>>,
    /// Picture size. 1920x1080 on a GPU and 320x180 on a CPU driver when left out.
    #[serde(default, deserialize_with = "parsed")]
    #[schemars(with = "Option<String>", regex(pattern = "^\\s*[0-9]+\\s*[xX]\\s*[0-9]+\\s*$"), extend("examples" = ["1920x1080"]))]
    pub size: Option<Size>,
    /// How rays are launched while they are timed: "paths", where each sample traces whole paths of its own, or
    /// "replay", where it launches the same rays of each bounce once more.
    #[schemars(with = "Option<String>", extend("enum" = ["paths", "replay"], "default" = "paths"))]
    pub method: Option<Method>,
    /// Most rays in a path, the primary ray included. 8 when left out, and 9 with the method "replay".
    #[schemars(range(min = 1, max = 64))]
    pub depth: Option<u32>,
    /// Seed of all random numbers that paths take.
    #[schemars(range(max = u32::MAX), extend("default" = 0))]
    pub seed: Option<u32>,
    /// Measured builds of each tree. 10 on a GPU and 3 on a CPU driver when left out.
    #[schemars(range(min = 1, max = u32::MAX))]
    pub builds: Option<u32>,
    /// Samples traced before those that count and thrown away.
    #[schemars(range(max = u32::MAX), extend("default" = WARM_UP))]
    pub warm_up: Option<u32>,
    /// Path samples a pixel and view, or launches of each bounce: exactly so many, or a table that says when they
    /// are enough. 10 launches with the method "replay" when left out.
    #[schemars(with = "Option<SamplesEntry>", extend("examples" = [15]))]
    pub samples: Option<Spanned<SamplesEntry>>,
    /// In which order points are measured.
    pub order: Option<OrderEntry>,
    /// Values of parameters that are no axes. Later entries win over earlier ones, axes over all.
    pub set: Option<Vec<SetEntry>>,
    /// Parameters that are varied. Every value of one meets every value of the others.
    #[schemars(with = "Option<Vec<AxisEntry>>")]
    pub axis: Option<Vec<Spanned<AxisEntry>>>,
}

/// `samples = 15` or `samples = { … }`.
#[derive(Debug)]
pub enum SamplesEntry {
    /// So many, neither more nor fewer.
    Exactly(u32),
    /// Until they are enough.
    Until(SamplesTable),
}

/// When samples are enough.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct SamplesTable {
    /// At least so many, however long they take.
    #[schemars(range(min = 1, max = u32::MAX))]
    pub least: Option<u32>,
    /// At most so many.
    #[schemars(range(min = 1, max = u32::MAX))]
    pub most: Option<u32>,
    /// Enough when half the width of the 95% confidence interval is below this share of the mean.
    #[schemars(with = "Option<String>", regex(pattern = "^\\s*[0-9.]+\\s*%\\s*$"), extend("default" = HALF_WIDTH, "examples" = ["1%"]))]
    pub half_width: Option<units::Share>,
    /// After this time a point gets no more samples than the least: a number and ms, s, min or h.
    #[schemars(with = "Option<String>", regex(pattern = "^\\s*[0-9.]+\\s*(ms|s|min|h)\\s*$"), extend("default" = TIME, "examples" = ["60 s"]))]
    pub time: Option<units::Time>,
    /// Samples do not count while the clock is below this share of the locked clock, or of the base clock
    /// where none is locked.
    #[schemars(with = "Option<String>", regex(pattern = "^\\s*[0-9.]+\\s*%\\s*$"), extend("default" = LEAST_CLOCK, "examples" = ["95%"]))]
    pub least_clock: Option<units::Share>,
}

/// In which order points are measured.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct OrderEntry {
    /// Seed of the shuffle.
    #[schemars(extend("default" = 0))]
    pub seed: Option<u64>,
    /// Points between two repetitions of the reference point, by which drift is noticed; 0 for none.
    #[schemars(range(max = u32::MAX), extend("default" = REFERENCE_EVERY))]
    pub reference_every: Option<u32>,
}

/// Values of parameters, for all points or where a condition holds.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct SetEntry {
    /// Where they hold; everywhere when left out.
    #[serde(default)]
    #[schemars(schema_with = "schema::when")]
    pub when: Option<Spanned<Named>>,
    /// The values, by the parameters' names in quotes.
    #[schemars(schema_with = "schema::parameters")]
    pub parameters: Named,
}

/// A parameter that is varied.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct AxisEntry {
    /// Which.
    #[schemars(schema_with = "schema::parameter")]
    pub parameter: Spanned<String>,
    /// Its values. Either these or `range`.
    #[schemars(with = "Option<Vec<Value>>", length(min = 1), extend("items" = schema::SCALAR.clone()))]
    pub values: Option<Spanned<Vec<Spanned<Value>>>>,
    /// Its values from one to another. Either these or `values`.
    #[schemars(with = "Option<RangeEntry>")]
    pub range: Option<Spanned<RangeEntry>>,
    /// Axes with the same word here walk together: the first value of one goes with the first of the others.
    #[schemars(with = "Option<String>")]
    pub zip: Option<Spanned<String>>,
    /// Where the axis is varied; elsewhere the parameter is not touched.
    #[serde(default)]
    #[schemars(schema_with = "schema::when")]
    pub when: Option<Spanned<Named>>,
}

/// Evenly spaced values, both ends included: either by `step` or by `factor`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct RangeEntry {
    /// The first value.
    pub from: f64,
    /// No value is larger.
    pub to: f64,
    /// What is added from value to value.
    pub step: Option<f64>,
    /// What a value is multiplied with to get the next.
    pub factor: Option<f64>,
}

/// Values by name, each with its place.
pub type Named = BTreeMap<Spanned<String>, Spanned<Value>>;

impl JsonSchema for SamplesEntry {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Samples".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut schema = SamplesTable::json_schema(generator);
        schema.insert("type".into(), vec!["integer", "object"].into());
        schema.insert("minimum".into(), 1.into());
        schema.insert("maximum".into(), u32::MAX.into());
        schema
    }
}

impl<'de> Deserialize<'de> for SamplesEntry {
    // Not `untagged`, which would forget where in the table something is wrong.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = SamplesEntry;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number of samples or a table")
            }
            fn visit_i64<E: de::Error>(self, count: i64) -> Result<SamplesEntry, E> {
                let wrong = |_| E::invalid_value(de::Unexpected::Signed(count), &self);
                count.try_into().map(SamplesEntry::Exactly).map_err(wrong)
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<SamplesEntry, A::Error> {
                SamplesTable::deserialize(MapAccessDeserializer::new(map)).map(SamplesEntry::Until)
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

/// Text that stands for something else.
fn parsed<'de, D: Deserializer<'de>, T: FromStr<Err: fmt::Display>>(
    deserializer: D,
) -> Result<Option<T>, D::Error> {
    String::deserialize(deserializer)?.parse().map(Some).map_err(de::Error::custom)
}
