//! Whether the numbers can be trusted: how the clocks were held, and whether the device was slowed down.

use super::chapter::Chapter;
use super::number::{count, gap, short};
use maud::{Markup, html};
use record::{ClockKind, Exclusion, Hold, Point, Policy, Reading, Record, Sample, Verdict, View};
use std::collections::BTreeMap;

/// How many points are named before the rest is only counted.
const NAMED: usize = 12;

/// The verdict of a chapter.
pub fn markup(chapter: &Chapter) -> Markup {
    let record = chapter.selection.record;
    let points: Vec<&Point> = chapter.selection.entries.iter().map(|entry| entry.point).collect();
    html! {
        (overall(&points))
        (doubtful(chapter))
        h4 { "How the clocks were held" }
        (policy(record))
        h4 { "What the device said" }
        (said(&points))
        (excluded(&points))
        (drift(record))
    }
}

/// The verdict of one point, and whether too few of its samples count.
pub fn of_point(point: &Point) -> Markup {
    let Some(measurement) = &point.measurement else { return gap("no verdict in the record") };
    html! {
        @match &measurement.verdict {
            Some(verdict) => (badge(verdict)),
            None => (gap("no verdict in the record")),
        }
        @if measurement.unreliable {
            " " span.badge.bad title="too few samples of a view count" { "✗ unreliable" }
        }
    }
}

/// A verdict as a word with a sign, so that its colour is not needed.
pub fn badge(verdict: &Verdict) -> Markup {
    let (class, word) = match verdict {
        Verdict::Trusted => ("badge good", "✓ trusted"),
        Verdict::Unknown { .. } => ("badge unsure", "? unknown"),
        Verdict::Throttled { .. } => ("badge bad", "✗ throttled"),
    };
    html! { span class=(class) title=(verdict) { (word) } }
}

fn verdicts<'p>(points: &[&'p Point]) -> impl Iterator<Item = &'p Verdict> {
    points.iter().filter_map(|point| point.measurement.as_ref()?.verdict.as_ref())
}

fn overall(points: &[&Point]) -> Markup {
    let known: Vec<&Verdict> = verdicts(points).collect();
    let missing = points.len() - known.len();
    let Some(worst) = Verdict::worst(known.iter().map(|&verdict| verdict.clone())) else {
        return html! {
            p.verdict { span.badge.unsure { "? no verdict" }
                " The record does not say whether the device was slowed down while it was measured: it is older than verdicts, or was imported." }
        };
    };
    let mut reasons: BTreeMap<String, usize> = BTreeMap::new();
    for verdict in &known {
        if let Verdict::Unknown { reason } = verdict {
            *reasons.entry(reason.clone()).or_default() += 1;
        }
    }
    let throttled = known.iter().filter(|verdict| matches!(verdict, Verdict::Throttled { .. })).count();
    let trusted = known.iter().filter(|verdict| verdict.is_trusted()).count();
    html! {
        p.verdict {
            (badge(&worst)) " "
            @if trusted == points.len() { "Nothing slowed the device down for longer than is tolerated, while any of the points was measured." }
            @else {
                "Of " (count(points.len(), "point")) ", " (trusted) " can be trusted"
                @if throttled > 0 { "; during " (throttled) " the device was slowed down" }
                @if missing > 0 { "; " (missing) " have no verdict" }
                @if reasons.is_empty() { "." }
            }
        }
        @if !reasons.is_empty() {
            p { "Unknown, because" }
            ul { @for (reason, number) in &reasons { li { (reason) " (" (count(*number, "point")) ")" } } }
        }
    }
}

/// The points that cannot be trusted, by name.
fn doubtful(chapter: &Chapter) -> Markup {
    let bad = |point: &Point| {
        point.measurement.as_ref().is_some_and(|measurement| {
            measurement.unreliable || matches!(measurement.verdict, Some(Verdict::Throttled { .. }))
        })
    };
    let doubtful: Vec<_> = chapter.selection.entries.iter().filter(|entry| bad(entry.point)).collect();
    html! {
        @if !doubtful.is_empty() {
            ul {
                @for entry in doubtful.iter().take(NAMED) {
                    li {
                        a href=(format!("#{}", chapter.id_of(entry))) { (entry.variant()) " on " (entry.scene()) } " "
                        @if let Some(measurement) = &entry.point.measurement {
                            @if let Some(verdict) = &measurement.verdict { "is " (verdict) }
                            @if measurement.unreliable { ", unreliable: too few samples count" }
                        }
                    }
                }
                @if doubtful.len() > NAMED { li { "and " (doubtful.len() - NAMED) " more; the table of all points has them" } }
            }
        }
    }
}

fn policy(record: &Record) -> Markup {
    html! {
        @match &record.run.policy {
            Some(policy) => (held(policy)),
            None => { p { "Not by stabilize: the device chose its clocks itself, unless somebody locked them by other means." } }
        }
        @if let Some(clock) = &record.run.clock {
            p {
                "Samples below " (short(100.0 * clock.least_share)) "% of " (clock.mhz) " MHz, "
                @match clock.kind {
                    ClockKind::Locked => "to which the device was locked",
                    ClockKind::Base => "its base clock",
                }
                ", do not count."
            }
        } @else {
            p { "Samples were held against no clock." }
        }
    }
}

fn held(policy: &Policy) -> Markup {
    html! {
        div.scroll role="region" tabindex="0" aria-label="Clocks under stabilize" {
            table {
                caption { "Clocks under stabilize, in MHz" }
                thead { tr {
                    th scope="col" { "clock" } th scope="col" { "asked for" }
                    th.number scope="col" { "locked to" } th.number scope="col" { "delivered" }
                    th scope="col" { "remark" }
                } }
                tbody { (hold("cores", &policy.graphics)) (hold("memory", &policy.memory)) }
            }
        }
        @if let Some(on) = policy.persistence {
            p { "Persistence mode was " @if on { "on" } @else { "off" } "." }
        }
    }
}

