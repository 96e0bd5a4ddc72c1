//! The command line.

use crate::{shard::Shard, size::Size};
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Builds BVHs on the GPU, traces rays through them, measures both, and writes a benchmark record.
///
/// SCENE is the name of a scene (`runner scenes` lists them), a generator with parameters such as
/// `city:triangles=1000000,seed=3`, or a path: to a GLB, glTF or OBJ file, for which eight views are placed
/// automatically, to a descriptor in TOML (`runner scene construct` writes them), or to a scene of RTRS in JSON.
///
/// What was asked for goes to stdout, remarks and progress go to stderr. An option that is given twice has its
/// last value.
///
/// Exit status: 0 done, 1 failed, 2 usage, 3 a variant that was asked for by name is unavailable on the device (all
/// else is done), 130 interrupted (what was measured until then is kept).
#[derive(Debug, Parser)]
#[command(
    version,
    subcommand_required = true,
    arg_required_else_help = true,
    args_override_self = true,
    after_help = EXAMPLES
)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
    #[command(flatten)]
    pub global: Global,
}

/// The exit status where a variant that was asked for by name is unavailable on the device.
pub const UNAVAILABLE: u8 = 3;

const EXAMPLES: &str = "\
Examples:
  runner devices
  runner run cornell city -o out/record.json
  runner run path/to/scene.glb --views 0,3 --samples 5
  runner render city --view roofs --samples 256 -o out/city.png
  runner render path/to/scene.glb --heatmap nodes -o out/cost.png";

const RUN_EXAMPLES: &str = "\
Examples:
  runner run cornell sphereflake -o out/record.json
  runner run sponza --scene-dir ~/scenes --views 0-3 --samples 30 -o out/sponza.json
  runner run city:triangles=1000000,seed=3 --size 1280x720
  runner run bistro_exterior --set collapse.c_t=3 --set ploc.radius=16
  runner run forest --variant all -o out/all.json
  runner run forest --bvh out/forest.bvh -o out/forest.json
  runner run sponza --variant 'Wide8*' --method replay -o out/bounces.json
  runner run sponza --variant Binary --variant Driver --set driver.build=fast-build -o out/driver.json
  runner run city --variant 'Wide4*' --set cbtc.threshold=16 --set cbtc.subsampling=100";

const PRECOMPUTE_EXAMPLES: &str = "\
Examples:
  runner bvh precompute sphereflake -o out/s.bvh
  runner bvh precompute sponza --build sbvh --set sbvh.alpha=1e-4 -o out/sponza.bvh
  runner run sponza --bvh out/sponza.bvh --variant 'Wide8*' -o out/sponza.json";

const CONSTRUCT_EXAMPLES: &str = "\
Examples:
  runner scene construct --model meshes/teapot.obj 0 --material 0.4 0.4 0.3 0.6 0.3 0.1 50 \\
    --light 20 20 20 1.5 --camera-pos 8 4 8 0 1 0 --camera-orbit --out out/tea.toml
  runner scene construct --name pair --camera-pos 0 2 9 0 1 0 \\
    --material 0.4 0.4 0.3 0.6 0.3 0.1 50 --material 0.3 0.1 0.1 0.9 0.1 0 10 \\
    --model a.glb 0 --translate -3 0 0 --model b.obj 1 --scale 2 2 2 --rotate 0 45 0 --translate 3 0 0
  runner render out/tea.toml --view orbit_3 -o out/tea.png";

const SWEEP_EXAMPLES: &str = "\
Examples:
  runner sweep configs/quick.toml --plan
  runner sweep configs/quick.toml -o out/quick
  runner sweep configs/workgroup.toml --only scene=sponza --only 'variant=Wide4*' -o out/wg
  runner sweep configs/overall.toml --include configs/tuned/my-gpu.toml --set samples=15 -o out/overall
  runner sweep configs/workgroup.toml --shard 2/4 -o out/wg-2";

const MERGE_EXAMPLES: &str = "\
Examples:
  runner merge out/wg-1 out/wg-2 out/wg-3 out/wg-4 -o out/wg.json";

const BEST_EXAMPLES: &str = "\
Examples:
  runner best out/wg/record.json
  runner best out/workgroup out/costs -o configs/tuned/my-gpu.toml";

const TUNE_EXAMPLES: &str = "\
Examples:
  runner tune sphereflake --variant Wide4 --size 160x90 -o out/tuned.toml
  runner tune sponza kitchen --variant all -o configs/tuned/my-gpu.toml";

const RENDER_EXAMPLES: &str = "\
Examples:
  runner render forest --samples 256 -o out/forest.png
  runner render city --view roofs --size 1920x1080 --exposure 0.5 -o out/city.png
  runner render city --view roofs --heatmap triangles -o out/cost.png";

const RAYS_EXAMPLES: &str = "\
Examples:
  runner rays city --depth 1 --size 320x180 -o out/city.rays --hits out/city.hits

