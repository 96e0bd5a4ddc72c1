//! Text for the message of a commit, as the thesis has it (Cezner 2025, figure 16).

use super::comparison::{Change, Comparison, Line, label, shown};
use std::fmt::Write;

/// The text.
pub fn text(comparison: &Comparison) -> String {
    let mut text = String::from("Performance changes from the last benchmark:\n");
    for obstacle in &comparison.obstacles {
        let _ = writeln!(text, " NOT COMPARABLE, {obstacle}");
    }
    let mut variant = "";
    for section in &comparison.sections {
        if section.variant != variant {
            let _ = writeln!(text, " {}:", section.variant);
            variant = &section.variant;
        }
        let _ = writeln!(text, "   Pass {}:", section.pass);
        for line in &section.lines {
            let _ = writeln!(text, "     {}: {}", label(line.figure), said(line));
        }
    }
    text += "\n";
    for note in notes(comparison) {
        let _ = writeln!(text, "{note}");
    }
    text
}

fn said(line: &Line) -> String {
    let without = match &line.missing[..] {
        [] => String::new(),
        missing => format!(" (without {})", missing.join(", ")),
    };
    let (Some((best, worst)), Some(mean)) = (line.extremes(), &line.mean) else {
        let one = |change: &Change| format!("{}{}", shown(change), place(change));
        return line.scenes.first().map_or_else(String::new, one) + &without;
    };
    if line.changes().all(|change| shown(change) == "~") {
        return format!("~{without}");
    }
    let one = |change: &Change| format!("{}{}", shown(change), place(change));
    format!("avg {}, the best {}, the worst {}{without}", shown(mean), one(best), one(worst))
}

fn place(change: &Change) -> String {
    change.scene.as_ref().map_or_else(String::new, |scene| format!(" in scene {scene}"))
}

/// What the signs mean, where they occur, and the remarks.
fn notes(comparison: &Comparison) -> Vec<String> {
    let mut notes = Vec::new();
    let lines = || comparison.sections.iter().flat_map(|section| &section.lines);
    let scenes = lines().filter(|line| line.mean.is_some()).map(|line| line.scenes.len()).max();
    if let Some(scenes) = scenes {
        notes.push(format!("avg: geometric mean over {scenes} scenes"));
    }
    let occurs = |sign: &str| comparison.changes().any(|(_, _, change)| shown(change).ends_with(sign));
    if occurs("~") {
        notes.push("~: inside the noise".into());
    }
    if occurs("?") {
        notes.push("?: too few samples to tell".into());
    }
    notes.extend(comparison.remarks.iter().cloned());
    notes
}
