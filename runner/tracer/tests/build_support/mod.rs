//! What the tests of the builders share: a device under the validation layer, and triangles of every
//! awkward kind.

#![allow(dead_code, reason = "each test binary uses its own part")]

use std::sync::OnceLock;
use tracer::{
    bvh2::Triangle,
    gpu::{Gpu, Options},
};

/// One device for all tests of a binary, with validation on.
pub fn gpu() -> &'static Gpu {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    GPU.get_or_init(|| Gpu::open(&Options { validate: true, ..Default::default() }).expect("a device"))
}

/// Fails if the validation layer has said anything so far.
pub fn assert_silent() {
    assert_eq!(gpu().validation_messages(), Vec::<String>::new());
}

/// A small generator of random numbers (SplitMix64), so that tests repeat.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    /// In 0 to 1.
    pub fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u64 << 24) as f32
    }

    pub fn point(&mut self, scale: f32) -> [f32; 3] {
        std::array::from_fn(|_| (self.unit() - 0.5) * scale)
    }
}

/// Triangles of `size` scattered over a cube of edge `scene`.
pub fn scattered(n: usize, scene: f32, size: f32) -> Vec<Triangle> {
    let mut random = Random(n as u64);
    (0..n)
        .map(|_| {
            let at = random.point(scene);
            std::array::from_fn(|_| {
                let offset = random.point(size);
                std::array::from_fn(|i| at[i] + offset[i])
            })
        })
        .collect()
}

/// A height field of two triangles a cell: a surface, as scenes are made of.
pub fn terrain(n: usize) -> Vec<Triangle> {
    let side = (n as f64 / 2.0).sqrt().ceil() as usize;
    let height = |x: f32, y: f32| (x * 0.37).sin() * 3.0 + (y * 0.23).cos() * 4.0 + (x * y * 0.01).sin();
    let corner = |x: usize, y: usize| {
        let (x, y) = (x as f32, y as f32);
        [x, height(x, y), y]
    };
    (0..n)
        .map(|i| {
            let (x, y) = (i / 2 % side, i / 2 / side);
            if i % 2 == 0 {
                [corner(x, y), corner(x + 1, y), corner(x, y + 1)]
            } else {
                [corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)]
            }
        })
        .collect()
}

/// Degenerate inputs of `n` triangles, each with its name.
pub fn awkward(n: usize) -> Vec<(&'static str, Vec<Triangle>)> {
    let one = [[1.0, 2.0, 3.0], [4.0, 2.5, 3.0], [1.0, 7.0, 3.5]];
    let mut random = Random(7);
    let flat = (0..n).map(|_| std::array::from_fn(|_| [random.unit(), 0.25, random.unit()])).collect();
    let points = (0..n).map(|_| [random.point(10.0); 3]).collect();
    // Boxes with one centre, each in the next: every one's nearest neighbour is the next smaller.
    let nest = (0..n)
        .map(|i| {
            let r = 1.0 + i as f32;
            [[-r, -r, -r], [r, r, r], [r, -r, r]]
        })
        .collect();
    // Along a line, each gap twice the last, until floats end; then again.
    let doubling = (0..n)
        .map(|i| {
            let x = 2.0f32.powi((i % 60) as i32);
            [[x, 0.0, 0.0], [x, 0.1, 0.0], [x, 0.0, 0.1]]
        })
        .collect();
    vec![
        ("all identical", vec![one; n]),
        ("all one point", vec![[[5.0; 3]; 3]; n]),
        ("all in one plane", flat),
        ("all of zero area", points),
        ("one box in the next", nest),
        ("growing gaps", doubling),
        ("huge", scattered(n, 1e18, 1e17)),
        ("tiny", scattered(n, 1e-18, 1e-19)),
        (
            "tiny and far away",
            scattered(n, 0.0, 1e-3).iter().map(|t| t.map(|p| p.map(|x| x + 1e4))).collect(),
        ),
        ("two far corners", (0..n).map(|i| [[if i % 2 == 0 { -1e18 } else { 1e18 }; 3]; 3]).collect()),
    ]
}
