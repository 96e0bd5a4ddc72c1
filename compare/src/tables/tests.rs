//! Every kind of table, from small records, in both forms.

use super::sample::{point, record, with};
use super::{Input, Kind, latex, markdown};
use crate::select::Filter;
use record::{Count, Counters, Launch, Launches, Method, OccupancyLimit, Point, Record, Sample, Utilization};

/// Two scenes, three variants, a name that must be escaped, and gaps.
fn scenes() -> Record {
    let mut record = record::example();
    let by_view = record.results.swap_remove(1);
    record.results.clear();
    for (scene, factor) in [("hall_1", 1.0), ("50% & more", 2.0)] {
        record.results.push(point(scene, "Binary", 1000.0 * factor, 200.0 * factor));
        let mut wide = point(scene, "Wide4", 900.0 * factor, 250.0 * factor);
        wide.tree.average_children = Some(3.1);
        wide.views[0].counters = None;
        record.results.push(wide);
        let mut own = point(scene, "Wide4 CBTC", 950.0 * factor, 260.0 * factor);
        own.views[0].adaptation = by_view.views[0].adaptation.clone();
        record.results.push(own);
    }
    record
}

/// Two ways to build on two scenes, and the driver's own, of which less is known.
fn builds() -> Record {
    let mut record = record();
    record.results.clear();
    for (scene, factor) in [("a", 1.0), ("b", 3.0)] {
        for (method, faster) in [("ploc", 1.0), ("hploc", 2.0)] {
            let mut point = with(point(scene, "Wide8", 1000.0, 200.0), "build.method", method);
            for repetition in &mut point.build.repetitions {
                repetition.milliseconds *= factor / faster;
                repetition.phases.iter_mut().for_each(|phase| phase.milliseconds *= factor / faster);
                if method == "hploc" {
                    repetition.phases.remove(3);
                    repetition.phases[2].name = method.into();
                    repetition.launches = Some(12);
                }
            }
            point.tree.sah_cost = point.tree.sah_cost.map(|cost| cost + faster);
            record.results.push(point);
        }
    }
    let mut driver = record.results[0].clone();
    driver.variant = "Driver".into();
    driver.parameters = record::Parameters::default();
    driver.tree = record::Tree { bytes: Some(1_000_000), ..record::Tree::default() };
    driver.views.iter_mut().for_each(|view| view.counters = None);
    driver.build.repetitions.iter_mut().for_each(|repetition| repetition.launches = None);
    record.results.push(driver);
    record
}

/// Both axes of workgroups walk together; one size is slow, and one is missing for a variant.
fn workgroups() -> Record {
    let mut record = record();
    for (scene, factor) in [("a", 1.0), ("b", 3.0)] {
        for (size, primary, secondary) in [(2u32, 900.0, 95.0), (8, 1000.0, 100.0), (32, 980.0, 80.0)] {
            for variant in ["Binary", "Wide4 Quantized"] {
                if (variant, size) == ("Wide4 Quantized", 32) {
                    continue;
                }
                let point = point(scene, variant, primary * factor, secondary * factor);
                let point = with(point, "trace.primary_subgroups", size);
                record.results.push(with(point, "trace.secondary_subgroups", size));
            }
        }
    }
    record.results.remove(0);
    record
}

/// Traversal costs of two variants, one of which lacks a point.
fn costs() -> Record {
    let mut record = record();
    record.results.clear();
    for (scene, factor) in [("a", 1.0), ("b", 3.0)] {
        for (cost, loss) in [(1.0, 0.98), (2.0, 1.0), (10.0, 0.9)] {
            for variant in ["Binary", "Wide4 Quantized"] {
                if (scene, variant, cost) == ("b", "Wide4 Quantized", 1.0) {
                    continue;
                }
                let point = point(scene, variant, 1000.0 * factor * loss, 100.0 * factor * loss);
                record.results.push(with(point, "collapse.c_t", cost));
            }
        }
    }
    record
}

/// Kernels of all sorts: full, spilling, and one of which nothing is known.
fn kernels() -> Record {
    let mut record = record();
    record.results = vec![point("a", "Binary", 1.0, 1.0), point("a", "Wide4", 1.0, 1.0)];
    let own = &mut record.results[1].kernels;
    own.truncate(1);
    own[0].purpose = "all".into();
    (own[0].registers, own[0].shared_bytes, own[0].spills) = (Some(156), Some(3344), Some(2));
    (own[0].occupancy, own[0].limited_by) = (Some(0.25), Some(OccupancyLimit::Registers));
    own.push(record::Kernel {
        name: "traverse/wide4".into(),
        purpose: "secondary".into(),
        workgroup_size: 48,
        subgroup_size: 32,
        registers: None,
        local_bytes: None,
        shared_bytes: None,
        spills: None,
        code_bytes: None,
        occupancy: None,
        limited_by: None,
    });
    record
}

