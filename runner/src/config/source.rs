//! Where something was said, and what is wrong with it.

use std::{fmt, ops::Range, path::PathBuf, rc::Rc};

/// What a document is read from.
#[derive(Debug)]
pub enum Source {
    /// A file.
    File {
        /// As the user named it.
        path: PathBuf,
        /// All of it.
        text: String,
    },
    /// An option of the command line, as it was given, such as `--set samples=1`.
    Option(String),
}

/// A place in a source.
#[derive(Clone, Debug)]
pub struct Place {
    source: Rc<Source>,
    /// Bytes before it.
    offset: usize,
}

impl Place {
    /// Where a span begins.
    pub fn new(source: &Rc<Source>, span: Range<usize>) -> Self {
        Self { source: source.clone(), offset: span.start }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &*self.source {
            Source::File { path, text } => {
                let before = text.get(..self.offset).unwrap_or(text);
                let line = before.matches('\n').count() + 1;
                let column = before.chars().rev().take_while(|&c| c != '\n').count() + 1;
                write!(f, "{}:{line}:{column}", path.display())
            }
            Source::Option(option) => f.write_str(option),
        }
    }
}

/// One thing that is wrong.
#[derive(Debug)]
pub struct Mistake {
    /// Where.
    pub place: Place,
    /// What, and what would be right.
    pub message: String,
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.message)
    }
}

/// The mistakes of one source.
#[derive(Debug)]
pub struct Mistakes {
    /// What they are in.
    pub source: Rc<Source>,
    found: Vec<Mistake>,
}

impl Mistakes {
    /// None so far.
    pub fn new(source: Source) -> Self {
        Self { source: Rc::new(source), found: Vec::new() }
    }

    /// The place of a span.
    pub fn place(&self, span: Range<usize>) -> Place {
        Place::new(&self.source, span)
    }

    /// Notes one.
    pub fn add(&mut self, span: Range<usize>, message: impl fmt::Display) {
        self.found.push(Mistake { place: self.place(span), message: message.to_string() });
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// Fails with all of them, if there are any, in their order in the source.
    pub fn none(mut self) -> anyhow::Result<()> {
        self.found.sort_by_key(|mistake| mistake.place.offset);
        report(&self.found)
    }
}

/// Fails with all mistakes, a line each, if there are any.
pub fn report(mistakes: &[Mistake]) -> anyhow::Result<()> {
    let lines: Vec<_> = mistakes.iter().map(Mistake::to_string).collect();
    if lines.is_empty() { Ok(()) } else { Err(anyhow::Error::msg(lines.join("\n"))) }
}

/// The end of a message about a word that is none of `known`: the one that is most like it, or else all.
pub fn instead<'k>(word: &str, known: impl IntoIterator<Item = &'k str>) -> String {
    let known: Vec<_> = known.into_iter().collect();
    let likeness = |candidate: &str| strsim::jaro(&word.to_lowercase(), &candidate.to_lowercase());
    // Of equals the first, hence backwards.
    let nearest = known.iter().rev().map(|candidate| (likeness(candidate), candidate));
    match nearest.max_by(|(a, _), (b, _)| a.total_cmp(b)) {
        // As far as clap goes for options.
        Some((likeness, candidate)) if likeness > 0.7 => format!("; did you mean {candidate}?"),
        Some(_) => format!("; there are {}", known.join(", ")),
        None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_lines_and_columns_of_characters() {
        let source = Source::File { path: "a.toml".into(), text: "x = 1\n\"é\" = 2\n".into() };
        let mistakes = Mistakes::new(source);
        assert_eq!(mistakes.place(0..1).to_string(), "a.toml:1:1");
        assert_eq!(mistakes.place(6..7).to_string(), "a.toml:2:1");
        assert_eq!(mistakes.place(11..12).to_string(), "a.toml:2:5");
        assert_eq!(mistakes.place(900..901).to_string(), "a.toml:3:1");
    }

    #[test]
    fn the_nearest_word_is_named_or_all_are() {
        assert_eq!(instead("smaples", ["scenes", "samples"]), "; did you mean samples?");
        assert_eq!(instead("collapse.ct", ["collapse.c_i", "collapse.c_t"]), "; did you mean collapse.c_t?");
        assert_eq!(instead("Wide5", ["Wide4", "Wide6"]), "; did you mean Wide4?");
        assert_eq!(instead("xyz", ["scenes", "samples"]), "; there are scenes, samples");
        assert_eq!(instead("xyz", []), "");
    }
}
