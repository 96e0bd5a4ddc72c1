//! The page of `compare report`: its structure, that it is sound HTML, that it loads nothing, and that odd records
//! neither break it nor get anything into it.

use crate::common::{compare_in, stderr, stdout, synthetic};
use compare::report::{Source, html};
use compare::select::{Filter, REFERENCE};
use record::{Record, Telemetry, Value, Verdict, example};
use scraper::{ElementRef, Html, Selector};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn source(record: &Record) -> Source<'_> {
    Source { name: "record.json".into(), folder: None, record }
}

fn page(record: &Record) -> String {
    html(&[source(record)], REFERENCE, &Filter::default()).unwrap()
}

fn reference() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../reports/reference/cezner2025.json")
}

fn all<'h>(html: &'h Html, selector: &str) -> Vec<ElementRef<'h>> {
    html.select(&Selector::parse(selector).unwrap()).collect()
}

fn text(element: ElementRef) -> String {
    element.text().collect::<String>().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Holds what is true of every page, and gives it parsed.
fn sound(page: &str) -> Html {
    let html = Html::parse_document(page);
    assert!(html.errors.is_empty(), "{:?}", html.errors);
    let ids: Vec<&str> = all(&html, "[id]").iter().filter_map(|element| element.attr("id")).collect();
    let unique: BTreeSet<&str> = ids.iter().copied().collect();
    assert_eq!(unique.len(), ids.len(), "an identifier is there twice");
    for link in all(&html, "[href]") {
        let target = link.attr("href").unwrap();
        let id = target.strip_prefix('#').unwrap_or_else(|| panic!("{target} is outside"));
        assert!(unique.contains(id), "{target} leads nowhere");
    }
    for element in all(&html, "[src]") {
        let target = element.attr("src").unwrap();
        assert!(target.starts_with("data:image/"), "{target} is outside");
    }
    for tag in ["link", "iframe", "object", "embed", "script[src]", "image", "use", "base", "form"] {
        assert!(all(&html, tag).is_empty(), "{tag} loads something");
    }
    for style in all(&html, "style") {
        let style = style.text().collect::<String>();
        assert!(!style.contains("url(") && !style.contains("@import"), "the style loads something");
    }
    for head in all(&html, "th") {
        assert!(head.attr("scope").is_some(), "{} has no scope", text(head));
    }
    for table in all(&html, "table") {
        assert_eq!(table.select(&Selector::parse("caption").unwrap()).count(), 1);
    }
    let mut level = 0;
    for heading in all(&html, "h1, h2, h3, h4, h5, h6") {
        let own = heading.value().name()[1..].parse::<u32>().unwrap();
        assert!(own <= level + 1, "{} skips a level", text(heading));
        level = own;
    }
    assert_eq!(all(&html, "script").len(), 1);
    assert_eq!(all(&html, "h1").len(), 1);
    assert!(all(&html, "[role=img]").iter().all(|image| image.attr("aria-label").is_some()));
    assert!(all(&html, "img").iter().all(|image| image.attr("alt").is_some()));
    html
}

/// Headings, captions, rows of tables, facts and blocks, and the titles of plots.
fn outline(html: &Html) -> String {
    let mut lines = Vec::new();
    for element in all(html, "h1, h2, h3, h4, h5, caption, tr, dl.facts > div, summary, figure, p") {
        let name = element.value().name();
        let line = match name {
            "tr" => element.child_elements().map(text).collect::<Vec<_>>().join(" | "),
            "figure" => element
                .child_elements()
                .next()
                .and_then(|child| child.attr("aria-label")?.split(". ").next())
                .unwrap_or_default()
                .to_owned(),
            "div" => element.child_elements().map(text).collect::<Vec<_>>().join(": "),
            _ => text(element),
        };
        lines.push(format!("{name:>8} {line}"));
    }
    lines.join("\n")
}

#[test]
fn the_structure_of_a_small_record() {
    insta::assert_snapshot!(outline(&sound(&page(&example()))));
}

#[test]
fn the_thesis_fits_on_a_page() {
    let record = compare::load::load(reference()).unwrap();
    let page = page(&record);
    let html = sound(&page);
    assert_eq!(all(&html, "details.point").len(), 130);
    assert_eq!(all(&html, "table.filtered tbody tr").len(), 130);
    assert!(all(&html, ".chart svg").len() > 5);
    assert!(page.len() < 3_000_000, "{}", page.len());
    let best = text(all(&html, "ul.best")[0]);
    assert!(best.contains("Fastest for secondary rays: Wide4 Quantized CBTC, 1.75 times Binary"), "{best}");
}

#[test]
fn every_rate_leads_to_its_samples() {
    let record = synthetic(1, |_, _, _| 1.0);
    let html = sound(&page(&record));
    for cell in all(&html, "table.filtered td.number a") {
        let about = cell.attr("title").unwrap();
        assert!(!about.is_empty());
        let target = Selector::parse(cell.attr("href").unwrap()).unwrap();
        let block = html.select(&target).next().unwrap();
        let parent = block.parent().and_then(ElementRef::wrap).unwrap();
        assert_eq!(parent.value().name(), "details");
    }
    let first = all(&html, "table.filtered td.number a")[0];
    assert!(first.attr("title").unwrap().contains("95% interval"), "{:?}", first.attr("title"));
}

#[test]
fn several_records_have_a_chapter_each() {
    let records = [synthetic(1, |_, _, _| 1.0), synthetic(2, |_, _, _| 1.1), example()];
    let sources: Vec<Source> = records.iter().map(source).collect();
    let two = sound(&html(&sources[..2], REFERENCE, &Filter::default()).unwrap());
    assert_eq!(all(&two, "section.chapter").len(), 3);
    assert_eq!(all(&two, "#changes .chart").len(), 1);
    let three = sound(&html(&sources, REFERENCE, &Filter::default()).unwrap());
    assert_eq!(all(&three, "section.chapter").len(), 3);
    assert_eq!(all(&three, "nav > ul > li").len(), 3);
}

#[test]
fn what_a_record_says_stays_text() {
    const EVIL: &str =
        "\"'><script>alert(1)</script><img src=http://example.org/x onerror=alert(1)>&amp;\0\u{7}";
    let mut record = example();
    record.device.name = EVIL.into();
    record.device.driver.version = EVIL.into();
    record.command_line = vec![EVIL.into()];
    record.host.cpu = EVIL.into();
    record.tool.version = EVIL.into();
    record.parameters.set(EVIL, EVIL);
    if let Some(sweep) = &mut record.sweep {
        sweep.title = EVIL.into();
        sweep.axes = vec![EVIL.into()];
    }
    for point in &mut record.results {
        point.variant += EVIL;
        point.scene.name += EVIL;
        point.parameters.set("evil", Value::Text(EVIL.into()));
        point.build.repetitions.iter_mut().for_each(|one| one.phases[0].name = EVIL.into());
        for view in &mut point.views {
            view.name += EVIL;
            view.pictures = vec![EVIL.into(), "../secret.png".into()];
            view.before = Telemetry::unavailable(EVIL);
        }
        if let Some(measurement) = &mut point.measurement {
            measurement.verdict = Some(Verdict::Unknown { reason: EVIL.into() });
        }
    }
    let source = Source { name: EVIL.into(), folder: Some(".".into()), record: &record };
    let html = sound(&html(&[source], EVIL, &Filter::default()).unwrap());
    assert!(all(&html, "img").is_empty());
    assert!(all(&html, "[onerror]").is_empty());
}

#[test]
fn odd_records_have_a_page_too() {
    let change: [fn(&mut Record); 9] = [
        |record| record.results.truncate(1),
        |record| drop(record.results.remove(0)),
        |record| record.results[0].views.clear(),
        |record| record.results.iter_mut().for_each(|point| point.build.repetitions.clear()),
        |record| record.results[0].views[0].samples.clear(),
        |record| record.results[0].views[0].samples.iter_mut().for_each(|sample| sample.depths.clear()),
        |record| {
            record.results[0].views[0]
                .samples
                .iter_mut()
                .for_each(|sample| sample.excluded = Some(record::Exclusion::Throttled));
        },
        |record| {
            (record.finished, record.run.policy, record.run.clock) = (None, None, None);
            record.results.iter_mut().for_each(|point| point.measurement = None);
        },
        |record| {
            for (index, value) in [f64::NAN, f64::INFINITY, -1.0].into_iter().enumerate() {
                record.results[0].views[0].samples[index].depths[0].milliseconds = value;
                record.results[1].build.repetitions[0].milliseconds = value;
                record.results[1].tree.sah_cost = Some(value);
            }
        },
    ];
    for (index, change) in change.into_iter().enumerate() {
        let mut record = example();
        change(&mut record);
        let html = sound(&page(&record));
        assert!(!all(&html, "details.point").is_empty(), "{index}");
    }
}

#[test]
fn many_samples_are_cut_and_said_to_be() {
    let mut record = example();
    let samples = &mut record.results[0].views[0].samples;
    *samples = std::iter::repeat_n(samples[1].clone(), 10_000).collect();
    let page = page(&record);
    let html = sound(&page);
    assert!(page.len() < 1_500_000, "{}", page.len());
    let remark = text(all(&html, "#r1-scenes > p.remark")[0]);
    assert!(remark.contains("are not in here"), "{remark}");
    assert!(page.contains("more in the record"));
}

#[test]
fn pictures_beside_the_record_are_inside_and_others_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut record = example();
    record.results[0].views[0].pictures.push("heat.png".into());
    std::fs::write(folder.path().join("sponza-atrium.png"), b"\x89PNG\r\n\x1a\n").unwrap();
    let source = Source { name: "record.json".into(), folder: Some(folder.path().into()), record: &record };
    let page = html(&[source], REFERENCE, &Filter::default()).unwrap();
    let html = sound(&page);
    assert_eq!(all(&html, "img").len(), 1);
    assert!(page.contains("heat.png</code> is not shown: the file is not there"));
}

#[test]
fn the_command_writes_the_page_and_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let record = reference().canonicalize().unwrap();
    let arguments = ["report", record.to_str().unwrap(), "-o", "out/report.html", "--scene", "bistro_int"];
    let output = compare_in(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(stdout(&output), "");
    assert!(stderr(&output).starts_with("compare: wrote out/report.html, "), "{}", stderr(&output));
    let html = sound(&std::fs::read_to_string(folder.path().join("out/report.html")).unwrap());
    assert_eq!(all(&html, "details.point").len(), 26);

    let arguments = ["report", record.to_str().unwrap(), "-o", "none.html", "--scene", "nowhere"];
    let output = compare_in(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("nothing to report of"), "{}", stderr(&output));
    assert!(!folder.path().join("none.html").exists());
}