/// One record with separate kernels and one with a single one, in two scenes.
fn both_ways() -> [Record; 2] {
    ["separate", "single"].map(|way| {
        let mut record = record();
        let slow = if way == "single" { 0.8 } else { 1.0 };
        record.results = ["a", "b"]
            .iter()
            .map(|scene| with(point(scene, "Wide4", 1000.0, 100.0 * slow), "trace.kernels", way))
            .collect();
        record
    })
}

/// Launches of nine bounces: a binary tree, and a wide one that is varied in two ways; a scene whose paths end early.
fn replayed() -> Record {
    let mut record = record();
    record.run.method = Method::Replay;
    record.run.depth = 9;
    record.results.clear();
    for (scene, factor, bounces) in [("a", 1.0, 9), ("b", 4.0, 5)] {
        let one = |variant: &str, rate: f64| {
            let mut one = point(scene, variant, 1.0, 1.0);
            let view = &mut one.views[0];
            // By launch, the rate in the middle being the one that is asked for.
            view.samples = [1.5, 0.5, 1.0]
                .map(|luck| {
                    let launch = |bounce: u32| Launch {
                        rays: 1_000_000,
                        milliseconds: 1e3 / (rate * factor * luck) * f64::from(1 + bounce),
                    };
                    Sample { depths: (0..bounces).map(launch).collect(), ..Sample::default() }
                })
                .into();
            let count = |bounce: u64| Count {
                rays: 1000,
                nodes: 14_000 + 100 * bounce,
                boxes: 112_000 + 800 * bounce,
                triangles: 6_500 + 250 * bounce,
                utilization: Some(Utilization {
                    subgroup_size: 32,
                    node_steps: 500 + 100 * bounce,
                    node_lanes: 14_000 + 100 * bounce,
                    triangle_steps: 400 + 100 * bounce,
                    triangle_lanes: 6_500 + 250 * bounce,
                    fetches: 40 + 5 * bounce,
                    fetch_lanes: 1000,
                }),
            };
            let depths = (0..u64::from(bounces)).map(count).collect();
            view.counters = Some(Counters { depths });
            one
        };
        let with_tree = |mut one: Point, nodes: u64, bytes: u64, children: f64, triangles: f64| {
            one.scene.triangles = 100_000;
            one.tree.nodes = Some(nodes);
            one.tree.node_bytes = Some(nodes * bytes);
            (one.tree.average_children, one.tree.average_triangles_per_leaf) =
                (Some(children), Some(triangles));
            one.tree.leaves = Some((124_000.0 / triangles) as u64);
            one.tree.triangle_bytes = Some(124_000 * 48);
            one
        };
        record.results.push(with_tree(one("Binary", 400.0), 90_000, 64, 2.0, 3.48));
        for (method, c_prim, rate, nodes) in
            [("optimal", 0.3, 1000.0, 12_000), ("afra", 0.3, 900.0, 18_000), ("optimal", 1.0, 1020.0, 15_600)]
        {
            let own = with_tree(one("Wide8 Compressed", rate), nodes, 80, 7.51, 1.56);
            let own = with(own, "contract.by-area", method);
            record.results.push(with(own, "contract.c_prim", c_prim));
        }
    }
    record
}

#[test]
fn bounces_are_relative_to_the_first_row_or_to_another_variant() {
    let records = [replayed()];
    let table = |filter: &Filter, reference: Option<&str>, launches| {
        let mut input = Input::new(&records, filter, reference).unwrap();
        input.launches = launches;
        let table = Kind::Bounces.tables(&input).unwrap().swap_remove(0);
        let bounce_0: Vec<String> = table.rows.iter().map(|row| row.cells[2].to_string()).collect();
        (bounce_0, table.caption, input.remarks.take())
    };
    let all = Filter::default();
    let (rates, caption, remarks) = table(&all, None, Launches::Median);
    assert_eq!(rates, ["100.0", "250.0", "225.0", "255.0"]);
    // 400 on one scene and four times as many on the other.
    assert!(caption.contains("relative to Binary") && caption.contains("800 for bounce 0"), "{caption}");
    assert_eq!(remarks, ["b: left out for bounce 8, because not every row has that there"]);
    assert!(table(&all, None, Launches::Best).1.contains("1200 for bounce 0"));
    let wide = Filter { variants: vec!["Wide*".into()], ..Filter::default() };
    assert_eq!(table(&wide, None, Launches::Median).0, ["100.0", "90.0", "102.0"]);
    // Also where it is not shown itself.
    assert_eq!(table(&wide, Some("Binary"), Launches::Median).0, ["250.0", "225.0", "255.0"]);
}

