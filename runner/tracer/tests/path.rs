//! Path tracing where the answer is known: closed rooms, furnaces, lone objects, the sky.

mod support;

use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use support::{
    Planted, assert_silent, awkward, builder, builder_for, gpu, icosphere, mesh, plant, scattered, scene,
    traversal, view,
};
use tracer::{
    Error,
    builder::{BuildParams, Widen},
    bvh2::Triangle,
    contract::{ContractParams, Contraction, VisitCounter, Visits},
    layout::Layout,
    path::{
        Camera, DeviceScene, Integrator, Params, PathTracer, Sample, Sampling, Shading, SingleKernel,
        Wavefront, phong,
    },
    scene::{self as scenes, Light, Material, Phong, Scene, SearchPath, Sky, View},
    traverse::{self, Counting, Counts, Hit, Ray, Traversal, Tree, TriangleTest},
};

type Point = [f32; 3];

const SIZE: (u32, u32) = (256, 144);
const PIXELS: usize = 256 * 144;

/// Traces `samples` paths a pixel and returns the sums of radiance and what each sample was made of.
fn render(
    scene: &Scene,
    view: &View,
    params: &Params,
    traversal: &traverse::Params,
    samples: u32,
) -> (Vec<[f32; 4]>, Vec<Sample>) {
    let planted = plant(builder(), &scene.positions);
    let device = DeviceScene::upload(gpu(), scene).unwrap();
    let traversal = Traversal::new(gpu(), traversal, &planted.tree, Counting::Nothing).unwrap();
    let tracer = PathTracer::new(gpu(), &device, SIZE, params, false).unwrap();
    let camera = Camera::new(view, SIZE.0, SIZE.1);
    tracer.clear().unwrap();
    let samples = (0..samples)
        .map(|sample| tracer.sample(&traversal, &planted.tree, &camera, sample).unwrap())
        .collect();
    (tracer.picture().unwrap(), samples)
}

/// Every wavefront of one path a pixel.
fn wavefronts(scene: &Scene, view: &View, params: &Params, sample: u32) -> Vec<Wavefront> {
    let planted = plant(builder(), &scene.positions);
    let device = DeviceScene::upload(gpu(), scene).unwrap();
    let traversal =
        Traversal::new(gpu(), &traverse::Params::default(), &planted.tree, Counting::Nothing).unwrap();
    let tracer = PathTracer::new(gpu(), &device, SIZE, params, false).unwrap();
    let camera = Camera::new(view, SIZE.0, SIZE.1);
    tracer.clear().unwrap();
    let mut waves = Vec::new();
    tracer
        .wavefronts(&traversal, &planted.tree, &camera, sample, |wave| {
            waves.push(wave);
            true
        })
        .unwrap();
    waves
}

fn sub(a: Point, b: Point) -> [f64; 3] {
    std::array::from_fn(|k| f64::from(a[k]) - f64::from(b[k]))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

fn normal([a, b, c]: &Triangle) -> [f64; 3] {
    let (u, v) = (sub(*b, *a), sub(*c, *a));
    let n: [f64; 3] =
        std::array::from_fn(|k| u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3]);
    n.map(|x| x / dot(n, n).sqrt())
}

/// Whether two triangles lie in one plane, to a part in a hundred thousand.
fn coplanar(a: &Triangle, b: &Triangle) -> bool {
    let n = normal(a);
    let size = a.iter().chain(b).flatten().fold(0f32, |m, x| m.max(x.abs()));
    b.iter().all(|p| dot(n, sub(*p, a[0])).abs() < 1e-5 * f64::from(size))
}

/// No ray leaves a closed scene, none meets the surface it starts from, and none sees a surface from
/// behind, as it would from outside the scene or from inside a closed object. Returns the secondary rays.
fn assert_nothing_leaks(
    what: &str,
    scene: &Scene,
    waves: &[Wavefront],
    two_sided: &[u32],
    sign: f64,
) -> usize {
    let mut secondary = 0;
    let mut before: HashMap<u32, u32> = HashMap::new();
    for wave in waves {
        if wave.depth > 0 {
            secondary += wave.rays.len();
            assert_eq!(
                wave.rays.len(),
                before.len(),
                "{what}: every ray of depth {} goes on",
                wave.depth - 1
            );
        }
        let mut now = HashMap::new();
        for ((ray, hit), pixel) in wave.rays.iter().zip(&wave.hits).zip(&wave.pixels) {
            let depth = wave.depth;
            assert_ne!(hit.triangle, Hit::MISS, "{what}, depth {depth}, pixel {pixel}: {ray:?} leaves");
            let met = &scene.positions[hit.triangle as usize];
            if let Some(&from) = before.get(pixel) {
                assert_ne!(from, hit.triangle, "{what}, depth {depth}: {ray:?} meets its own triangle");
                let own = &scene.positions[from as usize];
                assert!(!coplanar(own, met), "{what}, depth {depth}: {ray:?} meets the plane it starts from");
            } else {
                assert_eq!(depth, 0, "{what}: a ray without a past");
            }
            if !two_sided.contains(&scene.material_ids[hit.triangle as usize]) {
                let facing = dot(normal(met), ray.direction.map(f64::from)) * sign;
                assert!(facing < 0.0, "{what}, depth {depth}: {ray:?} sees {hit:?} from behind");
            }
            assert!(now.insert(*pixel, hit.triangle).is_none(), "{what}: two rays of one pixel");
        }
        before = now;
    }
    secondary
}

