//! Pictures of records: what is in them, that they look as before, and that no record is too odd.

use compare::Exit;
use compare::plot::chart::{Body, Chart, Value};
use compare::plot::draw::{Mark, draw};
use compare::plot::{Arguments, Format, Kind, charts, png, records, roofline, svg};
use compare::select::{Filter, REFERENCE, Selection};
use record::{Parameters, Point, Record, Source, example};
use std::fmt::Write;

/// Two scenes with four variants; samples of one point differ a little.
fn small() -> Record {
    let mut record = example();
    let [binary, by_view] = &record.results[..] else { panic!() };
    let adaptation = by_view.views[0].adaptation.clone();
    let mut points = Vec::new();
    for (scene, triangles, slow) in [("sponza", 262_205, 1.0), ("old_town", 3_000_000, 2.5)] {
        for (variant, factor) in
            [("Binary", 1.0), ("Wide4", 0.8), ("Wide4 CBTC", 0.75), ("Wide4 Quantized", 0.9)]
        {
            let mut point = binary.clone();
            point.scene.name = scene.into();
            point.scene.triangles = triangles;
            point.variant = variant.into();
            for repetition in &mut point.build.repetitions {
                repetition.milliseconds *= slow;
                repetition.phases.iter_mut().for_each(|phase| phase.milliseconds *= slow);
            }
            let samples = &mut point.views[0].samples;
            samples.extend(samples[1..].to_vec());
            for launch in samples.iter_mut().flat_map(|sample| &mut sample.depths) {
                launch.milliseconds *= factor * slow;
            }
            if variant.contains("CBTC") {
                point.views[0].adaptation = adaptation.clone();
            }
            points.push(point);
        }
    }
    record.results = points;
    record.references.truncate(1);
    record
}

/// The same with several values of a parameter.
fn swept() -> Record {
    let mut record = small();
    let by_view: Vec<Point> =
        record.results.iter().filter(|point| point.variant.contains("CBTC")).cloned().collect();
    record.results.retain(|point| !point.variant.contains("CBTC"));
    for (threshold, factor) in [(0u32, 1.0), (8, 1.01), (64, 0.97)] {
        for mut point in by_view.iter().cloned() {
            point.parameters.set("cbtc.threshold", threshold);
            for launch in point.views[0].samples.iter_mut().flat_map(|sample| &mut sample.depths) {
                launch.milliseconds /= factor;
            }
            record.results.push(point);
        }
    }
    record
}

/// The same with nine views of each point, on a circle, and the times of their frames.
fn circled(record: &Record) -> Record {
    let mut record = record.clone();
    for point in &mut record.results {
        // Some tests leave a point without any.
        let Some(view) = point.views.first().cloned() else { continue };
        point.views = (0..9)
            .map(|at| {
                let mut view = record::View { name: format!("orbit_{at}"), ..view.clone() };
                for sample in &mut view.samples {
                    let traced: f64 = sample.depths.iter().map(|launch| launch.milliseconds).sum();
                    sample.frame_milliseconds = Some(traced * (1.2 + 0.1 * f64::from(at)));
                }
                view
            })
            .collect();
    }
    record
}

fn drawn(record: &Record, kind: Kind) -> Vec<Chart> {
    let selection = Selection::new(record);
    match kind {
        Kind::Records => {
            let mut faster = record.clone();
            for point in &mut faster.results {
                for launch in point.views.iter_mut().flat_map(|v| &mut v.samples).flat_map(|s| &mut s.depths)
                {
                    launch.milliseconds *= 0.95;
                }
            }
            records::charts(&selection, &Selection::new(&faster)).charts
        }
        Kind::Frames => {
            let circled = circled(record);
            charts(&Selection::new(&circled), kind, REFERENCE).charts
        }
        Kind::Roofline => roofline::charts(&selection, &record::example_roofline()).charts,
        kind => charts(&selection, kind, REFERENCE).charts,
    }
}

/// The chart that stands for a kind.
fn first(kind: Kind) -> Chart {
    let record = if kind == Kind::Sweep { swept() } else { small() };
    drawn(&record, kind).swap_remove(0)
}