Files are little-endian: `RAYS`, u32 1, u64 count, then eight f32 a ray (origin, tmin, direction, tmax);
`HITS`, u32 1, u64 count, then f32 t and u32 triangle a hit (infinity and 0xFFFFFFFF for a miss).";

const TRACE_EXAMPLES: &str = "\
Examples:
  runner trace out/city.rays --scene city --launches 20 --hits out/again.hits";

const ROOFLINE_EXAMPLES: &str = "\
Examples:
  runner roofline --quick
  runner roofline -o out/roofline.json
  compare markdown out/record.json --table roofline --roofline out/roofline.json";

const VALIDATE_EXAMPLES: &str = "\
Examples:
  runner validate sponza --variant 'Wide6 Quantized CBTC'
  runner validate path/to/scene.glb --views 0-3 --brute-force 10000

Exit status: 0 everything holds, 1 something does not, or could not be checked, 3 a variant that was asked for by name
is unavailable on the device.";

/// What every command understands.
#[derive(Clone, Debug, Args)]
pub struct Global {
    /// Vulkan device: its number in `runner devices`, part of its name, or its UUID
    #[arg(long, global = true, value_name = "N|NAME|UUID")]
    pub device: Option<String>,
    /// Turn on Vulkan's validation layer; any message it gives makes the run fail
    #[arg(long, global = true)]
    pub validate: bool,
    /// Where scene files and descriptors are looked for, before the folders in BROADLEAF_SCENES
    #[arg(long, global = true, value_name = "DIR")]
    pub scene_dir: Vec<PathBuf>,
    /// No progress and no remarks on stderr
    #[arg(short, long, global = true)]
    pub quiet: bool,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// List the Vulkan devices and what matters here about each
    Devices {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// List the scenes that are known by name, and where to get those that are missing
    Scenes {
        /// Print JSON, with licences and credits
        #[arg(long)]
        json: bool,
    },
    /// Make scenes of your own
    #[command(subcommand)]
    Scene(SceneCommand),
    /// Measure: build each scene's BVH, trace paths from its views, print a table, write a record
    #[command(after_help = RUN_EXAMPLES)]
    Run(Run),
    /// Work with binary trees (BVHs) in files
    #[command(subcommand)]
    Bvh(BvhCommand),
    /// Measure every point of an experiment, so that nothing is lost when it is stopped
    ///
    /// Each finished point is added to a journal at once; the same command goes on where it was stopped. Ctrl-C
    /// finishes the running point, a second one stops at once. Points are shuffled, and one of them is measured
    /// again and again, so that a change of the device over time neither favours anybody nor stays unseen.
    #[command(after_help = SWEEP_EXAMPLES)]
    Sweep(Sweep),
    /// Join the shares of a sweep that several machines have measured
    #[command(after_help = MERGE_EXAMPLES)]
    Merge(Merge),
    /// Say which value of each axis of a sweep is best for each variant, and how sure that is
    ///
    /// In each scene, the rate with a value is divided by the best rate that any value has there. The value with
    /// the largest minimum over the scenes is best, and among equal ones the one with the largest mean. A workgroup
    /// size for primary rays is judged by those alone, one for secondary rays likewise.
    #[command(after_help = BEST_EXAMPLES)]
    Best(Best),
    /// Find good workgroup sizes and a good traversal cost without measuring all combinations
    ///
    /// Successive halving: all combinations of nine sizes and six costs get one sample a view, the better half gets
    /// as many again, and so on.
    #[command(after_help = TUNE_EXAMPLES)]
    Tune(Tune),
    /// Render a picture, or the cost of each pixel
    #[command(after_help = RENDER_EXAMPLES)]
    Render(Render),
    /// Look around in a scene: a window with the path tracer, and a live chart of its rates
    #[command(after_help = crate::view::help())]
    View(crate::view::Arguments),
    /// Write the rays of one wavefront to a file, and what they hit
    #[command(after_help = RAYS_EXAMPLES)]
    Rays(Rays),
    /// Trace rays from a file and time it
    #[command(after_help = TRACE_EXAMPLES)]
    Trace(Trace),
    /// List the variants: their nodes, how their trees are made, what they are written in
    Variants {
        /// Print JSON, with all parameters
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        tuning: Tuning,
    },
    /// Check a scene: every invariant of its trees, and its hits against brute force
    #[command(after_help = VALIDATE_EXAMPLES)]
    Validate(Validate),
    /// Show what each traversal kernel takes: registers, memory, and how full of it a multiprocessor can be
    ///
    /// First comes what one multiprocessor has, where that is known, then a row for each variant and kind of
    /// rays. Registers, memory and spills are what the driver's compiler tells; Mesa's CPU driver tells nothing.
    Resources {
        /// Variants to show; `*` stands for anything, `all` for every variant
        #[arg(long, value_name = "NAME", default_value = "all")]
        variant: Vec<String>,
        #[command(flatten)]
        tuning: Tuning,
        /// Print JSON, with all that the driver tells under its own names
        #[arg(long)]
        json: bool,
    },
    /// Measure what the device can do at best: copy memory, read nodes at random, compute
    ///
    /// These are the roofs below which every traversal stays. Each kernel's results are held against the CPU's, and the
    /// median of several launches counts. `compare markdown RECORD --table roofline --roofline FILE.json` says how near
    /// to them the variants of a record come.
    #[command(after_help = ROOFLINE_EXAMPLES)]
    Roofline(Roofline),
    /// Print the JSON Schema of the record
    Schema,
    /// Help with configs, the files that describe experiments
    #[command(subcommand)]
    Config(ConfigCommand),
    /// Print completions for a shell, such as `source <(runner completions bash)`
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print a manual page, such as `runner man run | man -l -`
    Man {
        /// The command that it is about; runner as a whole when left out
        command: Option<String>,
    },
}

/// What `scene` does.
#[derive(Debug, Subcommand)]
pub enum SceneCommand {
    /// Put models, materials, lights and a camera together in a file that every command takes for a scene
    ///
    /// The options are those of RTRS (Lewis 2024, appendix B.1). The file is text in TOML, for you to change.
    #[command(after_help = CONSTRUCT_EXAMPLES)]
    Construct(Construct),
}

/// What `scene construct` puts together.
#[derive(Debug, Args)]
#[command(group(clap::ArgGroup::new("place").required(true).multiple(true).args(["output", "name"])))]
pub struct Construct {
    #[command(flatten)]
    pub models: Models,
    /// A material: its colour (linear, 0 to 1), the shares of diffuse, specular and mirrored light, and the exponent
    /// of highlights. May be repeated; the first has number 0. A grey one when left out. The path tracer uses the
    /// colour and the share of mirrored light
    #[arg(
        long,
        num_args = 7,
        value_names = ["R", "G", "B", "DIFFUSE", "SPECULAR", "MIRRORED", "SHININESS"],
        allow_negative_numbers = true,
        value_parser = finite
    )]
    pub material: Vec<f32>,
    /// A point that shines, and its strength; may be repeated. Only --integrator phong sees it: in the path tracer, the
    /// sky shines
    #[arg(
        long,
        num_args = 4,
        value_names = ["X", "Y", "Z", "STRENGTH"],
        allow_negative_numbers = true,
        value_parser = finite
    )]
    pub light: Vec<f32>,
    /// Where the camera is, and the point it looks at
    #[arg(
        long,
        required = true,
        action = clap::ArgAction::Set,
        num_args = 6,
        value_names = ["X", "Y", "Z", "AT_X", "AT_Y", "AT_Z"],
        allow_negative_numbers = true,
        value_parser = finite
    )]
    pub camera_pos: Vec<f32>,
    /// The camera stays: one view, `camera`. So it does when left out
    #[arg(long, conflicts_with = "camera_orbit")]
    pub camera_fixed: bool,
    /// The camera circles the point it looks at, at its height: so many views, `orbit_0` and so on
    #[arg(
        long,
        value_name = "VIEWS",
        num_args = 0..=1,
        default_missing_value = "8",
        value_parser = clap::value_parser!(u32).range(1..=i64::from(tracer::scene::MOST_VIEWS))
    )]
    pub camera_orbit: Option<u32>,
    /// Vertical field of view of the camera
    #[arg(long, value_name = "DEGREES", default_value_t = 60.0, value_parser = finite)]
    pub camera_fov: f32,
    /// Where the descriptor goes; paths in it are relative to its folder
    #[arg(short, long = "out", value_name = "FILE.toml")]
    pub output: Option<PathBuf>,
    /// Name of the scene: without --out, the descriptor goes to scenes/NAME.toml
    #[arg(long, value_parser = scene_name)]
    pub name: Option<String>,
    /// One line about the scene
    #[arg(long, value_name = "TEXT")]
    pub title: Option<String>,
    /// Licence of the models; when left out, those of the known ones among them
    #[arg(long, value_name = "TEXT")]
    pub licence: Option<String>,
    /// Who is to be credited; when left out, those of the known ones among them
    #[arg(long, value_name = "TEXT")]
    pub credit: Option<String>,
}