fn hold(name: &str, hold: &Hold) -> Markup {
    let mhz = |value: Option<u32>, without: &str| match value {
        Some(value) => html! { td.number { (value) } },
        None => html! { td.number { (without) } },
    };
    html! {
        tr {
            th scope="row" { (name) }
            td { (hold.asked) }
            (mhz(hold.locked_mhz, "free"))
            (mhz(hold.delivered_mhz, "not told"))
            td.long { (hold.remark.as_deref().unwrap_or_default()) }
        }
    }
}

fn views<'p>(points: &[&'p Point]) -> impl Iterator<Item = &'p View> {
    points.iter().flat_map(|point| &point.views)
}

/// From what to what clocks, heat and power went.
fn said(points: &[&Point]) -> Markup {
    let readings: Vec<&Reading> = views(points)
        .flat_map(|view| [&view.before, &view.after])
        .filter_map(|telemetry| telemetry.reading())
        .collect();
    let samples = views(points).flat_map(|view| &view.samples).filter_map(|sample| sample.sm_clock_mhz);
    let after: Vec<f64> = samples.map(f64::from).collect();
    if readings.is_empty() && after.is_empty() {
        let mut reasons: Vec<&str> = Vec::new();
        for view in views(points) {
            if let record::Telemetry::Unavailable { reason } = &view.before
                && !reasons.contains(&reason.as_str())
            {
                reasons.push(reason);
            }
        }
        return html! { p { "Nothing: " (reasons.join("; ")) "." } };
    }
    let of = |value: fn(&Reading) -> Option<f64>| -> Vec<f64> {
        readings.iter().filter_map(|reading| value(reading)).collect()
    };
    let rows: [(&str, &str, Vec<f64>); 5] = [
        ("clock after each sample", "MHz", after),
        ("clock around each view", "MHz", of(|reading| reading.sm_clock_mhz.map(f64::from))),
        ("memory clock around each view", "MHz", of(|reading| reading.memory_clock_mhz.map(f64::from))),
        ("temperature around each view", "°C", of(|reading| reading.temperature_celsius.map(f64::from))),
        ("power around each view", "W", of(|reading| reading.power_watts)),
    ];
    let mut throttled: BTreeMap<String, usize> = BTreeMap::new();
    for reading in &readings {
        for reason in reading.throttle_reasons.iter().flatten().filter(|reason| reason.slows()) {
            *throttled.entry(reason.to_string()).or_default() += 1;
        }
    }
    html! {
        div.scroll role="region" tabindex="0" aria-label="Readings" {
            table {
                caption { "Readings" }
                thead { tr {
                    th scope="col" { "what" } th.number scope="col" { "least" } th.number scope="col" { "most" }
                    th scope="col" { "unit" } th.number scope="col" { "readings" }
                } }
                tbody {
                    @for (what, unit, values) in &rows {
                        tr {
                            th scope="row" { (what) }
                            @if values.is_empty() { td.number { (gap("not told")) } td.number { (gap("not told")) } }
                            @else {
                                td.number { (short(values.iter().copied().fold(f64::INFINITY, f64::min))) }
                                td.number { (short(values.iter().copied().fold(f64::NEG_INFINITY, f64::max))) }
                            }
                            td { (unit) }
                            td.number { (values.len()) }
                        }
                    }
                }
            }
        }
        @if throttled.is_empty() {
            @if readings.iter().any(|reading| reading.throttle_reasons.is_some()) {
                p { "No reading names anything that slowed it down." }
            }
        } @else {
            p { "Readings name what slowed it down: "
                @for (index, (reason, number)) in throttled.iter().enumerate() {
                    @if index > 0 { ", " } (reason) " (" (number) " of " (readings.len()) ")"
                } "." }
        }
    }
}

/// Why a sample does not count, in words.
pub fn exclusion(reason: Exclusion) -> &'static str {
    match reason {
        Exclusion::WarmUp => "the device was warming up",
        Exclusion::Throttled => "the device was slowed down",
        Exclusion::LowClock => "the clock was too low",
    }
}

fn excluded(points: &[&Point]) -> Markup {
    let samples: Vec<&Sample> = views(points).flat_map(|view| &view.samples).collect();
    let reasons: Vec<(&str, usize)> = [Exclusion::WarmUp, Exclusion::Throttled, Exclusion::LowClock]
        .into_iter()
        .map(|reason| {
            (exclusion(reason), samples.iter().filter(|sample| sample.excluded == Some(reason)).count())
        })
        .filter(|(_, number)| *number > 0)
        .collect();
    html! {
        p {
            @if reasons.is_empty() { "All of " (count(samples.len(), "sample")) " count." }
            @else {
                "Of " (count(samples.len(), "sample")) " these do not count: "
                @for (index, (reason, number)) in reasons.iter().enumerate() {
                    @if index > 0 { ", " } (number) " because " (reason)
                } "."
            }
        }
    }
}

fn drift(record: &Record) -> Markup {
    let drifts = record.drifts();
    html! {
        @if !drifts.is_empty() {
            ul {
                @for drift in &drifts {
                    li {
                        "The reference point's " (drift.rays) " rate, measured " (drift.count) " times"
                        @if record.parts.len() > 1 { " by part " (drift.part + 1) } ", "
                        @if drift.significant() {
                            strong { "follows the time" } ": the last one is " (format!("{:.3}", drift.change)) " times the first one"
                        } @else { "does not follow the time" }
                        " (p = " (format!("{:.2}", drift.correlation.probability)) ")."
                    }
                }
            }
        }
    }
}