/// A chart's data in short: what it says, not where it is drawn.
fn told(chart: &Chart) -> String {
    let value = |value: &Value| match value.interval {
        Some([low, high]) => format!("{:.3} [{low:.3}, {high:.3}]", value.value),
        None => format!("{:.3}", value.value),
    };
    let mut text = format!("{}: {}\n{}\n", chart.name, chart.title, chart.note);
    for series in &chart.series {
        writeln!(text, "- {}: {:?}", series.label, series.look).unwrap();
    }
    match &chart.body {
        Body::Bars(panels) => {
            for panel in panels {
                writeln!(
                    text,
                    "{} ({}), from {}, line {:?}",
                    panel.title, panel.axis, panel.floor, panel.line
                )
                .unwrap();
                for group in &panel.groups {
                    let bars: Vec<String> =
                        group.bars.iter().map(|bar| bar.as_ref().map_or("gap".into(), value)).collect();
                    let apart = if group.apart { " (apart)" } else { "" };
                    writeln!(text, "  {}{apart}: {}", group.label, bars.join(", ")).unwrap();
                }
            }
        }
        Body::Stacks(panels) => {
            for panel in panels {
                writeln!(text, "{} ({})", panel.title, panel.axis).unwrap();
                for row in &panel.rows {
                    let parts: Vec<String> = row
                        .parts
                        .iter()
                        .map(|part| part.map_or("gap".into(), |part| format!("{part:.3}")))
                        .collect();
                    writeln!(text, "  {}: {}, {:.3?}", row.label, parts.join(" + "), row.interval).unwrap();
                }
            }
        }
        Body::Planes(panels) => {
            for panel in panels {
                let right = panel.right.as_ref().map_or("", |axis| &axis.title);
                writeln!(
                    text,
                    "{}: {} {:?}, {} {:?}, {right}",
                    panel.title, panel.x.title, panel.x.scale, panel.y.title, panel.y.scale
                )
                .unwrap();
                for curve in &panel.curves {
                    let places: Vec<String> = curve
                        .places
                        .iter()
                        .map(|place| format!("{}: {}", place.x, value(&place.y)))
                        .collect();
                    let right = if curve.right { " (right)" } else { "" };
                    let band = if curve.band.is_empty() {
                        String::new()
                    } else {
                        format!(", band {:.3?}", curve.band)
                    };
                    writeln!(
                        text,
                        "  {}{right}: {}{band}",
                        chart.series[curve.series].label,
                        places.join(", ")
                    )
                    .unwrap();
                }
            }
        }
    }
    text
}

#[test]
fn charts_say_what_the_record_says() {
    for kind in Kind::ALL {
        insta::assert_snapshot!(format!("data_{kind}"), told(&first(kind)));
    }
}

#[test]
fn pictures_look_as_before() {
    for kind in Kind::ALL {
        let text = svg(&first(kind));
        assert!(
            text.starts_with("<svg class=\"plot\" width=\"640\"") && text.ends_with("</svg>\n"),
            "{kind}"
        );
        insta::assert_snapshot!(format!("svg_{kind}"), text);
    }
}

#[test]
fn bitmaps_are_large_and_not_blank() {
    let chart = first(Kind::Overall);
    let file = png(&chart).unwrap();
    let mut reader = png_reader(&file);
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.width, info.height), (1920, 3 * draw(&chart).height as u32));
    let dark = pixels.chunks(3).filter(|pixel| pixel.iter().any(|&channel| channel < 128)).count();
    assert!(dark > pixels.len() / 3 / 100, "{dark} of {}", pixels.len() / 3);
    assert_eq!(pixels[..3], [255; 3], "files are on white");
}

fn png_reader(bytes: &[u8]) -> png::Reader<std::io::Cursor<&[u8]>> {
    png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap()
}

/// Changes all points of a record.
fn changed(change: impl Fn(&mut Point)) -> Record {
    let mut record = swept();
    record.results.extend(small().results.into_iter().filter(|point| point.variant == "Wide4 CBTC").map(
        |mut point| {
            point.variant = "Wide4 Slang CBTC".into();
            point
        },
    ));
    record.results.iter_mut().for_each(change);
    record
}