#[test]
fn no_path_leaves_a_closed_room_or_meets_the_surface_it_starts_from() {
    let room = scenes::load("cornell", &SearchPath::only([])).unwrap();
    let lamp = room.materials.iter().position(|m| m.name == "light").unwrap() as u32;
    let mut secondary = 0;
    for (view, sample) in [(0, 0), (5, 1)] {
        let waves = wavefronts(&room, &room.views[view], &Params::default(), sample);
        assert_eq!(waves.len(), 8);
        assert!(waves.iter().all(|w| w.rays.len() == PIXELS));
        secondary += assert_nothing_leaks("room", &room, &waves, &[lamp], 1.0);
    }
    assert!(secondary >= 400_000, "{secondary}");
    // The same room far from the origin, where coordinates have fewer digits behind the point.
    let mut far = room.clone();
    far.positions
        .iter_mut()
        .flatten()
        .for_each(|p| *p = std::array::from_fn(|k| p[k] + [300.0, -100.0, 50.0][k]));
    let mut seen = room.views[0].clone();
    for p in [&mut seen.eye, &mut seen.target] {
        *p = std::array::from_fn(|k| p[k] + [300.0, -100.0, 50.0][k]);
    }
    let waves = wavefronts(&far, &seen, &Params { depth: 3, seed: 5, ..Params::default() }, 0);
    assert_nothing_leaks("room far away", &far, &waves, &[lamp], 1.0);
    assert_silent();
}

#[test]
fn a_furnace_has_the_radiance_of_the_geometric_series() {
    let albedo = [0.2, 0.5, 0.8];
    let emission = [1.0, 2.0, 0.5];
    let sphere = scene(mesh(&icosphere(5)), albedo, emission, [100.0; 3]);
    let inside = view([0.1, -0.2, 0.05], [1.0, 0.3, -0.5], 90.0);
    let waves = wavefronts(&sphere, &inside, &Params::default(), 0);
    assert!(assert_nothing_leaks("sphere", &sphere, &waves, &[], -1.0) > 250_000);
    for depth in [1, 2, 3, 8] {
        let (picture, samples) = render(
            &sphere,
            &inside,
            &Params { depth, seed: 1, ..Params::default() },
            &traverse::Params::default(),
            1,
        );
        assert_eq!(samples[0].waves.len(), depth as usize);
        assert!(samples[0].waves.iter().all(|w| w.rays == PIXELS as u64), "{:?}", samples[0]);
        for channel in 0..3 {
            let (a, e) = (f64::from(albedo[channel]), f64::from(emission[channel]));
            let want: f64 = (0..depth).map(|k| e * a.powi(k as i32)).sum();
            for (pixel, got) in picture.iter().enumerate() {
                let off = (f64::from(got[channel]) - want).abs();
                assert!(
                    off < 1e-5 * want,
                    "depth {depth}, pixel {pixel}: {got:?}, channel {channel} is {want}"
                );
            }
        }
    }
    assert_silent();
}

#[test]
fn a_lone_white_object_under_a_white_sky_cannot_be_seen() {
    for (radius, centre) in [(1.0, [0.0; 3]), (20.0, [500.0, 0.0, -800.0]), (1e-3, [0.0; 3])] {
        let (mut corners, faces) = icosphere(4);
        corners.iter_mut().for_each(|p| *p = std::array::from_fn(|k| centre[k] + radius * p[k]));
        let ball = scene(mesh(&(corners, faces)), [1.0; 3], [0.0; 3], [1.0; 3]);
        let eye = std::array::from_fn(|k| centre[k] + radius * [0.3, 0.7, 1.6][k]);
        let (picture, samples) =
            render(&ball, &view(eye, centre, 80.0), &Params::default(), &traverse::Params::default(), 3);
        for sample in &samples {
            // Nothing on a convex object sees another part of it.
            let waves: Vec<u64> = sample.waves.iter().map(|w| w.rays).collect();
            assert_eq!(waves.len(), 2, "radius {radius}: rays of each depth: {waves:?}");
            assert!(waves[1] > PIXELS as u64 / 10, "{waves:?}");
        }
        for got in &picture {
            assert!(got[..3].iter().all(|x| (x - 3.0).abs() < 3e-5), "radius {radius}: {got:?}");
        }
    }
    assert_silent();
}

#[test]
fn the_sky_is_what_the_scene_says() {
    let mut empty = scene(scattered(4, 1.0, 0.1), [0.5; 3], [0.0; 3], [0.0; 3]);
    empty.sky = Sky { zenith: [1.0, 2.0, 3.0], horizon: [5.0, 6.0, 7.0], ground: [0.25, 0.5, 0.75] };
    let away = view([0.0, 50.0, 0.0], [60.0, 60.0, 1.0], 100.0);
    let waves = wavefronts(&empty, &away, &Params { depth: 1, ..Params::default() }, 0);
    let (picture, _) =
        render(&empty, &away, &Params { depth: 1, ..Params::default() }, &traverse::Params::default(), 1);
    let (mut up, mut down) = (0, 0);
    for (ray, &pixel) in waves[0].rays.iter().zip(&waves[0].pixels) {
        let want = empty.sky.radiance(ray.direction);
        let got = picture[pixel as usize];
        assert!((0..3).all(|k| (got[k] - want[k]).abs() < 1e-4), "{ray:?}: {got:?}, not {want:?}");
        *(if ray.direction[1] > 0.0 { &mut up } else { &mut down }) += 1;
    }
    assert!(up > 5000 && down > 5000, "{up} up, {down} down");
    assert_silent();
}

