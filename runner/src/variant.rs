//! The variants: ways of building and storing a tree that can be measured against each other.

use std::fmt;
use tracer::layout::Layout;

/// A variant; its name follows the thesis: `<Arity> [Quantized] [CBTC]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// How nodes are stored, and how many children they have.
    pub layout: Layout,
    /// Whether boxes share a node according to how often sample rays of a view visit them.
    pub by_view: bool,
}

const fn of(layout: Layout, by_view: bool) -> Variant {
    Variant { layout, by_view }
}

impl Variant {
    /// The one that all others are compared with.
    pub const BINARY: Self = of(Layout::Binary, false);

    /// Every variant, in the order of tables.
    pub const ALL: &[Self] = &[
        Self::BINARY,
        of(Layout::Wide4, false),
        of(Layout::Wide4, true),
        of(Layout::Quantized4, false),
        of(Layout::Quantized4, true),
        of(Layout::Wide6, false),
        of(Layout::Wide6, true),
        of(Layout::Quantized6, false),
        of(Layout::Quantized6, true),
        of(Layout::Wide8, false),
        of(Layout::Wide8, true),
        of(Layout::Quantized8, false),
        of(Layout::Quantized8, true),
    ];

    /// As the thesis writes it.
    pub fn name(self) -> &'static str {
        match (self.layout, self.by_view) {
            (Layout::Binary, false) => "Binary",
            (Layout::Binary, true) => "Binary CBTC",
            (Layout::Wide4, false) => "Wide4",
            (Layout::Wide4, true) => "Wide4 CBTC",
            (Layout::Quantized4, false) => "Wide4 Quantized",
            (Layout::Quantized4, true) => "Wide4 Quantized CBTC",
            (Layout::Wide6, false) => "Wide6",
            (Layout::Wide6, true) => "Wide6 CBTC",
            (Layout::Quantized6, false) => "Wide6 Quantized",
            (Layout::Quantized6, true) => "Wide6 Quantized CBTC",
            (Layout::Wide8, false) => "Wide8",
            (Layout::Wide8, true) => "Wide8 CBTC",
            (Layout::Quantized8, false) => "Wide8 Quantized",
            (Layout::Quantized8, true) => "Wide8 Quantized CBTC",
        }
    }

    /// What its traversal is written in.
    pub fn language(self) -> &'static str {
        "GLSL"
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
pub fn matches(pattern: &str, text: &str) -> bool {
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
        assert_eq!(Variant::select(&["Wide*".into()]).unwrap().len(), 12);
        assert_eq!(Variant::select(&["wide6*cbtc".into()]).unwrap().len(), 2);
        let error = Variant::select(&["Trinary".into()]).unwrap_err().to_string();
        assert!(error.contains("Trinary") && error.contains("Wide8 Quantized CBTC"), "{error}");
        assert_eq!(Variant::one("BINARY").unwrap(), Variant::BINARY);
        assert_eq!(Variant::one("wide4 quantized").unwrap().layout, Layout::Quantized4);
        assert!(Variant::one("wide4*").is_err());
    }

    #[test]
    fn names_differ() {
        let mut names: Vec<_> = Variant::ALL.iter().map(|v| v.name()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), 13);
    }
}
