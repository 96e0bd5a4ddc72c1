//! Trees with spatial splits, on ordinary, awkward and random scenes. No device is needed.

mod support;

use proptest::prelude::*;
use support::{Random, awkward, scattered, terrain};
use tracer::{
    bvh2::{Bvh2, Bvh2Node, MAX_LEVELS, Triangle},
    morton::{self, MortonParams},
    ploc::{self, PlocParams},
    sbvh::{self, SbvhParams},
    scene::{SearchPath, load},
    sort, validate,
};

fn params(alpha: f32) -> SbvhParams {
    SbvhParams { alpha, ..SbvhParams::default() }
}

/// Builds with and without spatial splits, and checks both trees.
fn check(triangles: &[Triangle], what: &str) -> Bvh2 {
    let n = triangles.len();
    let tree = sbvh::build(triangles, &SbvhParams::default());
    assert_eq!(validate::references(&tree, triangles), Ok(()), "{what}");
    assert!((n..=3 * n).contains(&tree.leaves), "{what}: {} references", tree.leaves);
    let unsplit = sbvh::build(triangles, &params(1.0));
    assert_eq!(validate::bvh2(&unsplit, triangles), Ok(()), "{what}, without spatial splits");
    assert_eq!(validate::references(&unsplit, triangles), Ok(()), "{what}, without spatial splits");
    in_order(&tree, what);
    if n <= 20_000 {
        check_reinserted(triangles, &tree, what);
    }
    tree
}

/// Subtrees that are moved make a tree of the same leaves that costs no more.
fn check_reinserted(triangles: &[Triangle], tree: &Bvh2, what: &str) -> Bvh2 {
    let moved = sbvh::build(triangles, &SbvhParams { reinsertions: 2, ..SbvhParams::default() });
    assert_eq!(validate::references(&moved, triangles), Ok(()), "{what}, reinserted");
    in_order(&moved, what);
    let leaves = |tree: &Bvh2| {
        let mut leaves: Vec<[u32; 8]> =
            tree.nodes[..tree.leaves].iter().map(|&l| bytemuck::cast(l)).collect();
        leaves.sort_unstable();
        leaves
    };
    assert!(leaves(tree) == leaves(&moved), "{what}: other leaves");
    let (before, after) = (cost(tree), cost(&moved));
    assert!(before.is_nan() || after <= before * (1.0 + 1e-5), "{what}: {before} to {after}");
    moved
}

/// Leaves are in depth-first order, and a level holds the nodes of one height, in the same order.
fn in_order(tree: &Bvh2, what: &str) {
    let mut heights = vec![0; tree.nodes.len()];
    let mut next: Vec<u32> = std::iter::once(0).chain(tree.levels.iter().map(|l| l.start)).collect();
    let mut todo = vec![(tree.nodes.len() as u32 - 1, false)];
    while let Some((i, children_done)) = todo.pop() {
        let node = tree.nodes[i as usize];
        if (i as usize) < tree.leaves {
            assert_eq!(next[0], i, "{what}: a leaf");
            next[0] += 1;
        } else if children_done {
            let height = 1 + [node.left, node.right].map(|c| heights[c as usize]).into_iter().max().unwrap();
            heights[i as usize] = height;
            assert_eq!(next[height], i, "{what}: a node of height {height}");
            next[height] += 1;
        } else {
            todo.extend([(i, true), (node.right, false), (node.left, false)]);
        }
    }
}

/// Areas of all nodes by the root's.
fn cost(tree: &Bvh2) -> f64 {
    let area = |node: &Bvh2Node| {
        let e: [f64; 3] = std::array::from_fn(|i| f64::from(node.hi[i]) - f64::from(node.lo[i]));
        e[0] * e[1] + e[1] * e[2] + e[2] * e[0]
    };
    tree.nodes.iter().map(area).sum::<f64>() / area(tree.nodes.last().unwrap())
}

