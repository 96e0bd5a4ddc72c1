//! Everything that is behind the numbers of one point.

use super::chapter::Chapter;
use super::number::{count, gap, grouped, short};
use super::origin::{fact, parameters};
use super::provenance::provenance;
use super::trust;
use crate::figure::Figure;
use crate::select::{Entry, Selection};
use maud::{Markup, html};
use record::stats::{Estimate, median};
use record::{Build, Kernel, OccupancyLimit, Point, Rays, Reading, Sample, Stop, View};

/// Samples of a record that are in the page, about; each has a number for each kind of rays.
const TOGETHER: usize = 60_000;

/// Samples of one point that are in the page, at most.
const OF_POINT: usize = 400;

/// How many repetitions of a build are in the page.
const BUILDS: usize = 100;

/// How many samples are in the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Of a point, over its views.
    of_point: usize,
    /// Whether that leaves some out.
    left_out: usize,
}

impl Budget {
    /// That of these points.
    pub fn new(selection: &Selection) -> Budget {
        let of_point = (TOGETHER / selection.entries.len().max(1)).clamp(8, OF_POINT);
        let mut budget = Budget { of_point, left_out: 0 };
        for entry in &selection.entries {
            let most = budget.of_view(entry.point);
            let over = |view: &View| view.samples.len().saturating_sub(most);
            budget.left_out += entry.point.views.iter().map(over).sum::<usize>();
        }
        budget
    }

    /// Samples of one view of a point; at least one.
    fn of_view(&self, point: &Point) -> usize {
        (self.of_point / point.views.len().max(1)).max(1)
    }

    /// What the reader must know about it.
    pub fn remark(&self) -> String {
        match self.left_out {
            0 => "Every sample of the record is in here, in the order measured.".into(),
            left_out => format!(
                "To keep the page small, {} are not in here: of each point the first {} at most, over its views. \
                 Means, least and most are of all; the record has them all.",
                count(left_out, "sample"),
                self.of_point
            ),
        }
    }
}

/// The block of one point, closed until somebody asks.
pub fn markup(chapter: &Chapter, entry: &Entry, budget: Budget) -> Markup {
    let point = entry.point;
    let summary = [(Figure::Primary, "pMRps"), (Figure::Secondary, "sMRps")].map(|(figure, unit)| {
        figure.of(point).map_or(format!("– {unit}"), |value| format!("{} {unit}", short(value)))
    });
    html! {
        details.point {
            summary {
                b { (entry.variant()) } @if !entry.pass.0.is_empty() { ", " (entry.pass) }
                " " span.muted { (summary.join(", ")) }
            }
            // The identifier is inside, because that is what browsers open a closed block for.
            div id=(chapter.id_of(entry)) {
                p { code { (chapter.source.name) ": results[" (entry.index) "]" } }
                dl.facts {
                    (fact("Primary rate", html! { (provenance(point, Figure::Primary)) }))
                    (fact("Secondary rate", html! { (provenance(point, Figure::Secondary)) }))
                    (fact("Build", html! { (provenance(point, Figure::Total)) }))
                    (fact("Counts", html! { (provenance(point, Figure::Nodes)) }))
                    (fact("Tree", tree(point)))
                    (fact("Verdict", trust::of_point(point)))
                    (measurement(point))
                }
                @if !point.parameters.0.is_empty() { h5 { "Parameters that differ from the run's" } (parameters(&point.parameters)) }
                (views(point, budget))
                (builds(point))
                (kernels(&point.kernels))
            }
        }
    }
}

/// What was traced; the mean over views where each has its own.
fn tree(point: &Point) -> Markup {
    const OF_TREE: [(Figure, &str); 5] = [
        (Figure::Children, "children a node"),
        (Figure::LeafTriangles, "triangles a leaf"),
        (Figure::Depth, "levels"),
        (Figure::SahCost, "SAH cost"),
        (Figure::Bytes, "bytes"),
    ];
    let known = OF_TREE.map(|(figure, what)| {
        let value = figure.of(point)?;
        Some((if value.fract() == 0.0 { grouped(value as u64) } else { short(value) }, what))
    });
    html! {
        @if known.iter().all(Option::is_none) { (gap("not recorded")) } @else {
            @for (index, (value, what)) in known.iter().flatten().enumerate() {
                @if index > 0 { ", " } (value) " " (what)
            }
            "; " (provenance(point, Figure::Bytes))
        }
    }
}

