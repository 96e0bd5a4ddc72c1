//! The variants: ways of building and storing a tree that can be measured against each other.

use std::collections::HashMap;
use std::fmt;
use std::sync::LazyLock;
use tracer::driver;
use tracer::gpu::DeviceInfo;
use tracer::layout::Layout;
use tracer::list::Listing;
use tracer::traverse::Language::{self, Glsl, Slang};
use tracer::traverse::Structure;

/// A variant; its name follows the thesis: `<Arity> [Slang] [Quantized] [CBTC]`, or `Wide8 Compressed`, or it is one of
/// RTRS's handlers, `Blank`, `Naive`, `Direct` and `Reduced`, or `Driver`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Variant {
    /// What rays are traced through.
    pub structure: Structure,
    /// What its traversal is written in; without meaning where that is the driver's.
    pub language: Language,
    /// Whether boxes share a node according to how often sample rays of a view visit them.
    pub by_view: bool,
}

const fn of(layout: Layout, language: Language, by_view: bool) -> Variant {
    Variant { structure: Structure::Nodes(layout), language, by_view }
}

/// All ways to trace a layout that is not binary, in the thesis's order.
const fn wide(uncompressed: Layout, quantized: Layout) -> [Variant; 8] {
    [
        of(uncompressed, Glsl, false),
        of(uncompressed, Glsl, true),
        of(quantized, Glsl, false),
        of(quantized, Glsl, true),
        of(uncompressed, Slang, false),
        of(uncompressed, Slang, true),
        of(quantized, Slang, false),
        of(quantized, Slang, true),
    ]
}

impl Variant {
    /// The one that all others are compared with.
    pub const BINARY: Self = of(Layout::Binary, Glsl, false);

    /// The driver's own ray tracing.
    pub const DRIVER: Self = Self::without_tree(Structure::Driver);

    /// All but intersection.
    pub const BLANK: Self = Self::without_tree(Structure::List(Listing::None));

    /// Every triangle.
    pub const NAIVE: Self = Self::without_tree(Structure::List(Listing::All));

    const fn without_tree(structure: Structure) -> Self {
        Self { structure, language: Glsl, by_view: false }
    }

    /// Every variant, in the order of tables.
    pub const ALL: &[Self] = {
        const WIDE: [[Variant; 8]; 3] = [
            wide(Layout::Wide4, Layout::Quantized4),
            wide(Layout::Wide6, Layout::Quantized6),
            wide(Layout::Wide8, Layout::Quantized8),
        ];
        const ALL: [Variant; 32] = {
            let mut all = [Variant::BINARY; 32];
            all[1] = of(Layout::Binary, Slang, false);
            let mut at = 0;
            while at < 24 {
                all[2 + at] = WIDE[at / 8][at % 8];
                at += 1;
            }
            all[26] = of(Layout::Compressed8, Glsl, false);
            all[27] = Variant::BLANK;
            all[28] = Variant::NAIVE;
            all[29] = of(Layout::Direct, Glsl, false);
            all[30] = of(Layout::Reduced, Glsl, false);
            all[31] = Variant::DRIVER;
            all
        };
        &ALL
    };