fn plocs(triangles: &[Triangle]) -> Bvh2 {
    let bounds = morton::cpu::bounds(triangles);
    let codes = morton::cpu::codes(triangles, &bounds, &MortonParams::default());
    ploc::cpu::build(triangles, &sort::cpu::order(&codes), bounds.scale(), &PlocParams::default())
}

#[test]
fn every_small_number_of_triangles_makes_a_tree() {
    for n in (1..=20).chain(31..=34).chain(63..=66) {
        check(&scattered(n, 10.0, 1.0), &format!("{n} scattered"));
        check(&scattered(n, 10.0, 20.0), &format!("{n} that overlap"));
    }
    for n in [1, 2, 3, 17, 64, 65, 700] {
        for (what, triangles) in awkward(n) {
            check(&triangles, &format!("{n} {what}"));
        }
    }
}

#[test]
fn nodes_that_are_shared_out_make_trees() {
    // Parts are of 8192 references.
    for n in [8192, 8193, 20_000] {
        check(&terrain(n), &format!("{n} of a terrain"));
        check(&scattered(n, 10.0, 1.0), &format!("{n} scattered"));
    }
    for (what, triangles) in awkward(9000) {
        check(&triangles, &format!("9000 {what}"));
    }
}

#[test]
fn a_million_in_one_plane_make_a_tree() {
    let mut random = Random(3);
    let triangles: Vec<Triangle> = (0..1_000_000)
        .map(|_| {
            let (x, z) = (random.unit(), random.unit());
            [[x, 0.25, z], [x + 1e-3 * random.unit(), 0.25, z], [x, 0.25, z + 1e-3 * random.unit()]]
        })
        .collect();
    let tree = sbvh::build(&triangles, &SbvhParams::default());
    assert_eq!(validate::references(&tree, &triangles), Ok(()));
    let same = vec![triangles[0]; 100_000];
    let tree = sbvh::build(&same, &SbvhParams::default());
    assert_eq!(validate::references(&tree, &same), Ok(()));
}

#[test]
fn coordinates_of_every_magnitude_make_trees() {
    let mut random = Random(29);
    for most in [17.0, 37.0] {
        let mut magnitude = || {
            let power = (2.0 * random.unit() - 1.0) * most;
            (random.unit() - 0.5) * 10f32.powf(power)
        };
        let triangles: Vec<Triangle> =
            (0..400).map(|_| std::array::from_fn(|_| std::array::from_fn(|_| magnitude()))).collect();
        check(&triangles, &format!("to 1e{most}"));
    }
    let corner = |x: f32| [[x; 3], [x, 0.0, 1.0], [0.0, x, x]];
    check(&[f32::MAX, -f32::MAX, 1.0, 1e30, -1e-16, 1e-16, 1e-45, -0.0].map(corner), "to the ends of floats");
    let across = [[-f32::MAX; 3], [f32::MAX; 3], [-f32::MAX, f32::MAX, 0.0]];
    check(&vec![across; 50], "from end to end");
}

#[test]
fn depth_stays_within_bounds() {
    // Each much smaller than the last: the cheapest split always takes one away.
    let triangles: Vec<Triangle> = (0..6000)
        .map(|i| {
            let x = 0.96f32.powi(i);
            [[x, 0.0, 0.0], [x, x, 0.0], [x, 0.0, x]]
        })
        .collect();
    let tree = check(&triangles, "shrinking");
    assert!(tree.levels.len() <= MAX_LEVELS && tree.levels.len() > 30, "{}", tree.levels.len());
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let with = |threads: usize, triangles: &[Triangle]| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let params = SbvhParams { reinsertions: 2, ..SbvhParams::default() };
        pool.install(|| sbvh::build(triangles, &params))
    };
    let bits = |tree: &Bvh2| bytemuck::cast_slice::<_, u32>(&tree.nodes).to_vec();
    let zeros: Vec<Triangle> =
        scattered(30_000, 4.0, 1.0).iter().map(|t| t.map(|p| p.map(|x| (x * 4.0).trunc()))).collect();
    for triangles in [scattered(30_000, 10.0, 2.0), terrain(30_000), zeros] {
        let one = with(1, &triangles);
        for threads in [2, 3, 7] {
            let other = with(threads, &triangles);
            assert!(bits(&one) == bits(&other) && one.levels == other.levels, "{threads} threads");
        }
    }
}

