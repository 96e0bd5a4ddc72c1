//! Every stage of a build against its twin on the CPU, on ordinary and awkward scenes.

mod support;

use std::sync::OnceLock;
use support::{
    Random, assert_silent, awkward, builder_for, builder_of, gpu, on_any_tree, scattered, terrain, usual,
};
use tracer::{
    builder::{BuildError, BuildParams, BuildReport, BuildWorkspace, Builder, Method, WideWorkspace, Widen},
    bvh2::{Aabb, Bvh2, Triangle},
    collapse::{self, CollapseParams, Subtree},
    contract::{self, ContractParams, Contraction, Form, Numbering, Visits, WideBvh},
    hploc::{self, HplocParams},
    layout::{
        self, Layout, LayoutParams, LeafTriangles, NodeLayout, UnitTriangle, binary::Binary,
        compressed::Assignment,
    },
    measure::tree::stats,
    midpoint,
    morton::{self, MortonParams},
    ploc::{self, PlocParams},
    sbvh::{self, SbvhParams},
    sort,
    traverse::TriangleTest,
    treefile::{self, Made, Recipe},
    validate, with_layout,
};

/// The clustering in a single launch.
fn climbing(bits: u32, radius: u32, window: u32) -> BuildParams {
    BuildParams {
        method: Method::Hploc,
        morton: MortonParams { bits },
        hploc: HplocParams { radius, window },
        ..BuildParams::default()
    }
}

fn params(bits: u32, radius: u32) -> BuildParams {
    BuildParams { morton: MortonParams { bits }, ploc: PlocParams { radius }, ..BuildParams::default() }
}

/// What contraction and layout start from.
struct Collapsed<'a> {
    triangles: &'a [Triangle],
    tree: Bvh2,
    subtrees: Vec<Subtree>,
    scale: f32,
}

impl<'a> Collapsed<'a> {
    /// Copies it from the device.
    fn read(workspace: &BuildWorkspace, triangles: &'a [Triangle]) -> Self {
        Self {
            triangles,
            tree: workspace.read_tree().unwrap(),
            subtrees: workspace.read_subtrees().unwrap(),
            scale: workspace.read_bounds().unwrap().scale(),
        }
    }

    /// Holds the wide tree that was made of it, and its nodes, against the twins. Returns the tree in its
    /// canonical order.
    fn check(
        &self,
        to: &WideWorkspace,
        report: &BuildReport,
        params: &BuildParams,
        visits: Option<contract::cpu::Visits<'_>>,
        what: &str,
    ) -> WideBvh {
        let BuildParams { contract: params, layout: stored, .. } = params;
        let layout = to.tree(&report.summary, 0.0).structure.layout().expect("a layout of ours");
        let what = format!("{what}, {layout:?}");
        let wide = to.read_wide(report.summary.nodes as usize).unwrap();
        assert_eq!(
            validate::wide(&wide, &self.tree, &self.subtrees, params.method.keeps_leaves()),
            Ok(()),
            "{what}"
        );
        let canonical = wide.canonical();
        let twin =
            contract::cpu::contract(&self.tree, &self.subtrees, self.scale, layout.arity(), params, visits);
        assert!(canonical == twin, "{what}: the wide tree differs from the twin's");
        let found = (report.summary.depth, report.summary.stack);
        assert_eq!(found, wide.depth_and_stack(), "{what}: depth and stack");
        with_layout!(layout, L => self.check_nodes::<L>(to, &wide, report, stored, &what));
        canonical
    }