/// A number that is neither infinite nor none.
fn finite(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(number) if number.is_finite() => Ok(number),
        Ok(_) => Err("it must be finite".into()),
        Err(_) => Err("it is no number".into()),
    }
}

/// A name by which a scene can be asked for.
fn scene_name(text: &str) -> Result<String, String> {
    let fits = |c: char| c.is_alphanumeric() || "_-.".contains(c);
    if !text.is_empty() && !text.starts_with('.') && text.chars().all(fits) {
        Ok(text.into())
    } else {
        Err("a name has letters, digits, _, - and .".into())
    }
}

/// Models, each with what follows it: the options are read in their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Models(pub Vec<Placed>);

/// A model and where it goes.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    pub path: PathBuf,
    /// Which of the materials, counted from 0.
    pub material: u32,
    pub scale: Option<[f32; 3]>,
    /// Degrees.
    pub rotate: Option<[f32; 3]>,
    pub translate: Option<[f32; 3]>,
    pub matrix: Option<[[f32; 4]; 3]>,
}

impl Args for Models {
    fn augment_args(command: clap::Command) -> clap::Command {
        let place = |name: &'static str, values: &[&'static str], help: &'static str| {
            clap::Arg::new(name)
                .long(name)
                .num_args(values.len())
                .value_names(values.to_vec())
                .action(clap::ArgAction::Append)
                .allow_negative_numbers(true)
                .value_parser(finite)
                .help(help)
        };
        command
            .arg(
                clap::Arg::new("model")
                    .long("model")
                    .num_args(2)
                    .value_names(["PATH", "MATERIAL"])
                    .action(clap::ArgAction::Append)
                    .required(true)
                    .help(
                        "A GLB, glTF or OBJ file, and the number of the material that it is made of, from 0; may be \
                         repeated. The next four are about the model before them",
                    ),
            )
            .arg(place("scale", &["X", "Y", "Z"], "Factors along the axes, of the model before"))
            .arg(place(
                "rotate",
                &["X", "Y", "Z"],
                "Degrees about the axes x, then y, then z, of the model before, once scaled",
            ))
            .arg(place("translate", &["X", "Y", "Z"], "How far the model before is moved, once turned"))
            .arg(place(
                "matrix",
                &["XX", "XY", "XZ", "XW", "YX", "YY", "YZ", "YW", "ZX", "ZY", "ZZ", "ZW"],
                "Instead of these: three rows of a matrix by which columns (x, y, z, 1) are multiplied",
            ))
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        Self::augment_args(command)
    }
}