#[test]
fn a_picture_depends_on_its_seed_and_on_nothing_else() {
    let room = scenes::load("cornell:triangles=2000", &SearchPath::only([])).unwrap();
    let eight = Params { depth: 4, seed: 3, ..Params::default() };
    let usual = traverse::Params::default();
    let bits = |p: &[[f32; 4]]| p.as_flattened().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    let (first, _) = render(&room, &room.views[0], &eight, &usual, 2);
    let (again, _) = render(&room, &room.views[0], &eight, &usual, 2);
    assert!(bits(&first) == bits(&again), "the same seed gives the same bytes");
    let other_launch = traverse::Params {
        primary_subgroups: 1,
        secondary_subgroups: 3,
        primary_fetch_below: 1.0,
        primary_vote: 1.0,
        secondary_vote: 0.0,
        ..usual.clone()
    };
    let (launched, _) = render(&room, &room.views[0], &eight, &other_launch, 2);
    // Where a ray meets an edge, the order in which triangles are tested decides between its sides.
    let same = first.iter().zip(&launched).filter(|(a, b)| a == b).count();
    assert!(same > PIXELS * 999 / 1000, "{same} of {PIXELS} pixels are the same however rays are scheduled");
    let (seeded, _) = render(&room, &room.views[0], &Params { seed: 4, ..eight.clone() }, &usual, 2);
    let lit: Vec<_> = first.iter().zip(&seeded).filter(|(a, b)| a != b || a[0] > 0.0).collect();
    let same = lit.iter().filter(|(a, b)| a == b).count();
    assert!(same < lit.len() / 4, "another seed changes the picture, but {same} of {} pixels", lit.len());
    let mean = |p: &[[f32; 4]]| p.iter().map(|x| f64::from(x[1])).sum::<f64>() / p.len() as f64;
    assert!((mean(&first) / mean(&seeded) - 1.0).abs() < 0.05, "but not how bright it is");
    assert!(first.as_flattened().iter().all(|x| x.is_finite() && *x >= 0.0));
    assert_silent();
}

/// Pearson's statistic of numbers in 0 to 1 against the uniform distribution, less its mean and in units of
/// its standard deviation.
fn unevenness(numbers: impl Iterator<Item = f64>, bins: usize) -> f64 {
    let mut counts = vec![0u32; bins];
    let mut n = 0;
    for x in numbers {
        assert!((0.0..=1.0).contains(&x), "{x}");
        counts[((x * bins as f64) as usize).min(bins - 1)] += 1;
        n += 1;
    }
    let mean = f64::from(n) / bins as f64;
    let statistic: f64 = counts.iter().map(|&c| (f64::from(c) - mean).powi(2) / mean).sum();
    let freedom = (bins - 1) as f64;
    (statistic - freedom) / (2.0 * freedom).sqrt()
}

#[test]
fn secondary_rays_follow_the_cosine_and_are_independent() {
    // A floor that fills the picture, under a ceiling so large that every ray meets it, and so on.
    let quad = |y: f32, up: bool| -> [Triangle; 2] {
        let (a, b, c, d) = ([-1e4, y, -1e4], [1e4, y, -1e4], [1e4, y, 1e4], [-1e4, y, 1e4]);
        if up { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] }
    };
    let triangles = [quad(0.0, true), quad(10.0, false)].concat();
    let layers = scene(triangles, [0.5; 3], [0.0; 3], [1.0; 3]);
    let down = View { up: [0.0, 0.0, -1.0], ..view([0.0, 9.0, 0.0], [0.0, 0.0, 0.0], 60.0) };
    let mut previous: Option<Vec<(f64, f64)>> = None;
    for (seed, sample) in [(0, 0), (0, 1), (1, 0)] {
        let waves = wavefronts(&layers, &down, &Params { depth: 3, seed, ..Params::default() }, sample);
        let n = waves[1].rays.len();
        assert_eq!(n, PIXELS);
        for wave in &waves[1..3] {
            let sign = if wave.depth == 1 { 1.0 } else { -1.0 };
            let cosines = || wave.rays.iter().map(|r| f64::from(r.direction[1]) * sign);
            assert!(wave.rays.iter().all(|r| {
                let d = r.direction.map(f64::from);
                (dot(d, d) - 1.0).abs() < 1e-5 && r.t_min == 0.0 && r.t_max == f32::INFINITY
            }));
            if wave.depth == 1 {
                let mean = cosines().sum::<f64>() / n as f64;
                // Five standard deviations of the mean: those of a cosine are 1/sqrt(18).
                assert!(
                    (mean - 2.0 / 3.0).abs() < 5.0 * (1.0 / 18.0 / n as f64).sqrt(),
                    "mean cosine {mean}"
                );
            }
            // Under a density of cosine / pi, the cosine's square is uniform, and so is the azimuth.
            assert!(unevenness(cosines().map(|c| (c * c).min(1.0)), 64) < 6.0, "depth {}", wave.depth);
            let azimuth = |r: &Ray| {
                let turn = f64::from(r.direction[2]).atan2(f64::from(r.direction[0]));
                (turn / std::f64::consts::TAU + 1.0) % 1.0
            };
            assert!(unevenness(wave.rays.iter().map(azimuth), 64) < 6.0, "depth {}", wave.depth);
        }
        // Pairs of numbers: both of one ray, neighbours in the picture, two samples or seeds of a pixel.
        let mut by_pixel: Vec<(f64, f64)> = vec![(0.0, 0.0); PIXELS];
        for (ray, &pixel) in waves[1].rays.iter().zip(&waves[1].pixels) {
            let d = ray.direction.map(f64::from);
            by_pixel[pixel as usize] =
                (1.0 - (d[1] * d[1]).min(1.0), (d[2].atan2(d[0]) / std::f64::consts::TAU + 1.0) % 1.0);
        }
        let pairs = |list: Vec<(f64, f64)>| {
            let joint = list.iter().map(|&(a, b)| {
                let row = (a * 16.0).floor().min(15.0);
                (row * 16.0 + (b * 16.0).floor().min(15.0) + 0.5) / 256.0
            });
            unevenness(joint, 256)
        };
        assert!(pairs(by_pixel.clone()) < 6.0, "the two numbers of a ray");
        let neighbours = by_pixel.windows(2).map(|w| (w[0].0, w[1].0)).collect();
        assert!(pairs(neighbours) < 6.0, "numbers of neighbouring pixels");
        if let Some(previous) = &previous {
            let both = previous.iter().zip(&by_pixel).map(|(a, b)| (a.0, b.0)).collect();
            assert!(pairs(both) < 6.0, "numbers of two samples");
        }
        previous = Some(by_pixel);
    }
    assert_silent();
}