    /// Nodes are written where the contraction put them, so they are held against those of the tree as it
    /// was read, in its own order.
    fn check_nodes<L: NodeLayout>(
        &self,
        to: &WideWorkspace,
        wide: &WideBvh,
        report: &BuildReport,
        params: &LayoutParams,
        what: &str,
    ) {
        let nodes = to.read_nodes::<L>(wide.nodes.len()).unwrap();
        let leaves = to.stored.triangles.read(self.tree.leaves).unwrap();
        let split = self.tree.leaves != self.triangles.len();
        let bounds = |leaf: u32| self.tree.nodes[leaf as usize].bounds();
        let parts: Option<Vec<Aabb>> =
            split.then(|| layout::cpu::places(wide, &self.tree).into_iter().map(bounds).collect());
        let (twin_nodes, twin_leaves) = layout::cpu::encode::<L>(wide, &self.tree, self.triangles, params);
        for (i, (node, twin)) in nodes.iter().zip(&twin_nodes).enumerate() {
            // As words, because zeros of either sign and what is no number would pass for each other.
            let words = |n: &L::Node| bytemuck::cast_slice::<L::Node, u32>(&[*n]).to_vec();
            assert_eq!(words(node), words(twin), "{what}: node {i}");
        }
        assert!(leaves.agree(&twin_leaves), "{what}: triangles differ from the twin's");
        let depth = validate::layout::<L>(&nodes, &leaves, self.triangles, parts.as_deref());
        assert_eq!(depth, Ok(report.summary.depth as usize), "{what}");
        let s = stats::<L>(&nodes, size_of::<L::Node>(), &CollapseParams::default());
        assert_eq!((s.triangles, s.depth), (self.tree.leaves as u64, report.summary.depth), "{what}");
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
    let expected = match params.method {
        Method::Ploc => ploc::cpu::build(triangles, &order, bounds.scale(), &params.ploc),
        Method::Hploc => hploc::cpu::build(triangles, &codes, &order, bounds.scale(), &params.hploc),
        Method::Sbvh | Method::Midpoint => unreachable!("it is not built on the device"),
    };
    let read = Collapsed::read(workspace, triangles);
    assert_eq!(validate::bvh2(&read.tree, triangles), Ok(()), "{what}");
    assert_eq!(read.tree.levels, expected.levels, "{what}: levels");
    assert!(read.tree.nodes == expected.nodes, "{what}: nodes differ from the twin's");
    let subtrees = collapse::cpu::collapse(&read.tree, bounds.scale(), &params.collapse);
    assert!(read.subtrees == subtrees, "{what}: subtrees differ from the twin's");
    read.check(&workspace.wide, &report, params, None, what);

    let layout = workspace.wide.tree(&report.summary, 0.0).structure.layout().expect("a layout of ours");
    if let (Layout::Binary, Some(root)) = (layout, subtrees.last()) {
        // The collapse knows what its tree costs; its sums are in single precision and in the scene's scale.
        let nodes = workspace.wide.read_nodes::<Binary>(report.summary.nodes as usize).unwrap();
        let s = stats::<Binary>(&nodes, 56, &params.collapse);
        let whole = read.tree.nodes[2 * n - 2].bounds().half_area(bounds.scale());
        if whole > 1e-30 {
            let cost = f64::from(root.cost) / f64::from(whole);
            assert!((cost - s.sah_cost).abs() <= 1e-3 * s.sah_cost, "{what}: {cost}, {}", s.sah_cost);
        }
    }
    report
}

/// Kernels that make nodes of a tree that there is already.
fn widen(layout: Layout, params: &BuildParams) -> Widen {
    Widen::new(gpu(), params, layout).unwrap()
}

fn contracted(contract: ContractParams) -> BuildParams {
    BuildParams { contract, ..Default::default() }
}

/// Stores the tree that was last built in every layout that builders of Binary do not make.
fn check_other_layouts(from: &BuildWorkspace, triangles: &[Triangle], what: &str) {
    static OTHERS: OnceLock<Vec<(BuildParams, Widen)>> = OnceLock::new();
    let others = OTHERS.get_or_init(|| {
        let of = |&layout: &Layout| {
            let params = on_any_tree(layout);
            let widen = widen(layout, &params);
            (params, widen)
        };
        Layout::ALL[1..].iter().map(of).collect()
    });
    let read = Collapsed::read(from, triangles);
    let buffer = gpu().upload("triangles", triangles).unwrap();
    for (params, other) in others {
        let to = other.workspace(triangles.len()).unwrap();
        let report = other.build(from, &to, &buffer, triangles.len(), None).unwrap();
        read.check(&to, &report, params, None, what);
    }
}

#[test]
fn every_small_number_of_triangles_makes_a_tree() {
    let builder = Builder::new(gpu(), &params(10, 16), Layout::Binary).unwrap();
    let workspace = builder.workspace(70).unwrap();
    let check = |triangles: &[Triangle], what: &str| {
        check(&builder, &workspace, triangles, what);
        check_other_layouts(&workspace, triangles, what);
    };
    for n in (1..=20).chain(31..=34).chain(63..=66) {
        check(&scattered(n, 10.0, 1.0), &format!("{n} scattered"));
    }
    for n in [1, 2, 3, 17, 64] {
        for (what, triangles) in awkward(n) {
            check(&triangles, &format!("{n} {what}"));
        }
    }
    assert_silent();
}

#[test]
fn a_single_launch_makes_trees_of_every_small_number_of_triangles() {
    let builder = Builder::new(gpu(), &climbing(10, 8, 32), Layout::Binary).unwrap();
    let workspace = builder.workspace(70).unwrap();
    let check = |triangles: &[Triangle], what: &str| {
        check(&builder, &workspace, triangles, what);
        check_other_layouts(&workspace, triangles, what);
    };
    for n in 1..=70 {
        check(&scattered(n, 10.0, 1.0), &format!("{n} scattered"));
    }
    for n in [1, 2, 3, 17, 64] {
        for (what, triangles) in awkward(n) {
            check(&triangles, &format!("{n} {what}"));
        }
    }
    assert_silent();
}

#[test]
fn a_single_launch_makes_trees_whatever_the_scene_and_the_window() {
    for (bits, radius, window) in
        [(10, 8, 32), (21, 16, 32), (11, 3, 4), (1, 1, 8), (16, 64, 64), (10, 5, 18)]
    {
        let builder = Builder::new(gpu(), &climbing(bits, radius, window), Layout::Binary).unwrap();
        let workspace = builder.workspace(20_000).unwrap();
        let scenes = [700, 3000].into_iter().flat_map(awkward).map(|(what, t)| (what.to_owned(), t));
        let sizes = [255, 256, 257, 1025, 20_000].map(|n| (format!("{n} of a terrain"), terrain(n)));
        for (what, triangles) in scenes.chain(sizes) {
            let what = format!("{what}, {bits} bits, radius {radius}, window {window}");
            check(&builder, &workspace, &triangles, &what);
            if window == 32 {
                check_other_layouts(&workspace, &triangles, &what);
            }
        }
    }
    assert_silent();
}

#[test]
fn sizes_around_blocks_make_trees() {
    let builder = Builder::new(gpu(), &params(16, 8), Layout::Binary).unwrap();
    let (block, tail) = (builder.ploc().block(), builder.ploc().tail());
    let workspace = builder.workspace(33 * block + 1).unwrap();
    let mut sizes = vec![255, 256, 257, 1023, 1024, 1025, 4096];
    for at in [block, tail, 2 * block, 3 * block, 32 * block, 33 * block] {
        sizes.extend([at - 1, at, at + 1]);
    }
    for n in sizes {
        let (triangles, what) = (terrain(n), format!("{n} of a terrain"));
        check(&builder, &workspace, &triangles, &what);
        if [255, 1025, 4096].contains(&n) {
            check_other_layouts(&workspace, &triangles, &what);
        }
    }
    assert_silent();
}

#[test]
fn awkward_scenes_make_trees() {
    let builder = Builder::new(gpu(), &params(21, 16), Layout::Binary).unwrap();
    let workspace = builder.workspace(3000).unwrap();
    for n in [700, 3000] {
        for (what, triangles) in awkward(n) {
            let what = format!("{n} {what}");
            check(&builder, &workspace, &triangles, &what);
            check_other_layouts(&workspace, &triangles, &what);
        }
    }
    assert_silent();
}

#[test]
fn any_radius_and_grid_make_trees() {
    let triangles = scattered(5000, 10.0, 0.3);
    for (bits, radius) in [(1, 16), (9, 1), (10, 2), (11, 3), (21, 64)] {
        let builder = Builder::new(gpu(), &params(bits, radius), Layout::Binary).unwrap();
        let workspace = builder.workspace(triangles.len()).unwrap();
        check(&builder, &workspace, &triangles, &format!("{bits} bits, radius {radius}"));
    }
    assert_silent();
}

#[test]
fn triangles_are_stored_as_each_test_wants_them() {
    let mut scenes = awkward(500);
    scenes.push(("scattered", scattered(3000, 10.0, 1.0)));
    scenes.push(("terrain", terrain(3000)));
    // Ever thinner ones, until they have no map.
    let thin = |i: i32| [[1.0, 2.0, 3.0], [4.0, 1.0, -1.0], [4.0, 1.0, 2.0f32.powi(-i / 10) - 1.0]];
    scenes.push(("thin", (0..400).map(thin).collect()));
    for test in TriangleTest::ALL {
        let builder = builder_for(test, Layout::Wide4);
        for (what, triangles) in &scenes {
            let workspace = builder.workspace(triangles.len()).unwrap();
            check(&builder, &workspace, triangles, &format!("{what}, {test:?}"));
            let stored = workspace.wide.stored.triangles.read(triangles.len()).unwrap();
            if let LeafTriangles::Maps { maps, .. } = stored {
                let none = maps.iter().filter(|map| **map == UnitTriangle::NOWHERE).count();
                println!("{what}: {none} of {} triangles have no map", maps.len());
            }
        }
    }
    assert_silent();
}

#[test]
fn leaf_sizes_and_costs_are_obeyed() {
    let triangles = terrain(3000);
    let buffer = gpu().upload("triangles", &triangles).unwrap();
    for (traversal_cost, max_leaf) in [(2.0, 1), (2.0, 4), (1e6, 16), (0.0, 16)] {
        let collapse = CollapseParams { traversal_cost, max_leaf, ..Default::default() };
        let params = BuildParams { collapse, ..Default::default() };
        let builder = Builder::new(gpu(), &params, Layout::Binary).unwrap();
        let workspace = builder.workspace(3000).unwrap();
        let report = builder.build(&workspace, &buffer, 3000, false).unwrap();
        let nodes = workspace.wide.read_nodes::<Binary>(report.summary.nodes as usize).unwrap();
        let leaves = workspace.wide.stored.triangles.read(3000).unwrap();
        validate::layout::<Binary>(&nodes, &leaves, &triangles, None).unwrap();
        let s = stats::<Binary>(&nodes, 56, &params.collapse);
        let largest = s.triangles_histogram.iter().rposition(|&c| c > 0).unwrap();
        assert!(largest <= max_leaf as usize, "{largest} triangles in a leaf");
        match (traversal_cost, max_leaf) {
            (_, 1) => assert_eq!(s.leaves, 3000),
            // Where nodes are dear, leaves are as large as they may be; where they are free, none grows.
            (c, 16) if c > 1.0 => assert!(s.triangles_per_leaf > 6.0, "{}", s.triangles_per_leaf),
            (0.0, _) => assert!(s.triangles_per_leaf < 1.5, "{}", s.triangles_per_leaf),
            _ => {}
        }
        check_other_layouts(&workspace, &triangles, &format!("c_t {traversal_cost}, leaves of {max_leaf}"));
    }
    assert_silent();
}

#[test]
fn rows_of_identical_boxes_halve_at_once() {
    let n = 1 << 14;
    let builder = builder_of(Layout::Binary);
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
    let builder = builder_of(Layout::Binary);
    let workspace = builder.workspace(n).unwrap();
    let identical = awkward(n).swap_remove(0).1;
    check(builder, &workspace, &identical, "identical");
    check(builder, &workspace, &terrain(n), "a terrain after identical ones");
    let second = check(builder, &workspace, &terrain(n), "a terrain again");
    assert_eq!(second.recorded, second.summary.iterations);
    check(builder, &workspace, &identical, "identical after a terrain");
    assert_silent();
}

/// More iterations than were recorded: the build goes on in a second submission.
#[test]
fn a_slow_clustering_is_continued() {
    let n = 20_000;
    let builder = builder_of(Layout::Binary);
    let workspace = builder.workspace(n).unwrap();
    let (what, nest) = awkward(n).swap_remove(4);
    let report = check(builder, &workspace, &nest, what);
    assert!(report.recorded > builder.ploc().iterations(n), "{} recorded", report.recorded);
    assert_silent();
}

#[test]
fn a_million_triangles_in_one_plane_make_a_tree() {
    let n = 1_000_000;
    let mut random = Random(7);
    let triangles: Vec<Triangle> =
        (0..n).map(|_| std::array::from_fn(|_| [random.unit(), 0.25, random.unit()])).collect();
    let buffer = gpu().upload("triangles", &triangles).unwrap();
    let builder = builder_of(Layout::Binary);
    let workspace = builder.workspace(n).unwrap();
    let report = builder.build(&workspace, &buffer, n, false).unwrap();
    let nodes = workspace.wide.read_nodes::<Binary>(report.summary.nodes as usize).unwrap();
    let leaves = workspace.wide.stored.triangles.read(n).unwrap();
    let depth = validate::layout::<Binary>(&nodes, &leaves, &triangles, None);
    assert_eq!(depth, Ok(report.summary.depth as usize));
    assert_silent();
}

#[test]
fn an_empty_scene_is_an_error() {
    let builder = builder_of(Layout::Binary);
    assert!(matches!(builder.workspace(0), Err(BuildError::Empty)));
    let workspace = builder.workspace(1).unwrap();
    let buffer = gpu().buffer("nothing", 0).unwrap();
    assert!(matches!(builder.build(&workspace, &buffer, 0, false), Err(BuildError::Empty)));
}

/// One layout for each number of children, the one whose nodes hold what the contraction decided as it is.
const BY_ARITY: [Layout; 4] = [Layout::Binary, Layout::Wide4, Layout::Wide6, Layout::Wide8];

/// Visits of inner nodes as sample rays might count them: no child is visited more often than its parent,
/// siblings may be equal, and whole subtrees are never seen.
fn some_visits(tree: &Bvh2) -> Vec<u32> {
    let mut random = Random(tree.leaves as u64);
    let mut counts = vec![0; tree.leaves - 1];
    if let Some(root) = counts.last_mut() {
        *root = 1000;
    }
    for index in (0..counts.len()).rev() {
        let node = tree.nodes[tree.leaves + index];
        for child in [node.left, node.right] {
            if let Some(child) = (child as usize).checked_sub(tree.leaves) {
                counts[child] = match random.next() % 8 {
                    0 => 0,
                    1..4 => counts[index],
                    _ => counts[index] * (random.next() % 100) as u32 / 100,
                };
            }
        }
    }
    counts
}

#[test]
fn both_forms_of_contraction_make_the_same_tree() {
    let builder = builder_of(Layout::Binary);
    let scenes: Vec<_> = [1, 2, 3, 9, 40, 1500]
        .into_iter()
        .map(|n| (format!("{n} scattered"), scattered(n, 10.0, 1.0)))
        .chain([("a terrain".to_owned(), terrain(1200))])
        .chain([0, 4].map(|i| awkward(300).swap_remove(i)).map(|(what, t)| (what.to_owned(), t)))
        .collect();
    // What every form has to make of every scene, and the scene's own visits.
    let built: Vec<_> = scenes
        .iter()
        .map(|(what, triangles)| {
            let workspace = builder.workspace(triangles.len()).unwrap();
            let buffer = gpu().upload("triangles", triangles).unwrap();
            builder.build(&workspace, &buffer, triangles.len(), false).unwrap();
            let read = Collapsed::read(&workspace, triangles);
            let counts = some_visits(&read.tree);
            let visits = gpu().upload("visits", &[&counts[..], &[0]].concat()).unwrap();
            (what, workspace, buffer, read, counts, visits)
        })
        .collect();
    let threshold = 20;
    for layout in BY_ARITY {
        for &method in Contraction::ALL {
            let params = |form| {
                contracted(ContractParams { method, alpha: 0.3, form, p_max: 4, ..Default::default() })
            };
            let forms =
                [Form::Levels, Form::Handover].map(|form| (params(form), widen(layout, &params(form))));
            assert_eq!(forms.each_ref().map(|(_, w)| w.form()), [Form::Levels, Form::Handover]);
            for (what, workspace, buffer, read, counts, visits) in &built {
                let n = read.tree.leaves;
                let on_device = method.by_view().then_some(Visits { counts: visits, threshold });
                let on_host = method.by_view().then_some(contract::cpu::Visits { counts, threshold });
                let trees = forms.each_ref().map(|(params, widen)| {
                    let what = format!("{what}, {method}, {:?}", params.contract.form);
                    let to = widen.workspace(n).unwrap();
                    let report = widen.build(workspace, &to, buffer, n, on_device).unwrap();
                    read.check(&to, &report, params, on_host, &what)
                });
                assert!(trees[0] == trees[1], "{what}, {method}: the forms' trees differ");
            }
        }
    }
    assert_silent();
}

#[test]
fn a_tree_is_numbered_depth_first_and_is_otherwise_the_same() {
    let scenes = [1, 2, 3, 17, 1000].map(|n| (format!("{n} scattered"), scattered(n, 10.0, 1.0)));
    let awkward = awkward(300).into_iter().map(|(what, triangles)| (what.to_owned(), triangles));
    for (what, triangles) in
        scenes.into_iter().chain([("a terrain".to_owned(), terrain(1200))]).chain(awkward)
    {
        let n = triangles.len();
        let builder = builder_of(Layout::Binary);
        let workspace = builder.workspace(n).unwrap();
        let buffer = gpu().upload("triangles", &triangles).unwrap();
        builder.build(&workspace, &buffer, n, false).unwrap();
        for layout in BY_ARITY {
            for form in [Form::Levels, Form::Handover] {
                let [made, numbered, again] =
                    [Numbering::Creation, Numbering::DepthFirst, Numbering::DepthFirst].map(|numbering| {
                        let params = ContractParams { form, numbering, ..Default::default() };
                        let widen = widen(layout, &contracted(params));
                        let to = widen.workspace(n).unwrap();
                        let report = widen.build(&workspace, &to, &buffer, n, None).unwrap();
                        to.read_wide(report.summary.nodes as usize).unwrap()
                    });
                assert!(numbered == made.depth_first(), "{what}, {layout:?}, {form:?}: another order");
                assert!(
                    numbered.canonical() == made.canonical(),
                    "{what}, {layout:?}, {form:?}: another tree"
                );
                assert!(numbered == again, "{what}, {layout:?}, {form:?}: builds differ");
                // Triangles are in the order in which the nodes that hold them are reached.
                let mut todo = vec![0];
                let mut next = 0;
                while let Some(index) = todo.pop() {
                    let node = &numbered.nodes[index as usize];
                    assert!(node.leaves.is_empty() || node.first_triangle == next, "{what}: node {index}");
                    next += node.leaves.iter().map(|leaf| leaf.triangles).sum::<u32>();
                    todo.extend((0..node.nodes.len() as u32).rev().map(|i| node.first_node + i));
                }
                assert_eq!(next as usize, n, "{what}");
            }
        }
    }
    assert_silent();
}

#[test]
fn contractions_that_do_not_fill_obey_alpha() {
    let triangles = terrain(2000);
    let n = triangles.len();
    let builder = builder_of(Layout::Binary);
    let workspace = builder.workspace(n).unwrap();
    let buffer = gpu().upload("triangles", &triangles).unwrap();
    builder.build(&workspace, &buffer, n, false).unwrap();
    let read = Collapsed::read(&workspace, &triangles);
    // Everything has been seen, more often the higher up.
    let counts: Vec<u32> = read.subtrees.iter().map(|s| s.triangles).collect();
    let counts_buffer = gpu().upload("visits", &counts).unwrap();
    let visits = Some(Visits { counts: &counts_buffer, threshold: 0 });
    let on_host = Some(contract::cpu::Visits { counts: &counts, threshold: 0 });
    let children = |node: &contract::WideNode| node.leaves.len() + node.nodes.len();
    for layout in [Layout::Wide4, Layout::Wide8] {
        let most = layout.arity();
        for method in [Contraction::Satc, Contraction::Rdtc] {
            let mut means = Vec::new();
            for alpha in [0.0, 0.4, 0.7, 1.0, f32::INFINITY] {
                let params = contracted(ContractParams { method, alpha, ..Default::default() });
                let widen = widen(layout, &params);
                let to = widen.workspace(n).unwrap();
                let what = format!("{method}, alpha {alpha}");
                let report = widen.build(&workspace, &to, &buffer, n, visits).unwrap();
                let wide = read.check(&to, &report, &params, on_host, &what);
                if alpha == 0.0 {
                    // Everything is opened, as where nodes are filled: those that are not full have no child
                    // left that could be opened.
                    let full = |node: &contract::WideNode| children(node) == most || node.nodes.is_empty();
                    assert!(wide.nodes.iter().all(full), "{what}, {layout:?}");
                }
                if alpha >= 1.0 {
                    // No child is larger than its parent.
                    assert!(wide.nodes.iter().all(|node| children(node) == 2), "{what}, {layout:?}");
                    let inner = read.subtrees.last().unwrap().inner;
                    assert_eq!(wide.nodes.len(), inner as usize, "{what}, {layout:?}");
                }
                means.push(wide.nodes.iter().map(children).sum::<usize>() as f64 / wide.nodes.len() as f64);
            }
            assert!(means.is_sorted_by(|a, b| a >= b), "{method}, {layout:?}: children a node {means:?}");
            assert!(means[0] > means[1] + 0.1 && means[2] > 2.01, "{method}, {layout:?}: {means:?}");
        }
    }
    assert_silent();
}

/// Both kinds of contraction remember how many levels the last tree had.
#[test]
fn kernels_for_wide_trees_serve_scenes_of_more_or_fewer_levels_than_the_last() {
    let n = 3000;
    let builder = builder_of(Layout::Binary);
    let build = |triangles: &[Triangle]| {
        let workspace = builder.workspace(n).unwrap();
        let buffer = gpu().upload("triangles", triangles).unwrap();
        builder.build(&workspace, &buffer, triangles.len(), false).unwrap();
        (workspace, buffer)
    };
    let (identical, nest) = (awkward(n).swap_remove(0).1, awkward(n).swap_remove(4).1);
    let few = scattered(2, 1.0, 1.0);
    let scenes = [&identical, &nest, &few, &nest, &nest, &identical];
    let built = scenes.map(|triangles| build(triangles));
    let params = BuildParams::default();
    for layout in BY_ARITY {
        let widen = widen(layout, &params);
        let to = widen.workspace(n).unwrap();
        let depths: Vec<u32> = scenes
            .iter()
            .zip(&built)
            .enumerate()
            .map(|(i, (triangles, (workspace, buffer)))| {
                let read = Collapsed::read(workspace, triangles);
                let report = widen.build(workspace, &to, buffer, triangles.len(), None).unwrap();
                read.check(&to, &report, &params, None, &format!("scene {i}"));
                report.summary.depth
            })
            .collect();
        // One box in the next is deeper than what is recorded on suspicion, even once more than that.
        if layout == Layout::Binary {
            assert!(depths[1] > 64, "{depths:?}");
        }
        assert!(depths[2] == 1 && depths[0] > 1 && depths[1] > depths[0], "{depths:?}");
    }
    assert_silent();
}

#[test]
fn nodes_may_lie_further_apart_than_they_are_long() {
    let triangles = terrain(700);
    let n = triangles.len();
    let builder = builder_of(Layout::Binary);
    let workspace = builder.workspace(n).unwrap();
    let buffer = gpu().upload("triangles", &triangles).unwrap();
    builder.build(&workspace, &buffer, n, false).unwrap();
    let read = Collapsed::read(&workspace, &triangles);
    for &layout in Layout::ALL {
        for align in [4, 8, 16] {
            let stored = LayoutParams { align, ..Default::default() };
            let params = BuildParams { layout: stored, ..on_any_tree(layout) };
            let widen = widen(layout, &params);
            let to = widen.workspace(n).unwrap();
            let report = widen.build(&workspace, &to, &buffer, n, None).unwrap();
            let what = format!("aligned to {align}");
            read.check(&to, &report, &params, None, &what);
            let stride = to.tree(&report.summary, 0.0).stride;
            assert_eq!(stride, layout.node_bytes().next_multiple_of(align as usize), "{what}, {layout:?}");
        }
    }
    assert_silent();
}

#[test]
fn a_builder_of_any_layout_builds_from_triangles_to_nodes() {
    for &layout in Layout::ALL {
        let builder = builder_of(layout);
        let workspace = builder.workspace(2500).unwrap();
        for n in [1, 2, 5, 300, 2500, 4] {
            check(builder, &workspace, &terrain(n), &format!("{n} of a terrain"));
        }
    }
    assert_silent();
}

/// Boxes in one node whose sizes have nothing to do with each other, up to the largest floats.
#[test]
fn coordinates_of_every_magnitude_are_encoded_as_the_twin_does() {
    let mut random = Random(29);
    let mut magnitude = |most: f32| {
        let power = (2.0 * random.unit() - 1.0) * most;
        (random.unit() - 0.5) * 10f32.powf(power)
    };
    let mut scene = |most: f32, n: usize| -> Vec<Triangle> {
        (0..n).map(|_| std::array::from_fn(|_| std::array::from_fn(|_| magnitude(most)))).collect()
    };
    let mut scenes = vec![("to 1e17", scene(17.0, 400)), ("to 1e37", scene(37.0, 400))];
    let corner = |x: f32| [[x; 3], [x, 0.0, 1.0], [0.0, x, x]];
    scenes
        .push(("to the ends of floats", [f32::MAX, -f32::MAX, 1.0, 1e30, -1e-16, 1e-16].map(corner).into()));
    // Compared with a step of the second one's grid, the first is nothing.
    let diagonal = |lo: f32, hi: f32| [[lo; 3], [hi; 3], [lo, hi, lo]];
    scenes.push(("next to nothing", vec![diagonal(-1e-25, 1e-25), diagonal(0.0, 1e30)]));
    let builder = builder_of(Layout::Binary);
    for (what, triangles) in &scenes {
        let n = triangles.len();
        let workspace = builder.workspace(n).unwrap();
        let buffer = gpu().upload("triangles", triangles).unwrap();
        builder.build(&workspace, &buffer, n, false).unwrap();
        check_other_layouts(&workspace, triangles, what);
    }
    assert_silent();
}

#[test]
fn compressed_nodes_have_slots_by_each_assignment_and_planes_of_any_precision() {
    let builder = builder_of(Layout::Binary);
    let scenes: Vec<_> = [1, 2, 9, 700]
        .into_iter()
        .map(|n| (format!("{n} scattered"), scattered(n, 10.0, 1.0)))
        .chain(awkward(300).into_iter().map(|(what, triangles)| (what.to_owned(), triangles)))
        .collect();
    let built: Vec<_> = scenes
        .iter()
        .map(|(what, triangles)| {
            let workspace = builder.workspace(triangles.len()).unwrap();
            let buffer = gpu().upload("triangles", triangles).unwrap();
            builder.build(&workspace, &buffer, triangles.len(), false).unwrap();
            (what, Collapsed::read(&workspace, triangles), workspace, buffer)
        })
        .collect();
    for &assignment in Assignment::ALL {
        for bits in if assignment == Assignment::Auction { 4..=8 } else { 8..=8 } {
            let stored = LayoutParams { bits, assignment, ..Default::default() };
            let params = BuildParams { layout: stored, ..on_any_tree(Layout::Compressed8) };
            let widen = widen(Layout::Compressed8, &params);
            for (what, read, workspace, buffer) in &built {
                let to = widen.workspace(read.tree.leaves).unwrap();
                let report = widen.build(workspace, &to, buffer, read.tree.leaves, None).unwrap();
                read.check(&to, &report, &params, None, &format!("{what}, {assignment:?}, {bits} bits"));
            }
        }
    }
    assert_silent();
}

#[test]
fn leaves_too_large_for_a_layout_are_refused_with_the_parameter() {
    let error =
        |params: &BuildParams| Builder::new(gpu(), params, Layout::Compressed8).unwrap_err().to_string();
    assert!(error(&BuildParams::default()).contains("collapse.max_leaf=3"));
    let contract = ContractParams { p_max: 4, ..on_any_tree(Layout::Compressed8).contract };
    assert!(error(&contracted(contract)).contains("contract.p_max=3"));
}

/// The stages behind the binary tree do not ask where it comes from, or how often a triangle is in it.
#[test]
fn trees_with_spatial_splits_are_widened_as_others_are() {
    let scenes: Vec<_> = [1, 2, 3, 1500]
        .into_iter()
        .map(|n| (format!("{n} scattered"), scattered(n, 10.0, 3.0)))
        .chain(awkward(200).into_iter().map(|(what, triangles)| (what.to_owned(), triangles)))
        .collect();
    let mut split_any = false;
    for layout in [Layout::Binary, Layout::Wide4, Layout::Quantized6, Layout::Compressed8] {
        for method in [Contraction::Sah, Contraction::Optimal] {
            let contract = ContractParams { method, ..Default::default() };
            let params = BuildParams { method: Method::Sbvh, contract, ..usual(layout) };
            let builder = Builder::new(gpu(), &params, layout).unwrap();
            for (what, triangles) in &scenes {
                let what = format!("{what}, {method}");
                let tree = sbvh::build(triangles, &SbvhParams::default());
                split_any |= tree.leaves > triangles.len();
                let buffer = gpu().upload("triangles", triangles).unwrap();
                let workspace = builder.workspace(tree.leaves).unwrap();
                workspace.adopt(gpu(), &tree, triangles.len(), Some((Method::Sbvh, 7.0))).unwrap();
                let report = builder.build(&workspace, &buffer, triangles.len(), false).unwrap();
                let read = Collapsed::read(&workspace, triangles);
                assert!(read.tree == tree, "{what}: the tree that was adopted");
                let subtrees = collapse::cpu::collapse(&tree, read.scale, &params.collapse);
                assert!(read.subtrees == subtrees, "{what}: subtrees differ from the twin's");
                read.check(&workspace.wide, &report, &params, None, &what);
                assert!(report.milliseconds.sbvh == 7.0 && report.milliseconds.total >= 7.0, "{what}");
            }
        }
    }
    assert!(split_any, "some triangles were split");
    assert_silent();
}

/// Of boxes halved in the middle, every subtree that is small enough is a leaf, in every layout.
#[test]
fn halved_trees_have_leaves_as_large_as_they_may_be() {
    let scenes: Vec<_> = [1, 2, 3, 8, 9, 1500]
        .into_iter()
        .map(|n| (format!("{n} scattered"), scattered(n, 10.0, 1.0)))
        .chain(awkward(200).into_iter().map(|(what, triangles)| (what.to_owned(), triangles)))
        .collect();
    for (layout, max_leaf) in
        [(Layout::Binary, 16), (Layout::Direct, 2), (Layout::Reduced, 8), (Layout::Wide8, 1)]
    {
        let collapse = CollapseParams { max_leaf, by_size: true, ..Default::default() };
        let params = BuildParams { method: Method::Midpoint, collapse, ..usual(layout) };
        let builder = Builder::new(gpu(), &params, layout).unwrap();
        for (what, triangles) in &scenes {
            let tree = midpoint::build(triangles);
            let buffer = gpu().upload("triangles", triangles).unwrap();
            let workspace = builder.workspace(tree.leaves).unwrap();
            workspace.adopt(gpu(), &tree, triangles.len(), Some((Method::Midpoint, 7.0))).unwrap();
            let report = builder.build(&workspace, &buffer, triangles.len(), false).unwrap();
            let read = Collapsed::read(&workspace, triangles);
            assert!(read.tree == tree, "{what}: the tree that was adopted");
            let subtrees = collapse::cpu::collapse(&tree, read.scale, &params.collapse);
            assert!(read.subtrees == subtrees, "{what}: subtrees differ from the twin's");
            let below = subtrees.split_last().map_or(&[][..], |(_, below)| below);
            assert!(below.iter().all(|s| (s.inner == 0) == (s.triangles <= max_leaf)), "{what}");
            read.check(&workspace.wide, &report, &params, None, what);
            let took = report.milliseconds;
            assert!(took.midpoint == 7.0 && took.sbvh == 0.0 && took.total >= 7.0, "{what}: {took:?}");
        }
    }
    assert_silent();
}

/// More nodes than one launch gives their items to.
#[test]
fn items_of_many_nodes_follow_each_other() {
    let triangles = terrain(70_000);
    let collapse = CollapseParams { max_leaf: 1, ..Default::default() };
    let params = BuildParams { collapse, ..BuildParams::default() };
    let builder = Builder::new(gpu(), &params, Layout::Reduced).unwrap();
    let workspace = builder.workspace(triangles.len()).unwrap();
    let buffer = gpu().upload("triangles", &triangles).unwrap();
    let report = builder.build(&workspace, &buffer, triangles.len(), false).unwrap();
    assert!(report.summary.nodes > 1 << 16);
    Collapsed::read(&workspace, &triangles).check(&workspace.wide, &report, &params, None, "many");
    assert_silent();
}

/// A tree that was clustered before, and comes back from a file, takes the place of clustering: what is made of it is the
/// same, and only what is done counts.
#[test]
fn a_clustered_tree_is_adopted_as_it_was_built() {
    for layout in [Layout::Binary, Layout::Wide4, Layout::Compressed8] {
        let params = usual(layout);
        let builder = Builder::new(gpu(), &params, layout).unwrap();
        let adopting = Builder::adopting(gpu(), &params, layout).unwrap();
        for count in [1, 2, 3, 1500] {
            let what = format!("{count} triangles, {layout:?}");
            let triangles = scattered(count, 10.0, 3.0);
            let buffer = gpu().upload("triangles", &triangles).unwrap();
            let workspace = builder.workspace(count).unwrap();
            let built = builder.build(&workspace, &buffer, count, false).unwrap();
            let (tree, subtrees) = (workspace.read_tree().unwrap(), workspace.read_subtrees().unwrap());
            let content = treefile::content(&triangles);
            let recipe = Recipe::Ploc { morton: params.morton.clone(), ploc: params.ploc.clone() };
            let made = Made { scene: "scattered".into(), recipe, seconds: 1.0 };
            let bytes = treefile::encode(&tree, &made, &content, count);
            let (stored, _) = treefile::decode(&bytes, &content, count).unwrap();
            assert!(stored == tree, "{what}: the tree that was stored");

            let workspace = adopting.workspace(stored.leaves).unwrap();
            workspace.adopt(gpu(), &stored, count, None).unwrap();
            let report = adopting.build(&workspace, &buffer, count, false).unwrap();
            let read = Collapsed::read(&workspace, &triangles);
            assert!(read.tree == tree && read.subtrees == subtrees, "{what}: another tree");
            read.check(&workspace.wide, &report, &params, None, &what);
            let (nodes, levels) = (built.summary.nodes, built.summary.levels);
            assert_eq!((report.summary.nodes, report.summary.levels), (nodes, levels), "{what}");
            let took = &report.milliseconds;
            assert!(
                (took.sort, took.ploc, took.sbvh) == (0.0, 0.0, 0.0) && took.adopt > 0.0,
                "{what}: {took:?}"
            );
            assert!(took.total >= took.adopt + took.contract + took.layout, "{what}: {took:?}");
        }
    }
    assert_silent();
}