impl clap::FromArgMatches for Models {
    fn from_arg_matches(matches: &clap::ArgMatches) -> Result<Self, clap::Error> {
        let wrong = |text: String| clap::Error::raw(clap::error::ErrorKind::ValueValidation, text + "\n");
        // Where on the command line the first value of each occurrence stands.
        let places = |name: &str, values: usize| -> Vec<usize> {
            matches.indices_of(name).into_iter().flatten().step_by(values).collect()
        };
        let words: Vec<&String> = matches.get_many("model").into_iter().flatten().collect();
        let mut models = Vec::new();
        for words in words.chunks_exact(2) {
            let material = words[1].parse().map_err(|_| {
                wrong(format!(
                    "--model {} {}: after the path comes the number of a material, from 0 in the order of --material",
                    words[0], words[1]
                ))
            })?;
            let path = PathBuf::from(words[0]);
            models.push(Placed { path, material, scale: None, rotate: None, translate: None, matrix: None });
        }
        let starts = places("model", 2);
        for (name, values) in [("scale", 3), ("rotate", 3), ("translate", 3), ("matrix", 12)] {
            let numbers: Vec<f32> = matches.get_many(name).into_iter().flatten().copied().collect();
            for (place, numbers) in places(name, values).into_iter().zip(numbers.chunks_exact(values)) {
                let Some(before) = starts.iter().rposition(|&start| start < place) else {
                    return Err(wrong(format!("--{name} is about the --model before it, and there is none")));
                };
                let model: &mut Placed = &mut models[before];
                let three = || [numbers[0], numbers[1], numbers[2]];
                let twice = match name {
                    "scale" => model.scale.replace(three()).is_some(),
                    "rotate" => model.rotate.replace(three()).is_some(),
                    "translate" => model.translate.replace(three()).is_some(),
                    _ => {
                        let row = |i: usize| std::array::from_fn(|k| numbers[4 * i + k]);
                        model.matrix.replace([row(0), row(1), row(2)]).is_some()
                    }
                };
                if twice {
                    let path = model.path.display();
                    return Err(wrong(format!("--{name} is there twice for --model {path}; leave one out")));
                }
            }
        }
        Ok(Self(models))
    }

