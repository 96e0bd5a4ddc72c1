//! What tests on a device share: the device under the validation layer, triangles of every awkward kind,
//! closed meshes, and scenes made of them.

#![allow(dead_code, reason = "each test binary uses its own part")]

use std::{
    collections::HashMap,
    sync::{Mutex, OnceLock},
};
use tracer::{
    builder::{BuildParams, BuildWorkspace, Builder, Summary},
    bvh2::Triangle,
    contract::Contraction,
    gpu::{Gpu, Options},
    layout::{Layout, compressed::Compressed8},
    scene::{LoadReport, Material, Origin, Provenance, Scene, Sky, View},
    traverse::{
        Counting, Counts, Hit, Language, Params, Ray, Structure, Traversal, Tree, TriangleParams,
        TriangleTest, cpu,
        groups::{self, Order},
    },
    with_layout,
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

/// The nearest hit of a ray, and what it cost, as the CPU finds them.
pub type Twin = Box<dyn Fn(&Ray) -> (Hit, Counts) + Send + Sync>;

/// A tree on the device and on the host.
pub struct Planted {
    pub tree: Tree,
    pub summary: Summary,
    /// Traverses the nodes that the device wrote.
    pub twin: Twin,
    /// The last build in it is this tree.
    pub workspace: BuildWorkspace,
}

/// The usual parameters, with leaves no larger than the layout allows.
pub fn usual(layout: Layout) -> BuildParams {
    let mut params = BuildParams::default();
    params.collapse.max_leaf = params.collapse.max_leaf.min(layout.limits().triangles_per_leaf as u32);
    params
}

/// How a layout is made of a tree whose leaves may have 16 triangles: one that holds fewer gets its own leaves.
pub fn on_any_tree(layout: Layout) -> BuildParams {
    let mut params = BuildParams::default();
    if layout.limits().triangles_per_leaf < 16 {
        params.contract.method = Contraction::Optimal;
    }
    params
}

/// A builder with the usual parameters; compiling its kernels takes longer than most builds.
pub fn builder_of(layout: Layout) -> &'static Builder {
    static BUILDERS: [OnceLock<Builder>; Layout::ALL.len()] = [const { OnceLock::new() }; Layout::ALL.len()];
    BUILDERS[layout as usize].get_or_init(|| Builder::new(gpu(), &usual(layout), layout).expect("a builder"))
}

/// The same for the layout that most tests are content with.
pub fn builder() -> &'static Builder {
    builder_of(Layout::Binary)
}

/// The same with triangles stored for a test.
pub fn builder_for(test: TriangleTest, layout: Layout) -> Builder {
    let params = BuildParams { triangle: TriangleParams { test }, ..usual(layout) };
    Builder::new(gpu(), &params, layout).expect("a builder")
}

/// Builds a tree.
pub fn plant(builder: &Builder, triangles: &[Triangle]) -> Planted {
    let workspace = builder.workspace(triangles.len()).unwrap();
    let buffer = gpu().upload("triangles", triangles).unwrap();
    let report = builder.build(&workspace, &buffer, triangles.len(), false).unwrap();
    let extent = triangles.as_flattened().as_flattened().iter().fold(0f32, |m, x| m.max(x.abs()));
    let tree = workspace.wide.tree(&report.summary, extent);
    let leaves = workspace.wide.stored.triangles.read(triangles.len()).unwrap();
    let count = report.summary.nodes as usize;
    let layout = tree.structure.layout().expect("a layout of ours");
    let twin: Twin = if layout.is_compressed() {
        let nodes = workspace.wide.read_nodes::<Compressed8>(count).unwrap();
        Box::new(move |ray| groups::cpu::closest_hit(&nodes, &leaves, extent, Order::Octant, ray))
    } else {
        with_layout!(layout, L => {
            let nodes = workspace.wide.read_nodes::<L>(count).unwrap();
            Box::new(move |ray| cpu::closest_hit::<L>(&nodes, &leaves, extent, ray))
        })
    };
    Planted { tree, summary: report.summary, twin, workspace }
}

