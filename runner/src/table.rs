//! The record as a table on the terminal.

use crate::variant::Variant;
use comfy_table::{CellAlignment, Table};
use record::{BOUNCES, Launches, Method, Point, Rays, Record, Utilization, Verdict};
use std::fmt::Write;

/// Rates, costs and build times of every point, which variant wins and why, and what the columns mean.
pub fn summary(record: &Record) -> String {
    let many = record.results.iter().any(|p| p.variant != record.results[0].variant);
    let mut header = vec!["scene", "variant", "build ms", "pMRps", "sMRps", "nodes", "boxes", "tris", "SAH"];
    header.extend(["MiB", "B/ray"]);
    if many {
        // Beside the rates and the nodes, what they are of Binary's, for which the expected cost makes room.
        header.remove(8);
        header.insert(6, "×");
        header.insert(5, "×");
        header.insert(4, "×");
    }
    let mut rates = table(&header);
    let mut scene = "";
    for point in &record.results {
        let reference = reference(record, point);
        let per_ray = |point: &Point| point.counters().and_then(|c| c.all().per_ray());
        let cost = per_ray(point);
        let share = |of: fn(&Point) -> Option<f64>| {
            let (own, its) = (of(point)?, of(reference?)?);
            Some(format!("{:.2}", own / its)).filter(|_| its > 0.0)
        };
        let nodes = |point: &Point| point.counters().and_then(|c| c.all().per_ray()).map(|c| c.nodes);
        let build = match (point.sampling_milliseconds(), point.build_milliseconds()) {
            (Some(sampling), Some(build)) => format!("{} + {}", short(sampling), short(build)),
            (_, build) => number(build),
        };
        let mut row = vec![
            // A scene's name once: its variants stand below each other.
            if point.scene.name == scene { String::new() } else { point.scene.name.clone() },
            point.variant.clone(),
            build,
            number(point.primary_mrps()),
            number(point.secondary_mrps()),
            number(cost.map(|c| c.nodes)),
            number(cost.map(|c| c.boxes)),
            number(cost.map(|c| c.triangles)),
            number(point.of_trees(|t| t.sah_cost)),
            number(point.of_trees(|t| t.all_bytes().map(|bytes| bytes as f64 / 1048576.0))),
            bytes(point).map_or_else(|| "–".into(), |b| format!("{b:.0}")),
        ];
        if many {
            let dash = || "–".to_owned();
            row.remove(8);
            row.insert(6, share(nodes).unwrap_or_else(dash));
            row.insert(5, share(Point::secondary_mrps).unwrap_or_else(dash));
            row.insert(4, share(Point::primary_mrps).unwrap_or_else(dash));
        }
        rates.add_row(row);
        scene = &point.scene.name;
    }
    align(&mut rates, &[0, 1]);

    let mut text = shown(&rates);
    if many {
        text += "\n\nFastest";
        for verdict in winners(record) {
            let _ = write!(text, "\n{verdict}");
        }
    }
    let mut names: Vec<&str> = Vec::new();
    for point in &record.results {
        for (name, _) in point.build.mean_phases() {
            if !names.contains(&name) {
                names.push(name);
            }
        }
    }
    if !names.is_empty() {
        let mut header = vec!["scene", "variant", "launches", "Mtri/s", "SAH"];
        header.extend(&names);
        let mut build = table(&header);
        for point in &record.results {
            build.add_row(phases(point, &names));
        }
        align(&mut build, &[0, 1]);
        let _ = write!(text, "\n\nBuild by phase, ms\n{}", shown(&build));
        if record.results.iter().any(|p| p.sampling_milliseconds().is_some()) {
            text += "\nOf variants that go by view: the first build, whose tree the sample rays go through.";
        }
    }
    if record.run.method == Method::Replay {
        let _ = write!(text, "\n\nBounce by bounce, MRps\n{}", bounces(record));
        if let Some(table) = utilization(record) {
            let _ = write!(text, "\n\nSIMD utilization of bounces, %\n{table}");
        }
    }
    let triangles: Vec<String> = record.results.iter().fold(Vec::new(), |mut all, point| {
        let one = format!("{} {}", point.scene.name, thousands(point.scene.triangles));
        if !all.contains(&one) {
            all.push(one);
        }
        all
    });
    let _ = write!(
        text,
        "\n\npMRps, sMRps: million primary and secondary rays a second by the traversal kernel's time alone; mean of\n\
         {} a view. nodes, boxes, tris: inner nodes visited, boxes and triangles tested a ray, over\n\
         all rays of a path; {}. MiB: nodes and triangles.\n\
         B/ray: bytes of nodes and triangles a ray asks for. build ms: median, from triangles in device memory to\n\
         nodes that can be traversed; by view: tracing sample rays + both builds.\n\
         {} × {} pixels, at most {} rays a path, on {}. Triangles: {}.",
        samples(record),
        if many { "×: relative to Binary" } else { "SAH: the tree's cost by the surface area heuristic" },
        record.run.width,
        record.run.height,
        record.run.depth,
        record.device.name,
        triangles.join(", ")
    );
    text + &adopted(record) + &stability(record)
}