    /// As the thesis writes it: arity, language unless GLSL, `Quantized`, and `CBTC` where it goes by view.
    pub fn name(self) -> &'static str {
        // Names are asked for all the time, and there are few of them.
        static NAMES: LazyLock<HashMap<Variant, String>> = LazyLock::new(|| {
            let all = Layout::ALL.iter().flat_map(|&layout| {
                Language::ALL.map(|language| [false, true].map(|by_view| of(layout, language, by_view)))
            });
            let others = [Variant::BLANK, Variant::NAIVE, Variant::DRIVER];
            all.flatten().chain(others).map(|variant| (variant, variant.spelled())).collect()
        });
        &NAMES[&self]
    }

    fn spelled(self) -> String {
        let layout = match self.structure {
            Structure::Nodes(layout) => layout,
            Structure::Driver => return "Driver".into(),
            Structure::List(Listing::None) => return "Blank".into(),
            Structure::List(Listing::All) => return "Naive".into(),
        };
        let arity = match layout {
            Layout::Binary => "Binary",
            Layout::Wide4 | Layout::Quantized4 => "Wide4",
            Layout::Wide6 | Layout::Quantized6 => "Wide6",
            Layout::Wide8 | Layout::Quantized8 | Layout::Compressed8 => "Wide8",
            Layout::Direct => "Direct",
            Layout::Reduced => "Reduced",
        };
        let words = [
            ("Slang", self.language == Slang),
            ("Quantized", layout.is_quantized()),
            ("Compressed", layout.is_compressed()),
            ("CBTC", self.by_view),
        ];
        let words = words.iter().filter(|(_, holds)| *holds).map(|(word, _)| *word);
        std::iter::once(arity).chain(words).collect::<Vec<_>>().join(" ")
    }

    /// What its traversal is written in.
    pub fn language(self) -> &'static str {
        match (self.structure, self.language) {
            (Structure::Driver, _) => "driver",
            (_, Glsl) => "GLSL",
            (_, Slang) => "Slang",
        }
    }

    /// Why this build does not have it; nothing where it does.
    pub fn missing(self) -> Option<&'static str> {
        self.language.missing()
    }

    /// How nodes are stored, and how many children they have; nothing where there are none of ours.
    pub fn layout(self) -> Option<Layout> {
        self.structure.layout()
    }

    /// Whether the driver builds and traces.
    pub fn is_driver(self) -> bool {
        self.structure == Structure::Driver
    }

    /// Whether there is a tree; `all` and other patterns name no other variant.
    pub fn has_tree(self) -> bool {
        !matches!(self.structure, Structure::List(_))
    }

    /// Why a device does not have it, although this build does; nothing where it does.
    pub fn unavailable(self, device: &DeviceInfo) -> Option<tracer::Error> {
        if self.is_driver() { driver::check(device).err() } else { None }
    }

    /// Whether one of `patterns` names it alone, and none takes it away: it is missed where it is not there.
    pub fn is_asked_for(self, patterns: &[String]) -> bool {
        let alone = |pattern: &String| {
            !pattern.starts_with('!') && Self::named(pattern).is_ok_and(|named| named == [self])
        };
        patterns.iter().any(alone) && Self::choose(patterns).is_ok_and(|chosen| chosen.contains(&self))
    }

    /// The variants that `pattern` names, whether this build has them or not: `*` stands for any text, `all` for
    /// every variant, and case does not matter. Those without a tree, of which one takes too long for most scenes, are
    /// named by their whole names only. A `!` before it is not looked at.
    ///
    /// # Errors
    /// It names none.
    pub fn named(pattern: &str) -> anyhow::Result<Vec<Self>> {
        let wanted = pattern.trim_start_matches('!').to_lowercase();
        // `* Slang *` means `Wide4 Slang` too: with a space behind it, as if another word could follow.
        let is = |name: String| matches(&wanted, &name) || matches(&wanted, &(name + " "));
        let named: Vec<Self> = Self::ALL
            .iter()
            .filter(|variant| variant.has_tree() || wanted == variant.name().to_lowercase())
            .filter(|variant| wanted == "all" || is(variant.name().to_lowercase()))
            .copied()
            .collect();
        if named.is_empty() {
            let names: Vec<_> = Self::ALL.iter().map(|v| v.name()).collect();
            anyhow::bail!("no variant {pattern:?}; there are: {}", names.join(", "));
        }
        Ok(named)
    }

    /// The variants that any of `patterns` names, each once, less those that a later pattern with a `!` before it
    /// names.
    ///
    /// # Errors
    /// A pattern names none.
    pub fn choose(patterns: &[String]) -> anyhow::Result<Vec<Self>> {
        let mut chosen = Vec::new();
        for pattern in patterns {
            let named = Self::named(pattern)?;
            if pattern.starts_with('!') {
                chosen.retain(|variant| !named.contains(variant));
            } else {
                chosen.extend(
                    named.into_iter().filter(|variant| !chosen.contains(variant)).collect::<Vec<_>>(),
                );
            }
        }
        Ok(chosen)
    }

    /// Those of [`Variant::choose`] that this build has.
    ///
    /// # Errors
    /// A pattern names none, or this build has none of them.
    pub fn select(patterns: &[String]) -> anyhow::Result<Vec<Self>> {
        let chosen = Self::choose(patterns)?;
        let there: Vec<Self> = chosen.iter().filter(|variant| variant.missing().is_none()).copied().collect();
        match (chosen.first(), there.is_empty()) {
            (None, _) => anyhow::bail!("{} leaves no variant", patterns.join(", ")),
            (Some(first), true) => {
                anyhow::bail!("this build is without {first}: {}", first.missing().unwrap_or_default())
            }
            _ => Ok(there),
        }
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
        let built: Vec<_> =
            Variant::ALL.iter().filter(|v| v.missing().is_none() && v.has_tree()).copied().collect();
        assert_eq!(all, built);
        let glsl = Variant::select(&["all".into(), "!* Slang *".into()]).unwrap();
        assert_eq!(glsl.len(), 17);
        assert!(glsl.iter().all(|variant| variant.language == Glsl));
        assert!(Variant::select(&["Wide4".into(), "!Wide*".into()]).is_err());
        let languages = if Slang.missing().is_none() { 2 } else { 1 };
        assert_eq!(Variant::select(&["Wide*".into()]).unwrap().len(), 12 * languages + 1);
        assert_eq!(Variant::select(&["wide6*cbtc".into()]).unwrap().len(), 2 * languages);
        match Variant::select(&["* Slang *".into()]) {
            Ok(chosen) => assert_eq!(chosen.len(), 13),
            Err(error) => assert!(error.to_string().contains("without Binary Slang: no slangc"), "{error}"),
        }
        let error = Variant::select(&["Trinary".into()]).unwrap_err().to_string();
        assert!(error.contains("Trinary") && error.contains("Wide8 Quantized CBTC"), "{error}");
        assert_eq!(Variant::one("BINARY").unwrap(), Variant::BINARY);
        assert_eq!(Variant::one("wide4 quantized").unwrap().layout(), Some(Layout::Quantized4));
        assert_eq!(Variant::one("driver").unwrap(), Variant::DRIVER);
        assert!(Variant::one("wide4*").is_err());
        assert_eq!(Variant::one("naive").unwrap(), Variant::NAIVE);
        assert!(Variant::select(&["Nai*".into()]).is_err());
        let some = ["Blank", "Direct", "*", "!Naive", "!Blank"].map(String::from);
        assert!(Variant::select(&some).unwrap().iter().all(|variant| variant.has_tree()));
    }

    #[test]
    fn names_differ() {
        let mut names: Vec<_> = Variant::ALL.iter().map(|v| v.name()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), 32);
    }

    #[test]
    fn names_are_those_of_the_thesis() {
        let names: Vec<_> = Variant::ALL[..6].iter().map(|v| v.name()).collect();
        let first =
            ["Binary", "Binary Slang", "Wide4", "Wide4 CBTC", "Wide4 Quantized", "Wide4 Quantized CBTC"];
        assert_eq!(names, first);
        assert_eq!(Variant::ALL[25].name(), "Wide8 Slang Quantized CBTC");
        assert_eq!(Variant::ALL[26].name(), "Wide8 Compressed");
        let last: Vec<_> = Variant::ALL[27..].iter().map(|v| v.name()).collect();
        assert_eq!(last, ["Blank", "Naive", "Direct", "Reduced", "Driver"]);
        assert_eq!(of(Layout::Binary, Slang, true).name(), "Binary Slang CBTC");
    }

    #[test]
    fn what_is_named_alone_is_asked_for() {
        let asked = |patterns: &[&str]| {
            Variant::DRIVER.is_asked_for(&patterns.iter().map(|&p| p.into()).collect::<Vec<_>>())
        };
        assert!(asked(&["Driver"]) && asked(&["all", "driver"]) && asked(&["Binary", "Dri*"]));
        assert!(!asked(&["all"]) && !asked(&["*"]) && !asked(&["Binary"]) && !asked(&["*r*"]));
        assert!(!asked(&["Driver", "!Driver"]) && !asked(&["Driver", "!*"]));
    }
}
