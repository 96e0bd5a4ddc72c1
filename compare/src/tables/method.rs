//! Names of variants as the thesis arranges them.

/// A variant's name in parts, such as `Wide4`, GLSL, `Quantized`, `CBTC`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Method<'a> {
    /// How wide its nodes are: the first word.
    pub arity: &'a str,
    /// Whether its boxes are quantized.
    pub quantized: bool,
    /// Whether its tree goes by view.
    pub by_view: bool,
    /// Whether it is written in Slang, and not in GLSL.
    pub slang: bool,
}

impl<'a> Method<'a> {
    /// The parts of a name; nothing of one that has other parts.
    pub fn of(name: &'a str) -> Option<Method<'a>> {
        let mut words = name.split(' ');
        let mut method = Method { arity: words.next()?, quantized: false, by_view: false, slang: false };
        for word in words {
            let part = match word {
                "Quantized" => &mut method.quantized,
                "CBTC" => &mut method.by_view,
                "Slang" => &mut method.slang,
                _ => return None,
            };
            if std::mem::replace(part, true) {
                return None;
            }
        }
        Some(method)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_have_parts() {
        let found = Method::of("Wide6 Slang Quantized CBTC");
        let all = Method { arity: "Wide6", quantized: true, by_view: true, slang: true };
        assert_eq!(found, Some(all));
        let binary = Method { arity: "Binary", quantized: false, by_view: false, slang: false };
        assert_eq!(Method::of("Binary"), Some(binary));
        assert_eq!(Method::of("Wide4 Fancy"), None);
        assert_eq!(Method::of("Wide4 CBTC CBTC"), None);
    }
}
