//! A table in colours.

use super::comparison::{Change, Comparison, Side, label, shown};
use super::percent::Percent;
use super::verdict::Verdict;
use crate::figure::Figure;
use anstyle::{AnsiColor, Style};
use comfy_table::{CellAlignment, Table};
use std::fmt::Write;

/// The text, with colours.
pub fn text(comparison: &Comparison) -> String {
    let mut text = String::new();
    for obstacle in &comparison.obstacles {
        let _ = writeln!(text, "NOT COMPARABLE, {obstacle}");
    }
    for (when, side) in [("before", &comparison.old), ("after ", &comparison.new)] {
        let _ = writeln!(text, "{when}  {}  {}", side.file, measured(side));
    }
    text += "\n";
    let _ = writeln!(text, "{}\n\n{}", table(comparison), summary(comparison));
    for remark in &comparison.remarks {
        let _ = writeln!(text, "{remark}");
    }
    let [rates, builds] = [comparison.thresholds.rates, comparison.thresholds.builds].map(Percent);
    let _ = write!(
        text,
        "\npMRps, sMRps: million primary and secondary rays a second; build ms: all builds and sample rays of one view.\n\
         ~: inside the noise; ?: too few samples to tell; means are geometric;\n\
         threshold {rates}, of builds {builds}."
    );
    text
}

fn table(comparison: &Comparison) -> String {
    let mut table = Table::new();
    table.load_preset("     ──            ");
    table.set_header(["", "scene", "before", "after", "change", "95% interval", "verdict"]);
    // Titles and colours come when the rest is laid out, so that they take part in no column's width.
    let mut rows: Vec<(String, String, Style)> = Vec::new();
    for section in &comparison.sections {
        let mut title = match section.pass.0.is_empty() {
            true => section.variant.clone(),
            false => format!("{}, {}", section.variant, section.pass),
        };
        for line in &section.lines {
            for (index, change) in line.changes().enumerate() {
                let verdict = verdict(line.figure, change);
                table.add_row([
                    if index == 0 { format!("  {}", label(line.figure)) } else { String::new() },
                    change.scene.clone().unwrap_or_else(|| format!("mean of {}", line.scenes.len())),
                    figure(change.old),
                    figure(change.new),
                    shown(change),
                    interval(change),
                    verdict.clone(),
                ]);
                rows.push((std::mem::take(&mut title), verdict, style(change)));
            }
        }
    }
    for (index, column) in table.column_iter_mut().enumerate() {
        column.set_padding((0, 2));
        if (2..=5).contains(&index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let lines: Vec<String> = table.lines().map(|line| line.trim_end().to_owned()).collect();
    let (header, body) = lines.split_at(lines.len() - rows.len());
    let mut text = header.join("\n");
    let bold = Style::new().bold();
    for (line, (title, end, style)) in body.iter().zip(rows) {
        if !title.is_empty() {
            let _ = write!(text, "\n{bold}{title}{bold:#}");
        }
        let start = line.strip_suffix(&end).unwrap_or(line);
        let end = &line[start.len()..];
        let _ = write!(text, "\n{start}{style}{end}{style:#}");
    }
    text
}

/// How many changes have which verdict.
pub fn summary(comparison: &Comparison) -> String {
    let count = |wanted| comparison.changes().filter(|(_, _, change)| change.verdict == wanted).count();
    let all = [Verdict::Faster, Verdict::Slower, Verdict::Same, Verdict::Unclear];
    all.map(|verdict| format!("{} {}", count(verdict), verdict.word())).join(", ")
}

/// What measured a record, on what.
pub fn measured(side: &Side) -> String {
    let day = side.started.get(..10).unwrap_or(&side.started);
    let commit = side.commit.as_ref().map_or_else(String::new, |commit| {
        let dirty = if commit.ends_with("-dirty") { " with changes" } else { "" };
        format!(" of {}{dirty}", commit.get(..9).unwrap_or(commit))
    });
    format!("{}{commit}, {day}, {}, {}", side.tool, side.device, side.driver)
}

/// Four significant digits, or a dash.
pub fn figure(value: Option<f64>) -> String {
    value.map_or("–".into(), |value| {
        let digits = (3 - value.abs().max(1e-3).log10().floor() as i32).clamp(0, 6);
        format!("{value:.*}", digits as usize)
    })
}

/// The interval as changes in percent, or a dash.
pub fn interval(change: &Change) -> String {
    let percent = |ratio: f64| 100.0 * (ratio - 1.0);
    change.interval.map_or("–".into(), |interval| {
        format!("{:+.2} … {:+.2}%", percent(interval.low), percent(interval.high))
    })
}

/// The verdict and, where it is unclear, what would help.
pub fn verdict(figure: Figure, change: &Change) -> String {
    let what = if figure == Figure::Total { "builds" } else { "samples a view" };
    match (change.verdict, change.samples_needed) {
        (Verdict::Unclear, Some(number)) => format!("unclear, about {number} {what} would tell"),
        (verdict, _) => verdict.word().to_owned(),
    }
}

fn style(change: &Change) -> Style {
    match change.verdict {
        Verdict::Faster => AnsiColor::Green.on_default(),
        Verdict::Slower => AnsiColor::Red.on_default(),
        Verdict::Unclear => AnsiColor::Yellow.on_default(),
        Verdict::Same => Style::new().dimmed(),
    }
}