#[track_caller]
fn written(records: &[Record], kind: Kind) -> String {
    let mut input = Input::new(records, &Filter::default(), None).unwrap();
    input.roofline = Some(record::example_roofline());
    let tables = kind.tables(&input).unwrap();
    let remarks = input.remarks.take().join("\n");
    format!("{remarks}\n\n{}\n\n{}", markdown::page(&tables), latex::fragment(&tables))
}

#[test]
fn each_kind_is_written_in_both_forms() {
    insta::assert_snapshot!("scene", written(&[scenes()], Kind::Scene));
    insta::assert_snapshot!("workgroup", written(&[workgroups()], Kind::Workgroup));
    insta::assert_snapshot!("traversal-cost", written(&[costs()], Kind::TraversalCost));
    insta::assert_snapshot!("best", written(&[workgroups(), costs()], Kind::Best));
    insta::assert_snapshot!("resources", written(&[kernels()], Kind::Resources));
    insta::assert_snapshot!("single-kernel", written(&both_ways(), Kind::SingleKernel));
    insta::assert_snapshot!("bounces", written(&[replayed()], Kind::Bounces));
    insta::assert_snapshot!("tests", written(&[replayed()], Kind::Tests));
    insta::assert_snapshot!("memory", written(&[replayed()], Kind::Memory));
    insta::assert_snapshot!("roofline", written(&[scenes()], Kind::Roofline));
    insta::assert_snapshot!("builds", written(&[builds()], Kind::Builds));
}

#[test]
fn utilization_is_shown_where_it_was_counted() {
    let shown = |forgotten: usize| {
        let mut record = replayed();
        for point in record.results.iter_mut().take(forgotten) {
            let depths = &mut point.views[0].counters.as_mut().unwrap().depths;
            depths.iter_mut().for_each(|count| count.utilization = None);
        }
        let records = [record];
        let input = Input::new(&records, &Filter::default(), None).unwrap();
        (Kind::Tests.tables(&input).unwrap(), input.remarks.take())
    };
    let (all, _) = shown(0);
    // 14 000 lanes in 500 steps of 32, 6500 in 400, 1000 in 40.
    let cell = |at: usize| all[2].rows[0].cells[2 + at].to_string();
    assert_eq!([0, 3, 6].map(cell), ["87.5", "50.8", "78.1"]);
    let (none, remarks) = shown(usize::MAX);
    assert_eq!(none, all[..2]);
    assert!(remarks.is_empty(), "{remarks:?}");
    // A scene of which one row lacks it is left out, and that is said.
    let (_, remarks) = shown(1);
    let said = |remark: &String| remark.starts_with("a: ") && remark.contains("SIMD utilization of bounce 0");
    assert!(remarks.iter().any(said), "{remarks:?}");
}

#[test]
fn a_document_stands_alone() {
    let records = both_ways();
    let input = Input::new(&records, &Filter::default(), None).unwrap();
    insta::assert_snapshot!("document", latex::document(&Kind::SingleKernel.tables(&input).unwrap()));
}

#[test]
fn tables_longer_than_a_page_are_broken() {
    let mut record = record();
    let names = (0..70).map(|at| if at < 30 { format!("A {at}") } else { format!("B {at}") });
    record.results = names.map(|name| point("a", &name, 1.0, 1.0)).collect();
    let text = written(&[record], Kind::Scene);
    assert!(text.contains("no point of Binary to be relative to"), "{text}");
    let parts: Vec<&str> = text.split("\\begin{table}").skip(1).collect();
    assert_eq!(parts.len(), 2, "{text}");
    assert!(parts[0].contains("A 29 &") && parts[1].contains("\\midrule\nB 30 &"), "{text}");
    assert_eq!((text.matches("\\label").count(), text.matches("tab:scene-a}, continued").count()), (1, 1));
}

