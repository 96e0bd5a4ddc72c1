//! The traversal kernels of a variant.

use crate::{params::Params, resources, session::Session, variant::Variant};
use anyhow::bail;
use tracer::{
    path::{self, Camera, PathTracer, SingleKernel},
    traverse::{self, Counting, Traversal, Tree},
};

/// The traversal kernels of a variant: those that are timed, and those that count.
pub struct Kernels {
    timed: Timed,
    /// Counts what rays meet, unless the driver traces them, which does not tell.
    pub counting: Traversal,
    counts: bool,
    hits: bool,
}

/// How paths are traced while they are timed.
enum Timed {
    Separate(Traversal),
    Single(SingleKernel),
}

impl Kernels {
    pub fn new(session: &Session, tree: &Tree, variant: Variant, params: &Params) -> anyhow::Result<Self> {
        let params = params.trace(variant);
        let timed = match params.kernels {
            traverse::Kernels::Separate => {
                Timed::Separate(Traversal::new(&session.gpu, &params, tree, Counting::Nothing)?)
            }
            traverse::Kernels::Single => Timed::Single(SingleKernel::new(&session.gpu, &params, tree)?),
        };
        // What a ray meets is the same in workgroups of any size: those that count need not be compiled for each.
        let usual = traverse::Params::default();
        let trace = traverse::Params {
            primary_subgroups: usual.primary_subgroups,
            secondary_subgroups: usual.secondary_subgroups,
            ..params
        };
        let (counts, hits) = (!variant.is_driver(), variant != Variant::BLANK);
        let counting = if counts { Counting::Rays } else { Counting::Nothing };
        Ok(Self { timed, counting: Traversal::new(&session.gpu, &trace, tree, counting)?, counts, hits })
    }

    /// Whether what rays meet can be counted.
    pub fn count(&self) -> bool {
        self.counts
    }

    /// Whether rays can hit anything.
    pub fn hit(&self) -> bool {
        self.hits
    }

    /// Entries of the traversal stack they were compiled with.
    pub fn stack(&self) -> u32 {
        self.counting.stack()
    }

    /// Those of single bounces.
    ///
    /// # Errors
    /// One kernel traces whole paths.
    pub fn separate(&self) -> anyhow::Result<&Traversal> {
        match &self.timed {
            Timed::Separate(traversal) => Ok(traversal),
            Timed::Single(_) => bail!(
                "the method replay launches each bounce by itself, and with trace.kernels=single one kernel traces \
                 whole paths"
            ),
        }
    }

    pub fn recorded(&self) -> Vec<record::Kernel> {
        match &self.timed {
            Timed::Separate(traversal) => resources::recorded(traversal),
            Timed::Single(single) => vec![resources::recorded_as(single.kernel(), "all")],
        }
    }

    pub fn sample(
        &self,
        tracer: &PathTracer<'_>,
        tree: &Tree,
        camera: &Camera,
        sample: u32,
    ) -> Result<path::Sample, tracer::Error> {
        match &self.timed {
            Timed::Separate(traversal) => tracer.sample(traversal, tree, camera, sample),
            Timed::Single(single) => tracer.sample_in_one(single, tree, camera, sample),
        }
    }
}