    fn update_from_arg_matches(&mut self, matches: &clap::ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// What `bvh` does.
#[derive(Debug, Subcommand)]
pub enum BvhCommand {
    /// Build a scene's binary tree and store it, for `runner run SCENE --bvh FILE` to start from
    ///
    /// The file holds the tree, what it was built by, and hashes of itself and of the scene's triangles: a damaged
    /// one, or one of another scene, is refused.
    #[command(after_help = PRECOMPUTE_EXAMPLES)]
    Precompute(Precompute),
}

/// What `bvh precompute` builds.
#[derive(Debug, Args)]
pub struct Precompute {
    /// The scene
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// How the tree is built, the same as `--set build.method=METHOD`; on the device when left out
    #[arg(long, value_enum, value_name = "METHOD")]
    pub build: Option<Build>,
    #[command(flatten)]
    pub tuning: Tuning,
    /// Where the tree goes
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
}

/// How a binary tree is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Build {
    /// Clustering along a Morton curve, on the device; parameters morton.* and ploc.*
    Ploc,
    /// The same up the hierarchy of the codes, in a single launch; parameters morton.* and hploc.*
    Hploc,
    /// Spatial splits, on the CPU: better, and slower to build; parameters sbvh.*
    Sbvh,
    /// Boxes halved in the middle, on the CPU, as RTRS does; no parameters
    Midpoint,
}

impl From<Build> for tracer::builder::Method {
    fn from(build: Build) -> Self {
        match build {
            Build::Ploc => Self::Ploc,
            Build::Hploc => Self::Hploc,
            Build::Sbvh => Self::Sbvh,
            Build::Midpoint => Self::Midpoint,
        }
    }
}

/// What `config` does.
#[derive(Debug, Subcommand)]
pub enum ConfigCommand {
    /// Print the JSON Schema of configs, by which editors complete and check them
    Schema,
}

/// What `run` measures.
#[derive(Debug, Args)]
pub struct Run {
    /// Scenes to measure
    #[arg(required = true, value_name = "SCENE")]
    pub scenes: Vec<String>,
    /// Variants to measure; `*` stands for anything, `all` for every variant
    #[arg(long, value_name = "NAME", default_value = "Binary")]
    pub variant: Vec<String>,
    /// Start every variant from the binary tree in this file, which `runner bvh precompute` wrote, instead of building
    /// one
    #[arg(long, value_name = "FILE")]
    pub bvh: Option<PathBuf>,
    /// Views, by number or name, such as `0,3` or `0-3`; all when left out
    #[arg(long, value_name = "LIST")]
    pub views: Option<String>,
    /// How rays are launched while they are timed
    #[arg(long, value_enum, default_value_t)]
    pub method: Method,
    /// Samples of each view: paths a pixel, 15 on a GPU and 3 on a CPU driver when left out, or with --method replay
    /// launches of each bounce, 10 when left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub samples: Option<u32>,
    /// Samples traced before them from each view and thrown away; on a GPU at least 0.15 seconds' worth (0.4
    /// before the first view), more for as long as its clock still rises, and 0.4 seconds of builds before those that
    /// count, unless it is 0
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub warm_up: u32,
    /// Measured builds of each tree, after the warm-up; 10 on a GPU and 3 on a CPU driver when left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub builds: Option<u32>,
    #[command(flatten)]
    pub paths: Paths,
    /// Where the record goes; it is written anew after each view
    #[arg(short, long, value_name = "FILE.json")]
    pub output: Option<PathBuf>,
    /// Put this computer's name into the record
    #[arg(long)]
    pub host_name: bool,
}

/// What `sweep` measures.
#[derive(Debug, Args)]
pub struct Sweep {
    /// The experiment, such as `configs/quick.toml`; configs/README.md explains the format
    #[arg(value_name = "CONFIG.toml")]
    pub config: PathBuf,
    /// Only print the points that are left to measure, and about how long they take
    #[arg(long)]
    pub plan: bool,
    /// Folder of the journal and the record; a sweep that was stopped goes on there
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub tuning: Tuning,
    /// Only points with this value of an axis; scene, variant and view are axes too. Several values of one axis
    /// add up
    #[arg(long, value_name = "AXIS=VALUE")]
    pub only: Vec<String>,
    /// Take another config's settings where this one has none, such as configs/tuned/DEVICE.toml
    #[arg(long, value_name = "CONFIG.toml")]
    pub include: Vec<PathBuf>,
    /// Measure share I of N, the same at all times; `runner merge` joins them
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,
    /// Print what happens, and with --plan the points, as lines of JSON
    #[arg(long)]
    pub json: bool,
    /// What the GPU is locked to: samples far below it are left out of the means. Without it, its base clock
    #[arg(long, value_name = "MHZ", value_parser = clap::value_parser!(u32).range(1..))]
    pub locked_clock: Option<u32>,
    /// Put this computer's name into the record
    #[arg(long)]
    pub host_name: bool,
}

/// What `roofline` measures.
#[derive(Debug, Args)]
pub struct Roofline {
    /// Fewer sizes and fewer launches: a few seconds, also on a CPU driver
    #[arg(long)]
    pub quick: bool,
    /// Where it goes, for `compare`
    #[arg(short, long, value_name = "FILE.json")]
    pub output: Option<PathBuf>,
    /// Print JSON instead of tables
    #[arg(long)]
    pub json: bool,
}

/// What `merge` joins.
#[derive(Debug, Args)]
pub struct Merge {
    /// Folders that `sweep -o` wrote
    #[arg(required = true, value_name = "DIR")]
    pub folders: Vec<PathBuf>,
    /// Where the record goes
    #[arg(short, long, value_name = "RECORD.json")]
    pub output: PathBuf,
    /// Join what differs in device, driver, clocks, shaders or settings, and take the first of what is there twice
    #[arg(long)]
    pub anyway: bool,
    /// Write a record although points are missing
    #[arg(long)]
    pub incomplete: bool,
}

/// What `best` judges.
#[derive(Debug, Args)]
pub struct Best {
    /// Records, or folders of sweeps; each is judged by itself
    #[arg(required = true, value_name = "RECORD.json")]
    pub records: Vec<PathBuf>,
    /// Which rays decide on axes that concern both kinds; whole paths when left out
    #[arg(long, value_enum)]
    pub rays: Option<Kind>,
    /// Write the best values as a config that others include, such as configs/tuned/DEVICE.toml
    #[arg(short, long, value_name = "FILE.toml")]
    pub output: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// A method of measuring.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// Each sample traces whole paths of its own, one a pixel
    #[default]
    Paths,
    /// The rays of each bounce of one path a pixel are collected once, and each sample launches the same ones again:
    /// what bounces 0 to 8 take by themselves (Ylitie et al. 2017)
    Replay,
}

impl From<Method> for record::Method {
    fn from(method: Method) -> Self {
        match method {
            Method::Paths => Self::Paths,
            Method::Replay => Self::Replay,
        }
    }
}

/// A kind of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// From the camera
    Primary,
    /// Of all bounces
    Secondary,
    /// Of whole paths
    All,
}

