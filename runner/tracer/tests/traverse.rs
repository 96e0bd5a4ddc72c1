//! The traversal kernel against its twin, against brute force, and where answers are known.

mod support;

use rayon::prelude::*;
use support::{
    Planted, Random, assert_silent, awkward, builder, builder_for, builder_of, gpu, icosphere, languages_of,
    mesh, plant, scattered, terrain, traversal, traversal_in, usual,
};
use tracer::{
    Error,
    builder::{BuildParams, Builder},
    bvh2::Triangle,
    collapse::CollapseParams,
    gpu::Pass,
    layout::{Layout, LayoutParams, LeafTriangles, compressed::Compressed8},
    list::{self, Listing},
    traverse::{
        Buffers, Counting, Counts, Hit, Language, Params, Queue, Ray, Technique, Traversal, Tree,
        TriangleTest, Utilization, Wave, cpu,
        groups::{self, Fetch, Order},
    },
};

type Point = [f32; 3];

/// What stands in memory before a launch: no hit that a kernel writes looks like it.
const POISON: u32 = 0xABAB_ABAB;

/// What subgroups are said to have done before a launch, which goes on from there: a carry is not far.
const BEFORE: Utilization = Utilization {
    node_steps: u32::MAX as u64,
    node_lanes: u32::MAX as u64 - 1,
    triangle_steps: u32::MAX as u64 - 2,
    triangle_lanes: (7 << 32) - 3,
    fetches: u32::MAX as u64,
    fetch_lanes: u32::MAX as u64 - 4,
};

/// Traces rays once and requires that each was finished exactly once, and nothing else was touched.
fn trace(
    traversal: &Traversal,
    counting: Counting,
    wave: Wave,
    planted: &Planted,
    rays: &[Ray],
) -> (Vec<Hit>, Vec<Counts>) {
    let (hits, counts, _) = trace_and_count(traversal, counting, wave, planted, rays);
    (hits, counts)
}

/// The same, and how well subgroups were used: of a kernel that counts, it must fit what the rays met.
fn trace_and_count(
    traversal: &Traversal,
    counting: Counting,
    wave: Wave,
    planted: &Planted,
    rays: &[Ray],
) -> (Vec<Hit>, Vec<Counts>, Utilization) {
    trace_through(traversal, counting, wave, &planted.tree, rays)
}

/// The same through any tree, or none.
fn trace_through(
    traversal: &Traversal,
    counting: Counting,
    wave: Wave,
    tree: &Tree,
    rays: &[Ray],
) -> (Vec<Hit>, Vec<Counts>, Utilization) {
    let n = rays.len();
    assert!(tree.stack <= traversal.stack(), "the stack is deep enough");
    let counting = counting == Counting::Rays;
    let ray_buffer = gpu().upload("rays", rays).unwrap();
    // Room for as many as the largest workgroup beyond the last ray.
    let hits = gpu().buffer("hits", 8 * (n as u64 + 1024)).unwrap();
    let counts = gpu().buffer("counts", 16 * (n as u64 + 1024)).unwrap();
    let queue = gpu().upload("queue", &[Queue { count: n as u32, ..Queue::default() }]).unwrap();
    let utilization = gpu().upload("SIMD utilization", &[BEFORE]).unwrap();
    let buffers = Buffers {
        rays: ray_buffer.address(),
        hits: hits.address(),
        queue: queue.address(),
        counts: if counting { counts.address() } else { 0 },
        visits: 0,
        utilization: if counting { utilization.address() } else { 0 },
    };
    let mut pass = Pass::new(gpu()).unwrap();
    pass.fill(&hits, POISON);
    pass.fill(&counts, POISON);
    traversal.record(&mut pass, "trace", wave, tree, &buffers, n);
    pass.submit().unwrap();
    let queue: Queue = queue.read(0, 1).unwrap()[0];
    assert_eq!((queue.count, queue.finished, queue.unused), (n as u32, n as u32, 0));
    assert!(queue.next >= queue.count, "{queue:?}");
    let all: Vec<Hit> = hits.read(0, n + 1024).unwrap();
    let all_counts: Vec<Counts> = counts.read(0, n + 1024).unwrap();
    let poison = Counts { nodes: POISON, boxes: POISON, triangles: POISON, unused: POISON };
    assert!(all[..n].iter().all(|h| h.triangle != POISON), "every hit is written");
    assert!(all[n..].iter().all(|h| h.triangle == POISON && h.t.to_bits() == POISON), "and none behind");
    let counted = if counting { n } else { 0 };
    assert!(all_counts[..counted].iter().all(|c| c.nodes != POISON && c.unused == 0));
    assert!(all_counts[counted..].iter().all(|c| *c == poison), "counts are written by counting kernels");
    let counts = all_counts[..counted].to_vec();
    let utilization = since(&BEFORE, &utilization.read(0, 1).unwrap()[0]);
    if counting {
        assert_fits(&utilization, &counts);
    }
    (all[..n].to_vec(), counts, utilization)
}

/// What was added.
fn since(before: &Utilization, after: &Utilization) -> Utilization {
    Utilization {
        node_steps: after.node_steps - before.node_steps,
        node_lanes: after.node_lanes - before.node_lanes,
        triangle_steps: after.triangle_steps - before.triangle_steps,
        triangle_lanes: after.triangle_lanes - before.triangle_lanes,
        fetches: after.fetches - before.fetches,
        fetch_lanes: after.fetch_lanes - before.fetch_lanes,
    }
}

/// A lane visits one node a step, tests one triangle a step, and each ray is fetched once.
fn assert_fits(of_subgroups: &Utilization, of_rays: &[Counts]) {
    let sum = |of: fn(&Counts) -> u32| of_rays.iter().map(|c| u64::from(of(c))).sum::<u64>();
    let lanes = [of_subgroups.node_lanes, of_subgroups.triangle_lanes, of_subgroups.fetch_lanes];
    assert_eq!(lanes, [sum(|c| c.nodes), sum(|c| c.triangles), of_rays.len() as u64], "{of_subgroups:?}");
    let steps = [of_subgroups.node_steps, of_subgroups.triangle_steps, of_subgroups.fetches];
    let size = u64::from(gpu().info().subgroup_size);
    for (steps, lanes) in steps.into_iter().zip(lanes) {
        assert!((lanes.div_ceil(size)..=lanes).contains(&steps), "{of_subgroups:?}");
    }
}

/// Distances agree: to 1e-5 of themselves, and to what single precision can tell about the scene's extent
/// when that is divided by the direction's length.
fn agree(a: f32, b: f32, ray: &Ray, extent: f32) -> bool {
    let reach = ray.origin.iter().fold(extent, |m, x| m.max(x.abs()));
    let length = ray.direction.iter().map(|d| d * d).sum::<f32>().sqrt();
    // A hit never agrees with a miss.
    let off = (a - b).abs();
    a == b || off.is_finite() && off <= 1e-5 * a.abs().max(b.abs()) + 1e-6 * reach / length
}

fn ray(origin: Point, direction: Point) -> Ray {
    Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
}

fn towards(origin: Point, target: Point) -> Ray {
    ray(origin, std::array::from_fn(|k| target[k] - origin[k]))
}