fn measurement(point: &Point) -> Markup {
    html! {
        @if let Some(measurement) = &point.measurement {
            (fact("Measured", html! {
                "from " (measurement.started) " to " (measurement.finished) ", after "
                (grouped(measurement.position)) " others"
                @if measurement.part > 0 { ", by part " (u64::from(measurement.part) + 1) }
            }))
            (fact("Ended", html! { (match measurement.stopped {
                Stop::Precise => "when its rates were known well enough",
                Stop::Samples => "with all the samples that it may have",
                Stop::Time => "when its time was over",
                Stop::Interrupted => "when somebody interrupted it",
            }) }))
        }
    }
}

fn views(point: &Point, budget: Budget) -> Markup {
    let most = budget.of_view(point);
    html! {
        div.scroll role="region" tabindex="0" aria-label="Samples by view" {
            table.samples {
                caption { "Samples by view, in million rays per second; those struck through do not count" }
                thead { tr {
                    th scope="col" { "view" } th scope="col" { "rays" } th.number scope="col" { "mean" }
                    th.number scope="col" { "±" } th.number scope="col" { "least" }
                    th.number scope="col" { "most" } th.number scope="col" { "count" } th scope="col" { "samples" }
                } }
                tbody {
                    @for view in &point.views {
                        @for rays in [Rays::Primary, Rays::Secondary] { (of_view(view, rays, most)) }
                    }
                }
            }
        }
        @if point.views.iter().any(|view| view.before.reading().or(view.after.reading()).is_some()) {
            (telemetry(point))
        } @else if let Some(record::Telemetry::Unavailable { reason }) = point.views.first().map(|view| &view.before) {
            p.remark { "Clocks, temperature and power are not known: " (reason) "." }
        }
    }
}

fn of_view(view: &View, rays: Rays, most: usize) -> Markup {
    let rates = view.rates(rays);
    let known = |value: Option<f64>| match value {
        Some(value) => html! { td.number { (short(value)) } },
        None => html! { td.number { (gap("not known")) } },
    };
    html! {
        tr {
            @if rays == Rays::Primary { th scope="rowgroup" rowspan="2" { (view.name) } }
            td { (rays) }
            (known(view.rate(rays)))
            (known(Estimate::of(&rates).map(|estimate| estimate.half_width())))
            (known(rates.iter().copied().reduce(f64::min)))
            (known(rates.iter().copied().reduce(f64::max)))
            td.number { (view.counted().count()) @if view.counted().count() < view.samples.len() { " of " (view.samples.len()) } }
            td.list {
                @for sample in view.samples.iter().take(most) { (of_sample(sample, rays)) " " }
                @if view.samples.len() > most { "… and " (grouped((view.samples.len() - most) as u64)) " more in the record" }
            }
        }
    }
}

fn of_sample(sample: &Sample, rays: Rays) -> Markup {
    let rate = sample.rate(rays).map_or("–".to_owned(), short);
    match sample.excluded {
        Some(reason) => {
            let clock = sample.sm_clock_mhz.map_or(String::new(), |mhz| format!(" ({mhz} MHz)"));
            html! { del title=(format!("{}{clock}", trust::exclusion(reason))) { (rate) } }
        }
        None => html! { (rate) },
    }
}