#[test]
fn primary_rays_are_spread_evenly_over_their_pixels() {
    let anything = scene(scattered(4, 1.0, 0.1), [0.5; 3], [0.0; 3], [0.0; 3]);
    // At 90 degrees the picture's half height is 1 at distance 1.
    let ahead = view([0.0; 3], [0.0, 0.0, -1.0], 90.0);
    let waves = wavefronts(&anything, &ahead, &Params { depth: 1, seed: 9, ..Params::default() }, 4);
    let place = |r: &Ray, pixel: u32| {
        let [x, y, z] = r.direction.map(f64::from);
        let half = f64::from(SIZE.1) / 2.0;
        let column = x / -z * half + f64::from(SIZE.0) / 2.0;
        let row = half - y / -z * half;
        // Rounding may put a point on the edge of its pixel.
        let within = |at: f64, pixel: u32| (at - f64::from(pixel)).clamp(-1e-3, 1.0 + 1e-3).clamp(0.0, 1.0);
        let (u, v) = (within(column, pixel % SIZE.0), within(row, pixel / SIZE.0));
        assert!((column - f64::from(pixel % SIZE.0) - u).abs() < 1e-3, "{r:?} is not in pixel {pixel}");
        assert!((row - f64::from(pixel / SIZE.0) - v).abs() < 1e-3, "{r:?} is not in pixel {pixel}");
        (u, v)
    };
    let places: Vec<_> = waves[0].rays.iter().zip(&waves[0].pixels).map(|(r, &p)| place(r, p)).collect();
    assert_eq!(places.len(), PIXELS);
    assert!(unevenness(places.iter().map(|p| p.0), 64) < 6.0);
    assert!(unevenness(places.iter().map(|p| p.1), 64) < 6.0);
    assert_silent();
}

#[test]
fn awkward_scenes_give_finite_pictures() {
    let mut random = support::Random(23);
    // Corners on a line, where rounding gives a triangle an area as seen by some rays.
    let on_a_line: Vec<Triangle> = (0..500)
        .map(|_| {
            let (a, b) = (random.point(10.0), random.point(10.0));
            [a, b, std::array::from_fn(|k| a[k] + 2.0 * (b[k] - a[k]))]
        })
        .collect();
    let mut scenes = awkward(300);
    scenes.push(("on a line", on_a_line));
    scenes.push(("very tiny", scattered(300, 1e-11, 1e-12)));
    scenes.push(("very huge", scattered(300, 1e10, 1e9)));
    for (what, triangles) in scenes {
        let lit = scene(triangles, [0.8; 3], [0.1; 3], [1.0; 3]);
        let (lo, hi) = lit.bounds();
        let middle = std::array::from_fn(|k| 0.5 * lo[k] + 0.5 * hi[k]);
        let reach = (0..3).fold(0f32, |m, k| m.max(hi[k] - lo[k])).max(1e-20);
        let eye = std::array::from_fn(|k| middle[k] + reach * [0.3, 0.4, 0.9][k]);
        let (picture, _) = render(
            &lit,
            &view(eye, middle, 70.0),
            &Params { depth: 4, ..Params::default() },
            &traverse::Params::default(),
            1,
        );
        let bad = picture.iter().filter(|p| !p.iter().all(|x| (0.0..10.0).contains(x))).count();
        assert_eq!(bad, 0, "{what}: pixels that are not finite");
    }
    assert_silent();
}

/// A room whose far half no primary ray sees, with a tree over it and what sample rays need.
struct Sampled<'s> {
    scene: &'s Scene,
    device: DeviceScene,
    planted: Planted,
    counter: VisitCounter,
}

impl<'s> Sampled<'s> {
    fn new(scene: &'s Scene) -> Self {
        Self {
            scene,
            device: DeviceScene::upload(gpu(), scene).unwrap(),
            planted: plant(builder(), &scene.positions),
            counter: VisitCounter::new(gpu(), scene.positions.len()).unwrap(),
        }
    }