/// Rays of every awkward kind through a scene, none without a direction.
fn awkward_rays(triangles: &[Triangle], n: usize) -> Vec<Ray> {
    let corners = triangles.as_flattened();
    let lo: Point = std::array::from_fn(|k| corners.iter().fold(f32::INFINITY, |m, p| m.min(p[k])));
    let hi: Point = std::array::from_fn(|k| corners.iter().fold(f32::NEG_INFINITY, |m, p| m.max(p[k])));
    let size = (0..3).fold(0f32, |m, k| m.max(hi[k] - lo[k]));
    let size = if size > 0.0 { size } else { 1.0 };
    let mut random = Random(n as u64);
    let mut rays = Vec::new();
    while rays.len() < n {
        let r = &mut random;
        let mut inside = |grow: f32| -> Point {
            std::array::from_fn(|k| lo[k] + (hi[k] - lo[k]) * r.unit() + size * grow * (r.unit() - 0.5))
        };
        let (origin, target) = (inside(1.0), inside(0.1));
        let triangle = triangles[r.next() as usize % triangles.len()];
        let (u, v) = (r.unit(), r.unit());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let on: Point =
            std::array::from_fn(|k| (1.0 - u - v) * triangle[0][k] + u * triangle[1][k] + v * triangle[2][k]);
        let corner = triangle[r.next() as usize % 3];
        let axis = r.next() as usize % 3;
        let sign = if r.next().is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut along = if r.next().is_multiple_of(2) { [0.0; 3] } else { [-0.0; 3] };
        along[axis] = sign * size * r.unit().max(0.1);
        let mut new = match rays.len() % 12 {
            // Along an axis: from anywhere, towards a triangle, over a corner, along the faces of boxes.
            0 => ray(origin, along),
            1 => {
                let mut from = on;
                from[axis] -= sign * size;
                ray(from, along)
            }
            2 => {
                let mut from = corner;
                from[axis] -= sign * size;
                ray(from, along)
            }
            3 => ray(corner, along),
            // From inside, from a surface, at corners and at surfaces.
            4 => towards(target, origin),
            5 => towards(on, target),
            6 => towards(origin, corner),
            7 => towards(origin, on),
            // Limits that cut in front of and behind surfaces.
            8 => Ray { t_min: 0.9 + 0.2 * r.unit(), ..towards(origin, on) },
            9 => Ray { t_max: 0.9 + 0.2 * r.unit(), ..towards(origin, on) },
            10 => Ray { t_min: 0.5, t_max: 2.0 * r.unit(), ..towards(origin, target) },
            // One component that is next to nothing.
            _ => {
                let mut thin = towards(origin, on);
                thin.direction[axis] = sign * 1e-30 * size;
                thin
            }
        };
        if rays.len() % 5 == 0 {
            // Neither short nor long directions matter.
            let scale = 10f32.powf(6.0 * r.unit() - 3.0);
            new.direction = new.direction.map(|d| d * scale);
            (new.t_min, new.t_max) = (new.t_min / scale, new.t_max / scale);
        }
        if rays.len() % 7 == 0 && new.t_max == f32::INFINITY {
            new.t_max = f32::MAX;
        }
        if new.direction.iter().any(|d| d.abs() > 1e-25 * size) {
            rays.push(new);
        }
    }
    rays
}

/// What each ray hits of all triangles.
fn brute_force(test: TriangleTest, triangles: &[Triangle], rays: &[Ray]) -> Vec<Hit> {
    let stored = LeafTriangles::in_file_order(test, triangles);
    rays.par_iter().map(|ray| cpu::brute_force(&stored, ray)).collect()
}

/// Traces awkward rays through trees in every layout and compares with brute force and with the twin.
fn check(what: &str, triangles: &[Triangle], n: usize) {
    let rays = awkward_rays(triangles, n);
    let brute = brute_force(TriangleTest::Watertight, triangles, &rays);
    for &layout in Layout::ALL {
        let planted = plant(builder_of(layout), triangles);
        check_layout(&format!("{what}, {layout:?}"), layout, triangles, &planted, &rays, &brute);
    }
}

fn check_layout(
    what: &str,
    layout: Layout,
    triangles: &[Triangle],
    planted: &Planted,
    rays: &[Ray],
    brute: &[Hit],
) {
    let extent = planted.tree.extent;
    let kernels = traversal(&planted.tree, Counting::Rays);
    let (hits, counts) = trace(kernels, Counting::Rays, Wave::Secondary, planted, rays);
    for language in languages_of(layout).filter(|language| *language != Language::Glsl) {
        let (its_hits, its_counts) = trace(
            traversal_in(language, &planted.tree, Counting::Rays),
            Counting::Rays,
            Wave::Secondary,
            planted,
            rays,
        );
        for (at, ray) in rays.iter().enumerate() {
            let same = its_hits[at].t.to_bits() == hits[at].t.to_bits()
                && its_hits[at].triangle == hits[at].triangle;
            assert!(same, "{what}, {language:?}: {ray:?}: {:?}, not {:?}", its_hits[at], hits[at]);
        }
        // Which rays share a subgroup depends on timing, and that decides what is postponed.
        let sums = |counts: &[Counts]| {
            counts.iter().fold([0u64; 3], |sum, one| {
                [
                    sum[0] + u64::from(one.nodes),
                    sum[1] + u64::from(one.boxes),
                    sum[2] + u64::from(one.triangles),
                ]
            })
        };
        for (its, own) in sums(&its_counts).into_iter().zip(sums(&counts)) {
            let ratio = its as f64 / own.max(1) as f64;
            assert!(its == own || (0.98..1.02).contains(&ratio), "{what}, {language:?}: {its} for {own}");
        }
    }
    let (twin, there) = (&planted.twin, planted.summary.nodes);
    let most = layout.arity() as u32;
    let test = planted.tree.test;
    // Of the tests that are not watertight each kernel has its own answer for a ray that passes an edge, and some
    // of those rays pass outside the box in which they would be hit.
    let same = |ray: &Ray, a: &Hit, b: &Hit| {
        let nearer = if a.t < b.t { a } else { b };
        let may_differ = test != TriangleTest::Watertight && nearer.triangle != Hit::MISS;
        agree(a.t, b.t, ray, extent)
            || may_differ && cpu::passes_edge(ray, &triangles[nearer.triangle as usize], extent)
    };
    // Only the root of a lone triangle has a single child.
    let least = if triangles.len() == 1 { 1 } else { 2 };
    let judge = |(((ray, hit), counts), brute): (((&Ray, &Hit), &Counts), &Hit)| {
        let (twin, twin_counts) = twin(ray);
        let is_hit = hit.triangle != Hit::MISS;
        // The triangle that is named is at that distance.
        let named = || cpu::intersect(test, ray, f32::INFINITY, &triangles[hit.triangle as usize]);
        let faults = [
            (!same(ray, brute, hit), "differs from brute force"),
            (!same(ray, brute, &twin), "twin differs from brute force"),
            (is_hit != hit.t.is_finite(), "neither hit nor miss"),
            (counts.boxes < least * counts.nodes, "fewer boxes than children"),
            (counts.boxes > most * counts.nodes, "more boxes than children"),
            (!(1..=there).contains(&counts.nodes), "nodes that are not there"),
            (counts.triangles as usize > triangles.len(), "triangles that are not there"),
            (is_hit && !(hit.t > ray.t_min && hit.t < ray.t_max), "outside the ray's limits"),
            (is_hit && counts.triangles == 0, "hit without a test"),
            (
                is_hit && !same(ray, hit, &named().map_or(Hit::NONE, |t| Hit { t, triangle: hit.triangle })),
                "another triangle's distance",
            ),
        ];
        // Maps to the unit triangle, which the device made, are the twin's too.
        let differs = !agree(twin.t, hit.t, ray, extent);
        match faults.iter().find(|(found, _)| *found) {
            Some((_, fault)) => Err(format!("{fault}: {ray:?}: {hit:?}, {counts:?}, brute force {brute:?}")),
            None => Ok([is_hit.into(), counts.nodes as usize, twin_counts.nodes as usize, differs.into()]),
        }
    };
    let found: Result<Vec<_>, String> =
        rays.par_iter().zip(&hits).zip(&counts).zip(brute).map(judge).collect();
    let sums = found
        .unwrap_or_else(|fault| panic!("{what}: {fault}"))
        .iter()
        .fold([0; 4], |sums, one| std::array::from_fn(|k| sums[k] + one[k]));
    let [found, nodes, twin_nodes, differ] = sums;
    println!(
        "{what}: {found} of {} rays hit, {differ} not as in the twin, {nodes} nodes, {twin_nodes} in the twin",
        rays.len()
    );
    assert!(differ <= rays.len() / 100, "{what}: {differ} rays are not as in the twin");
    // Lanes that go on with a leaf postponed visit nodes that the leaf would have cut off. Without the nearest
    // child first there would be far more.
    let ratio = nodes as f64 / twin_nodes as f64;
    // Where all coordinates are beyond halves, or below, boxes are entered at the same distance, and ties are in
    // another order in the twin.
    let ties = layout == Layout::Reduced && !(1e-2..6e4).contains(&extent);
    let least = if ties { 0.8 } else { 0.99 };
    assert!((least..1.3).contains(&ratio), "{what}: {nodes} nodes visited, {twin_nodes} by the twin");
}