/// The languages that this build has kernels in. That one is left out is said once.
pub fn languages() -> &'static [Language] {
    static LANGUAGES: OnceLock<Vec<Language>> = OnceLock::new();
    LANGUAGES.get_or_init(|| {
        let there = |language: &Language| match language.missing() {
            None => true,
            Some(reason) => {
                eprintln!("skipped: nothing is tested in {language:?}: {reason}");
                false
            }
        };
        Language::ALL.into_iter().filter(there).collect()
    })
}

/// Those of them in which a layout is traced.
pub fn languages_of(layout: Layout) -> impl Iterator<Item = Language> {
    let fits = move |&language: &Language| language == Language::Glsl || layout.slang().is_some();
    languages().iter().copied().filter(fits)
}

/// The kernels with the usual parameters for a tree, compiled once for all trees that are served by them.
pub fn traversal(tree: &Tree, counting: Counting) -> &'static Traversal {
    traversal_in(Language::Glsl, tree, counting)
}

/// The same in a language.
pub fn traversal_in(language: Language, tree: &Tree, counting: Counting) -> &'static Traversal {
    type Key = (Language, Structure, TriangleTest, usize, u32, u32);
    static KERNELS: Mutex<Option<HashMap<Key, &'static OnceLock<Traversal>>>> = Mutex::new(None);
    let params = Params { language, ..Params::default() };
    let stack = tree.stack.next_multiple_of(32).max(params.stack);
    let key = (language, tree.structure, tree.test, tree.stride, stack, counting as u32);
    // Nobody waits for kernels that somebody else compiles, unless they are the same.
    let slot = *KERNELS
        .lock()
        .unwrap()
        .get_or_insert_default()
        .entry(key)
        .or_insert_with(|| Box::leak(Box::default()));
    slot.get_or_init(|| Traversal::new(gpu(), &params, tree, counting).unwrap())
}

/// Corners of an icosahedron whose faces were each cut in four `levels` times, on the unit sphere, and its
/// faces, counter-clockwise as seen from outside: 20 · 4^levels. Neighbours share corners.
pub fn icosphere(levels: u32) -> (Vec<[f32; 3]>, Vec<[usize; 3]>) {
    let unit = |p: [f32; 3]| {
        let length = p.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
        p.map(|x| (f64::from(x) / length) as f32)
    };
    let g = f32::midpoint(1.0, 5f32.sqrt());
    let mut corners = Vec::new();
    for (a, b) in [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)] {
        corners.push([a, b, 0.0]);
    }
    for (a, b) in [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)] {
        corners.push([0.0, a, b]);
    }
    for (a, b) in [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)] {
        corners.push([b, 0.0, a]);
    }
    corners.iter_mut().for_each(|p| *p = unit(*p));
    let mut faces = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..levels {
        let mut middles = HashMap::new();
        let mut middle = |a: usize, b: usize| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let sum = std::array::from_fn(|k| corners[a][k] + corners[b][k]);
                corners.push(unit(sum));
                corners.len() - 1
            })
        };
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    (corners, faces)
}

/// The triangles of a mesh.
pub fn mesh((corners, faces): &(Vec<[f32; 3]>, Vec<[usize; 3]>)) -> Vec<Triangle> {
    faces.iter().map(|f| f.map(|i| corners[i])).collect()
}

/// A scene of one material under a sky of one colour.
pub fn scene(positions: Vec<Triangle>, albedo: [f32; 3], emission: [f32; 3], sky: [f32; 3]) -> Scene {
    Scene {
        name: "test".into(),
        material_ids: vec![0; positions.len()],
        positions,
        materials: vec![Material { emission, ..Material::diffuse("", albedo) }],
        views: Vec::new(),
        lights: Vec::new(),
        sky: Sky { zenith: sky, horizon: sky, ground: sky },
        provenance: Provenance {
            origin: Origin::File { path: "test".into(), sha256: String::new() },
            licence: String::new(),
            credit: String::new(),
        },
        report: LoadReport::default(),
    }
}

/// A view.
pub fn view(eye: [f32; 3], target: [f32; 3], vfov_degrees: f32) -> View {
    View { name: String::new(), eye, target, up: [0.0, 1.0, 0.0], vfov_degrees }
}
