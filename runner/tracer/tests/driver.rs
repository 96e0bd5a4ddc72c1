//! The driver's own ray tracing against brute force, where a device has it, and what is said where it has not.

mod support;

use rayon::prelude::*;
use support::*;
use tracer::{
    Error,
    bvh2::Triangle,
    driver::{self, Builder},
    gpu::{Gpu, Pass, Prefer, RAY_TRACING},
    layout::LeafTriangles,
    traverse::{Buffers, Counting, Hit, Params, Queue, Ray, Traversal, TriangleTest, Wave, cpu},
};

/// The device, where its driver traces rays. That it does not is tested elsewhere.
fn tracing() -> Option<&'static Gpu> {
    let there = gpu().info().has(RAY_TRACING);
    if !there {
        eprintln!("skipped: {} does not trace rays", gpu().info());
    }
    there.then(gpu)
}

#[test]
fn a_device_whose_driver_does_not_trace_rays_is_named_with_a_way_out() {
    let mut info = gpu().info().clone();
    info.optional.retain(|feature| feature != RAY_TRACING);
    let error = driver::check(&info).unwrap_err();
    assert!(matches!(error, Error::NoRayTracing { .. }));
    let text = error.to_string();
    for word in ["unavailable", &info.name, "VK_KHR_ray_tracing_pipeline", "runner devices"] {
        assert!(text.contains(word), "{word} in {text}");
    }
    info.optional.push(RAY_TRACING.into());
    assert!(driver::check(&info).is_ok());
    if !gpu().info().has(RAY_TRACING) {
        let buffer = gpu().upload("triangles", &terrain(2)).unwrap();
        let refused = Builder::new(gpu(), &driver::Params::default(), &buffer, 2);
        assert!(matches!(refused, Err(Error::NoRayTracing { .. })));
    }
}

/// Hits of `rays` in a queue of which `queued` are to be traced; the others keep what was there.
fn traced(
    gpu: &Gpu,
    params: &driver::Params,
    triangles: &[Triangle],
    rays: &[Ray],
    queued: usize,
) -> Vec<Hit> {
    let corners = gpu.upload("triangles", triangles).unwrap();
    let builder = Builder::new(gpu, params, &corners, triangles.len()).unwrap();
    // Twice: the second build finds what the first has allocated.
    builder.build(&corners).unwrap();
    let took = builder.build(&corners).unwrap();
    assert!(took.bottom > 0.0 && took.top > 0.0 && (took.compact > 0.0) == params.compact, "{took:?}");
    assert!(took.total >= 0.99 * (took.bottom + took.compact + took.top), "{took:?}");
    let structure = builder.finish();
    assert!(structure.bytes() > 0);
    let tree = structure.tree(1.0);
    // Of our own kernels' parameters none has a meaning here, not even one that kernels of few layouts have.
    let params = Params { driver: params.clone(), primary_packets: 1, ..Params::default() };
    let traversal = Traversal::new(gpu, &params, &tree, Counting::Nothing).unwrap();
    assert!(traversal.kernel(Wave::Primary).is_none());
    let uncounted = Traversal::new(gpu, &params, &tree, Counting::Rays);
    assert!(matches!(uncounted, Err(Error::DriverTellsNot(_))));

    let untouched = Hit { t: -1.0, triangle: 12_345 };
    let (memory, hits) =
        (gpu.upload("rays", rays).unwrap(), gpu.upload("hits", &vec![untouched; rays.len()]).unwrap());
    let queue = gpu.upload("queue", &[Queue { count: queued as u32, ..Queue::default() }]).unwrap();
    let buffers = Buffers {
        rays: memory.address(),
        hits: hits.address(),
        queue: queue.address(),
        counts: 0,
        visits: 0,
        utilization: 0,
    };
    let mut pass = Pass::new(gpu).unwrap();
    traversal.record(&mut pass, "trace", Wave::Secondary, &tree, &buffers, rays.len());
    let timings = pass.submit().unwrap();
    assert!(timings.milliseconds("trace") > 0.0);
    traversal.check(0, &queue.read(0, 1).unwrap()[0]).unwrap();
    let mut all: Vec<Hit> = hits.read(0, rays.len()).unwrap();
    assert!(all.split_off(queued).iter().all(|hit| *hit == untouched), "rays behind the queue's end");
    all
}