#[test]
fn every_ray_through_every_kind_of_scene_agrees_with_brute_force() {
    let shifted = |scale: f32, by: f32| -> Vec<Triangle> {
        scattered(600, scale, 0.1 * scale).iter().map(|t| t.map(|p| p.map(|x| x + by))).collect()
    };
    check("scattered", &scattered(1500, 10.0, 1.0), 12_000);
    check("huge", &shifted(1e6, 0.0), 4_000);
    check("tiny", &shifted(1e-6, 0.0), 4_000);
    check("far away", &shifted(1.0, 1e4), 4_000);
    let mut random = Random(3);
    let needles: Vec<Triangle> = (0..600)
        .map(|_| {
            let (a, b) = (random.point(10.0), random.point(10.0));
            let offset = random.point(1e-5);
            [a, b, std::array::from_fn(|k| b[k] + offset[k])]
        })
        .collect();
    check("needles", &needles, 4_000);
    // A street grid: boxes without thickness, and rays along their faces.
    let grid: Vec<Triangle> = (0..600)
        .map(|i| {
            let (x, y, z) = ((i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32);
            match i % 3 {
                0 => [[x, y, z], [x + 1.0, y, z], [x, y + 1.0, z]],
                1 => [[x, y, z], [x, y + 1.0, z], [x, y, z + 1.0]],
                _ => [[x, y, z], [x + 1.0, y, z], [x, y, z + 1.0]],
            }
        })
        .collect();
    check("grid", &grid, 12_000);
    for (what, triangles) in awkward(500) {
        check(what, &triangles, 2_000);
    }
    assert_silent();
}

/// Without a tree: every triangle, in as many launches as it takes, or none.
#[test]
fn lists_agree_with_brute_force_and_with_nothing() {
    let mut scenes = awkward(100);
    scenes.retain(|(what, _)| *what != "tiny");
    scenes.push(("one", scattered(1, 10.0, 5.0)));
    scenes.push(("terrain", terrain(1000)));
    scenes.push(("three launches", scattered(17_000, 10.0, 0.5)));
    for test in TriangleTest::ALL {
        for (what, triangles) in &scenes {
            let n = if triangles.len() > 10_000 { 300 } else { 2_000 };
            let mut rays = awkward_rays(triangles, n);
            rays.truncate(n);
            let extent = triangles.as_flattened().as_flattened().iter().fold(0f32, |m, x| m.max(x.abs()));
            let brute = brute_force(test, triangles, &rays);
            let buffer = gpu().upload("triangles", triangles).unwrap();
            for listing in [Listing::All, Listing::None] {
                let what = format!("{what}, {test:?}, {listing:?}");
                let builder = list::Builder::new(gpu(), listing, test, triangles.len()).unwrap();
                assert!(builder.build(&buffer).unwrap() > 0.0, "{what}");
                let list = builder.finish();
                let LeafTriangles::Corners { triangles: twin, .. } =
                    LeafTriangles::in_file_order(TriangleTest::Watertight, triangles)
                else {
                    unreachable!("the watertight test takes no maps")
                };
                assert!(list.triangles.read(triangles.len()).unwrap().agree(&twin), "{what}");
                let tree = list.tree(extent);
                for (counting, wave) in
                    [(Counting::Rays, Wave::Primary), (Counting::Nothing, Wave::Secondary)]
                {
                    let traversal = Traversal::new(gpu(), &Params::default(), &tree, counting).unwrap();
                    let (hits, counts, _) = trace_through(&traversal, counting, wave, &tree, &rays);
                    let tested = if listing == Listing::All { triangles.len() as u32 } else { 0 };
                    let all = Counts { nodes: 0, boxes: 0, triangles: tested, unused: 0 };
                    assert!(counts.iter().all(|found| *found == all), "{what}");
                    for ((ray, hit), want) in rays.iter().zip(&hits).zip(&brute) {
                        if listing == Listing::None {
                            assert_eq!(*hit, Hit::NONE, "{what}: {ray:?}");
                            continue;
                        }
                        let nearer = if hit.t < want.t { hit } else { want };
                        let may_differ = test != TriangleTest::Watertight && nearer.triangle != Hit::MISS;
                        let same = agree(hit.t, want.t, ray, extent)
                            || may_differ
                                && cpu::passes_edge(ray, &triangles[nearer.triangle as usize], extent);
                        assert!(same, "{what}: {ray:?}: {hit:?}, not {want:?}");
                    }
                }
            }
        }
    }
    let refused = |count| list::Builder::new(gpu(), Listing::All, TriangleTest::Watertight, count);
    let error = refused(list::MOST + 1).unwrap_err().to_string();
    assert!(error.contains("65536") && error.contains("Direct"), "{error}");
    assert!(refused(0).is_err());
    assert_silent();
}

#[test]
fn every_triangle_test_agrees_with_brute_force_in_every_layout() {
    let mut scenes = awkward(100);
    // There rays are shorter than boxes are tested for, while Woop's test knows no scale.
    scenes.retain(|(what, _)| *what != "tiny");
    scenes.push(("terrain", terrain(1000)));
    scenes.push(("scattered", scattered(1500, 10.0, 1.0)));
    for test in [TriangleTest::MoellerTrumbore, TriangleTest::KenslerShirley, TriangleTest::Woop] {
        for &layout in Layout::ALL {
            let builder = builder_for(test, layout);
            for (what, triangles) in &scenes {
                let what = format!("{what}, {test:?}, {layout:?}");
                let rays = awkward_rays(triangles, if triangles.len() > 100 { 4_000 } else { 1_000 });
                let brute = brute_force(test, triangles, &rays);
                let planted = plant(&builder, triangles);
                assert_eq!(
                    (planted.tree.test, planted.tree.indices != 0),
                    (test, test == TriangleTest::Woop)
                );
                check_layout(&what, layout, triangles, &planted, &rays, &brute);
            }
        }
    }
    assert_silent();
}

#[test]
fn each_ray_is_finished_once_however_many_there_are() {
    let triangles = scattered(300, 10.0, 2.0);
    let planted = plant(builder(), &triangles);
    let kernels = traversal(&planted.tree, Counting::Rays);
    let rays = awkward_rays(&triangles, 65_537);
    let twin = &planted.twin;
    let want: Vec<Hit> = rays.par_iter().map(|ray| twin(ray).0).collect();
    for wave in [Wave::Primary, Wave::Secondary] {
        let size = kernels.kernel(wave).unwrap().workgroup_size() as usize;
        let lanes = gpu().info().subgroup_size as usize;
        let mut sizes = vec![0, 1, 2, 65_537];
        for around in [lanes, size, 2 * size, 8 * size] {
            sizes.extend([around - 1, around, around + 1]);
        }
        for n in sizes {
            let (hits, _) = trace(kernels, Counting::Rays, wave, &planted, &rays[..n]);
            for i in 0..n {
                assert!(agree(hits[i].t, want[i].t, &rays[i], 10.0), "{n} rays, ray {i}: {:?}", hits[i]);
            }
        }
    }
    assert_silent();
}

#[test]
fn scheduling_changes_no_distance() {
    let triangles = scattered(2000, 10.0, 1.0);
    let rays = awkward_rays(&triangles, 5_000);
    for &layout in Layout::ALL {
        let planted = plant(builder_of(layout), &triangles);
        let kernels = traversal(&planted.tree, Counting::Rays);
        let (want, _) = trace(kernels, Counting::Rays, Wave::Primary, &planted, &rays);
        let mut stride = 0;
        for (align, primary_subgroups, secondary_subgroups, fetch_below, postpone_below, vote, stack) in
            [(4, 1, 2, 0.01, 0.0, 0.0, 64), (8, 4, 8, 1.0, 1.0, 0.25, 96), (16, 16, 32, 0.5, 0.5, 4.0, 33)]
        {
            let params = Params {
                primary_subgroups,
                secondary_subgroups,
                primary_fetch_below: fetch_below,
                secondary_fetch_below: fetch_below,
                primary_vote: vote,
                secondary_vote: vote,
                postpone_below,
                stack,
                ..Params::default()
            };
            let build = BuildParams { layout: LayoutParams { align, ..Default::default() }, ..usual(layout) };
            // The distance to the next node decides how many bytes are loaded at a time. Many nodes are
            // multiples of 8 or 16 bytes anyway; the one layout shows what scheduling alone does.
            if layout != Layout::Binary && layout.stride(&build.layout) == stride {
                continue;
            }
            stride = layout.stride(&build.layout);
            let planted = match align {
                4 => &planted,
                _ => &plant(&Builder::new(gpu(), &build, layout).unwrap(), &triangles),
            };
            assert_eq!(planted.tree.stride, layout.node_bytes().next_multiple_of(align as usize));
            let traversal = Traversal::new(gpu(), &params, &planted.tree, Counting::Nothing).unwrap();
            for wave in [Wave::Primary, Wave::Secondary] {
                let (hits, _) = trace(&traversal, Counting::Nothing, wave, planted, &rays);
                // Each is a kernel of its own, which a driver may round differently.
                for ((ray, hit), want) in rays.iter().zip(&hits).zip(&want) {
                    let what = format!("{layout:?}, {params:?}, {wave:?}");
                    assert!(agree(hit.t, want.t, ray, 0.0), "{what}: {ray:?}: {hit:?}, not {want:?}");
                }
            }
        }
    }
    let planted = plant(builder(), &triangles);
    let wrong = Params { primary_subgroups: 1 << 20, ..Params::default() };
    let error = Traversal::new(gpu(), &wrong, &planted.tree, Counting::Nothing).unwrap_err().to_string();
    assert!(error.contains("workgroup"), "{error}");
    assert_silent();
}

#[test]
fn few_votes_and_stragglers_change_no_distance() {
    let triangles = scattered(2000, 10.0, 1.0);
    let rays = awkward_rays(&triangles, 5_003);
    for layout in [Layout::Binary, Layout::Wide6, Layout::Quantized4, Layout::Direct] {
        let planted = plant(builder_of(layout), &triangles);
        for language in languages_of(layout) {
            let traced = |visits_a_vote, search_above, speculate| {
                let params = Params { visits_a_vote, search_above, speculate, language, ..Params::default() };
                let traversal = Traversal::new(gpu(), &params, &planted.tree, Counting::Rays).unwrap();
                trace_and_count(&traversal, Counting::Rays, Wave::Primary, &planted, &rays)
            };
            let (want, _, waiting) = traced(1, 0.0, true);
            for (visits, search, speculate) in
                [(2, 0.0, true), (4, 0.25, true), (1, 1.0, true), (1, 0.0, false), (3, 0.1, false)]
            {
                let (hits, _, utilization) = traced(visits, search, speculate);
                let what = format!("{layout:?}, {language:?}, {visits} visits, {search}, {speculate}");
                for ((ray, hit), want) in rays.iter().zip(&hits).zip(&want) {
                    assert!(agree(hit.t, want.t, ray, 0.0), "{what}: {ray:?}: {hit:?}, not {want:?}");
                }
                assert_ne!(utilization, waiting, "{what}: it makes a difference to the steps");
                // Whoever waits for nobody tests triangles more often, with fewer lanes.
                if search == 1.0 {
                    assert!(utilization.triangle_steps > waiting.triangle_steps, "{what}");
                }
                // Whoever waits with a leaf visits no node that it would not need behind the leaf's triangles.
                if !speculate {
                    assert!(utilization.node_lanes < waiting.node_lanes, "{what}");
                }
            }
        }
    }
    assert_silent();
}

#[test]
fn rays_that_workgroups_end_together_keep_their_distance() {
    let scenes = [("scattered", scattered(3000, 10.0, 1.0)), ("terrain", terrain(2000))].into_iter();
    for (name, triangles) in scenes.chain(awkward(200)) {
        let rays = awkward_rays(&triangles, 2_003);
        for layout in [Layout::Binary, Layout::Wide4, Layout::Wide8, Layout::Quantized6, Layout::Direct] {
            let planted = plant(builder_of(layout), &triangles);
            let alone = traversal(&planted.tree, Counting::Rays);
            let (want, _) = trace(alone, Counting::Rays, Wave::Primary, &planted, &rays);
            for (counting, primary_subgroups, end_together, end_steps, primary_fetch_below, speculate) in [
                (Counting::Rays, 2, 0.1, 1, 0.5, true),
                (Counting::Nothing, 4, 0.5, 2, 0.25, false),
                (Counting::Rays, 8, 1.0, 5, 1.0, false),
            ] {
                let params = Params {
                    end_together,
                    end_steps,
                    primary_subgroups,
                    primary_fetch_below,
                    speculate,
                    octants: !speculate,
                    ..Params::default()
                };
                let together = Traversal::new(gpu(), &params, &planted.tree, counting).unwrap();
                let (hits, _) = trace(&together, counting, Wave::Primary, &planted, &rays);
                for (i, (hit, want)) in hits.iter().zip(&want).enumerate() {
                    let what = format!("{name}, {layout:?}, ray {i}");
                    assert!(agree(hit.t, want.t, &rays[i], 0.0), "{what}: {hit:?}, not {want:?}");
                }
            }
        }
    }
    assert_silent();
}

#[test]
fn octants_change_nothing() {
    let scenes = [("scattered", scattered(3000, 10.0, 1.0)), ("terrain", terrain(2000))].into_iter();
    for (name, triangles) in scenes.chain(awkward(200)) {
        // Rays in the order of their octants, some subgroups in one and some between two.
        let mut rays = awkward_rays(&triangles, 2_003);
        rays.sort_by_key(|ray| ray.direction.map(|d| d < 0.0));
        let planted = plant(builder_of(Layout::Binary), &triangles);
        let [without, with] = [false, true].map(|octants| {
            let params = Params { octants, primary_subgroups: 1, ..Params::default() };
            Traversal::new(gpu(), &params, &planted.tree, Counting::Rays).unwrap()
        });
        let traced =
            |traversal, rays: &[Ray]| trace(traversal, Counting::Rays, Wave::Primary, &planted, rays);
        for (ray, (hit, want)) in
            rays.iter().zip(traced(&with, &rays).0.iter().zip(&traced(&without, &rays).0))
        {
            assert!(agree(hit.t, want.t, ray, 0.0), "{name}, {ray:?}: {hit:?}, not {want:?}");
        }
        // What a ray visits depends on which others it is traced with, and on which comes first of boxes that it starts in.
        // So these start outside.
        let extent = triangles.as_flattened().as_flattened().iter().fold(1e-30f32, |m, x| m.max(x.abs()));
        for ray in &mut rays {
            let back = 8.0 * extent / ray.direction.iter().fold(0f32, |m, x| m.max(x.abs()));
            ray.origin = std::array::from_fn(|k| ray.origin[k] - back * ray.direction[k]);
            (ray.t_min, ray.t_max) = (0.0, f32::INFINITY);
        }
        for rays in rays.chunks(gpu().info().subgroup_size as usize).step_by(8) {
            assert_eq!(traced(&with, rays), traced(&without, rays), "{name}, {rays:?}");
        }
    }
    assert_silent();
}

#[test]
fn packets_change_no_distance_and_test_what_any_of_their_rays_needs() {
    // Rays that go anywhere need most of a tree together, so it is small for drivers that end long loops.
    let scenes = [("scattered", scattered(500, 10.0, 1.0)), ("terrain", terrain(500))].into_iter();
    for (name, triangles) in scenes.chain(awkward(200)) {
        // The last packet has few rays; behind those of a triangle each, one meets nothing. Half of them are in the order of their
        // octants, so that most packets of these are in one, and those of the others in none.
        let mut rays = awkward_rays(&triangles, 1_003);
        rays[500..].sort_by_key(|ray| ray.direction.map(|d| d < 0.0));
        for layout in [Layout::Wide4, Layout::Wide6, Layout::Wide8] {
            let planted = plant(builder_of(layout), &triangles);
            let alone = traversal(&planted.tree, Counting::Rays);
            let (want, alone) = trace(alone, Counting::Rays, Wave::Primary, &planted, &rays);
            for (counting, primary_subgroups, primary_packets) in
                [(Counting::Rays, 4, 1), (Counting::Nothing, 1, 2), (Counting::Rays, 2, 4)]
            {
                let params = Params { primary_packets, primary_subgroups, ..Params::default() };
                let packets = Traversal::new(gpu(), &params, &planted.tree, counting).unwrap();
                let (hits, counts) = trace(&packets, counting, Wave::Primary, &planted, &rays);
                for (i, (hit, want)) in hits.iter().zip(&want).enumerate() {
                    let what = format!("{name}, {layout:?}, ray {i}");
                    assert!(agree(hit.t, want.t, &rays[i], 0.0), "{what}: {hit:?}, not {want:?}");
                }
                if counting == Counting::Rays {
                    // The root, and no box that a ray by itself would not look into if its neighbours held its order.
                    for (i, (count, alone)) in counts.iter().zip(&alone).enumerate() {
                        assert!(
                            count.nodes >= 1 && count.boxes + 1 >= count.nodes,
                            "{name}, ray {i}: {count:?}"
                        );
                        assert!(hits[i].t.is_finite() <= (count.triangles > 0), "{name}, ray {i}: {count:?}");
                        assert!(alone.nodes >= 1);
                    }
                }
            }
        }
    }
    assert_silent();
}

#[test]
fn packets_are_refused_where_there_are_none() {
    let triangles = scattered(100, 10.0, 1.0);
    let packets = Params { primary_packets: 1, ..Params::default() };
    let refusal = |layout, params: &Params| {
        let planted = plant(builder_of(layout), &triangles);
        Traversal::new(gpu(), params, &planted.tree, Counting::Nothing).unwrap_err()
    };
    assert!(matches!(refusal(Layout::Binary, &packets), Error::NoPackets));
    let slang = Params { language: Language::Slang, ..packets.clone() };
    if Language::Slang.missing().is_none() {
        assert!(matches!(refusal(Layout::Wide4, &slang), Error::NoPackets));
    }
    let slang = Params { language: Language::Slang, octants: true, ..Params::default() };
    if Language::Slang.missing().is_none() {
        assert!(matches!(refusal(Layout::Wide4, &slang), Error::GlslOnly));
    }
    let deep = Params { stack: 4096, primary_subgroups: 16, ..packets };
    assert!(matches!(refusal(Layout::Wide8, &deep), Error::PacketStacks { packets: 16, entries: 4096, .. }));
}

#[test]
fn languages_and_techniques_change_no_distance() {
    let triangles = scattered(2000, 10.0, 1.0);
    // Many workgroups of several subgroups, the last of which has few rays.
    let rays = awkward_rays(&triangles, 5_000);
    for &layout in &[Layout::Binary, Layout::Wide6, Layout::Quantized4] {
        let planted = plant(builder_of(layout), &triangles);
        let (want, _) =
            trace(traversal(&planted.tree, Counting::Rays), Counting::Rays, Wave::Primary, &planted, &rays);
        for (language, (barrier, hoist, subgroups)) in languages_of(layout)
            .flat_map(|l| [(true, false, 4), (true, true, 1), (false, true, 3)].map(|t| (l, t)))
        {
            let params = Params {
                primary_subgroups: subgroups,
                secondary_subgroups: subgroups,
                secondary_vote: 0.0,
                stack: 96,
                language,
                technique: Technique { barrier, hoist, reconverge: false },
                ..Params::default()
            };
            let traversal = Traversal::new(gpu(), &params, &planted.tree, Counting::Nothing).unwrap();
            for wave in [Wave::Primary, Wave::Secondary] {
                let (hits, _) = trace(&traversal, Counting::Nothing, wave, &planted, &rays);
                for ((ray, hit), want) in rays.iter().zip(&hits).zip(&want) {
                    let what = format!("{layout:?}, {params:?}, {wave:?}");
                    assert!(agree(hit.t, want.t, ray, 0.0), "{what}: {ray:?}: {hit:?}, not {want:?}");
                }
            }
        }
    }
    assert_silent();
}

/// The traversal in groups, however it is scheduled and in whichever order children are visited.
#[test]
fn schedules_and_orders_of_groups_change_no_distance() {
    let triangles = scattered(3000, 10.0, 1.0);
    let rays = awkward_rays(&triangles, 6_000);
    let planted = plant(builder_of(Layout::Compressed8), &triangles);
    let count = planted.summary.nodes as usize;
    let nodes = planted.workspace.wide.read_nodes::<Compressed8>(count).unwrap();
    let leaves = planted.workspace.wide.stored.triangles.read(triangles.len()).unwrap();
    let brute = brute_force(TriangleTest::Watertight, &triangles, &rays);
    let mut visited = Vec::new();
    for &order in Order::ALL {
        let twin = |ray: &Ray| groups::cpu::closest_hit(&nodes, &leaves, planted.tree.extent, order, ray);
        let twins: Vec<_> = rays.par_iter().map(twin).collect();
        let lost = groups::Params::default();
        let inactive = groups::Params { fetch: Fetch::Inactive, ..groups::Params::default() };
        for (groups, subgroups) in [
            (groups::Params { r_t: 0.0, ..lost }, 8),
            (groups::Params { n_w: 0, n_d: 0, shared_stack: 0, ..lost }, 1),
            (groups::Params { n_w: 64, r_t: 1.0, shared_stack: 16, ..lost }, 4),
            (groups::Params { n_t: 0, shared_stack: 1, ..inactive }, 2),
            (groups::Params { share_triangles: true, ..lost }, 4),
            (groups::Params { share_triangles: true, shared_stack: 2, ..inactive }, 1),
            (groups::Params { share_triangles: true, share_from: 0.6, steal_below: 0.5, ..lost }, 2),
            (groups::Params { steal_below: 1.0, shared_stack: 1, ..inactive }, 4),
            (groups::Params { n_t: 32, r_t: 0.5, shared_stack: 2, ..inactive }, 3),
        ] {
            let params = Params {
                primary_subgroups: subgroups,
                secondary_subgroups: subgroups,
                stack: 1,
                order,
                groups: groups.clone(),
                ..Params::default()
            };
            let traversal = Traversal::new(gpu(), &params, &planted.tree, Counting::Rays).unwrap();
            let (hits, counts, utilization) =
                trace_and_count(&traversal, Counting::Rays, Wave::Secondary, &planted, &rays);
            let what = format!("{order:?}, {groups:?}");
            if (groups.fetch, groups.n_t) == (Fetch::Inactive, 32) {
                // Nobody fetches before all lanes are idle.
                let fewest = rays.len().div_ceil(gpu().info().subgroup_size as usize);
                assert_eq!(utilization.fetches, fewest as u64, "{what}");
            }
            for ((ray, hit), want) in rays.iter().zip(&hits).zip(&brute) {
                assert!(agree(hit.t, want.t, ray, 10.0), "{what}: {ray:?}: {hit:?}, not {want:?}");
            }
            if groups.r_t == 0.0 {
                // Nothing is put off, so each ray takes the way of the twin, but where a box is just touched.
                let same = counts.iter().zip(&twins).filter(|(own, (_, its))| *own == its).count();
                assert!(same * 1000 >= rays.len() * 999, "{what}: {same} of {} as the twin", rays.len());
                visited.push(counts.iter().map(|c| u64::from(c.nodes)).sum::<u64>());
            }
        }
    }
    // Octants come close to distances, and chance does not.
    let [octant, distance, random] = visited[..] else { panic!("three orders") };
    assert!(distance <= octant && 20 * octant < 23 * distance && 20 * random > 21 * octant, "{visited:?}");
    let too_much = groups::Params { shared_stack: 16, ..groups::Params::default() };
    let params = Params { groups: too_much, primary_subgroups: 1 << 20, ..Params::default() };
    let error = Traversal::new(gpu(), &params, &planted.tree, Counting::Nothing).unwrap_err().to_string();
    assert!(error.contains("groups.shared_stack"), "{error}");
    assert_silent();
}

/// Waiting for full subgroups of triangles spares steps at triangles, stealing spares steps at nodes; neither changes a hit,
/// and what all lanes have done for a ray is counted.
#[test]
fn lanes_that_wait_or_steal_take_fewer_steps() {
    let triangles = scattered(3000, 10.0, 1.0);
    let rays = awkward_rays(&triangles, 6_000);
    for test in TriangleTest::ALL {
        let planted = plant(&builder_for(test, Layout::Compressed8), &triangles);
        let alone = groups::Params { share_triangles: true, ..groups::Params::default() };
        let traced = |groups: &groups::Params| {
            let params = Params { groups: groups.clone(), ..Params::default() };
            let traversal = Traversal::new(gpu(), &params, &planted.tree, Counting::Rays).unwrap();
            trace_and_count(&traversal, Counting::Rays, Wave::Secondary, &planted, &rays)
        };
        let (want, _, plain) = traced(&alone);
        for (waits, steals) in [(0.6, 0.0), (1.0, 0.0), (0.0, 0.5), (0.0, 1.0), (0.75, 1.0)] {
            let (hits, counts, own) =
                traced(&groups::Params { share_from: waits, steal_below: steals, ..alone.clone() });
            let what = format!("{test:?}, waiting {waits}, stealing {steals}");
            for ((ray, hit), want) in rays.iter().zip(&hits).zip(&want) {
                assert!(agree(hit.t, want.t, ray, 10.0), "{what}: {ray:?}: {hit:?}, not {want:?}");
            }
            let sum = |of: fn(&Counts) -> u32| counts.iter().map(|c| u64::from(of(c))).sum::<u64>();
            assert_eq!(own.node_lanes, sum(|c| c.nodes), "{what}");
            assert_eq!(own.triangle_lanes, sum(|c| c.triangles), "{what}");
            if waits > 0.0 {
                assert!(own.triangle_steps < plain.triangle_steps, "{what}: {own:?}, without {plain:?}");
            }
            // Those that wait look farther meanwhile.
            if steals > 0.0 && waits == 0.0 {
                assert!(own.node_steps < plain.node_steps, "{what}: {own:?}, without {plain:?}");
            }
        }
    }
    assert_silent();
}

/// Copies of one ray take every step together, and a ray alone takes every step alone.
#[test]
fn utilization_is_whole_for_copies_of_a_ray_and_least_for_one() {
    let triangles = scattered(2000, 10.0, 1.0);
    let size = gpu().info().subgroup_size as usize;
    for &layout in Layout::ALL {
        let planted = plant(builder_of(layout), &triangles);
        // Subgroups that wait for each other in one layout, whose kernels are small.
        let both = [false, true].into_iter().filter(|barrier| !barrier || layout == Layout::Binary);
        for (language, barrier) in languages_of(layout).flat_map(|l| both.clone().map(move |b| (l, b))) {
            let technique = Technique { barrier, ..Technique::default() };
            let in_phases = Params { language, technique, secondary_vote: 0.0, ..Params::default() };
            let own;
            let kernels = if barrier {
                own = Traversal::new(gpu(), &in_phases, &planted.tree, Counting::Rays).unwrap();
                &own
            } else {
                traversal_in(language, &planted.tree, Counting::Rays)
            };
            for wave in [Wave::Primary, Wave::Secondary] {
                let what = format!("{layout:?}, {language:?}, barrier {barrier}, {wave:?}");
                let count = |rays: &[Ray]| trace_and_count(kernels, Counting::Rays, wave, &planted, rays).2;
                let ray = towards([-9.0, 1.0, 2.0], [9.0, -2.0, 1.0]);
                let alone = count(&[ray]);
                assert!(alone.node_steps > 3 && alone.triangle_steps > 0, "{what}: {alone:?}");
                let steps = |u: &Utilization| [u.node_steps, u.triangle_steps, u.fetches];
                let lanes = |u: &Utilization| [u.node_lanes, u.triangle_lanes, u.fetch_lanes];
                assert_eq!(steps(&alone), lanes(&alone), "{what}");
                let copies = count(&vec![ray; 100 * size]);
                assert_eq!(steps(&copies), steps(&alone).map(|n| 100 * n), "{what}");
                assert_eq!(lanes(&copies), steps(&copies).map(|n| size as u64 * n), "{what}");
            }
        }
    }
    assert_silent();
}

#[test]
fn techniques_that_cannot_be_are_errors() {
    let planted = plant(builder(), &scattered(10, 1.0, 1.0));
    let error = |params: Params| {
        Traversal::new(gpu(), &params, &planted.tree, Counting::Nothing).map(drop).unwrap_err().to_string()
    };
    let barrier = Technique { barrier: true, ..Technique::default() };
    let told = error(Params { technique: barrier, secondary_vote: 1.0, ..Params::default() });
    assert!(told.contains("trace.secondary_vote=0"), "{told}");
    let reconverge = Technique { reconverge: true, ..Technique::default() };
    let params = Params { technique: reconverge, ..Params::default() };
    match Traversal::new(gpu(), &params, &planted.tree, Counting::Nothing) {
        Err(error) => assert!(error.to_string().contains("VK_KHR_shader_maximal_reconvergence"), "{error}"),
        Ok(traversal) => {
            let ray = ray([0.0; 3], [1.0, 0.0, 0.0]);
            trace(&traversal, Counting::Nothing, Wave::Primary, &planted, &[ray]);
        }
    }
    assert_silent();
}

#[test]
fn few_triangles_are_hit_in_their_order() {
    for n in [1, 2, 3, 16, 17] {
        // Plates one behind the other, the nearest the last of the file.
        let plates: Vec<Triangle> = (0..n)
            .map(|i| {
                let z = (n - i) as f32;
                [[-1.0, -1.0, z], [1.0, -1.0, z], [0.0, 1.0, z]]
            })
            .collect();
        let mut rays = vec![ray([0.0; 3], [0.0, 0.0, -1.0]), ray([2.0, 0.0, 0.0], [0.0, 0.0, 1.0])];
        let mut want = vec![Hit::NONE, Hit::NONE];
        for i in 0..n {
            let t = (n - i) as f32;
            let hit = Hit { t, triangle: i as u32 };
            rays.push(Ray { t_min: t - 0.5, ..ray([0.0; 3], [0.0, 0.0, 1.0]) });
            want.push(hit);
            // Limits just in front of it and just behind it.
            rays.push(Ray { t_min: t - 0.9, t_max: t * 0.99999, ..ray([0.0; 3], [-0.0, 0.0, 1.0]) });
            want.push(Hit::NONE);
            rays.push(Ray { t_min: t - 0.9, t_max: t * 1.00001, ..ray([0.0; 3], [0.0, -0.0, 1.0]) });
            want.push(hit);
            // From behind, and in half lengths.
            rays.push(Ray { t_max: 2.5, ..ray([0.1, -0.1, t + 1.0], [0.0, 0.0, -0.5]) });
            want.push(Hit { t: 2.0, ..hit });
        }
        for &layout in Layout::ALL {
            let planted = plant(builder_of(layout), &plates);
            let kernels = traversal(&planted.tree, Counting::Rays);
            let (hits, counts) = trace(kernels, Counting::Rays, Wave::Secondary, &planted, &rays);
            for ((ray, hit), want) in rays.iter().zip(&hits).zip(&want) {
                let same = hit.triangle == want.triangle && agree(hit.t, want.t, ray, 0.0);
                assert!(same, "{n} triangles, {layout:?}: {ray:?}: {hit:?}, not {want:?}");
            }
            assert!(counts.iter().all(|c| c.triangles as usize <= n));
            assert_eq!(counts[1].triangles, 0, "{n} triangles, {layout:?}: a ray beside all boxes");
        }
    }
    assert_silent();
}

#[test]
fn a_tree_deeper_than_the_stack_gets_a_larger_one() {
    // Tilted triangles around the origin, each 1.05 times as large as the last: boxes one in the next, so
    // every level of the tree is one triangle and all the smaller ones. A ray from the middle lies in all
    // boxes and puts the other child of each level on the stack.
    let n = 120;
    let corners = [[-1.0, -1.0, 0.5], [1.0, -1.0, 1.0], [0.0, 1.0, 1.5]];
    let mut triangles: Vec<Triangle> =
        (0..n).map(|i| corners.map(|p| p.map(|x| x * 1.05f32.powi(i)))).collect();
    triangles.iter_mut().for_each(|t| t[0][2] *= -1.0);
    let collapse = CollapseParams { max_leaf: 1, ..CollapseParams::default() };
    let params = BuildParams { collapse, ..BuildParams::default() };
    let mut random = Random(11);
    let rays: Vec<Ray> = (0..4000)
        .map(|i| {
            let mut at = random.point(2.0);
            // Half of them towards the triangles, the others anywhere.
            if i % 2 == 0 {
                at = [0.3 * at[0], 0.3 * at[1], 0.5];
            }
            Ray { t_min: if i % 3 == 0 { 300.0 * random.unit() } else { 0.0 }, ..ray([0.0; 3], at) }
        })
        .collect();
    let want = brute_force(TriangleTest::Watertight, &triangles, &rays);
    for &layout in Layout::ALL {
        let builder = Builder::new(gpu(), &params, layout).unwrap();
        for order in ["from small to large", "from large to small"] {
            let what = format!("{layout:?}, {order}");
            let planted = plant(&builder, &triangles);
            let tree = &planted.tree;
            // With k children a node one goes on and k - 1 wait.
            let levels = 100 / (layout.arity() as u32 - 1);
            assert!(planted.summary.depth > levels, "{what}: only {} levels", planted.summary.depth);
            let kernels = traversal(tree, Counting::Rays);
            // Of groups, two for each.
            let least = if layout.is_compressed() { 2 * levels } else { 100 };
            assert!(tree.stack > least && kernels.stack() >= tree.stack, "{what}: {tree:?}");
            for wave in [Wave::Primary, Wave::Secondary] {
                let (hits, counts) = trace(kernels, Counting::Rays, wave, &planted, &rays);
                for ((ray, hit), want) in rays.iter().zip(&hits).zip(&want) {
                    assert!(agree(hit.t, want.t, ray, 1.0), "{what}: {ray:?}: {hit:?}, not {want:?}");
                }
                let found = hits.iter().filter(|h| h.triangle != Hit::MISS).count();
                assert!((1500..3500).contains(&found), "{what}: {found} hits");
                assert!(counts.iter().any(|c| c.nodes > levels), "{what}: some ray goes all the way down");
            }
            triangles.reverse();
        }
    }
    assert_silent();
}

#[test]
fn a_lost_ray_is_an_error() {
    let queue = Queue { next: 300, count: 300, finished: 298, unused: 0 };
    let planted = plant(builder(), &scattered(1, 1.0, 1.0));
    let kernels = traversal(&planted.tree, Counting::Rays);
    match kernels.check(3, &queue) {
        Err(Error::LoopLimit { depth: 3, unfinished: 2, rays: 300, device }) => {
            assert_eq!(device, gpu().info().name);
        }
        other => panic!("{other:?}"),
    }
    assert!(kernels.check(0, &Queue { finished: 300, ..queue }).is_ok());
}

/// Rays from inside a closed mesh: at its corners, at points of its edges, and anywhere.
fn rays_from_inside(
    (corners, faces): &(Vec<Point>, Vec<[usize; 3]>),
    random: &mut Random,
    centre: Point,
    radius: f32,
    n: usize,
) -> Vec<Ray> {
    (0..n)
        .map(|i| {
            let offset = random.point(2.0 * radius / 3f32.sqrt());
            let origin: Point = std::array::from_fn(|k| centre[k] + offset[k]);
            let face = faces[random.next() as usize % faces.len()];
            let side = random.next() as usize % 3;
            let (a, b) = (corners[face[side]], corners[face[(side + 1) % 3]]);
            let along = random.unit();
            match i % 4 {
                0 => towards(origin, a),
                1 => towards(origin, std::array::from_fn(|k| a[k] + (b[k] - a[k]) * along)),
                2 => towards(
                    centre,
                    if along < 0.5 { a } else { std::array::from_fn(|k| 0.5 * (a[k] + b[k])) },
                ),
                _ => ray(origin, random.point(2.0)),
            }
        })
        .filter(|r| r.direction != [0.0; 3])
        .collect()
}

/// A closed mesh with hills and valleys whose every point can be seen from half its radius.
fn bumpy(levels: u32, radius: f32, centre: Point) -> (Vec<Point>, Vec<[usize; 3]>) {
    let (mut corners, faces) = icosphere(levels);
    for p in &mut corners {
        let height = 1.0 + 0.05 * (7.0 * p[0]).sin() * (9.0 * p[1]).cos() + 0.02 * (23.0 * p[2]).sin();
        *p = std::array::from_fn(|k| centre[k] + p[k] * height * radius);
    }
    (corners, faces)
}

#[test]
fn no_ray_leaves_a_closed_mesh_through_an_edge_or_a_corner() {
    // Of the million, a part in a mesh far from the origin, where coordinates are coarse, and in tiny and
    // huge ones.
    for (launches, radius, centre) in [
        (10, 1.0, [0.0; 3]),
        (2, 1.0, [1000.0, -2000.0, 500.0]),
        (2, 1e-6, [0.0; 3]),
        (2, 1e6, [1e6, 0.0, 3e5]),
    ] {
        let closed = bumpy(5, radius, centre);
        let planted = plant(builder(), &mesh(&closed));
        let mut random = Random(radius.to_bits().into());
        for _ in 0..launches {
            let rays = rays_from_inside(&closed, &mut random, centre, 0.4 * radius, 65_536);
            let (hits, _) = trace(
                traversal(&planted.tree, Counting::Rays),
                Counting::Rays,
                Wave::Secondary,
                &planted,
                &rays,
            );
            for (ray, hit) in rays.iter().zip(&hits) {
                let length = ray.direction.iter().map(|d| d * d).sum::<f32>().sqrt();
                let distance = hit.t * length / radius;
                assert!((0.4..1.6).contains(&distance), "radius {radius}: {ray:?} hits {hit:?}");
            }
        }
    }
    assert_silent();
}

#[test]
fn no_ray_leaves_a_box_of_twelve_triangles() {
    let corners: Vec<Point> =
        (0..8).map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 1 { 1.0 } else { -1.0 })).collect();
    let faces: Vec<[usize; 3]> =
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect();
    for (scale, offset) in [(1.0, 0.0), (1000.0, 0.0), (0.37, 100.0)] {
        let corners: Vec<Point> = corners.iter().map(|p| p.map(|x| x * scale + offset)).collect();
        let closed = (corners, faces.clone());
        let planted = plant(builder(), &mesh(&closed));
        let centre = [offset; 3];
        let mut rays = rays_from_inside(&closed, &mut Random(5), centre, scale, 20_000);
        // Along the axes and diagonals from a lattice of points, among them those that run along the
        // faces' own diagonals and towards the middles of edges.
        let directions = (0..27).map(|i| [i % 3, i / 3 % 3, i / 9].map(|x| x as f32 - 1.0));
        for direction in directions.filter(|d| *d != [0.0; 3]) {
            for i in 0..343 {
                let at = [i % 7, i / 7 % 7, i / 49].map(|x| (x as f32 - 3.0) * 0.25 * scale + offset);
                rays.push(ray(at, direction));
                rays.push(ray(at, direction.map(|d| if d == 0.0 { -0.0 } else { d * 0.01 })));
            }
        }
        let (hits, _) =
            trace(traversal(&planted.tree, Counting::Rays), Counting::Rays, Wave::Secondary, &planted, &rays);
        for (ray, hit) in rays.iter().zip(&hits) {
            assert!(hit.t.is_finite() && hit.t > 0.0, "scale {scale}: {ray:?} hits {hit:?}");
        }
    }
    assert_silent();
}

