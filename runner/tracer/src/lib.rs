//! Broadleaf's tracer: builds bounding volume hierarchies on the GPU, traces rays through them, and
//! measures both. It knows nothing of sweeps or of the record's JSON.

mod assemble;
pub mod builder;
pub mod bvh2;
pub mod collapse;
pub mod contract;
pub mod driver;
pub mod gpu;
pub mod hploc;
pub mod layout;
pub mod list;
pub mod measure;
pub mod midpoint;
pub mod morton;
pub mod path;
pub mod permutations;
pub mod ploc;
pub mod roofline;
pub mod sbvh;
pub mod scene;
pub mod sort;
pub mod traverse;
pub mod treefile;
mod upwards;
pub mod validate;

use gpu::RAY_TRACING;

/// What can go wrong between a scene and its hits.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The build has no kernels in a language.
    #[error("this build has no kernels in Slang: {reason}, and build again")]
    NotBuilt {
        /// What it lacked.
        reason: &'static str,
    },
    /// A workgroup's barrier with a schedule that has no place for it.
    #[error(
        "a barrier between nodes and triangles is for schedules in phases, which the compressed layout has none of: set \
         trace.primary_vote=0 and trace.secondary_vote=0, or leave the barrier out"
    )]
    BarrierByVote,
    /// The traversal stack's shared part is too large.
    #[error(
        "{entries} entries of the stack for each of {size} invocations are {bytes} bytes of shared memory, and a workgroup \
         has {limit}: set groups.shared_stack, trace.primary_subgroups or trace.secondary_subgroups lower"
    )]
    SharedStack {
        /// Invocations a workgroup.
        size: u32,
        /// Entries of each.
        entries: u32,
        /// What they take.
        bytes: u32,
        /// What there is.
        limit: u32,
    },
    /// Packets in a kernel that has none.
    #[error(
        "rays are traced in packets in GLSL, through Wide4, Wide6 and Wide8, and by subgroups of as many lanes: set \
         trace.primary_packets=0"
    )]
    NoPackets,
    /// What only kernels in GLSL have, in Slang.
    #[error("in Slang rays are traced without trace.octants and trace.end_together: set them to false and 0")]
    GlslOnly,
    /// What the subgroups of a workgroup share at the end is too large.
    #[error(
        "what {subgroups} subgroups share at the end are {bytes} bytes of shared memory, and a workgroup has {limit}: set \
         trace.primary_subgroups lower, or trace.end_together=0"
    )]
    SharedEnds {
        /// Subgroups a workgroup.
        subgroups: u32,
        /// What they share.
        bytes: u32,
        /// What there is.
        limit: u32,
    },
    /// The stacks of a workgroup's packets are too large.
    #[error(
        "{packets} stacks of {entries} entries are {bytes} bytes of shared memory, and a workgroup has {limit}: set \
         trace.primary_subgroups lower"
    )]
    PacketStacks {
        /// Packets a workgroup.
        packets: u32,
        /// Entries of each stack.
        entries: u32,
        /// What they take.
        bytes: u32,
        /// What there is.
        limit: u32,
    },
    /// The single kernel is asked for what only separate kernels have.
    #[error("a single kernel there is in GLSL only, and without a barrier: set trace.kernels=separate")]
    NoSingleKernel,
    /// The driver does not trace rays.
    #[error(
        "Driver is unavailable: the driver of {device} ({driver}) has no VK_KHR_ray_tracing_pipeline; choose a device \
         that has it (`runner devices` lists {RAY_TRACING} among what is optional; Mesa's CPU driver has it from 25.0 \
         on), or leave the variant out"
    )]
    NoRayTracing {
        /// The device's name.
        device: String,
        /// Its driver, with the version.
        driver: String,
    },
    /// There is nothing that the driver could build a structure over, or too much.
    #[error("the driver builds over 1 to {most} triangles, and the scene has {triangles}; use another scene")]
    DriverTriangles {
        /// How many there are.
        triangles: usize,
        /// How many there may be.
        most: u64,
    },
    /// A kernel that measures what the device can do did something else.
    #[error(
        "{what}: {device} came to other results than the CPU, so its rate would mean nothing; update the driver, and \
         run with --validate"
    )]
    Roofline {
        /// What was measured.
        what: String,
        /// The device's name.
        device: String,
    },
    /// Something is asked of the driver's ray tracing that it does not tell.
    #[error("no driver tells what rays meet in its tree: {0}")]
    DriverTellsNot(&'static str),
    /// One kernel is to trace whole paths where there is no tree of ours.
    #[error(
        "one kernel traces whole paths only through trees of ours: set trace.kernels=separate, or choose another variant"
    )]
    SeparateKernels,
    /// There are no triangles to test rays against, or too many.
    #[error(
        "Naive tests each ray against every triangle, of 1 to {most}, and the scene has {triangles}: use a smaller scene, \
         or Direct, which has a tree"
    )]
    ListTriangles {
        /// How many there are.
        triangles: usize,
        /// How many there may be.
        most: usize,
    },
    /// The device or its driver.
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    /// The single kernel cannot be timed.
    #[error(
        "the driver of {device} has no clock that kernels can read (shaderDeviceClock of VK_KHR_shader_clock), \
         which tracing in a single kernel needs; use trace.kernels=separate"
    )]
    NoClock {
        /// The device's name.
        device: String,
    },
    /// The driver ended a traversal loop before its rays were done.
    #[error(
        "{unfinished} of {rays} rays at depth {depth} were not finished: the driver of {device} ends long \
         loops silently; use Mesa 25 or newer (Debian's backports have it), or a smaller picture"
    )]
    LoopLimit {
        /// Depth of the wavefront.
        depth: usize,
        /// Rays without a result.
        unfinished: u32,
        /// Rays in the wavefront.
        rays: u32,
        /// The device's name.
        device: String,
    },
}