fn odd() -> Vec<(&'static str, Record)> {
    let mut all = vec![("as usual", changed(|_| {})), ("the example", example())];
    let mut add = |name, change: fn(&mut Point)| all.push((name, changed(change)));
    add("no views", |point| point.views.clear());
    add("no samples", |point| point.views[0].samples.clear());
    add("one sample", |point| point.views[0].samples.truncate(1));
    add("none counts", |point| {
        point.views[0].samples.iter_mut().for_each(|s| s.excluded = Some(record::Exclusion::Throttled));
    });
    add("no depths", |point| point.views[0].samples.iter_mut().for_each(|sample| sample.depths.clear()));
    add("no bounces", |point| point.views[0].samples.iter_mut().for_each(|sample| sample.depths.truncate(1)));
    add("no time", |point| {
        for launch in point.views[0].samples.iter_mut().flat_map(|sample| &mut sample.depths) {
            launch.milliseconds = 0.0;
        }
    });
    add("no number", |point| {
        for launch in point.views[0].samples.iter_mut().flat_map(|sample| &mut sample.depths) {
            launch.milliseconds = f64::NAN;
        }
    });
    add("always the same", |point| {
        let first = point.views[0].samples[1].clone();
        point.views[0].samples.fill(first);
        point.build.repetitions.truncate(1);
    });
    add("no build", |point| point.build.repetitions.clear());
    add("build of no time", |point| {
        for repetition in &mut point.build.repetitions {
            repetition.milliseconds = 0.0;
            repetition.phases.clear();
        }
    });
    add("no counters", |point| point.views[0].counters = None);
    add("no sampling", |point| {
        if let Some(adaptation) = &mut point.views[0].adaptation {
            adaptation.sampling_milliseconds.clear();
            adaptation.build.repetitions.clear();
        }
    });
    add("no triangles", |point| point.scene.triangles = 0);
    add("no names", |point| (point.scene.name, point.variant) = Default::default());
    add("long names", |point| {
        point.scene.name = format!("{} and a name that has no end", point.scene.name).repeat(4);
        point.variant = format!("{} {}", point.variant, "Experimental ".repeat(9));
    });
    let mut one = small();
    one.results.truncate(1);
    all.push(("one scene, one variant", one));
    let mut none = small();
    none.results.clear();
    all.push(("nothing", none));
    let mut gap = small();
    gap.results.remove(1);
    all.push(("one missing", gap));
    let mut many = small();
    for number in 0..60 {
        let mut point = small().results[1].clone();
        point.variant = format!("Tree{number} Quantized");
        point.scene.name = format!("scene {}", number % 17);
        many.results.push(point);
    }
    all.push(("many", many));
    all
}

#[test]
fn no_record_is_too_odd() {
    for (name, record) in odd() {
        for kind in Kind::ALL {
            for chart in drawn(&record, kind) {
                for mark in &draw(&chart).marks {
                    assert!(finite(mark), "{name}, {}: {mark:?}", chart.name);
                }
                assert!(svg(&chart).contains("</svg>"), "{name}, {}", chart.name);
            }
        }
    }
}

/// Whether a mark has a place: what is not known must be a gap, not a number that is none.
fn finite(mark: &Mark) -> bool {
    let places = match mark {
        Mark::Rectangle { from, to, .. } => vec![*from, *to],
        Mark::Area { corners, .. } => corners.clone(),
        Mark::Line { places, .. } => places.clone(),
        Mark::Text { at, .. } => vec![*at],
    };
    places.iter().all(|(x, y)| x.is_finite() && y.is_finite())
}