#[test]
fn the_budget_bounds_the_references() {
    let triangles = scattered(2000, 10.0, 8.0);
    let references = |budget: f32| {
        let tree = sbvh::build(&triangles, &SbvhParams { budget, ..SbvhParams::default() });
        assert_eq!(validate::references(&tree, &triangles), Ok(()));
        tree.leaves
    };
    assert_eq!(references(0.0), 2000);
    assert!(references(0.1) <= 2200);
    assert!((2001..=4000).contains(&references(1.0)));
}

#[test]
fn generated_scenes_cost_less_than_with_plocs_tree() {
    for scene in ["cornell", "hairball:triangles=10000", "city:triangles=10000", "forest:triangles=10000"] {
        let triangles = load(scene, &SearchPath::only([])).unwrap().positions;
        let (sbvh, ploc) = (cost(&check(&triangles, scene)), cost(&plocs(&triangles)));
        assert!(sbvh < ploc, "{scene}: {sbvh} and {ploc}");
    }
}

#[test]
fn moved_subtrees_make_generated_scenes_cheaper() {
    for scene in ["hairball:triangles=10000", "city:triangles=10000", "forest:triangles=10000"] {
        let triangles = load(scene, &SearchPath::only([])).unwrap().positions;
        let tree = sbvh::build(&triangles, &SbvhParams::default());
        let (before, after) = (cost(&tree), cost(&check_reinserted(&triangles, &tree, scene)));
        assert!(after < 0.98 * before, "{scene}: {before} to {after}");
    }
}

#[test]
fn spatial_splits_pay_off_where_triangles_are_long() {
    let triangles = load("hairball:triangles=10000", &SearchPath::only([])).unwrap().positions;
    let with = cost(&sbvh::build(&triangles, &SbvhParams::default()));
    let without = cost(&sbvh::build(&triangles, &params(1.0)));
    assert!(with < 0.9 * without, "{with} and {without}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    /// Corners on a coarse grid meet planes, share sides and fall together.
    #[test]
    fn random_triangles_on_a_grid_make_trees(
        corners in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-4i8..4)), 1..80),
        bins in 2u32..40,
        sweep in 0u32..40,
        reinsertions in 0u32..3,
        scale in prop::sample::select(vec![1.0f32, 0.1, 1e-20, 1e20, 7e30]),
    ) {
        let triangles: Vec<Triangle> = corners.iter().map(|t| t.map(|p| p.map(|x| f32::from(x) * scale))).collect();
        let params = SbvhParams { object_bins: bins, spatial_bins: bins, sweep, reinsertions, ..SbvhParams::default() };
        let tree = sbvh::build(&triangles, &params);
        prop_assert_eq!(validate::references(&tree, &triangles), Ok(()));
    }

    #[test]
    fn random_triangles_make_trees(
        triangles in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-1e3f32..1e3)), 1..80),
        offset in prop::sample::select(vec![0.0f32, 1e4, 1e7]),
    ) {
        let triangles: Vec<Triangle> = triangles.iter().map(|t| t.map(|p| p.map(|x| x + offset))).collect();
        let tree = sbvh::build(&triangles, &SbvhParams { reinsertions: 1, ..SbvhParams::default() });
        prop_assert_eq!(validate::references(&tree, &triangles), Ok(()));
    }

    /// Whatever finite floats there are.
    #[test]
    fn any_triangles_make_trees(
        triangles in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(
            prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO)), 1..40),
    ) {
        let tree = sbvh::build(&triangles, &SbvhParams { reinsertions: 1, ..SbvhParams::default() });
        prop_assert_eq!(validate::references(&tree, &triangles), Ok(()));
    }
}