    /// Visits of each inner node of the binary tree.
    fn visits(&self, tracer: &PathTracer<'_>, view: &View, sampling: &Sampling) -> Vec<u32> {
        let camera = Camera::new(view, SIZE.0, SIZE.1);
        let tree = &self.planted.tree;
        let kernels = traversal(tree, Counting::Visits);
        let milliseconds = tracer
            .sample_visits(kernels, tree, &camera, sampling, &self.planted.workspace, &self.counter)
            .unwrap();
        assert!(milliseconds > 0.0);
        self.counter.by_inner.read(0, self.scene.positions.len() - 1).unwrap()
    }
}

/// A ball before the camera, and another one behind it that light reaches only by way of the first.
fn two_balls() -> Scene {
    let ball = icosphere(3);
    let at = |z: f32, radius: f32| -> Vec<Triangle> {
        mesh(&ball).iter().map(|t| t.map(|p| [radius * p[0], radius * p[1], radius * p[2] + z])).collect()
    };
    scene([at(-3.0, 1.5), at(6.0, 2.0)].concat(), [0.7; 3], [0.0; 3], [1.0; 3])
}

#[test]
fn each_wavefront_has_a_utilization_of_its_own() {
    let balls = two_balls();
    let sampled = Sampled::new(&balls);
    let tree = &sampled.planted.tree;
    let camera = Camera::new(&view([0.0; 3], [0.0, 0.0, -1.0], 70.0), SIZE.0, SIZE.1);
    let tracer = PathTracer::new(
        gpu(),
        &sampled.device,
        SIZE,
        &Params { depth: 4, seed: 2, ..Params::default() },
        true,
    )
    .unwrap();
    // The second time, nothing is left of the first.
    for sample in 0..2 {
        let waves = tracer.count(traversal(tree, Counting::Rays), tree, &camera, sample).unwrap();
        assert!(waves.len() > 1, "{waves:?}");
        for wave in &waves {
            let u = &wave.utilization;
            assert_eq!(
                [u.node_lanes, u.triangle_lanes, u.fetch_lanes],
                [wave.nodes, wave.triangles, wave.rays],
                "{wave:?}"
            );
        }
        // What primary rays cost pixel by pixel is as much as they cost together, but for what depends on when a lane of a
        // subgroup gets to its next triangle.
        let costs = tracer.primary_costs(traversal(tree, Counting::Rays), tree, &camera, sample).unwrap();
        assert_eq!(costs.len(), PIXELS);
        let sum = |of: fn(&Counts) -> u32| costs.iter().map(|c| u64::from(of(c))).sum::<u64>();
        let primary = &waves[0];
        for (apart, together) in [
            (sum(|c| c.nodes), primary.nodes),
            (sum(|c| c.boxes), primary.boxes),
            (sum(|c| c.triangles), primary.triangles),
        ] {
            assert!(apart.abs_diff(together) * 200 < together, "{apart} is not {together}");
        }
    }
    assert_silent();
}

#[test]
fn sample_rays_count_how_often_each_node_is_visited() {
    let balls = two_balls();
    let sampled = Sampled::new(&balls);
    let n = balls.positions.len();
    let tree = sampled.planted.workspace.read_tree().unwrap();
    let subtrees = sampled.planted.workspace.read_subtrees().unwrap();
    let ahead = view([0.0; 3], [0.0, 0.0, -1.0], 70.0);
    let params = Params { depth: 4, seed: 2, ..Params::default() };
    let tracer = PathTracer::new(gpu(), &sampled.device, SIZE, &params, true).unwrap();
    // What the same rays cost, as the kernels that count by ray find it: sample rays take the last of all
    // samples' random numbers.
    let mut waves = Vec::new();
    tracer
        .wavefronts(
            traversal(&sampled.planted.tree, Counting::Rays),
            &sampled.planted.tree,
            &Camera::new(&ahead, SIZE.0, SIZE.1),
            u32::MAX,
            |wave| {
                waves.push(wave);
                true
            },
        )
        .unwrap();
    for (depth_limit, subsampling) in [(0, 1), (0, 64), (1, 1), (3, 1), (2, 7), (3, 64), (9, 1)] {
        let what = format!("{depth_limit} bounces, each pixel of {subsampling}");
        let sampling = Sampling { depth_limit, subsampling, ..Sampling::default() };
        let visits = sampled.visits(&tracer, &ahead, &sampling);
        // Rays go through the pixels at every so-many-th place of the Z-order curve, which is the order of
        // wavefronts, and of the later ones those whose pixels these are.
        let every: HashSet<u32> = waves[0].pixels.iter().copied().step_by(subsampling as usize).collect();
        assert_eq!(every.len(), PIXELS.div_ceil(subsampling as usize), "{what}");
        let (mut rays, mut nodes) = (0u64, 0u64);
        for wave in &waves[..waves.len().min(depth_limit as usize + 1)] {
            for (pixel, counts) in wave.pixels.iter().zip(&wave.counts) {
                if every.contains(pixel) {
                    rays += 1;
                    nodes += u64::from(counts.nodes);
                }
            }
        }
        // Every ray visits the root. A handful may hit the other of two triangles at their edge, because
        // which is tested first depends on scheduling, and go on elsewhere.
        let root = u64::from(*visits.last().unwrap());
        assert!(root.abs_diff(rays) <= 2 + rays / 10_000, "{what}: {root} visits of the root, {rays} rays");
        if depth_limit == 0 {
            assert_eq!(root, PIXELS.div_ceil(subsampling as usize) as u64, "{what}");
        }
        // While a lane has a leaf postponed it visits nodes that the leaf may cut off; how many depends on
        // which rays share its subgroup, and that differs from launch to launch.
        let sum: u64 = visits.iter().map(|&v| u64::from(v)).sum();
        assert!(sum.abs_diff(nodes) <= 20 + nodes / 50, "{what}: {sum} visits, {nodes} by ray");
        let mut unseen = 0;
        for (index, &own) in visits.iter().enumerate() {
            let node = tree.nodes[n + index];
            for child in [node.left, node.right].into_iter().filter_map(|c| (c as usize).checked_sub(n)) {
                assert!(visits[child] <= own, "{what}: {} visits below {own}", visits[child]);
            }
            assert!(own == 0 || subtrees[index].inner > 0, "{what}: a leaf has {own} visits");
            // The ball behind the camera: no primary ray meets it, but those that bounce do.
            if subtrees[index].inner > 0 && node.lo[2] > 1.0 {
                unseen += u64::from(own);
            }
        }
        assert_eq!(unseen == 0, depth_limit == 0, "{what}: {unseen} visits behind the camera");
    }
    // Another view, in which nobody sees the first ball: nothing is left of the counts before.
    let sampling = Sampling { depth_limit: 0, subsampling: 1, ..Sampling::default() };
    let behind = view([0.0; 3], [0.0, 0.0, 1.0], 70.0);
    let visits = sampled.visits(&tracer, &behind, &sampling);
    let seen = |z: fn(f32, f32) -> bool| -> u64 {
        let inner =
            visits.iter().enumerate().filter(|(i, _)| z(tree.nodes[n + i].lo[2], tree.nodes[n + i].hi[2]));
        inner.map(|(_, &v)| u64::from(v)).sum()
    };
    assert_eq!((seen(|_, hi| hi < -1.0), visits.last().copied()), (0, Some(PIXELS as u32)));
    assert!(seen(|lo, _| lo > 1.0) > PIXELS as u64);
    assert_silent();
}

