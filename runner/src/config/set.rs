//! Parameters that are given values for all points or for some.

use super::{document::SetEntry, source::Mistakes, value, when::When};
use crate::variant::Variant;
use record::Parameters;

/// Values of parameters where a condition holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Set {
    /// Where.
    pub when: When,
    /// By name.
    pub parameters: Parameters,
}

impl Set {
    /// Values for one variant.
    pub fn of(variant: Variant, parameters: Parameters) -> Self {
        let when = When { variants: vec![variant.name().into()], ..When::default() };
        Self { when, parameters }
    }

    /// Reads an entry; what is wrong with it is noted.
    pub fn read(entry: &SetEntry, mistakes: &mut Mistakes) -> Self {
        let mut set = Self { when: When::read(entry.when.as_ref(), mistakes), ..Self::default() };
        for (name, value) in &entry.parameters {
            match value::of(name.get_ref(), value.get_ref()) {
                Ok(value) => set.parameters.set(name.get_ref().as_str(), value),
                Err(error) => mistakes.add(value.span(), error),
            }
        }
        set
    }

    /// Sets as entries of a config, which others can include.
    pub fn to_toml(sets: &[Self]) -> String {
        let mut text = String::new();
        for set in sets {
            text += if text.is_empty() { "[[set]]\n" } else { "\n[[set]]\n" };
            if set.when != When::default() {
                text += &format!("when = {}\n", set.when.to_toml());
            }
            let parameters = set.parameters.0.iter();
            let parameters: Vec<_> =
                parameters.map(|(name, value)| format!("\"{name}\" = {}", value::toml(value))).collect();
            text += &format!("parameters = {{ {} }}\n", parameters.join(", "));
        }
        text
    }
}