impl From<Kind> for record::Rays {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Primary => Self::Primary,
            Kind::Secondary => Self::Secondary,
            Kind::All => Self::All,
        }
    }
}

/// What `tune` looks for.
#[derive(Debug, Args)]
pub struct Tune {
    /// Scenes to be fast in
    #[arg(required = true, value_name = "SCENE")]
    pub scenes: Vec<String>,
    /// Variants to tune, one after the other; `*` stands for anything, `all` for every variant
    #[arg(long, value_name = "NAME", default_value = "Binary")]
    pub variant: Vec<String>,
    /// Views, by number or name, such as `0,3` or `0-3`; all when left out
    #[arg(long, value_name = "LIST")]
    pub views: Option<String>,
    /// Samples a view that the last contenders get, and each combination would get in the full grid
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..))]
    pub samples: u32,
    #[command(flatten)]
    pub paths: Paths,
    /// Where the best values go, as a config that others include; it is written anew after each round
    #[arg(short, long, value_name = "FILE.toml")]
    pub output: Option<PathBuf>,
}

/// Which paths are traced, how, and at which clock.
#[derive(Clone, Debug, Args)]
pub struct Paths {
    /// Picture size; 1920x1080 on a GPU and 320x180 on a CPU driver when left out
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// Most rays in a path, the primary ray included; 8 when left out, and 9 with `run --method replay`
    #[arg(long, value_name = "D", value_parser = clap::value_parser!(u32).range(1..=64))]
    pub depth: Option<u32>,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 0)]
    pub seed: u32,
    /// How light is gathered, the same as `--set shade.integrator=NAME`
    #[arg(long, value_enum, value_name = "NAME")]
    pub integrator: Option<Integrator>,
    #[command(flatten)]
    pub tuning: Tuning,
    /// What the GPU is locked to: samples below 95% of it are left out of the means. Without it, its base clock
    #[arg(long, value_name = "MHZ", value_parser = clap::value_parser!(u32).range(1..))]
    pub locked_clock: Option<u32>,
}

/// How light is gathered along a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Integrator {
    /// Path tracing: rays go on in random directions, and light is what emits and the sky
    Path,
    /// Lambert's and Blinn's and Phong's terms of point lights and of one at the camera, ambient light, and mirror
    /// reflections; parameters shade.ambience and shade.camera_light
    Phong,
}

impl Integrator {
    fn assignment(self) -> String {
        let name = self.to_possible_value().expect("none is hidden");
        format!("shade.integrator={}", name.get_name())
    }
}

impl Cli {
    /// Reads the command line. What is an option of its own for a parameter becomes its assignment.
    pub fn read() -> Self {
        let mut cli = Self::parse();
        cli.settle();
        cli
    }

    fn settle(&mut self) {
        let (integrator, tuning) = match &mut self.command {
            Command::Run(Run { paths, .. }) | Command::Tune(Tune { paths, .. }) => {
                (paths.integrator, &mut paths.tuning)
            }
            Command::Render(Render { seen, .. }) | Command::Rays(Rays { seen, .. }) => {
                (seen.integrator, &mut seen.tuning)
            }
            _ => return,
        };
        tuning.set.extend(integrator.map(Integrator::assignment));
    }
}

/// Parameters of the stages.
#[derive(Clone, Debug, Default, Args)]
pub struct Tuning {
    /// Set a parameter of a stage, such as `collapse.c_t=3`; a wrong name prints all of them
    #[arg(long, value_name = "NAME=VALUE")]
    pub set: Vec<String>,
}