#[test]
fn trees_contracted_by_view_lead_to_the_same_hits() {
    let balls = two_balls();
    let sampled = Sampled::new(&balls);
    let n = balls.positions.len();
    let params = Params { depth: 3, seed: 2, ..Params::default() };
    let tracer = PathTracer::new(gpu(), &sampled.device, SIZE, &params, false).unwrap();
    let ahead = view([0.0; 3], [0.0, 0.0, -1.0], 70.0);
    let camera = Camera::new(&ahead, SIZE.0, SIZE.1);
    let hits = |tree: &Tree| {
        let mut hits = Vec::new();
        let kernels = traversal(tree, Counting::Nothing);
        tracer
            .wavefronts(kernels, tree, &camera, 0, |wave| {
                hits.push((wave.pixels, wave.hits));
                true
            })
            .unwrap();
        hits
    };
    let want = hits(&sampled.planted.tree);
    let sampling = Sampling { subsampling: 4, ..Sampling::default() };
    let counts = sampled.visits(&tracer, &ahead, &sampling);
    assert!(counts.iter().any(|&c| c > sampling.threshold));
    let visits = Visits { counts: &sampled.counter.by_inner, threshold: sampling.threshold };
    for layout in [Layout::Wide4, Layout::Quantized8] {
        let trees: Vec<_> = [Contraction::Sah, Contraction::Cbtc, Contraction::Rdtc]
            .into_iter()
            .map(|method| {
                let contract = ContractParams { method, ..ContractParams::default() };
                let widen =
                    Widen::new(gpu(), &BuildParams { contract, ..BuildParams::default() }, layout).unwrap();
                let to = widen.workspace(n).unwrap();
                let report = widen
                    .build(&sampled.planted.workspace, &to, &sampled.device.positions, n, Some(visits))
                    .unwrap();
                let tree = to.tree(&report.summary, sampled.device.extent);
                let got = hits(&tree);
                assert_eq!(got.len(), want.len());
                for (depth, (got, want)) in got.iter().zip(&want).enumerate() {
                    // Where two triangles meet, either may be hit; the distance is the same.
                    let at: HashMap<u32, Hit> = got.0.iter().copied().zip(got.1.iter().copied()).collect();
                    let same = |(pixel, want): (&u32, &Hit)| {
                        let near = |got: &Hit| got.t == want.t || (got.t - want.t).abs() <= 1e-4 * want.t;
                        at.get(pixel).is_some_and(near)
                    };
                    let same = want.0.iter().zip(&want.1).filter(|pair| same(*pair)).count();
                    let least = if depth == 0 { want.0.len() } else { want.0.len() * 999 / 1000 };
                    assert!(same >= least, "{layout:?}, {method}, depth {depth}: {same} hits of {least}");
                }
                let wide = to.read_wide(report.summary.nodes as usize).unwrap();
                wide.canonical()
            })
            .collect();
        assert!(trees[0] != trees[1] && trees[1] != trees[2], "{layout:?}: visits make a difference");
    }
    assert_silent();
}