fn telemetry(point: &Point) -> Markup {
    type Column = (&'static str, fn(&Reading) -> Option<f64>);
    const COLUMNS: [Column; 4] = [
        ("clock MHz", |reading| reading.sm_clock_mhz.map(f64::from)),
        ("memory MHz", |reading| reading.memory_clock_mhz.map(f64::from)),
        ("°C", |reading| reading.temperature_celsius.map(f64::from)),
        ("W", |reading| reading.power_watts),
    ];
    html! {
        div.scroll role="region" tabindex="0" aria-label="The device around each view" {
            table {
                caption { "The device before → after each view" }
                thead { tr {
                    th scope="col" { "view" }
                    @for (name, _) in COLUMNS { th.number scope="col" { (name) } }
                    th scope="col" { "slowed down by" }
                    th.number scope="col" { "nodes" } th.number scope="col" { "boxes" } th.number scope="col" { "tris per ray" }
                } }
                tbody {
                    @for view in &point.views {
                        tr {
                            th scope="row" { (view.name) }
                            @for (_, value) in COLUMNS {
                                td.number { @for (index, telemetry) in [&view.before, &view.after].into_iter().enumerate() {
                                    @if index > 0 { " → " }
                                    @match telemetry.reading().and_then(value) {
                                        Some(value) => (short(value)),
                                        None => (gap("not told")),
                                    }
                                } }
                            }
                            td { (slowed(view)) }
                            @match view.counters.as_ref().and_then(|counters| counters.all().per_ray()) {
                                Some(met) => { td.number { (short(met.nodes)) } td.number { (short(met.boxes)) } td.number { (short(met.triangles)) } }
                                None => { @for _ in 0..3 { td.number { (gap("not counted")) } } }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn slowed(view: &View) -> String {
    let reasons: Vec<String> = [&view.before, &view.after]
        .into_iter()
        .filter_map(|telemetry| telemetry.reading()?.throttle_reasons.as_ref())
        .flatten()
        .filter(|reason| reason.slows())
        .map(ToString::to_string)
        .collect();
    match (reasons.is_empty(), view.throttled()) {
        (false, _) => crate::select::in_order(reasons).join(", "),
        (true, Some(_)) => "nothing".into(),
        (true, None) => "not told".into(),
    }
}

fn builds(point: &Point) -> Markup {
    let adapted: Vec<(&str, &Build)> = point
        .views
        .iter()
        .filter_map(|view| Some((view.name.as_str(), &view.adaptation.as_ref()?.build)))
        .collect();
    html! {
        div.scroll role="region" tabindex="0" aria-label="Builds" {
            table.samples {
                caption { "Builds and sampling, in milliseconds" }
                thead { tr {
                    th scope="col" { "what" } th.number scope="col" { "median" } th scope="col" { "phases, mean" } th scope="col" { "repetitions" }
                } }
                tbody {
                    (of_build(if adapted.is_empty() { "tree" } else { "binary tree" }, &point.build))
                    @for (view, build) in &adapted { (of_build(&format!("tree of view {view}"), build)) }
                    @for view in &point.views {
                        @if let Some(adaptation) = &view.adaptation {
                            (row(&format!("sampling of view {}", view.name), &adaptation.sampling_milliseconds, &[]))
                        }
                    }
                }
            }
        }
    }
}

fn of_build(what: &str, build: &Build) -> Markup {
    let times: Vec<f64> = build.repetitions.iter().map(|repetition| repetition.milliseconds).collect();
    row(what, &times, &build.mean_phases())
}

fn row(what: &str, times: &[f64], phases: &[(&str, f64)]) -> Markup {
    html! {
        tr {
            th scope="row" { (what) }
            td.number { @match median(times) { Some(time) => (short(time)), None => (gap("not measured")) } }
            td { @for (index, (name, time)) in phases.iter().enumerate() { @if index > 0 { ", " } (name) " " (short(*time)) } }
            td.list {
                @for time in times.iter().take(BUILDS) { (short(*time)) " " }
                @if times.len() > BUILDS { "… and " (times.len() - BUILDS) " more in the record" }
            }
        }
    }
}

fn kernels(kernels: &[Kernel]) -> Markup {
    let told = |value: Option<u64>| match value {
        Some(value) => html! { td.number { (grouped(value)) } },
        None => html! { td.number { (gap("not told")) } },
    };
    html! {
        @if !kernels.is_empty() {
            div.scroll role="region" tabindex="0" aria-label="Kernels" {
                table {
                    caption { "Kernels" }
                    thead { tr {
                        th scope="col" { "kernel" } th scope="col" { "rays" } th.number scope="col" { "workgroup" }
                        th.number scope="col" { "subgroup" } th.number scope="col" { "registers" } th.number scope="col" { "local bytes" }
                        th.number scope="col" { "shared bytes" } th.number scope="col" { "spills" } th.number scope="col" { "occupancy" }
                    } }
                    tbody {
                        @for kernel in kernels {
                            tr {
                                th scope="row" { (kernel.name) } td { (kernel.purpose) }
                                td.number { (kernel.workgroup_size) } td.number { (kernel.subgroup_size) }
                                (told(kernel.registers.map(u64::from))) (told(kernel.local_bytes))
                                (told(kernel.shared_bytes)) (told(kernel.spills))
                                td.number {
                                    @match kernel.occupancy { Some(share) => { (short(100.0 * share)) "%" } None => (gap("not told")) }
                                    @if let Some(limit) = kernel.limited_by { small { " by " (limited(limit)) } }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn limited(limit: OccupancyLimit) -> &'static str {
    match limit {
        OccupancyLimit::Subgroups => "subgroups",
        OccupancyLimit::Workgroups => "workgroups",
        OccupancyLimit::Registers => "registers",
        OccupancyLimit::SharedMemory => "shared memory",
    }
}
