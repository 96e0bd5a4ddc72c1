//! Rays on the device against brute force.

use tracer::{
    gpu::{Gpu, Options, Pass},
    traverse::{self, Buffers, Hit, Queue, Ray, Traversal, Tree, Wave, cpu},
};

fn gpu() -> Gpu {
    Gpu::open(&Options { validate: true, ..Options::default() }).expect("scripts/setup installs a driver")
}

fn boxed(triangles: &[[[f32; 3]; 3]], ids: &[u32]) -> ([f32; 3], [f32; 3]) {
    let mut lo = [f32::INFINITY; 3];
    let mut hi = [f32::NEG_INFINITY; 3];
    for &id in ids {
        for v in triangles[id as usize] {
            for k in 0..3 {
                lo[k] = lo[k].min(v[k]);
                hi[k] = hi[k].max(v[k]);
            }
        }
    }
    (lo, hi)
}

fn split(
    triangles: &[[[f32; 3]; 3]],
    ids: &mut [u32],
    nodes: &mut Vec<[u32; 14]>,
    out: &mut Vec<[f32; 12]>,
) -> u32 {
    if ids.len() <= 2 {
        let first = out.len() as u32;
        for &id in ids.iter() {
            let [a, b, c] = triangles[id as usize];
            out.push([a[0], a[1], a[2], f32::from_bits(id), b[0], b[1], b[2], 0.0, c[0], c[1], c[2], 0.0]);
        }
        return 1 << 31 | (ids.len() as u32 - 1) << 27 | first;
    }
    let (lo, hi) = boxed(triangles, ids);
    let axis = (0..3).max_by(|&a, &b| (hi[a] - lo[a]).total_cmp(&(hi[b] - lo[b]))).unwrap();
    let key = |id: &u32| triangles[*id as usize].iter().map(|v| v[axis]).sum::<f32>();
    ids.sort_by(|a, b| key(a).total_cmp(&key(b)));
    let me = nodes.len();
    nodes.push([0; 14]);
    let (l, r) = ids.split_at_mut(ids.len() / 2);
    let (bl, br) = (boxed(triangles, l), boxed(triangles, r));
    let l = split(triangles, l, nodes, out);
    let r = split(triangles, r, nodes, out);
    let f: Vec<u32> = [bl.0, bl.1, br.0, br.1].concat().iter().map(|x| x.to_bits()).collect();
    nodes[me][..12].copy_from_slice(&f);
    nodes[me][12..].copy_from_slice(&[l, r]);
    me as u32
}

fn random(state: &mut u32) -> f32 {
    *state = state.wrapping_mul(747796405).wrapping_add(2891336453);
    let w = ((*state >> ((*state >> 28) + 4)) ^ *state).wrapping_mul(277803737);
    ((w >> 22) ^ w) as f32 / 4294967296.0
}

#[test]
fn smoke() {
    let gpu = gpu();
    let mut s = 1u32;
    let triangles: Vec<[[f32; 3]; 3]> = (0..1000)
        .map(|_| {
            let c: [f32; 3] = std::array::from_fn(|_| random(&mut s) * 10.0);
            std::array::from_fn(|_| std::array::from_fn(|k| c[k] + random(&mut s)))
        })
        .collect();
    let rays: Vec<Ray> = (0..20000)
        .map(|_| Ray {
            origin: std::array::from_fn(|_| random(&mut s) * 12.0 - 1.0),
            t_min: 0.0,
            direction: std::array::from_fn(|_| random(&mut s) * 2.0 - 1.0),
            t_max: f32::INFINITY,
        })
        .collect();
    let (mut nodes, mut out) = (vec![], vec![]);
    split(&triangles, &mut (0..1000).collect::<Vec<_>>(), &mut nodes, &mut out);
    let nodes = gpu.upload("nodes", &nodes).unwrap();
    let tris = gpu.upload("triangles", &out).unwrap();
    let rays_b = gpu.upload("rays", &rays).unwrap();
    let hits = gpu.buffer("hits", 8 * rays.len() as u64).unwrap();
    let counts = gpu.buffer("counts", 16 * rays.len() as u64).unwrap();
    let queue = gpu.upload("queue", &[Queue { count: rays.len() as u32, ..Queue::default() }]).unwrap();
    let t = Traversal::new(&gpu, &traverse::Params::default(), 20, true).unwrap();
    let tree = Tree { nodes: nodes.address(), triangles: tris.address(), depth: 20, extent: 11.0 };
    let mut pass = Pass::new(&gpu).unwrap();
    pass.fill(&hits, 0xABABABAB);
    t.record(
        &mut pass,
        "trace",
        Wave::Secondary,
        &tree,
        &Buffers {
            rays: rays_b.address(),
            hits: hits.address(),
            queue: queue.address(),
            counts: counts.address(),
        },
        rays.len(),
    );
    let timings = pass.submit().unwrap();
    println!("{timings:?}");
    let got: Vec<Hit> = hits.read(0, rays.len()).unwrap();
    let q: Vec<Queue> = queue.read(0, 1).unwrap();
    println!("{q:?}");
    let mut bad = 0;
    for (ray, hit) in rays.iter().zip(&got) {
        let want = cpu::brute_force(&triangles, ray);
        if !(want.t == hit.t || (want.t - hit.t).abs() <= 1e-5 * want.t) {
            bad += 1;
            if bad < 5 {
                println!("{want:?} {hit:?}");
            }
        }
    }
    assert_eq!(bad, 0);
    assert_eq!(gpu.validation_messages(), Vec::<String>::new());
}