#[test]
fn what_a_record_lacks_is_an_error_that_says_what_to_do() {
    for kind in Kind::ALL {
        let mut record = record();
        record.results[0].kernels.clear();
        let records = [record];
        let input = Input::new(&records, &Filter::default(), None).unwrap();
        match (kind, kind.tables(&input)) {
            (Kind::Scene | Kind::Bounces | Kind::Builds, tables) => assert_eq!(tables.unwrap().len(), 1),
            (Kind::Memory, tables) => assert_eq!(tables.unwrap().len(), 2),
            (Kind::Tests, tables) => assert_eq!(tables.unwrap().len(), 3),
            (_, tables) => assert!(tables.unwrap_err().to_string().contains("runner"), "{kind:?}"),
        }
    }
    let mut record = record();
    let view = &mut record.results[0].views[0];
    view.counters = None;
    view.samples.clear();
    record.results[0].build.repetitions.clear();
    let records = [record];
    let input = Input::new(&records, &Filter::default(), None).unwrap();
    for kind in [Kind::Bounces, Kind::Tests, Kind::Builds] {
        assert!(kind.tables(&input).unwrap_err().to_string().contains("runner"), "{kind:?}");
    }
}

/// A row of the driver's own, of which little is known, takes nothing from the others.
#[test]
fn what_the_driver_does_not_tell_is_a_gap_in_its_row_alone() {
    let mut record = replayed();
    let mut driver = record.results[0].clone();
    driver.variant = "Driver".into();
    driver.tree = record::Tree { bytes: Some(1_000_000), ..record::Tree::default() };
    driver.views.iter_mut().for_each(|view| view.counters = None);
    let before = written(&[record.clone()], Kind::Tests);
    record.results.push(driver);
    for kind in [Kind::Tests, Kind::Memory, Kind::Roofline, Kind::Scene, Kind::Builds] {
        let text = written(&[record.clone()], kind);
        let row = text.lines().find(|line| line.contains("| Driver |")).unwrap();
        assert!(row.contains('–') && !text.starts_with("left out"), "{kind:?}: {row}");
    }
    let after = written(&[record], Kind::Tests);
    let rows = |text: &str| -> Vec<String> {
        text.lines()
            .filter(|line| line.starts_with("| ") && !line.contains("Driver"))
            .map(str::to_owned)
            .collect()
    };
    assert_eq!(rows(&before), rows(&after));
}

#[test]
fn a_reference_that_nobody_has_is_an_error() {
    let error = Input::new(&[scenes()], &Filter::default(), Some("Wide9")).unwrap_err().to_string();
    assert!(error.contains("\"Wide9\"") && error.contains("Binary, Wide4"), "{error}");
    let none = Filter { scenes: vec!["x".into()], ..Filter::default() };
    let error = Input::new(&[scenes(), costs()], &none, None).unwrap_err().to_string();
    assert!(error.contains("hall_1"), "{error}");
}

#[test]
fn values_are_relative_to_a_variant_that_is_not_shown() {
    let records = [scenes()];
    let wide = Filter { variants: vec!["Wide4".into()], scenes: vec!["hall*".into()] };
    let input = Input::new(&records, &wide, None).unwrap();
    let table = &Kind::Scene.tables(&input).unwrap()[0];
    let cells: Vec<String> = table.rows[0].cells.iter().map(ToString::to_string).collect();
    assert_eq!((table.rows.len(), cells[5].as_str()), (1, "250 (1.25)"));
}

/// A generated scene of two sizes is two scenes.
#[test]
fn scenes_of_one_name_and_two_sizes_are_told_apart() {
    let mut record = record();
    record.results.clear();
    for (triangles, factor) in [(10u32, 1.0), (1000, 0.5)] {
        for (variant, rate) in [("Binary", 100.0), ("Wide4", 120.0)] {
            for (size, loss) in [(2u32, 1.0), (8, 0.9)] {
                let mut point = point("city", variant, rate * factor * loss, rate * factor * loss);
                let mut parameters = record::Parameters::default();
                parameters.set("triangles", triangles);
                point.scene.source =
                    record::Source::Generator { name: "city".into(), parameters, sha256: None };
                record.results.push(with(point, "trace.primary_subgroups", size));
            }
        }
    }
    // No Binary of the larger one to be relative to.
    record.results.drain(4..6);
    let records = [record];
    let input = Input::new(&records, &Filter::default(), None).unwrap();
    let tables = Kind::Scene.tables(&input).unwrap();
    let heads: Vec<&str> = tables.iter().map(|table| table.columns[0].head[0].as_str()).collect();
    assert_eq!(heads, ["city (triangles=10)", "city (triangles=1000)"]);
    let cell = |table: usize, row: usize| tables[table].rows[row].cells[5].to_string();
    assert_eq!([cell(0, 2), cell(0, 3), cell(1, 0)], ["120 (1.20)", "108 (1.20)", "60"]);
    assert_eq!(tables[0].rows[3].cells[0].to_string(), "Wide4 (trace.primary_subgroups=8)");
    let best = &Kind::Best.tables(&input).unwrap()[0];
    assert_eq!(best.rows.len(), 2);
}

