use crate::{Kernel, Parameters, Telemetry, Timestamp, Verdict};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One scene, traced with one variant and one set of parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Point {
    /// The scene.
    pub scene: Scene,
    /// Name of the variant, such as `Wide4 Quantized`.
    pub variant: String,
    /// The parameters in which this point differs from the rest of the run.
    #[serde(default)]
    pub parameters: Parameters,
    /// The file that the binary tree was taken from; absent where it was built here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adopted: Option<Adopted>,
    /// How long the build took; of a variant that goes by view, the first build, that of the binary tree.
    pub build: Build,
    /// What the build made; of a variant that goes by view, see the views.
    pub tree: Tree,
    /// The kernels that traced its rays; none in records from before they were kept.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kernels: Vec<Kernel>,
    /// What was measured from each view.
    pub views: Vec<View>,
    /// How measuring it went; absent in records from before that was kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measurement: Option<Measurement>,
}

/// A binary tree that was built before, and stored in a file: builds begin with it, and their times are of what follows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Adopted {
    /// Name of the file, without the folder it lay in.
    pub name: String,
    /// SHA-256 of its bytes, in hexadecimal.
    pub sha256: String,
    /// The method that the tree was built with: `ploc`, `sbvh` or `midpoint`.
    pub method: String,
    /// What that method went by, as `stage.name`.
    pub parameters: Parameters,
    /// Seconds that building it took, then: no time in this record includes them.
    pub built_seconds: f64,
    /// Milliseconds of reading and checking the file, once for all builds, and in none of their times.
    pub read_milliseconds: f64,
}

/// How measuring a point went.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Measurement {
    /// Which of the record's `parts` measured it; 0 where there are none.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub part: u32,
    /// How many points the same part had measured before it, references included.
    pub position: u64,
    /// When it began.
    pub started: Timestamp,
    /// When it ended.
    pub finished: Timestamp,
    /// Why no more samples were taken.
    pub stopped: Stop,
    /// Whether too few samples of a view count: fewer than the fewest that `stopping` asks for, or without it fewer
    /// than half. The rates are then hearsay.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub unreliable: bool,
    /// Whether the device was slowed down between `started` and `finished`; absent in older records.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verdict: Option<Verdict>,
}

fn is_zero(number: &u32) -> bool {
    *number == 0
}

/// Why no more samples of a point were taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Stop {
    /// Its rates were known well enough.
    Precise,
    /// Each view had the most samples it may have.
    Samples,
    /// It had taken the time it may take.
    Time,
    /// Somebody stopped the run.
    Interrupted,
}

/// A scene, and how it came to be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Scene {
    /// Name of the scene.
    pub name: String,
    /// Where its triangles come from.
    pub source: Source,
    /// Triangles that the tree was built from.
    pub triangles: u64,
    /// Triangles left out, by reason.
    pub skipped: BTreeMap<String, u64>,
    /// Milliseconds from opening the file, or starting the generator, to triangles in host memory.
    pub load_milliseconds: f64,
}

/// What names of parameters begin with that a scene's generator was given.
pub const OF_SCENE: &str = "scene.";

impl Scene {
    /// What its generator was given, as `scene.name`: what tells scenes of one name apart. Nothing of a file.
    pub fn parameters(&self) -> Parameters {
        let Source::Generator { parameters, .. } = &self.source else { return Parameters::default() };
        let named = parameters.0.iter().map(|(name, value)| (format!("{OF_SCENE}{name}"), value.clone()));
        Parameters(named.collect())
    }
}

/// Where a scene's triangles come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Source {
    /// A file.
    File {
        /// Its name, without the folder it lay in.
        name: String,
        /// SHA-256 of its bytes, in hexadecimal.
        sha256: String,
    },
    /// A generator.
    Generator {
        /// Its name.
        name: String,
        /// What it was given: seed, number of triangles and so on.
        parameters: Parameters,
        /// SHA-256 of the triangles it made, in hexadecimal, where somebody computed it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        sha256: Option<String>,
    },
}

/// Every repetition of the build of one tree.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Build {
    /// The repetitions, in the order measured.
    pub repetitions: Vec<Repetition>,
}

/// One build, from triangles in device memory to nodes that can be traversed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Repetition {
    /// Milliseconds from the first timestamp to the last, gaps between the phases included.
    pub milliseconds: f64,
    /// The phases, in the order in which they ran.
    pub phases: Vec<Phase>,
    /// Kernels launched, fills and copies; absent where nobody knows, as of the driver's own builder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub launches: Option<u32>,
}