/// Which files binary trees came from, and what that means for the time of builds.
fn adopted(record: &Record) -> String {
    let mut files: Vec<String> = Vec::new();
    for adopted in record.results.iter().filter_map(|point| point.adopted.as_ref()) {
        let one = format!("{}, built by {} in {:.3} s", adopted.name, adopted.method, adopted.built_seconds);
        if !files.contains(&one) {
            files.push(one);
        }
    }
    if files.is_empty() {
        return String::new();
    }
    format!("\nBinary trees from files: {}, which is not part of build ms.", files.join("; "))
}

/// How many samples a view has, and of what.
fn samples(record: &Record) -> String {
    let of = match record.run.method {
        Method::Paths => "sample",
        Method::Replay => "launch",
    };
    let all = match record.run.method {
        Method::Paths => "samples",
        Method::Replay => "launches of each bounce",
    };
    match (&record.run.stopping, record.run.samples) {
        (Some(stopping), most) => format!("{} to {most} {all}", stopping.least),
        (None, 1) => format!("one {of}"),
        (None, n) => format!("{n} {all}"),
    }
}

/// Rates of single bounces: of the fastest launch and of the one in the middle.
fn bounces(record: &Record) -> String {
    let heads: Vec<String> = (BOUNCES.iter())
        .flat_map(|bounce| [Launches::Best, Launches::Median].map(|of| format!("{bounce} {of}")))
        .collect();
    let mut rows =
        table(&["scene", "variant"].into_iter().chain(heads.iter().map(String::as_str)).collect::<Vec<_>>());
    for point in &record.results {
        let mut row = vec![point.scene.name.clone(), point.variant.clone()];
        for bounce in BOUNCES {
            row.extend([Launches::Best, Launches::Median].map(|of| number(point.bounce(bounce, of))));
        }
        rows.add_row(row);
    }
    align(&mut rows, &[0, 1]);
    format!(
        "{}\nOf the launches of each view, the mean over the views; 0 are the primary rays.",
        shown(&rows)
    )
}

/// How many lanes of a subgroup take part in its steps, by bounce; nothing where nobody has counted that.
fn utilization(record: &Record) -> Option<String> {
    let of = |point: &Point, bounce: usize| point.counters()?.depths.get(bounce)?.utilization;
    record.results.iter().find_map(|point| of(point, 0))?;
    // There is no room for all.
    let bounces = &BOUNCES[..3];
    let heads: Vec<String> = (bounces.iter())
        .flat_map(|bounce| ["nodes", "tris", "init"].map(|steps| format!("{bounce} {steps}")))
        .collect();
    let mut rows =
        table(&["scene", "variant"].into_iter().chain(heads.iter().map(String::as_str)).collect::<Vec<_>>());
    for point in &record.results {
        let mut row = vec![point.scene.name.clone(), point.variant.clone()];
        for &bounce in bounces {
            let of = |share: fn(&Utilization) -> Option<f64>| of(point, bounce).as_ref().and_then(share);
            let shares = [Utilization::of_nodes, Utilization::of_triangles, Utilization::of_fetches].map(of);
            row.extend(shares.map(|share| share.map_or("–".into(), |share| format!("{:.1}", 100.0 * share))));
        }
        rows.add_row(row);
    }
    align(&mut rows, &[0, 1]);
    Some(format!(
        "{}\nLanes of a subgroup that take part where it visits nodes, tests triangles, and initializes rays.",
        shown(&rows)
    ))
}