#[test]
fn labels_are_there_once() {
    let records = [scenes(), scenes()];
    let input = Input::new(&records, &Filter::default(), None).unwrap();
    let text = latex::fragment(&Kind::Scene.tables(&input).unwrap());
    let mut labels: Vec<&str> = text.lines().filter(|line| line.starts_with("\\label")).collect();
    labels.sort_unstable();
    labels.dedup();
    assert_eq!(labels.len(), 4, "{labels:?}");
}

fn unreliable(point: &mut Point) {
    let measurement = record::example().results.into_iter().find_map(|point| point.measurement).unwrap();
    point.measurement = Some(record::Measurement { unreliable: true, ..measurement });
}

#[test]
fn points_of_too_few_samples_are_named_in_captions() {
    let mut record = scenes();
    record.results.iter_mut().for_each(|point| point.measurement = None);
    unreliable(&mut record.results[1]);
    let records = [record];
    let input = Input::new(&records, &Filter::default(), None).unwrap();
    let tables = Kind::Scene.tables(&input).unwrap();
    let named = " Unreliable, because too few samples count: Wide4.";
    assert_eq!([0, 1].map(|at: usize| tables[at].caption.ends_with(named)), [true, false], "{tables:?}");
    let mut records = both_ways();
    records.iter_mut().flat_map(|record| &mut record.results).for_each(|point| point.measurement = None);
    unreliable(&mut records[1].results[0]);
    let input = Input::new(&records, &Filter::default(), None).unwrap();
    let caption = &Kind::SingleKernel.tables(&input).unwrap()[0].caption;
    assert!(caption.ends_with("too few samples count: Wide4 on a, single."), "{caption}");
}

#[test]
fn captions_name_the_scenes_that_were_compared() {
    let records = [costs()];
    let input = Input::new(&records, &Filter::default(), None).unwrap();
    for (kind, at) in [(Kind::Best, 0), (Kind::TraversalCost, 0), (Kind::TraversalCost, 1)] {
        let caption = &kind.tables(&input).unwrap()[at].caption;
        assert!(caption.contains("(a, b; of Wide4 Quantized") && caption.contains(" only a)"), "{caption}");
    }
}

/// Sizes of workgroup crossed with costs: a size of which one point does not count is there all the same.
#[test]
fn a_value_is_left_out_only_if_no_point_of_it_counts() {
    let told = |weak: &[(u32, u32)]| {
        let mut record = record();
        record.results.clear();
        for size in [2u32, 4, 8] {
            for cost in [1u32, 2] {
                let mut point = with(point("a", "Binary", 100.0, 100.0), "collapse.c_t", cost);
                point.measurement = None;
                if weak.contains(&(size, cost)) {
                    unreliable(&mut point);
                }
                record.results.push(with(point, "trace.secondary_subgroups", size));
            }
        }
        let records = [record];
        let input = Input::new(&records, &Filter::default(), None).unwrap();
        Kind::Workgroup.tables(&input).unwrap();
        input.remarks.take()
    };
    let axis = "trace.secondary_subgroups";
    assert!(told(&[]).is_empty());
    assert_eq!(
        told(&[(2, 1), (8, 2)]),
        [format!("a, Binary: 2 of 6 points do not count for {axis}, because too few samples count")]
    );
    let gone = told(&[(2, 1), (8, 1), (8, 2)]);
    assert_eq!(gone[0], format!("a, Binary, {axis}=8: left out, because too few samples count"));
    assert_eq!(
        gone[1],
        format!("a, Binary: 1 of 4 points do not count for {axis}, because too few samples count")
    );
}