/// One phase of a build.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Phase {
    /// Name of the phase.
    pub name: String,
    /// Milliseconds it took on the device.
    pub milliseconds: f64,
}

/// What a build made. What the driver does not tell of a tree that it has built is absent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Tree {
    /// Nodes, leaves that are stored inside their parent not counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nodes: Option<u64>,
    /// Leaves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leaves: Option<u64>,
    /// Bytes of all nodes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub node_bytes: Option<u64>,
    /// Bytes of all triangles as the traversal reads them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub triangle_bytes: Option<u64>,
    /// Bytes of nodes and triangles together; only where they are not known apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bytes: Option<u64>,
    /// Children of a node, on average.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub average_children: Option<f64>,
    /// Triangles of a leaf, on average.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub average_triangles_per_leaf: Option<f64>,
    /// Most edges between the root and a leaf.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth: Option<u32>,
    /// Cost by the surface area heuristic, with the costs that the parameters name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sah_cost: Option<f64>,
}

/// What was measured from one view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct View {
    /// Name of the view.
    pub name: String,
    /// How the view's own tree was made, where the variant goes by view.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adaptation: Option<Adaptation>,
    /// The samples, in the order measured.
    pub samples: Vec<Sample>,
    /// What the rays met, from a run of its own, so that counting never slows a timed one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub counters: Option<Counters>,
    /// The device's state before the first sample.
    pub before: Telemetry,
    /// The device's state after the last sample.
    pub after: Telemetry,
    /// Pictures rendered from this view, by path.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pictures: Vec<String>,
}

/// A tree made for one view (Cezner 2025, section 4.2.2): sample rays through the binary tree, then the
/// wide tree that suits them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Adaptation {
    /// Milliseconds from clearing the visit counts to having them, one for each repetition.
    pub sampling_milliseconds: Vec<f64>,
    /// How long it took to make the wide tree of the binary one.
    pub build: Build,
    /// What that made.
    pub tree: Tree,
}

/// One path sample of every pixel or, of the method `replay`, one launch of the rays of each bounce.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sample {
    /// The traversal of each wavefront: primary rays first, then one entry per bounce.
    pub depths: Vec<Launch>,
    /// Milliseconds of all its kernels from the first to the last, shading included: the time of a frame. Absent of the
    /// method `replay`, which shades nothing, and in records from before it was kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame_milliseconds: Option<f64>,
    /// Clock of the streaming multiprocessors right after it, in MHz, where it was read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sm_clock_mhz: Option<u32>,
    /// Why it does not count; absent if it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub excluded: Option<Exclusion>,
}

/// Why a sample is kept and does not count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Exclusion {
    /// The device was still warming up.
    WarmUp,
    /// The device said that it was being slowed down.
    Throttled,
    /// The clock was too low.
    LowClock,
}

/// The traversal of one wavefront.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Launch {
    /// Rays traced.
    pub rays: u64,
    /// Milliseconds that the traversal kernel took, and nothing else.
    pub milliseconds: f64,
}

/// What the rays of each wavefront met on their way through the tree.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Counters {
    /// Totals of each wavefront: primary rays first, then one entry per bounce.
    pub depths: Vec<Count>,
}

/// Totals over some rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Count {
    /// Rays counted.
    pub rays: u64,
    /// Nodes visited.
    pub nodes: u64,
    /// Boxes tested.
    pub boxes: u64,
    /// Triangles tested.
    pub triangles: u64,
    /// How well the subgroups were used that traced them; absent in records from before that was counted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub utilization: Option<Utilization>,
}

/// SIMD utilization (Ylitie et al. 2017, tables 7 and 10): what subgroups executed, and in how many of their lanes each
/// time. A step is counted where at least one lane takes part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Utilization {
    /// Lanes of a subgroup.
    pub subgroup_size: u32,
    /// Steps in which lanes visited a node.
    pub node_steps: u64,
    /// Lanes that did, over all these steps.
    pub node_lanes: u64,
    /// Steps in which lanes tested a triangle.
    pub triangle_steps: u64,
    /// Lanes that did, over all these steps.
    pub triangle_lanes: u64,
    /// Steps in which lanes fetched a ray and made it ready.
    pub fetches: u64,
    /// Lanes that did, over all these steps.
    pub fetch_lanes: u64,
}