#[test]
fn charts_that_cannot_be_drawn_say_why() {
    let mut record = small();
    record.results.retain(|point| point.variant == "Wide4");
    let selection = Selection::new(&record);
    for (kind, reason) in [
        (Kind::Overall, "there is no variant \"Binary\" to compare with; --reference names another"),
        (Kind::Scenes, "there is no variant \"Binary\" to compare with; --reference names another"),
        (Kind::Pairs, "no two variants differ by one word of their names, such as Quantized"),
        (Kind::Sweep, "no parameter was varied"),
    ] {
        let found = charts(&selection, kind, REFERENCE);
        assert!(found.charts.is_empty(), "{kind}");
        assert_eq!(found.remarks, [reason], "{kind}");
    }
}

#[test]
fn sizes_of_one_scene_are_no_parameter_of_the_tree() {
    let mut record = small();
    record.results.retain(|point| point.scene.name == "sponza" && !point.variant.contains(' '));
    let points = record.results.clone();
    record.results.clear();
    for size in 1..=3u32 {
        for mut point in points.iter().cloned() {
            point.scene.name = "sphereflake".into();
            point.scene.triangles = 1000 * 10u64.pow(size);
            point.scene.source = Source::Generator {
                name: "sphereflake".into(),
                parameters: Parameters([("depth".to_owned(), size.into())].into()),
                sha256: None,
            };
            record.results.push(point);
        }
    }
    let [cost] = &drawn(&record, Kind::Cost)[..] else { panic!() };
    let Body::Planes(panels) = &cost.body else { panic!() };
    assert!(
        panels.iter().all(|panel| panel.curves.iter().all(|curve| curve.places.len() == 3)),
        "{panels:?}"
    );
    assert!(drawn(&record, Kind::Sweep).is_empty());
}

fn arguments(record: &Record, folder: &std::path::Path) -> Arguments {
    let path = folder.join("record.json");
    record.write_atomic(&path).unwrap();
    Arguments {
        records: vec![path],
        output: folder.join("out/plots"),
        format: Format::Svg,
        only: Vec::new(),
        anyway: false,
        reference: REFERENCE.into(),
        roofline: None,
        filter: Filter::default(),
    }
}

#[test]
fn files_are_named_after_what_they_show() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = arguments(&small(), folder.path());
    assert_eq!(compare::plot::run(&arguments).unwrap(), Exit::Done);
    let files = std::fs::read_dir(folder.path().join("out/plots")).unwrap();
    let mut names: Vec<String> = files.map(|file| file.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(
        names,
        [
            "build-phases.svg",
            "cost-cbtc.svg",
            "cost-quantized.svg",
            "cost-uncompressed.svg",
            "overall.svg",
            "pairs-cbtc-against-uncompressed.svg",
            "pairs-quantized-against-uncompressed.svg",
            "samples-old-town.svg",
            "samples-reference.svg",
            "samples-sponza.svg",
            "scenes-cbtc.svg",
            "scenes-quantized.svg",
            "scenes-uncompressed.svg",
        ]
    );
}

#[test]
fn nothing_to_draw_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let mut arguments = arguments(&small(), folder.path());
    arguments.only = vec![Kind::Sweep];
    let error = compare::plot::run(&arguments).unwrap_err().to_string();
    assert!(error.contains("nothing of that can be drawn from"), "{error}");
    assert!(!arguments.output.exists());
}

fn unreliable(point: &mut Point) {
    let measurement = example().results.into_iter().find_map(|point| point.measurement).unwrap();
    point.measurement = Some(record::Measurement { unreliable: true, ..measurement });
}

#[test]
fn points_of_too_few_samples_are_named_below_pictures() {
    let mut record = small();
    record.results.iter_mut().for_each(|point| point.measurement = None);
    record.results.iter_mut().filter(|point| point.variant == "Wide4 Quantized").for_each(unreliable);
    record.references.iter_mut().for_each(|point| point.measurement = None);
    let named = "Unreliable, because too few samples count: Wide4 Quantized on ";
    for kind in Kind::ALL.into_iter().filter(|kind| *kind != Kind::Sweep) {
        let charts = drawn(&record, kind);
        let those: Vec<&str> = charts
            .iter()
            .filter(|chart| chart.note.contains(named))
            .map(|chart| chart.name.as_str())
            .collect();
        let expected: &[&str] = match kind {
            Kind::Overall => &["overall"],
            Kind::Scenes => &["scenes-quantized"],
            Kind::Pairs => &["pairs-quantized-against-uncompressed"],
            Kind::Records => &["records-quantized"],
            Kind::Build => &["build-phases"],
            Kind::Cost => &["cost-quantized"],
            Kind::Roofline => &["roofline-sponza", "roofline-old-town"],
            Kind::Frames => &["frames-sponza", "frames-old-town"],
            _ => &["samples-sponza", "samples-old-town"],
        };
        assert_eq!(those, expected, "{kind}");
    }
    assert!(drawn(&record, Kind::Overall)[0].note.ends_with("Wide4 Quantized on old_town."));
}

