//! A table in Markdown.

use super::comparison::{Comparison, label, shown};
use super::percent::Percent;
use super::terminal::{figure, interval, measured, summary, verdict};
use std::fmt::Write;

/// The text.
pub fn text(comparison: &Comparison) -> String {
    let mut text = String::new();
    for obstacle in &comparison.obstacles {
        let _ = writeln!(text, "> **Not comparable**, {}\n", escaped(obstacle));
    }
    for (when, side) in [("before", &comparison.old), ("after", &comparison.new)] {
        let _ = writeln!(text, "- {when}: `{}`, {}", side.file.replace('`', "'"), escaped(&measured(side)));
    }
    let _ = writeln!(text, "- {}\n", summary(comparison));
    text += "| variant | pass | figure | scene | before | after | change | 95% interval | p | verdict |\n";
    text += "|---|---|---|---|--:|--:|--:|--:|--:|---|\n";
    for (section, line, change) in comparison.changes() {
        let scene = match &change.scene {
            Some(scene) => escaped(scene),
            None => format!("**mean of {}**", line.scenes.len()),
        };
        let p = change.p.map_or("–".into(), |p| if p < 0.001 { "<0.001".into() } else { format!("{p:.3}") });
        let _ = writeln!(
            text,
            "| {} | {} | {} | {scene} | {} | {} | {} | {} | {p} | {} |",
            escaped(&section.variant),
            escaped(&section.pass.to_string()),
            label(line.figure),
            figure(change.old),
            figure(change.new),
            shown(change).replace('~', "\\~"),
            interval(change),
            verdict(line.figure, change)
        );
    }
    let [rates, builds] = [comparison.thresholds.rates, comparison.thresholds.builds].map(Percent);
    let _ = writeln!(
        text,
        "\nMeans are geometric. Threshold {rates}, of builds {builds}, p after Holm's correction over {} tests.",
        comparison.tests
    );
    for remark in &comparison.remarks {
        let _ = writeln!(text, "- {}", escaped(remark));
    }
    text
}

/// Text in which no character means anything to Markdown.
fn escaped(text: &str) -> String {
    text.chars().fold(String::new(), |mut all, character| {
        if "\\`*_{}[]<>()#+!|~".contains(character) {
            all.push('\\');
        }
        all.push(if character == '\n' { ' ' } else { character });
        all
    })
}