/// One scene seen from one view.
#[derive(Debug, Args)]
pub struct Seen {
    /// The scene
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// View, by number or name
    #[arg(long, default_value = "0")]
    pub view: String,
    /// Variant that traces
    #[arg(long, value_name = "NAME", default_value = "Binary")]
    pub variant: String,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 0)]
    pub seed: u32,
    /// How light is gathered, the same as `--set shade.integrator=NAME`
    #[arg(long, value_enum, value_name = "NAME")]
    pub integrator: Option<Integrator>,
    #[command(flatten)]
    pub tuning: Tuning,
}

/// What `render` draws.
#[derive(Debug, Args)]
pub struct Render {
    #[command(flatten)]
    pub seen: Seen,
    /// Path samples a pixel
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
    pub samples: u32,
    /// Picture size
    #[arg(long, value_name = "WxH", default_value = "960x540")]
    pub size: Size,
    /// Most rays in a path, the primary ray included
    #[arg(long, value_name = "D", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub depth: u32,
    /// Brightness: doubles with every whole step
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_negative_numbers = true)]
    pub exposure: f32,
    /// Show what the primary ray of each pixel cost instead of the picture
    #[arg(long, value_enum)]
    pub heatmap: Option<Heatmap>,
    /// Where the picture goes
    #[arg(short, long, value_name = "OUT.png")]
    pub output: PathBuf,
}

/// Which cost a heat map shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Heatmap {
    /// Inner nodes visited
    Nodes,
    /// Boxes tested
    Boxes,
    /// Triangles tested
    Triangles,
}

impl Heatmap {
    /// What it shows of the costs of a ray.
    pub fn of(self, counts: &tracer::traverse::Counts) -> u32 {
        match self {
            Self::Nodes => counts.nodes,
            Self::Boxes => counts.boxes,
            Self::Triangles => counts.triangles,
        }
    }
}

/// What `rays` writes.
#[derive(Debug, Args)]
pub struct Rays {
    #[command(flatten)]
    pub seen: Seen,
    /// Which wavefront: 0 for primary rays, 1 for the first bounce, and so on
    #[arg(long, value_name = "K", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..64))]
    pub depth: u32,
    /// Picture size
    #[arg(long, value_name = "WxH", default_value = "1920x1080")]
    pub size: Size,
    /// Where the rays go
    #[arg(short, long, value_name = "RAYS")]
    pub output: PathBuf,
    /// Where their hits go
    #[arg(long, value_name = "HITS")]
    pub hits: Option<PathBuf>,
}

/// What `trace` does.
#[derive(Debug, Args)]
pub struct Trace {
    /// File of rays, as `runner rays` writes it
    #[arg(value_name = "RAYS")]
    pub rays: PathBuf,
    /// The scene they are traced through
    #[arg(long, value_name = "SCENE")]
    pub scene: String,
    /// Variant that traces
    #[arg(long, value_name = "NAME", default_value = "Binary")]
    pub variant: String,
    /// Times the rays are traced, one launch right after the other, once the device has been busy for a second
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..))]
    pub launches: u32,
    /// Launch as for primary rays; otherwise as for secondary ones
    #[arg(long)]
    pub primary: bool,
    #[command(flatten)]
    pub tuning: Tuning,
    /// Where the hits go
    #[arg(long, value_name = "HITS")]
    pub hits: Option<PathBuf>,
}

/// What `validate` checks.
#[derive(Debug, Args)]
pub struct Validate {
    /// The scene
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// Variants to check; `*` stands for anything, `all` for every variant
    #[arg(long, value_name = "NAME", default_value = "all")]
    pub variant: Vec<String>,
    /// Views that rays are taken from, by number or name; all when left out
    #[arg(long, value_name = "LIST")]
    pub views: Option<String>,
    /// Picture size: one path a pixel
    #[arg(long, value_name = "WxH", default_value = "96x54")]
    pub size: Size,
    /// Most rays in a path, the primary ray included
    #[arg(long, value_name = "D", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub depth: u32,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 0)]
    pub seed: u32,
    /// Tests of rays with triangles, in millions, that brute force may take for each set of rays
    #[arg(long, value_name = "MILLIONS", default_value_t = 1000)]
    pub brute_force: u64,
    #[command(flatten)]
    pub tuning: Tuning,
}

