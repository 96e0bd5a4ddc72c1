//! Every stage of a build against its twin on the CPU, on ordinary and awkward scenes.

mod support;

use support::{assert_silent, awkward, gpu, scattered, terrain};
use tracer::{
    builder::{BuildError, BuildParams, BuildReport, BuildWorkspace, Builder, build},
    bvh2::Triangle,
    collapse::{self, CollapseParams},
    layout::{
        LeafTriangle,
        binary::{self, Binary, BinaryNode},
    },
    measure::tree::stats,
    morton::{self, MortonParams},
    ploc::{self, PlocParams},
    sort, validate,
};

fn params(bits: u32, radius: u32) -> BuildParams {
    BuildParams {
        morton: MortonParams { bits },
        ploc: PlocParams { radius },
        collapse: CollapseParams::default(),
    }
}

/// Builds on the device and holds every intermediate result against the twins.
fn check(builder: &Builder, workspace: &BuildWorkspace, triangles: &[Triangle], what: &str) -> BuildReport {
    let n = triangles.len();
    let params = builder.params();
    let buffer = gpu().upload("triangles", triangles).unwrap();
    let report = builder.build(workspace, &buffer, n, false).unwrap();

    let bounds = morton::cpu::bounds(triangles);
    assert_eq!(workspace.read_bounds().unwrap(), bounds, "{what}: bounds");
    let codes = morton::cpu::codes(triangles, &bounds, &params.morton);
    let order = sort::cpu::order(&codes);
    let expected = ploc::cpu::build(triangles, &order, bounds.scale(), &params.ploc);
    let tree = workspace.read_tree(n).unwrap();
    assert_eq!(validate::bvh2(&tree, triangles), Ok(()), "{what}");
    assert_eq!(tree.levels, expected.levels, "{what}: levels");
    assert!(tree.nodes == expected.nodes, "{what}: nodes differ from the twin's");

    let subtrees = collapse::cpu::collapse(&tree, bounds.scale(), &params.collapse);
    assert!(workspace.read_subtrees(n).unwrap() == subtrees, "{what}: subtrees differ from the twin's");
    let (nodes, leaves) = binary::cpu::rearrange(&tree, &subtrees, triangles);
    assert_eq!(report.summary.nodes as usize, nodes.len(), "{what}");
    let read_nodes: Vec<BinaryNode> = workspace.nodes.read(0, nodes.len()).unwrap();
    let read_leaves: Vec<LeafTriangle> = workspace.triangles.read(0, n).unwrap();
    assert!(read_nodes == nodes, "{what}: rearranged nodes differ from the twin's");
    assert!(read_leaves == leaves, "{what}: rearranged triangles differ from the twin's");
    let depth = validate::layout::<Binary>(&read_nodes, &read_leaves, triangles);
    assert_eq!(depth, Ok(report.summary.depth as usize), "{what}");

    let s = stats::<Binary>(&read_nodes, &params.collapse);
    assert_eq!((s.triangles, s.depth), (n as u64, report.summary.depth), "{what}");
    if let Some(root) = subtrees.last() {
        // The collapse's sums are in single precision and in the scene's scale.
        let whole = tree.nodes[2 * n - 2].bounds().half_area(bounds.scale());
        if whole > 1e-30 {
            let cost = f64::from(root.cost) / f64::from(whole);
            assert!((cost - s.sah_cost).abs() <= 1e-3 * s.sah_cost, "{what}: {cost}, {}", s.sah_cost);
        }
    }
    report
}

#[test]
fn every_small_number_of_triangles_makes_a_tree() {
    let builder = Builder::new(gpu(), &params(10, 16)).unwrap();
    let workspace = builder.workspace(70).unwrap();
    for n in (1..=20).chain(31..=34).chain(63..=66) {
        check(&builder, &workspace, &scattered(n, 10.0, 1.0), &format!("{n} scattered"));
    }
    for n in [1, 2, 3, 17, 64] {
        for (what, triangles) in awkward(n) {
            check(&builder, &workspace, &triangles, &format!("{n} {what}"));
        }
    }
    assert_silent();
}

#[test]
fn sizes_around_blocks_make_trees() {
    let builder = Builder::new(gpu(), &params(16, 8)).unwrap();
    let (block, tail) = (builder.ploc().block(), builder.ploc().tail());
    let workspace = builder.workspace(33 * block + 1).unwrap();
    let mut sizes = vec![255, 256, 257, 1023, 1024, 1025, 4096];
    for at in [block, tail, 2 * block, 3 * block, 32 * block, 33 * block] {
        sizes.extend([at - 1, at, at + 1]);
    }
    for n in sizes {
        check(&builder, &workspace, &terrain(n), &format!("{n} of a terrain"));
    }
    assert_silent();
}

