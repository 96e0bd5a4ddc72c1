//! Conditions: where a set or an axis holds.

use super::{
    axis::Axis,
    document::Named,
    source::{Mistakes, instead},
    value,
};
use crate::variant::{self, Variant};
use record::{Parameters, Value};
use std::collections::BTreeMap;
use toml::Spanned;
use tracer::scene;

/// What must be so, by scene, variant and parameters that are axes; an empty condition always holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct When {
    /// Patterns of scenes, any of which is enough; none for all.
    pub scenes: Vec<String>,
    /// Patterns of variants, as in `--variant`; none for all.
    pub variants: Vec<String>,
    /// For each parameter the values that it may have. An axis that is left out has none.
    pub axes: BTreeMap<String, Vec<Value>>,
}

impl When {
    /// Reads a condition; what is wrong with it is noted.
    pub fn read(entry: Option<&Spanned<Named>>, mistakes: &mut Mistakes) -> Self {
        let mut when = Self::default();
        for (key, wanted) in entry.iter().flat_map(|entry| entry.get_ref()) {
            let (span, wanted) = (wanted.span(), wanted.get_ref());
            let wanted = wanted.as_array().map_or(std::slice::from_ref(wanted), Vec::as_slice);
            let words = || wanted.iter().filter_map(|word| word.as_str().map(str::to_owned));
            match key.get_ref().as_str() {
                "scene" => {
                    when.scenes = words().collect();
                    for pattern in when.scenes.iter().filter(|pattern| !names_scene(pattern)) {
                        let known = scene::built_in().iter().map(|scene| scene.name);
                        let instead = instead(pattern, known);
                        mistakes.add(span.clone(), format_args!("no scene is called {pattern:?}{instead}"));
                    }
                }
                "variant" => {
                    when.variants = words().collect();
                    for pattern in &when.variants {
                        variants(pattern, span.clone(), mistakes);
                    }
                }
                parameter => {
                    let mut values = Vec::new();
                    for wanted in wanted {
                        match value::of(parameter, wanted) {
                            Ok(value) => values.push(value),
                            Err(error) => mistakes.add(span.clone(), error),
                        }
                    }
                    when.axes.insert(parameter.to_owned(), values);
                }
            }
        }
        when
    }

    /// Whether it holds for a variant on a scene, where the axes that it names have these values.
    pub fn holds(&self, scene: &str, variant: Variant, axes: &Parameters) -> bool {
        let scene = scene.to_lowercase();
        let is = |pattern: &String| variant::matches(&pattern.to_lowercase(), &scene);
        (self.scenes.is_empty() || self.scenes.iter().any(is))
            && (self.variants.is_empty()
                || Variant::choose(&self.variants).is_ok_and(|meant| meant.contains(&variant)))
            && self.axes.iter().all(|(name, values)| axes.get(name).is_some_and(|now| values.contains(now)))
    }

    /// What it asks of axes that can never be, in words.
    pub fn never(&self, axes: &[Axis]) -> Vec<String> {
        let mut never = Vec::new();
        for (parameter, wanted) in &self.axes {
            match axes.iter().find(|axis| axis.parameter == *parameter) {
                None => never.push(format!("{parameter} is no axis here, so no condition can be about it")),
                Some(axis) => {
                    let absent = wanted.iter().filter(|value| !axis.values.contains(value));
                    never.extend(absent.map(|value| {
                        let (value, values) = (value::text(value), value::list(&axis.values));
                        format!("{parameter} is never {value}; its values are {values}")
                    }));
                }
            }
        }
        never
    }

    /// As an inline table of TOML.
    pub fn to_toml(&self) -> String {
        let texts = |patterns: &[String]| {
            listed(patterns.iter().map(|pattern| toml::Value::from(pattern.as_str()).to_string()))
        };
        let mut entries = Vec::new();
        for (name, patterns) in [("scene", &self.scenes), ("variant", &self.variants)] {
            if !patterns.is_empty() {
                entries.push(format!("{name} = {}", texts(patterns)));
            }
        }
        for (name, values) in &self.axes {
            entries.push(format!("\"{name}\" = {}", listed(values.iter().map(value::toml))));
        }
        format!("{{ {} }}", entries.join(", "))
    }
}

/// One value as it is, several as a list.
fn listed(values: impl Iterator<Item = String>) -> String {
    let values: Vec<_> = values.collect();
    match values.as_slice() {
        [one] => one.clone(),
        several => format!("[{}]", several.join(", ")),
    }
}

/// The variants that a pattern names; that it names none is noted.
pub fn variants(pattern: &str, span: std::ops::Range<usize>, mistakes: &mut Mistakes) -> Vec<Variant> {
    Variant::named(pattern).unwrap_or_else(|_| {
        let instead = instead(pattern, Variant::ALL.iter().map(|variant| variant.name()));
        mistakes.add(span, format_args!("no variant is called {pattern:?}{instead}"));
        Vec::new()
    })
}

/// A pattern with `*` may mean scenes that only another config names. Without it must be one that could be
/// measured, wherever its description lies.
fn names_scene(pattern: &str) -> bool {
    let known = |scene: &scene::BuiltIn| pattern.eq_ignore_ascii_case(scene.name);
    pattern.contains(['*', ':', '/', '.']) || scene::built_in().iter().any(known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_parts_of_a_condition_must_hold() {
        let wide4 = Variant::one("Wide4").unwrap();
        let mut axes = Parameters::default();
        let when = When {
            scenes: vec!["bistro*".into(), "City".into()],
            variants: vec!["Wide4*".into()],
            axes: [("cbtc.threshold".into(), vec![4u32.into(), 8u32.into()])].into(),
        };
        assert!(!when.holds("city", wide4, &axes), "the axis is left out");
        axes.set("cbtc.threshold", 8u32);
        assert!(when.holds("city", wide4, &axes) && when.holds("bistro_exterior", wide4, &axes));
        assert!(!when.holds("sponza", wide4, &axes) && !when.holds("city", Variant::BINARY, &axes));
        axes.set("cbtc.threshold", 2u32);
        assert!(!when.holds("city", wide4, &axes));
        assert!(When::default().holds("any", Variant::BINARY, &Parameters::default()));
    }
}