fn rays(n: usize, scale: f32) -> Vec<Ray> {
    let mut random = Random(99);
    (0..n)
        .map(|_| {
            let (origin, target) = (random.point(scale), random.point(scale));
            let direction = std::array::from_fn(|k| target[k] - origin[k]);
            Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
        })
        .collect()
}

/// Holds hits against brute force. Rays that pass an edge of what is nearer may hit it or not.
fn agree(what: &str, triangles: &[Triangle], rays: &[Ray], found: &[Hit]) {
    let extent = triangles.as_flattened().as_flattened().iter().fold(0f32, |m, x| m.max(x.abs()));
    let leaves = LeafTriangles::in_file_order(TriangleTest::Watertight, triangles);
    let wrong = |(ray, hit): (&Ray, &Hit)| {
        let expected = cpu::brute_force(&leaves, ray);
        let refined = |hit: &Hit| match triangles.get(hit.triangle as usize) {
            Some(triangle) => cpu::refine(ray, triangle, hit.t),
            None => hit.t,
        };
        let (s, t) = (refined(&expected), refined(hit));
        let length = ray.direction.iter().map(|d| d * d).sum::<f32>().sqrt();
        let reach = ray.origin.iter().fold(extent, |m, x| m.max(x.abs()));
        let near = |a: f32, b: f32, share: f32| {
            a == b || (a - b).abs() <= share * (a.abs().max(b.abs()) + reach / length)
        };
        if near(s, t, 1e-5) {
            // What it says of the distance, and not only which triangle it names.
            return (!near(hit.t, t, 1e-3)).then(|| format!("{ray:?}: {hit:?}, and the triangle is at {t}"));
        }
        let nearer = if s < t { expected } else { *hit };
        let excused =
            triangles.get(nearer.triangle as usize).is_some_and(|v| cpu::passes_edge(ray, v, extent));
        (!excused).then(|| format!("{ray:?}: {hit:?} and not {expected:?}"))
    };
    let wrong: Vec<String> = rays.par_iter().zip(found).filter_map(wrong).collect();
    assert!(wrong.is_empty(), "{what}: {} of {}, the first {}", wrong.len(), rays.len(), wrong[0]);
}

#[test]
fn hits_are_those_of_brute_force() {
    let Some(gpu) = tracing() else { return };
    let all = |build| {
        let of = move |compact, row| driver::Params { build, compact, row };
        [of(true, 0), of(false, 8), of(true, 32)]
    };
    let scenes = [
        ("terrain", terrain(2000), 40.0),
        ("scattered", scattered(3000, 10.0, 2.0), 10.0),
        ("one", vec![[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]], 3.0),
    ];
    for params in all(Prefer::FastTrace).into_iter().chain(all(Prefer::FastBuild)) {
        for (name, triangles, scale) in &scenes {
            // Around full rows, and fewer than there is room for.
            for (n, queued) in [(4099, 4099), (100, 97), (1, 1), (64, 0)] {
                let rays = rays(n, *scale);
                let found = traced(gpu, &params, triangles, &rays, queued);
                agree(&format!("{name}, {params:?}, {queued} of {n}"), triangles, &rays[..queued], &found);
            }
        }
    }
    assert_silent();
}

#[test]
fn launches_of_one_pass_have_their_own_rays_and_spans() {
    let Some(gpu) = tracing() else { return };
    let triangles = terrain(2000);
    let corners = gpu.upload("triangles", &triangles).unwrap();
    for row in [0, 8] {
        let params = driver::Params { row, ..driver::Params::default() };
        let builder = Builder::new(gpu, &params, &corners, triangles.len()).unwrap();
        builder.build(&corners).unwrap();
        let structure = builder.finish();
        let tree = structure.tree(1.0);
        let params = Params { driver: params, ..Params::default() };
        let traversal = Traversal::new(gpu, &params, &tree, Counting::Nothing).unwrap();
        // Longer and shorter ones in turn: who launched as many as another did would leave some out.
        let waves: Vec<_> = [300, 4099, 1, 77]
            .into_iter()
            .map(|n| {
                let rays = rays(n, 40.0);
                let memory = gpu.upload("rays", &rays).unwrap();
                let hits = gpu.upload("hits", &vec![Hit { t: -1.0, triangle: 12_345 }; n]).unwrap();
                let queue = gpu.upload("queue", &[Queue { count: n as u32, ..Queue::default() }]).unwrap();
                (rays, memory, hits, queue)
            })
            .collect();
        let mut pass = Pass::new(gpu).unwrap();
        for _ in 0..3 {
            for (at, (rays, memory, hits, queue)) in waves.iter().enumerate() {
                let (rays, n) = (memory.address(), rays.len());
                let (hits, queue) = (hits.address(), queue.address());
                let buffers = Buffers { rays, hits, queue, counts: 0, visits: 0, utilization: 0 };
                traversal.record(&mut pass, &at.to_string(), Wave::at(at), &tree, &buffers, n);
            }
        }
        let timings = pass.submit().unwrap();
        for (at, (rays, _, hits, queue)) in waves.iter().enumerate() {
            let name = at.to_string();
            assert!(timings.milliseconds(&name) > 0.0, "{name}");
            assert_eq!(timings.spans.iter().filter(|span| span.path == name).count(), 3, "{name}");
            traversal.check(at, &queue.read(0, 1).unwrap()[0]).unwrap();
            agree(
                &format!("launch {at}, rows of {row}"),
                &triangles,
                rays,
                &hits.read(0, rays.len()).unwrap(),
            );
        }
    }
    assert_silent();
}