#[test]
fn points_of_too_few_samples_are_no_part_of_a_sweep() {
    let mut record = swept();
    record.results.iter_mut().for_each(|point| point.measurement = None);
    let all = drawn(&record, Kind::Sweep).swap_remove(0);
    assert!(!all.note.contains("left out"), "{}", all.note);
    let mut other = record.results.iter().find(|point| point.variant.contains("CBTC")).unwrap().clone();
    unreliable(&mut other);
    other.parameters.set("cbtc.threshold", 128u32);
    record.results.push(other);
    let without = drawn(&record, Kind::Sweep).swap_remove(0);
    assert!(without.note.contains("; 1 of 7 points are left out, because too few"), "{}", without.note);
    assert_eq!(without.body, all.body);
}

/// A single variant with two sets of other parameters: the band is not over variants.
#[test]
fn a_band_says_what_it_runs_over() {
    let label = |record: &Record| drawn(record, Kind::Sweep)[0].series[0].label.clone();
    let mut record = swept();
    record.results.retain(|point| point.variant.contains("CBTC"));
    assert_eq!(label(&record), "mean");
    let of_one = record.results.clone();
    let more = |points: &[Point], change: fn(&mut Point)| {
        let mut points = points.to_vec();
        points.iter_mut().for_each(change);
        points
    };
    record.results.extend(more(&of_one, |point| point.parameters.set("collapse.c_t", 5u32)));
    assert_eq!(label(&record), "mean; band: from the least to the greatest set of other parameters");
    let both = more(&record.results, |point| point.variant = "Wide8 CBTC".into());
    record.results.extend(both);
    assert_eq!(
        label(&record),
        "mean; band: from the least to the greatest variant and set of other parameters"
    );
    record.results = more(&of_one, |point| point.variant = "Wide8 CBTC".into());
    record.results.extend(of_one);
    assert_eq!(label(&record), "mean; band: from the least to the greatest variant");
}

#[test]
fn records_that_do_not_belong_together_are_drawn_only_if_somebody_insists() {
    let folder = tempfile::tempdir().unwrap();
    let mut other = small();
    other.device.driver.info = "999.9".into();
    let path = folder.path().join("other.json");
    other.write_atomic(&path).unwrap();
    for only in [Vec::new(), vec![Kind::Records], vec![Kind::Overall]] {
        let mut arguments = arguments(&small(), folder.path());
        arguments.records.push(path.clone());
        arguments.only = only;
        let error = compare::plot::run(&arguments).unwrap_err().to_string();
        for part in ["not comparable", "driver: ", "record.json, NVIDIA 999.9 in", "other.json", "--anyway"] {
            assert!(error.contains(part), "{part}: {error}");
        }
        assert!(!arguments.output.exists());
        arguments.anyway = true;
        assert_eq!(compare::plot::run(&arguments).unwrap(), Exit::Done);
        for file in std::fs::read_dir(&arguments.output).unwrap() {
            let path = file.unwrap().path();
            assert!(std::fs::read_to_string(&path).unwrap().contains("Not comparable: driver"), "{path:?}");
        }
        std::fs::remove_dir_all(&arguments.output).unwrap();
    }
    let one = small();
    let charts = records::charts(&Selection::new(&one), &Selection::new(&other)).charts;
    assert!(charts[0].note.contains("999.9 after. "), "{}", charts[0].note);
}
