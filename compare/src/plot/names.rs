//! What a variant's name says: how many children its nodes have, and what else it does.
//!
//! Names follow the thesis (Cezner 2025, section 6): `<Arity> [Slang] [Quantized] [CBTC]`. Nothing here depends on
//! these words but the looks; other names are split in the same way.

use super::theme::{Dash, Hatch, Look, Marker, Tone};
use crate::select::in_order;

/// What variants are called that have no word but their arity.
pub const PLAIN: &str = "Uncompressed";

/// The first word of a name, such as `Wide4`.
pub fn arity(variant: &str) -> &str {
    variant.split(' ').next().unwrap_or(variant)
}

/// The other words.
pub fn words(variant: &str) -> Vec<&str> {
    variant.split(' ').skip(1).collect()
}

/// The other words as one name.
pub fn flavour(variant: &str) -> String {
    let words = words(variant);
    if words.is_empty() { PLAIN.to_owned() } else { words.join(" ") }
}

/// The name without one of its words, where it has that.
pub fn without(variant: &str, word: &str) -> Option<String> {
    let rest: Vec<&str> = words(variant).into_iter().filter(|other| *other != word).collect();
    let shorter = rest.len() < words(variant).len();
    shorter.then(|| [&[arity(variant)], &rest[..]].concat().join(" "))
}

/// The arities of some variants, in order.
pub fn arities(variants: &[&str]) -> Vec<String> {
    in_order(variants.iter().map(|variant| arity(variant).to_owned()))
}

/// The flavours of some variants, in the order of the arity that has most of them.
pub fn flavours(variants: &[&str]) -> Vec<String> {
    let of = |name: &String| -> Vec<String> {
        in_order(variants.iter().filter(|variant| arity(variant) == name).map(|variant| flavour(variant)))
    };
    let mut most: Vec<Vec<String>> = arities(variants).iter().map(of).collect();
    most.sort_by_key(|flavours| std::cmp::Reverse(flavours.len()));
    in_order(most.into_iter().flatten())
}

/// The look of an arity; the number is its place among those that have no look of their own.
pub fn look_of_arity(arity: &str, number: usize) -> Look {
    let (tone, hatch, marker, dash) = match arity {
        "Binary" => (Tone::Slate, Hatch::Plain, Marker::Diamond, Dash::Dotted),
        "Wide4" => (Tone::Blue, Hatch::Plain, Marker::Disc, Dash::Solid),
        "Wide6" => (Tone::Orange, Hatch::Plain, Marker::Square, Dash::Solid),
        "Wide8" => (Tone::Green, Hatch::Falling, Marker::Triangle, Dash::Dashed),
        _ => return Look::numbered(number + 3),
    };
    Look { tone, hatch, marker, dash }
}

/// The look of a flavour: blue is uncompressed and orange quantized, pale is Slang, and hatched goes by view.
/// Flavours with other words are numbered.
pub fn look_of_flavour(flavour: &str, number: usize) -> Look {
    let words: Vec<&str> = flavour.split(' ').filter(|word| *word != PLAIN).collect();
    if words.iter().any(|word| !["Slang", "Quantized", "CBTC"].contains(word)) {
        return Look::numbered(number);
    }
    let has = |word: &str| words.contains(&word);
    let tone = match (has("Quantized"), has("Slang")) {
        (false, false) => Tone::Blue,
        (true, false) => Tone::Orange,
        (false, true) => Tone::PaleBlue,
        (true, true) => Tone::PaleOrange,
    };
    let hatch = if has("CBTC") { Hatch::Rising } else { Hatch::Plain };
    Look { tone, hatch, marker: Marker::Disc, dash: Dash::Solid }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_taken_apart() {
        assert_eq!((arity("Wide4"), flavour("Wide4").as_str()), ("Wide4", PLAIN));
        assert_eq!(flavour("Wide4 Slang CBTC"), "Slang CBTC");
        assert_eq!(without("Wide4 Slang CBTC", "Slang").as_deref(), Some("Wide4 CBTC"));
        assert_eq!(without("Wide4 CBTC", "CBTC").as_deref(), Some("Wide4"));
        assert_eq!(without("Wide4", "CBTC"), None);
        assert_eq!(arity(""), "");
    }

    #[test]
    fn each_flavour_of_the_thesis_looks_its_own_way() {
        let mut looks = Vec::new();
        for slang in ["", "Slang"] {
            for quantized in ["", "Quantized"] {
                for cbtc in ["", "CBTC"] {
                    let name = ["Wide4", slang, quantized, cbtc].map(str::to_owned);
                    let name: Vec<String> = name.into_iter().filter(|word| !word.is_empty()).collect();
                    looks.push(look_of_flavour(&flavour(&name.join(" ")), 0));
                }
            }
        }
        for (index, look) in looks.iter().enumerate() {
            assert!(!looks[..index].contains(look), "{look:?}");
        }
    }
}