#[test]
fn both_sides_are_seen_and_the_ends_of_a_ray_are_not() {
    let Some(gpu) = tracing() else { return };
    let at = |z: f32| [[-1.0, -1.0, z], [1.0, -1.0, z], [0.0, 1.0, z]];
    let mut back = at(2.0);
    back.swap(0, 1);
    let triangles = [at(1.0), back, at(3.0)];
    let ray = |from: f32, way: f32, t_min, t_max| Ray {
        origin: [0.0, 0.0, from],
        t_min,
        direction: [0.0, 0.0, way],
        t_max,
    };
    let inf = f32::INFINITY;
    let cases = [
        (ray(0.0, 1.0, 0.0, inf), Some((1.0, 0))),
        (ray(1.5, 1.0, 0.0, inf), Some((0.5, 1))),
        (ray(4.0, -2.0, 0.0, inf), Some((0.5, 2))),
        (ray(1.5, -1.0, 0.0, inf), Some((0.5, 0))),
        (ray(0.0, 1.0, 1.5, inf), Some((2.0, 1))),
        (ray(0.0, 1.0, 0.0, 0.5), None),
        (ray(0.0, 1.0, 3.5, inf), None),
        (ray(4.0, 1.0, 0.0, inf), None),
        (ray(0.0, 1.0, -1.0, inf), Some((1.0, 0))),
        (ray(0.0, 0.0, 0.0, inf), None),
        (ray(f32::NAN, 1.0, 0.0, inf), None),
        (ray(0.0, f32::NAN, 0.0, inf), None),
        (ray(0.0, inf, 0.0, inf), None),
        (ray(0.0, 1.0, f32::NAN, inf), None),
        (ray(0.0, 1.0, 2.0, 1.0), None),
    ];
    let rays: Vec<Ray> = cases.iter().map(|(ray, _)| *ray).collect();
    let found = traced(gpu, &driver::Params::default(), &triangles, &rays, rays.len());
    for ((ray, expected), hit) in cases.iter().zip(&found) {
        match expected {
            Some((t, triangle)) => {
                assert_eq!(hit.triangle, *triangle, "{ray:?}");
                assert!((hit.t - t).abs() < 1e-5, "{ray:?}: {hit:?}");
            }
            None => assert_eq!(*hit, Hit::NONE, "{ray:?}"),
        }
    }
    assert_silent();
}

#[test]
fn awkward_triangles_do_no_harm() {
    let Some(gpu) = tracing() else { return };
    for (name, triangles) in awkward(300) {
        // Of numbers whose squares leave the range of floats a driver need not make sense.
        if ["huge", "tiny", "growing gaps", "two far corners"].contains(&name) {
            continue;
        }
        let extent = triangles.as_flattened().as_flattened().iter().fold(0f32, |m, x| m.max(x.abs()));
        let rays = rays(500, 2.0 * extent);
        let found = traced(gpu, &driver::Params::default(), &triangles, &rays, rays.len());
        if name != "tiny and far away" {
            agree(name, &triangles, &rays, &found);
        }
    }
    assert_silent();
}

#[test]
fn too_few_triangles_are_refused() {
    let Some(gpu) = tracing() else { return };
    let corners = gpu.upload("triangles", &terrain(2)).unwrap();
    let refused = Builder::new(gpu, &driver::Params::default(), &corners, 0);
    assert!(matches!(refused, Err(Error::DriverTriangles { triangles: 0, .. })));
}
