//! The page around the chapters.

use super::chapter::{Chapter, PARTS};
use super::{plots, slim};
use crate::plot::records;
use crate::plot::theme::dark_css;
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("script.js");

/// Nothing may be loaded, whatever is in the page: the browser itself sees to that.
const POLICY: &str = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; \
                      script-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";

/// The page.
pub fn page(chapters: &[Chapter]) -> String {
    let title = match chapters {
        [one] => format!("Broadleaf: {} on {}", one.source.name, one.selection.record.device.name),
        several => format!("Broadleaf: {} records", several.len()),
    };
    let style = format!("{STYLE}\n@media screen and (prefers-color-scheme: dark) {{\n{}}}\n", dark_css(""));
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta name="generator" content=(concat!("compare ", env!("CARGO_PKG_VERSION")));
                title { (title) }
                style { (PreEscaped(style)) }
            }
            body {
                a.skip href="#main" { "To the content" }
                header {
                    h1 { "Broadleaf report" }
                    (contents(chapters))
                }
                main id="main" {
                    @for chapter in chapters { (chapter.markup()) }
                    (changes(chapters))
                }
                footer {
                    p {
                        "Made by compare " (env!("CARGO_PKG_VERSION")) ". Point at a number to see how many samples it has and between what it lies; "
                        "follow it to the samples. docs/record.md in Broadleaf's repository explains the record."
                    }
                }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    // HTML knows no such characters; a record may hold them all the same.
    page.into_string().replace(|c: char| c.is_control() && c != '\n' && c != '\t', "\u{fffd}")
}

fn contents(chapters: &[Chapter]) -> Markup {
    html! {
        nav aria-label="Contents" {
            ul {
                @for chapter in chapters {
                    li {
                        a href=(format!("#{}", chapter.id("record"))) { (chapter.source.name) }
                        ul { @for (part, title) in PARTS { li { a href=(format!("#{}", chapter.id(part))) { (title) } } } }
                    }
                }
                @if chapters.len() == 2 { li { a href="#changes" { "From the first to the second" } } }
            }
        }
    }
}

/// What changed from the first to the second of two records.
fn changes(chapters: &[Chapter]) -> Markup {
    let [old, new] = chapters else { return html! {} };
    let found = records::charts(&old.selection, &new.selection);
    html! {
        section.chapter id="changes" {
            h2 { "From the first to the second" }
            p { "What changed from " (old.source.name) " to " (new.source.name) ". `compare diff` has the numbers, and how sure they are." }
            div.plots { @for chart in &found.charts { (plots::figure(chart, &slim::svg(chart))) } }
            @for remark in &found.remarks { p.remark { (remark) } }
        }
    }
}