/// One workgroup on a CPU driver, which waits for nobody; as many as run at once where they may wait.
#[test]
fn a_single_kernel_paints_the_same_picture() {
    let mut room = scenes::load("cornell:triangles=300", &SearchPath::only([])).unwrap();
    // So that `phong` sends some rays on.
    let mirrors = room.materials.len().div_ceil(2);
    for material in &mut room.materials[..mirrors] {
        material.phong = Some(Phong { reflective: 0.5, ..phong::MATTE });
    }
    let size = (24, 16);
    let device = DeviceScene::upload(gpu(), &room).unwrap();
    let camera = Camera::new(&room.views[0], size.0, size.1);
    let [tracer, of_phong] = [Integrator::Path, Integrator::Phong].map(|integrator| {
        let shade = Shading { integrator, ..Shading::default() };
        let path = Params { depth: 4, seed: 1, shade };
        PathTracer::new(gpu(), &device, size, &path, false).unwrap()
    });
    let usual = Layout::ALL.iter().map(|&layout| (&tracer, TriangleTest::Watertight, layout));
    for (tracer, test, layout) in usual.chain([
        (&tracer, TriangleTest::MoellerTrumbore, Layout::Wide4),
        (&tracer, TriangleTest::KenslerShirley, Layout::Wide8),
        (&tracer, TriangleTest::Woop, Layout::Binary),
        (&of_phong, TriangleTest::Watertight, Layout::Binary),
        (&of_phong, TriangleTest::Watertight, Layout::Compressed8),
    ]) {
        let planted = plant(&builder_for(test, layout), &room.positions);
        let params = traverse::Params::default();
        let separate = Traversal::new(gpu(), &params, &planted.tree, Counting::Nothing).unwrap();
        let single = match SingleKernel::new(gpu(), &params, &planted.tree) {
            Err(Error::NoClock { device }) => {
                println!("SKIPPED: {device} has no clock for kernels");
                return;
            }
            made => made.unwrap(),
        };
        let paint = |sample: &dyn Fn(u32) -> Sample| {
            tracer.clear().unwrap();
            let rays: Vec<Vec<u64>> =
                (0..2).map(|i| sample(i).waves.iter().map(|w| w.rays).collect()).collect();
            (rays, tracer.picture().unwrap())
        };
        let (rays, want) = paint(&|i| tracer.sample(&separate, &planted.tree, &camera, i).unwrap());
        let (rays_in_one, found) = paint(&|i| {
            let sample = tracer.sample_in_one(&single, &planted.tree, &camera, i).unwrap();
            let waves: f64 = sample.waves.iter().map(|w| w.milliseconds).sum();
            assert!(waves > 0.0 && waves <= sample.milliseconds, "{waves} of {} ms", sample.milliseconds);
            sample
        });
        assert!(rays[0][0] == 24 * 16 && rays[0][1] > 0, "{rays:?}");
        for (a, b) in rays.iter().flatten().zip(rays_in_one.iter().flatten()) {
            assert!(a.abs_diff(*b) <= 2, "{test:?}, {layout:?}: {rays:?}, {rays_in_one:?}");
        }
        let same = want.iter().zip(&found).filter(|(a, b)| a == b).count();
        assert!(same > 24 * 16 * 98 / 100, "{test:?}, {layout:?}: {same} pixels are the same");
    }
    assert_silent();
}

/// Of a picture by `phong`, each pixel is what the twin makes of its primary ray.
#[test]
fn a_picture_of_local_shading_is_the_one_that_the_twin_paints() {
    let floor = [[-9.0, -3.0, -9.0], [9.0, -3.0, -9.0], [9.0, -3.0, 9.0], [-9.0, -3.0, 9.0]];
    let mut positions = scattered(40, 8.0, 3.0);
    positions.extend([[floor[0], floor[2], floor[1]], [floor[0], floor[3], floor[2]]]);
    let mut room = scene(positions, [0.7; 3], [0.0; 3], [0.0; 3]);
    let phong = |diffuse, specular, reflective, shininess| Phong { diffuse, specular, reflective, shininess };
    let material = |albedo, phong| Material { phong, ..Material::diffuse("", albedo) };
    room.materials = vec![
        material([0.4, 0.4, 0.3], Some(phong(0.6, 0.3, 0.1, 50.0))),
        material([0.3, 0.1, 0.1], Some(phong(0.9, 0.1, 0.0, 10.0))),
        material([0.9, 0.9, 1.0], Some(phong(0.1, 0.8, 0.8, 0.0))),
        Material { emission: [0.2, 0.1, 0.0], ..material([0.2, 0.6, 0.3], None) },
    ];
    room.material_ids = (0..room.positions.len() as u32).map(|i| i * 7 % 4).collect();
    *room.material_ids.last_mut().unwrap() = 2;
    let light = |position, strength| Light { position, strength };
    room.lights = vec![light([20.0, 20.0, 20.0], 1.5), light([-3.0, 6.0, 2.0], 0.7)];
    room.sky = Sky { zenith: [0.1, 0.2, 0.4], horizon: [0.3, 0.3, 0.2], ground: [0.05, 0.0, 0.1] };
    let seen = view([1.0, 2.0, 12.0], [0.0, 0.0, 0.0], 50.0);
    for (shade, depth) in [
        (Shading { integrator: Integrator::Phong, ..Shading::default() }, 4),
        (
            Shading { integrator: Integrator::Phong, ambience: 0.0, camera_light: 0.0, ..Shading::default() },
            4,
        ),
        (
            Shading { integrator: Integrator::Phong, ambience: 0.3, camera_light: 2.0, ..Shading::default() },
            1,
        ),
    ] {
        let params = Params { depth, seed: 3, shade };
        let primary = &wavefronts(&room, &seen, &params, 0)[0];
        let (picture, _) = render(&room, &seen, &params, &traverse::Params::default(), 1);
        let same = |(ray, pixel): (&Ray, &u32)| {
            let want = phong::radiance(&room, &params.shade, ray, depth);
            let found = picture[*pixel as usize];
            (0..3).all(|k| (found[k] - want[k]).abs() <= 2e-3 * (1.0 + want[k].abs()))
        };
        let pairs: Vec<_> = primary.rays.iter().zip(&primary.pixels).collect();
        let same = pairs.par_iter().filter(|pair| same(**pair)).count();
        // A ray that passes an edge may see what is beside it, and does not forget it in a mirror.
        assert!(same >= PIXELS * 997 / 1000, "{:?}: {same} of {PIXELS} pixels as in the twin", params.shade);
        let light = picture.iter().map(|p| p[1]).sum::<f32>() / PIXELS as f32;
        assert!(light > 0.05, "{:?}: {light}", params.shade);
    }
    assert_silent();
}