/// What a sweep found: as [`summary`] does where it has no axes, and otherwise a row for each point, with how sure
/// its rates are. Then whether the device drifted, and what cannot be relied upon.
pub fn sweep(record: &Record) -> String {
    let axes = record.sweep.as_ref().map_or(&[][..], |sweep| &sweep.axes);
    let mut text = if axes.is_empty() { summary(record) } else { points(record, axes) + &stability(record) };
    for drift in record.drifts() {
        let part = if record.parts.len() > 1 { format!(" of part {}", drift.part) } else { String::new() };
        let verdict = if drift.significant() { "The device drifted" } else { "No drift is to be seen" };
        let _ = write!(
            text,
            "\n{verdict}: {} rays of the reference point{part}, {} times, rank correlation with time {:+.2} (p = {:.2}), \
             last over first {:.3}.",
            drift.rays,
            drift.count,
            drift.correlation.coefficient,
            drift.correlation.probability,
            drift.change
        );
    }
    let unreliable: Vec<String> = (record.results.iter())
        .filter(|point| point.measurement.as_ref().is_some_and(|measurement| measurement.unreliable))
        .map(|point| format!("{}, {}", point.scene.name, point.variant))
        .collect();
    if !unreliable.is_empty() {
        let _ = write!(text, "\nUnreliable, because too few samples count: {}.", unreliable.join("; "));
    }
    text
}

/// How the clocks were held, and which points were slowed down all the same; empty where there is nothing to say.
fn stability(record: &Record) -> String {
    let mut text = String::new();
    if let Some(policy) = &record.run.policy {
        let _ = write!(text, "\nstabilize: {policy}.");
    }
    for point in &record.results {
        match point.measurement.as_ref().and_then(|measurement| measurement.verdict.as_ref()) {
            Some(Verdict::Trusted) | None => {}
            // Without stabilize nobody asked, and many devices do not count.
            Some(Verdict::Unknown { .. }) if record.run.policy.is_none() => {}
            Some(verdict) => {
                let _ = write!(text, "\n{}, {}: {verdict}.", point.scene.name, point.variant);
            }
        }
    }
    text
}

fn points(record: &Record, axes: &[String]) -> String {
    let mut header = vec!["scene", "variant"];
    header.extend(axes.iter().map(String::as_str));
    header.extend(["samples", "pMRps", "±", "sMRps", "±", "build ms", "stopped"]);
    let mut rows = table(&header);
    for point in &record.results {
        let parameters = record.parameters_of(point);
        let mut row = vec![point.scene.name.clone(), point.variant.clone()];
        row.extend(axes.iter().map(|axis| parameters.get(axis).map_or("–".into(), ToString::to_string)));
        let counted: usize = point.views.iter().map(|view| view.counted().count()).sum();
        let all: usize = point.views.iter().map(|view| view.samples.len()).sum();
        row.push(if counted == all { all.to_string() } else { format!("{counted} of {all}") });
        for rays in [Rays::Primary, Rays::Secondary] {
            row.push(number(point.rate(rays)));
            let width = point.estimate(rays).map(|e| format!("{:.1}%", 100.0 * e.relative_half_width()));
            row.push(width.unwrap_or_else(|| "–".into()));
        }
        row.push(number(point.build_milliseconds()));
        let stopped = point.measurement.as_ref().map(|measurement| format!("{:?}", measurement.stopped));
        row.push(stopped.map_or("–".into(), |stopped| stopped.to_lowercase()));
        rows.add_row(row);
    }
    align(&mut rows, &[0, 1, header.len() - 1]);
    format!(
        "{}\n\nsamples: of all views together, and how many of them count. pMRps, sMRps: million primary and secondary\n\
         rays a second by the traversal kernel's time alone, ± half the width of the 95% confidence interval.\n\
         {} × {} pixels, at most {} rays a path, on {}.",
        shown(&rows),
        record.run.width,
        record.run.height,
        record.run.depth,
        record.device.name
    )
}