#[test]
fn refined_distances_are_exact_to_the_last_place() {
    // Corners, origins and directions that are small whole numbers: the exact distance is a fraction of
    // integers.
    let mut random = Random(17);
    let mut whole = |range: i64| -> [i64; 3] {
        std::array::from_fn(|_| (random.next() % (2 * range as u64 + 1)) as i64 - range)
    };
    let sub = |a: [i64; 3], b: [i64; 3]| -> [i64; 3] { std::array::from_fn(|k| a[k] - b[k]) };
    let cross = |a: [i64; 3], b: [i64; 3]| -> [i64; 3] {
        std::array::from_fn(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
    };
    let dot = |a: [i64; 3], b: [i64; 3]| (0..3).map(|k| i128::from(a[k]) * i128::from(b[k])).sum::<i128>();
    let float = |a: [i64; 3]| a.map(|x| x as f32);
    let mut checked = 0;
    while checked < 20_000 {
        let [v0, v1, v2] = [whole(1000), whole(1000), whole(1000)];
        let (origin, direction) = (whole(5000), whole(300));
        let normal = cross(sub(v1, v0), sub(v2, v0));
        let (over, under) = (dot(normal, sub(v0, origin)), dot(normal, direction));
        if under == 0 || (over < 0) != (under < 0) || over == 0 {
            continue;
        }
        let exact = over as f64 / under as f64;
        let ray = ray(float(origin), float(direction));
        let triangle = [v0, v1, v2].map(float);
        // A distance that is wrong in its fourth digit is mended; one that is from elsewhere is kept.
        for rough in [exact as f32, (exact * 1.0005) as f32, (exact * 0.9995) as f32] {
            let refined = cpu::refine(&ray, &triangle, rough);
            let nearest = exact as f32;
            let off = (i64::from(refined.to_bits()) - i64::from(nearest.to_bits())).abs();
            assert!(off <= 1, "{ray:?}, {triangle:?}: {refined}, exactly {exact}");
        }
        // As far as the farthest corner is from the ray's origin, a distance cannot be off.
        let reach = 2.0 * 6000.0 * 3f64.sqrt()
            / f64::from(direction.map(|x| (x * x) as f32).iter().sum::<f32>().sqrt());
        let elsewhere = (1.01 * exact + reach) as f32;
        assert_eq!(cpu::refine(&ray, &triangle, elsewhere), elsewhere);
        checked += 1;
    }
    // In the plane there is nothing to refine.
    let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    assert_eq!(cpu::refine(&ray([0.2, -1.0, 0.0], [0.0, 1.0, 0.0]), &flat, 1.25), 1.25);
}

#[test]
fn refining_brings_the_kernels_distances_to_a_millionth() {
    let triangles = scattered(1000, 10.0, 1.0);
    let planted = plant(builder(), &triangles);
    let rays: Vec<Ray> = awkward_rays(&triangles, 8_000);
    let (hits, _) =
        trace(traversal(&planted.tree, Counting::Rays), Counting::Rays, Wave::Primary, &planted, &rays);
    let exact = |ray: &Ray, t: &Triangle| {
        let d = |a: Point| a.map(f64::from);
        let sub = |a: Point, b: Point| -> [f64; 3] { std::array::from_fn(|k| d(a)[k] - d(b)[k]) };
        let (p, q, s) = (sub(t[1], t[0]), sub(t[2], t[0]), sub(t[0], ray.origin));
        let normal: [f64; 3] =
            std::array::from_fn(|k| p[(k + 1) % 3] * q[(k + 2) % 3] - p[(k + 2) % 3] * q[(k + 1) % 3]);
        let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
        dot(normal, s) / dot(normal, d(ray.direction))
    };
    let mut coarse = 0;
    for (ray, hit) in rays.iter().zip(&hits).filter(|(_, h)| h.triangle != Hit::MISS) {
        let triangle = &triangles[hit.triangle as usize];
        let (want, got) = (exact(ray, triangle), f64::from(cpu::refine(ray, triangle, hit.t)));
        if (f64::from(hit.t) - want).abs() <= 1e-3 * want.abs() {
            assert!((got - want).abs() <= 1e-6 * want.abs(), "{ray:?}: {hit:?}, {got}, exactly {want}");
        } else {
            coarse += 1;
        }
    }
    // Rays that start on a surface, or graze one, have no fourth digit to begin with.
    assert!(coarse < rays.len() / 20, "{coarse} hits are too coarse to refine");
    assert_silent();
}

#[test]
fn what_does_not_fit_the_heap_is_an_error_with_a_way_out() {
    let heap = gpu().info().memory_bytes;
    for bytes in [1 << 40, u64::MAX / 2, heap + 1] {
        match gpu().buffer("a very large thing", bytes) {
            Err(error @ tracer::gpu::Error::OutOfMemory { .. }) => {
                let text = error.to_string();
                assert!(text.contains("a very large thing") && text.contains("smaller"), "{text}");
            }
            other => panic!("{bytes} bytes: {other:?}"),
        }
    }
    assert!(gpu().buffer("nothing", 0).is_ok());
    assert_silent();
}