/// Only what mirrors sends rays on in `phong`, and they are as many as the paths that meet it.
#[test]
fn local_shading_goes_on_where_something_mirrors() {
    let mut ball = scene(mesh(&icosphere(2)), [0.5; 3], [0.0; 3], [1.0; 3]);
    let seen = view([0.0, 0.0, 3.0], [0.0; 3], 60.0);
    let shade = Shading { integrator: Integrator::Phong, ..Shading::default() };
    let params = Params { depth: 3, seed: 1, shade };
    let waves = wavefronts(&ball, &seen, &params, 0);
    assert!(waves.len() == 2 && waves[1].rays.is_empty(), "a matte ball ends all paths");
    ball.materials[0].phong = Some(Phong { reflective: 0.5, ..phong::MATTE });
    let waves = wavefronts(&ball, &seen, &params, 0);
    let met = waves[0].hits.iter().filter(|hit| hit.triangle != Hit::MISS).count();
    assert!(met > 1000 && waves[1].rays.len() == met, "{met} rays meet the ball");
    assert_silent();
}

/// Where all is mirrored, rays leave at the angle at which they came.
#[test]
fn mirrored_rays_leave_as_they_came() {
    let ball = scene(mesh(&icosphere(2)), [0.5; 3], [0.0; 3], [1.0; 3]);
    let seen = view([0.0, 0.0, 3.0], [0.0; 3], 60.0);
    for integrator in [Integrator::Path, Integrator::Phong] {
        let mut ball = ball.clone();
        let mut shade = Shading { integrator, ..Shading::default() };
        match integrator {
            Integrator::Path => shade.specular = 1.0,
            Integrator::Phong => ball.materials[0].phong = Some(Phong { reflective: 1.0, ..phong::MATTE }),
        }
        let waves = wavefronts(&ball, &seen, &Params { depth: 2, seed: 1, shade }, 0);
        let next: HashMap<u32, &Ray> = waves[1].pixels.iter().copied().zip(&waves[1].rays).collect();
        let mut met = 0;
        for ((ray, hit), pixel) in waves[0].rays.iter().zip(&waves[0].hits).zip(&waves[0].pixels) {
            if hit.triangle == Hit::MISS {
                assert!(!next.contains_key(pixel));
                continue;
            }
            met += 1;
            let normal = normal(&ball.positions[hit.triangle as usize]);
            let (came, left) = (ray.direction.map(f64::from), next[pixel].direction.map(f64::from));
            let across = dot(came, normal);
            let off =
                (0..3).map(|k| (came[k] - 2.0 * across * normal[k] - left[k]).abs()).fold(0.0, f64::max);
            assert!(off < 1e-5, "{integrator:?}: {ray:?} leaves as {:?}", next[pixel]);
        }
        assert!(met > 1000, "{met} rays meet the ball");
    }
    assert_silent();
}

/// Inside a closed surface that mirrors a share of light, light is what remains after each bounce.
#[test]
fn a_furnace_that_mirrors_has_the_radiance_of_its_series() {
    let (albedo, emission) = (0.5f32, 1.0f32);
    let mut inside = scene(mesh(&icosphere(3)), [albedo; 3], [emission; 3], [0.0; 3]);
    let seen = view([0.1, 0.2, 0.0], [1.0, 0.0, 0.3], 90.0);
    for (of_material, of_all) in [(None, 0.25), (Some(0.25), 0.0), (Some(0.25), 0.1), (Some(0.1), 0.25)] {
        inside.materials[0].phong = of_material.map(|reflective| Phong { reflective, ..phong::MATTE });
        let shade = Shading { specular: of_all, ..Shading::default() };
        let params = Params { depth: 4, seed: 2, shade };
        let (picture, _) = render(&inside, &seen, &params, &traverse::Params::default(), 2);
        let remains = 0.25 + 0.75 * f64::from(albedo);
        let want: f64 = (0..4).map(|k| remains.powi(k)).sum();
        let found = picture.iter().map(|p| f64::from(p[0])).sum::<f64>() / (2 * PIXELS) as f64;
        assert!((found - want).abs() < 0.01 * want, "{of_material:?}, {of_all}: {found}, not {want}");
    }
    assert_silent();
}