/// The point of the same scene that others are compared with.
fn reference<'r>(record: &'r Record, point: &Point) -> Option<&'r Point> {
    record.results.iter().find(|p| p.scene.name == point.scene.name && p.variant == Variant::BINARY.name())
}

/// Bytes of nodes and triangles that a ray asks for, whichever cache they come from.
fn bytes(point: &Point) -> Option<f64> {
    Some(point.bytes_per_ray(&point.counters()?.all())?.iter().sum())
}

/// One line for each scene and kind of rays: which variant is fastest, and what differs from Binary.
fn winners(record: &Record) -> Vec<String> {
    let mut lines = Vec::new();
    let mut scenes: Vec<&str> = record.results.iter().map(|p| p.scene.name.as_str()).collect();
    scenes.dedup();
    for scene in scenes {
        for (rays, rate) in [
            ("primary", Point::primary_mrps as fn(&Point) -> Option<f64>),
            ("secondary", Point::secondary_mrps as fn(&Point) -> Option<f64>),
        ] {
            let points = record.results.iter().filter(|p| p.scene.name == scene);
            let best = points.filter_map(|p| Some((p, rate(p)?))).max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((best, fastest)) = best else { continue };
            let mut line =
                format!("{scene}, {rays} rays: {} with {} MRps", best.variant, number(Some(fastest)));
            if let Some(binary) = reference(record, best).filter(|b| b.variant != best.variant)
                && let (Some(slower), Some(own), Some(its)) = (rate(binary), bytes(best), bytes(binary))
                && let (Some(a), Some(b)) = (best.counters(), binary.counters())
                && let (Some(a), Some(b)) = (a.all().per_ray(), b.all().per_ray())
            {
                let _ = write!(
                    line,
                    ", {:.2} times Binary:\n    {:.2} of its nodes, {:.2} of its boxes and {:.2} of its triangles a ray, \
                     {:.2} of its bytes",
                    fastest / slower,
                    a.nodes / b.nodes,
                    a.boxes / b.boxes,
                    a.triangles / b.triangles.max(f64::MIN_POSITIVE),
                    own / its
                );
            }
            lines.push(line);
        }
    }
    lines
}

/// Three significant digits, where two numbers share a column.
fn short(x: f64) -> String {
    let digits = (2 - x.abs().max(1e-3).log10().floor() as i32).clamp(0, 3);
    format!("{x:.*}", digits as usize)
}

fn phases(point: &Point, names: &[&str]) -> Vec<String> {
    let launches = point.build.launches().map_or("–".into(), |launches| launches.to_string());
    let sah = point.of_trees(|tree| tree.sah_cost);
    let mut row = vec![
        point.scene.name.clone(),
        point.variant.clone(),
        launches,
        number(point.build_mtris()),
        number(sah),
    ];
    let means = point.build.mean_phases();
    row.extend(names.iter().map(|name| number(means.iter().find(|(n, _)| n == name).map(|(_, ms)| *ms))));
    row
}

/// A table whose only line is below the header, as all of ours are.
pub fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_preset("     ──            ").set_header(header);
    for column in table.column_iter_mut() {
        column.set_padding((0, 1));
    }
    table
}

/// The table without blanks at the ends of its lines.
pub fn shown(table: &Table) -> String {
    table.trim_fmt()
}