/// Picks items by a list of numbers, ranges and names, such as `0,3-5,door`.
pub fn pick(names: &[String], list: &str) -> Result<Vec<usize>, String> {
    let mut picked = Vec::new();
    for part in list.split(',').map(str::trim).filter(|p| !p.is_empty()) {
        let number = |text: &str| text.parse::<usize>().ok().filter(|n| *n < names.len());
        let range = part.split_once('-').and_then(|(a, b)| Some(number(a)?..=number(b)?));
        if let Some(n) = number(part) {
            picked.push(n);
        } else if let Some(range) = range {
            picked.extend(range);
        } else if let Some(n) = names.iter().position(|name| name == part) {
            picked.push(n);
        } else {
            let all: Vec<_> = names.iter().enumerate().map(|(i, n)| format!("{i} {n}")).collect();
            return Err(format!("no view {part:?}; there are: {}", all.join(", ")));
        }
    }
    if picked.is_empty() { Err(format!("{list:?} names no view")) } else { Ok(picked) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_sound() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }

    #[test]
    fn the_last_value_counts_and_lists_grow() {
        let cli = Cli::parse_from(
            "runner run a --size 2x2 --samples 1 --variant x --set a=1 --size 4x3 --samples 5 --set b=2 -q --variant y"
                .split(' '),
        );
        let Command::Run(run) = cli.command else { panic!("another command") };
        assert_eq!((run.paths.size, run.samples), (Some(Size { width: 4, height: 3 }), Some(5)));
        assert_eq!((run.variant.len(), run.paths.tuning.set.len()), (2, 2));
    }

    #[test]
    fn an_integrator_is_a_parameter() {
        for (command, phong) in [("run", true), ("tune", true), ("render", true), ("run", false)] {
            let output = if command == "run" { "" } else { " -o x" };
            let chosen = if phong { " --integrator phong" } else { "" };
            let mut cli = Cli::parse_from(format!("runner {command} a --set b=1{chosen}{output}").split(' '));
            cli.settle();
            let tuning = match cli.command {
                Command::Run(run) => run.paths.tuning,
                Command::Tune(tune) => tune.paths.tuning,
                Command::Render(render) => render.seen.tuning,
                _ => panic!("another command"),
            };
            let set: Vec<_> = tuning.set.iter().map(String::as_str).collect();
            assert_eq!(set, if phong { &["b=1", "shade.integrator=phong"][..] } else { &["b=1"] });
        }
    }

    #[test]
    fn what_places_a_model_follows_it() {
        let line = "runner scene construct --out x.toml --camera-pos 0 0 9 0 0 0 --model a.glb 0 --translate -1 2 3 \
                    --light 1 2 3 4 --rotate 0 90 0 --model b.glb 1 --model c.glb 2 --scale 2 2 2";
        let Command::Scene(SceneCommand::Construct(construct)) = Cli::parse_from(line.split(' ')).command
        else {
            panic!("another command")
        };
        let models = construct.models.0;
        assert_eq!((models[0].translate, models[0].rotate), (Some([-1.0, 2.0, 3.0]), Some([0.0, 90.0, 0.0])));
        assert_eq!((models[0].scale, models[1].scale, models[2].scale), (None, None, Some([2.0; 3])));
        assert_eq!((models[2].path.to_str(), models[2].material), (Some("c.glb"), 2));
        for (old, new, words) in [
            ("--model a.glb 0 ", "", "is about the --model before it"),
            ("--rotate 0 90 0", "--translate 0 0 0", "twice for --model a.glb"),
            ("a.glb 0", "a.glb first", "after the path comes the number"),
            ("--scale 2 2 2", "--scale 2 2 inf", "finite"),
            ("--light 1 2 3 4", "--light 1 2 nan 4", "finite"),
            ("--light 1 2 3 4", "--light 1 2 3", "4 values required"),
            ("--out x.toml ", "", "--out"),
        ] {
            let error = Cli::try_parse_from(line.replacen(old, new, 1).split(' ')).unwrap_err().to_string();
            assert!(error.contains(words), "{new}: {error}");
        }
    }

    #[test]
    fn every_option_is_explained() {
        use clap::CommandFactory;
        let mut cli = Cli::command();
        cli.build();
        for command in cli.get_subcommands().chain([&cli]).filter(|c| c.get_name() != "help") {
            assert!(command.get_about().is_some(), "{}", command.get_name());
            for arg in command.get_arguments() {
                assert!(arg.get_help().is_some(), "{} {}", command.get_name(), arg.get_id());
            }
        }
    }

    #[test]
    fn sizes_are_read_or_explained() {
        assert_eq!("320x180".parse(), Ok(Size { width: 320, height: 180 }));
        assert!("320".parse::<Size>().unwrap_err().contains("1920x1080"));
        assert!("0x5".parse::<Size>().is_err());
        assert!("70000x5".parse::<Size>().is_err());
    }

    #[test]
    fn views_are_picked_by_number_range_and_name() {
        let names: Vec<String> = ["door", "window", "bar", "stairs"].map(String::from).to_vec();
        assert_eq!(pick(&names, "0,2-3").unwrap(), [0, 2, 3]);
        assert_eq!(pick(&names, "window, 0").unwrap(), [1, 0]);
        assert!(pick(&names, "7").unwrap_err().contains("3 stairs"));
        assert!(pick(&names, ",").is_err());
    }
}
