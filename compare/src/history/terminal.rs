//! A table for each variant, in colours.

use super::course::{Course, History, Step};
use crate::diff::{Change, Verdict, shown};
use crate::figure::Figure;
use anstyle::{AnsiColor, Style};
use std::fmt::Write;

/// The text, with colours.
pub fn text(history: &History) -> String {
    let mut text = String::new();
    let bold = Style::new().bold();
    let _ =
        writeln!(text, "{bold}{}{bold:#}, geometric mean over {}", history.path, history.scenes.join(", "));
    for course in &history.courses {
        let of = if course.pass.0.is_empty() { String::new() } else { format!(", {}", course.pass) };
        let rays = if course.figure == Figure::Primary { "primary" } else { "secondary" };
        let _ = writeln!(text, "\n{bold}{}{of}, {rays} MRps{bold:#}", course.variant);
        lines(&mut text, history, course);
    }
    let problems: Vec<_> =
        history.versions.iter().filter_map(|version| Some((version, version.problem.as_ref()?))).collect();
    if !problems.is_empty() {
        text += "\n";
    }
    for (version, problem) in problems {
        let _ = writeln!(text, "{} {}: {problem}", version.commit.short(), day(&version.commit.date));
    }
    text += "\n*: faster or slower than the one before, or than the first one since the last *; ~: inside the noise; \
             ?: too few samples to tell\n";
    text
}

fn lines(text: &mut String, history: &History, course: &Course) {
    let width = course.steps.iter().map(|step| value(step).len()).max().unwrap_or(0);
    let hash = course
        .steps
        .iter()
        .map(|step| history.versions[step.version].commit.short().len())
        .max()
        .unwrap_or(0);
    for step in &course.steps {
        let commit = &history.versions[step.version].commit;
        let mark = if step.change_point { '*' } else { ' ' };
        let change = step.change.as_ref().map_or_else(String::new, shown);
        let style = style(step);
        let _ = write!(
            text,
            "  {mark} {:hash$}  {}  {:>width$}  {style}{change:>9}{style:#}  {}",
            commit.short(),
            day(&commit.date),
            value(step),
            commit.subject
        );
        // What a single step does not show.
        let differs = |change: &Change| matches!(change.verdict, Verdict::Faster | Verdict::Slower);
        if let Some(since) = step.since.as_ref().filter(|since| differs(&since.change))
            && !step.change.as_ref().is_some_and(differs)
        {
            let first = history.versions[since.version].commit.short();
            let _ = write!(text, " ({} since {first})", shown(&since.change));
        }
        while text.ends_with(' ') {
            text.pop();
        }
        text.push('\n');
    }
}

fn value(step: &Step) -> String {
    format!("{:.1}", step.value)
}

fn day(date: &str) -> &str {
    date.get(..10).unwrap_or(date)
}

fn style(step: &Step) -> Style {
    match step.change.as_ref().map(|change| change.verdict) {
        Some(Verdict::Faster) => AnsiColor::Green.on_default(),
        Some(Verdict::Slower) => AnsiColor::Red.on_default(),
        Some(Verdict::Unclear) => AnsiColor::Yellow.on_default(),
        _ => Style::new().dimmed(),
    }
}