/// Numbers to the right, the columns `texts` to the left.
pub fn align(table: &mut Table, texts: &[usize]) {
    for (i, column) in table.column_iter_mut().enumerate() {
        if !texts.contains(&i) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
}

/// Four significant digits, or a dash.
pub fn number(value: Option<f64>) -> String {
    match value {
        None => "–".into(),
        Some(x) => {
            let digits = (3 - x.abs().max(1e-3).log10().floor() as i32).clamp(0, 6);
            format!("{x:.*}", digits as usize)
        }
    }
}

/// `2452458` as `2,452,458`.
pub fn thousands(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tree_from_a_file_is_told() {
        let mut record = record::example();
        assert!(!summary(&record).contains("from files"));
        record.results[0].adopted = Some(record::Adopted {
            name: "s.bvh".into(),
            sha256: "a0".repeat(32),
            method: "sbvh".into(),
            parameters: record::Parameters::default(),
            built_seconds: 1.25,
            read_milliseconds: 3.0,
        });
        let text = summary(&record);
        assert!(text.contains("from files: s.bvh, built by sbvh in 1.250 s, which is not part"), "{text}");
    }

    #[test]
    fn numbers_keep_four_digits() {
        assert_eq!(number(Some(1234.567)), "1235");
        assert_eq!(number(Some(0.98765)), "0.9877");
        assert_eq!(number(Some(12.3)), "12.30");
        assert_eq!(number(Some(0.0)), "0.000000");
        assert_eq!(number(None), "–");
        assert_eq!(thousands(2452458), "2,452,458");
        assert_eq!(thousands(999), "999");
    }

    #[test]
    fn launches_of_each_bounce_are_told_where_they_were_measured() {
        let mut record = record::example();
        assert!(!summary(&record).contains("Bounce by bounce"));
        record.run.method = Method::Replay;
        let text = summary(&record);
        let table = text.split("Bounce by bounce, MRps\n").nth(1).unwrap();
        let heads: Vec<&str> = table.lines().next().unwrap().split("  ").map(str::trim).collect();
        assert!(heads.ends_with(&["4 best", "4 median", "8 best", "8 median"]), "{table}");
        assert!(table.lines().nth(2).unwrap().starts_with("sponza"), "{table}");
        assert!(text.contains("launches of each bounce"), "{text}");
    }

    #[test]
    fn utilization_of_each_bounce_is_told_where_it_was_counted() {
        let mut record = record::example();
        record.run.method = Method::Replay;
        let text = summary(&record);
        let table = text.split("SIMD utilization of bounces, %\n").nth(1).unwrap();
        let cells = |line: usize| table.lines().nth(line).unwrap().split("  ").map(str::trim);
        let heads: Vec<&str> = cells(0).filter(|cell| !cell.is_empty()).collect();
        assert_eq!(heads[2..6], ["0 nodes", "0 tris", "0 init", "1 nodes"]);
        let row: Vec<&str> = cells(2).filter(|cell| !cell.is_empty()).collect();
        assert_eq!(
            (row[0], &row[2..7], row[8]),
            ("sponza", &["90.0", "60.0", "80.0", "50.0", "25.0"][..], "–")
        );
        assert!(table.lines().all(|line| line.chars().count() <= 120), "{table}");
        let views = record.results.iter_mut().flat_map(|point| &mut point.views);
        let counted = views.filter_map(|view| view.counters.as_mut());
        counted.flat_map(|counters| &mut counters.depths).for_each(|count| count.utilization = None);
        assert!(!summary(&record).contains("SIMD utilization"));
    }

    #[test]
    fn every_point_has_its_row() {
        let record = record::example();
        let text = summary(&record);
        for point in &record.results {
            assert!(text.contains(&point.scene.name) && text.contains(&point.variant), "{text}");
        }
        assert!(text.contains("pMRps"));
        assert!(text.contains("sponza, secondary rays: Binary with"), "{text}");
        for line in text.lines() {
            assert!(line.chars().count() <= 120, "{line}");
            assert!(!line.ends_with("──") || line.starts_with('─'), "{line}");
        }
    }
}