#[test]
fn awkward_scenes_make_trees() {
    let builder = Builder::new(gpu(), &params(21, 16)).unwrap();
    let workspace = builder.workspace(3000).unwrap();
    for n in [700, 3000] {
        for (what, triangles) in awkward(n) {
            check(&builder, &workspace, &triangles, &format!("{n} {what}"));
        }
    }
    assert_silent();
}

#[test]
fn any_radius_and_grid_make_trees() {
    let triangles = scattered(5000, 10.0, 0.3);
    for (bits, radius) in [(1, 16), (9, 1), (10, 2), (11, 3), (21, 64)] {
        let builder = Builder::new(gpu(), &params(bits, radius)).unwrap();
        let workspace = builder.workspace(triangles.len()).unwrap();
        check(&builder, &workspace, &triangles, &format!("{bits} bits, radius {radius}"));
    }
    assert_silent();
}

#[test]
fn leaf_sizes_and_costs_are_obeyed() {
    let triangles = terrain(3000);
    for (traversal_cost, max_leaf) in [(2.0, 1), (2.0, 4), (1e6, 16), (0.0, 16)] {
        let collapse = CollapseParams { traversal_cost, max_leaf, ..Default::default() };
        let params = BuildParams { collapse, ..Default::default() };
        let built = build(gpu(), &gpu().upload("triangles", &triangles).unwrap(), 3000, &params).unwrap();
        let nodes: Vec<BinaryNode> = built.nodes.read(0, built.report.summary.nodes as usize).unwrap();
        let leaves: Vec<LeafTriangle> = built.triangles.read(0, 3000).unwrap();
        validate::layout::<Binary>(&nodes, &leaves, &triangles).unwrap();
        let s = stats::<Binary>(&nodes, &params.collapse);
        let largest = s.triangles_histogram.iter().rposition(|&c| c > 0).unwrap();
        assert!(largest <= max_leaf as usize, "{largest} triangles in a leaf");
        match (traversal_cost, max_leaf) {
            (_, 1) => assert_eq!(s.leaves, 3000),
            // Where nodes are dear, leaves are as large as they may be; where they are free, none grows.
            (c, 16) if c > 1.0 => assert!(s.triangles_per_leaf > 6.0, "{}", s.triangles_per_leaf),
            (0.0, _) => assert!(s.triangles_per_leaf < 1.5, "{}", s.triangles_per_leaf),
            _ => {}
        }
    }
    assert_silent();
}

#[test]
fn rows_of_identical_boxes_halve_at_once() {
    let n = 1 << 14;
    let builder = Builder::new(gpu(), &BuildParams::default()).unwrap();
    let workspace = builder.workspace(n).unwrap();
    let buffer = gpu().upload("triangles", &awkward(n)[0].1).unwrap();
    let report = builder.build(&workspace, &buffer, n, false).unwrap();
    assert_eq!(report.summary.levels, 14);
    assert_silent();
}

/// What a workspace remembers of the last scene is only a guess about the next.
#[test]
fn a_workspace_serves_scenes_that_need_more_or_less_than_the_last() {
    let n = 20_000;
    let builder = Builder::new(gpu(), &BuildParams::default()).unwrap();
    let workspace = builder.workspace(n).unwrap();
    let identical = awkward(n).swap_remove(0).1;
    check(&builder, &workspace, &identical, "identical");
    check(&builder, &workspace, &terrain(n), "a terrain after identical ones");
    let second = check(&builder, &workspace, &terrain(n), "a terrain again");
    assert_eq!(second.recorded, second.summary.iterations);
    check(&builder, &workspace, &identical, "identical after a terrain");
    assert_silent();
}

/// More iterations than were recorded: the build goes on in a second submission.
#[test]
fn a_slow_clustering_is_continued() {
    let n = 20_000;
    let builder = Builder::new(gpu(), &BuildParams::default()).unwrap();
    let workspace = builder.workspace(n).unwrap();
    let (what, nest) = awkward(n).swap_remove(4);
    let report = check(&builder, &workspace, &nest, what);
    assert!(report.recorded > builder.ploc().iterations(n), "{} recorded", report.recorded);
    assert_silent();
}

#[test]
fn a_million_triangles_in_one_plane_make_a_tree() {
    let n = 1_000_000;
    let triangles = &awkward(n)[2].1;
    let built =
        build(gpu(), &gpu().upload("triangles", triangles).unwrap(), n, &BuildParams::default()).unwrap();
    let nodes: Vec<BinaryNode> = built.nodes.read(0, built.report.summary.nodes as usize).unwrap();
    let leaves: Vec<LeafTriangle> = built.triangles.read(0, n).unwrap();
    let depth = validate::layout::<Binary>(&nodes, &leaves, triangles);
    assert_eq!(depth, Ok(built.report.summary.depth as usize));
    assert_silent();
}

#[test]
fn an_empty_scene_is_an_error() {
    let buffer = gpu().buffer("nothing", 0).unwrap();
    let refused = build(gpu(), &buffer, 0, &BuildParams::default());
    assert!(matches!(refused, Err(BuildError::Empty)));
}
