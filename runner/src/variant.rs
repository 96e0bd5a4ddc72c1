//! The variants: ways of building and storing a tree that can be measured against each other.

use std::fmt;

/// A variant's name follows the thesis: `<Arity> [Slang] [Quantized] [CBTC]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// The binary BVH, 56 bytes a node.
    Binary,
}

impl Variant {
    /// Every variant, in the order of tables.
    pub const ALL: &[Self] = &[Self::Binary];

    /// As the thesis writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Binary => "Binary",
        }
    }

    /// The variants that any of `patterns` names, each once: `*` stands for any text, `all` for every
    /// variant, and case does not matter.
    ///
    /// # Errors
    /// A pattern names none.
    pub fn select(patterns: &[String]) -> anyhow::Result<Vec<Self>> {
        let mut chosen = Vec::new();
        for pattern in patterns {
            let everything = pattern.eq_ignore_ascii_case("all");
            let wanted = pattern.to_lowercase();
            let mut known = false;
            for &variant in Self::ALL {
                if everything || matches(&wanted, &variant.name().to_lowercase()) {
                    known = true;
                    if !chosen.contains(&variant) {
                        chosen.push(variant);
                    }
                }
            }
            if !known {
                let names: Vec<_> = Self::ALL.iter().map(|v| v.name()).collect();
                anyhow::bail!("no variant {pattern:?}; there are: {}", names.join(", "));
            }
        }
        Ok(chosen)
    }

    /// The one variant that `name` names.
    ///
    /// # Errors
    /// It names none, or several.
    pub fn one(name: &str) -> anyhow::Result<Self> {
        match Self::select(&[name.into()])?.as_slice() {
            [one] => Ok(*one),
            several => anyhow::bail!("{name:?} names {} variants; one is needed here", several.len()),
        }
    }
}

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Whether `pattern`, in which `*` stands for any text, describes all of `text`.
fn matches(pattern: &str, text: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == text,
        Some((head, tail)) => text.strip_prefix(head).is_some_and(|rest| {
            (0..=rest.len()).filter(|&i| rest.is_char_boundary(i)).any(|i| matches(tail, &rest[i..]))
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_stand_for_any_text() {
        assert!(matches("wide*", "wide4 cbtc"));
        assert!(matches("*slang*", "wide4 slang quantized"));
        assert!(matches("* cbtc", "wide4 cbtc"));
        assert!(!matches("wide4", "wide4 cbtc"));
        assert!(!matches("*slang *", "wide4 slang"));
    }

    #[test]
    fn variants_are_chosen_once_and_wrong_names_are_explained() {
        let all = Variant::select(&["all".into(), "binary".into(), "*".into()]).unwrap();
        assert_eq!(all, Variant::ALL);
        let error = Variant::select(&["Trinary".into()]).unwrap_err().to_string();
        assert!(error.contains("Trinary") && error.contains("Binary"), "{error}");
        assert_eq!(Variant::one("BINARY").unwrap(), Variant::Binary);
    }
}
