//! The scene on stage: the variant that traces it, its tree, and the picture that its samples add up to.

use super::camera::Pose;
use crate::{
    args::Heatmap,
    describe,
    measure::Kernels,
    params::Params,
    picture::{Picture, Scale},
    session::{Grown, Loaded, Plant, Session},
    variant::Variant,
};
use record::{Adaptation, Build, Counters};
use std::time::Duration;
use tracer::{
    gpu::Gpu,
    path::{self, Camera, Integrator, PathTracer, Shading},
    traverse::Tree,
};

/// What the user calls an integrator.
pub fn name(integrator: Integrator) -> &'static str {
    match integrator {
        Integrator::Path => "path tracing",
        Integrator::Phong => "local shading",
    }
}

/// What a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// The light that reaches it.
    Light(Integrator),
    /// What its primary ray cost.
    Cost(Heatmap),
}

/// Light, and then all heat maps, in the order of the key that goes through them.
pub const HEAT_MAPS: [Option<Heatmap>; 4] =
    [None, Some(Heatmap::Nodes), Some(Heatmap::Boxes), Some(Heatmap::Triangles)];

/// All that a picture depends on, so that one that differs in anything begins anew.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shot {
    pub pose: Pose,
    pub size: (u32, u32),
    pub depth: u32,
    pub variant: Variant,
    pub shown: Shown,
}

/// How many samples are in a picture.
#[derive(Debug)]
pub struct Progress<S> {
    of: Option<S>,
    samples: u32,
}

impl<S: PartialEq + Copy> Progress<S> {
    /// Of no picture yet.
    pub fn new() -> Self {
        Self { of: None, samples: 0 }
    }

    /// Begins the next sample of a picture: its number, 0 where the picture begins with it.
    pub fn next(&mut self, shot: &S) -> u32 {
        if self.of.as_ref() != Some(shot) {
            *self = Self { of: Some(*shot), samples: 0 };
        }
        self.samples += 1;
        self.samples - 1
    }

    /// The picture is spoilt: whatever comes next begins anew.
    pub fn spoil(&mut self) {
        self.of = None;
    }

    /// Whether there is no picture that anybody should see.
    pub fn is_spoilt(&self) -> bool {
        self.of.is_none()
    }

    /// How many samples a picture has.
    pub fn samples(&self) -> u32 {
        self.samples
    }
}

/// How often trees are built.
#[derive(Clone, Copy, Debug)]
pub struct Builds {
    /// Builds whose times are kept.
    pub kept: u32,
    /// Whether others come before them.
    pub warm_up: bool,
}

/// A scene that is looked at.
pub struct Stage<'a> {
    session: &'a Session,
    loaded: &'a Loaded,
    set: &'a [String],
    /// What a path is, but for its depth and integrator.
    path: path::Params,
    builds: Builds,
    actor: Actor,
    tracer: PathTracer<'a>,
    /// What the tracer was made for: size, depth and integrator.
    room: ((u32, u32), u32, Integrator),
    progress: Progress<Shot>,
    /// Sums over the samples of a heat map.
    costs: Vec<u32>,
}

/// A variant with all that it needs.
struct Actor {
    variant: Variant,
    params: Params,
    plant: Plant,
    build: Build,
    /// For which camera the tree is, where it goes by view.
    grown: Option<(Pose, Grown)>,
    kernels: Option<Kernels>,
}

impl Actor {
    fn new(
        session: &Session,
        loaded: &Loaded,
        variant: Variant,
        set: &[String],
        builds: Builds,
    ) -> anyhow::Result<Self> {
        let params = Params::with(variant, set)?;
        let mut repetitions = Vec::new();
        let warm_up = builds.warm_up.then_some(Duration::ZERO);
        let plant = session
            .plant(loaded, variant, &params, warm_up, builds.kept, |report| repetitions.push(report))?;
        Ok(Self { variant, params, plant, build: Build { repetitions }, grown: None, kernels: None })
    }

    /// The tree for a camera, and whether it is a new one. While the camera moves, the one from before will do: every
    /// tree finds the same hits.
    fn tree(
        &mut self,
        loaded: &Loaded,
        tracer: &PathTracer<'_>,
        (pose, camera): (Pose, &Camera),
        moving: bool,
    ) -> anyhow::Result<(Tree, bool)> {
        let seedling = match &self.plant {
            Plant::Planted(planted) => return Ok((planted.tree, false)),
            Plant::Seedling(seedling) => seedling,
        };
        match &self.grown {
            Some((of, grown)) if *of == pose || moving => Ok((grown.tree, false)),
            _ => {
                let grown = seedling.grow(loaded, tracer, camera)?;
                let tree = grown.tree;
                self.grown = Some((pose, grown));
                Ok((tree, true))
            }
        }
    }
}

impl<'a> Stage<'a> {
    /// A scene with its first variant.
    ///
    /// # Errors
    /// Too little memory, or a parameter is out of its range.
    pub fn new(
        (session, loaded): (&'a Session, &'a Loaded),
        variant: Variant,
        set: &'a [String],
        (size, path): ((u32, u32), &path::Params),
        builds: Builds,
    ) -> anyhow::Result<Self> {
        let actor = Actor::new(session, loaded, variant, set, builds)?;
        let tracer = PathTracer::new(&session.gpu, &loaded.device, size, path, true)?;
        Ok(Self {
            session,
            loaded,
            set,
            path: path.clone(),
            builds,
            actor,
            tracer,
            room: (size, path.depth, path.shade.integrator),
            progress: Progress::new(),
            costs: Vec::new(),
        })
    }

    /// Goes on with another variant; with the one from before where it fails.
    ///
    /// # Errors
    /// Too little memory, or a parameter is out of its range.
    pub fn cast(&mut self, variant: Variant) -> anyhow::Result<()> {
        self.actor = Actor::new(self.session, self.loaded, variant, self.set, self.builds)?;
        self.progress.spoil();
        Ok(())
    }

    /// Traces the next sample of a picture; what it took, where light was traced.
    ///
    /// # Errors
    /// The device failed.
    pub fn frame(&mut self, shot: &Shot, moving: bool) -> anyhow::Result<Option<path::Sample>> {
        debug_assert_eq!(shot.variant, self.actor.variant);
        let (session, loaded) = (self.session, self.loaded);
        let integrator = match shot.shown {
            Shown::Light(integrator) => integrator,
            // Primary rays are the same for both.
            Shown::Cost(_) => self.room.2,
        };
        let room = (shot.size, shot.depth, integrator);
        if self.room != room {
            let shade = Shading { integrator, ..self.path.shade.clone() };
            let path = path::Params { depth: shot.depth, shade, ..self.path.clone() };
            self.tracer = PathTracer::new(&session.gpu, &loaded.device, shot.size, &path, true)?;
            self.room = room;
        }
        let tracer = &self.tracer;
        let camera = Camera::new(&shot.pose.view(""), shot.size.0, shot.size.1);
        let (tree, new) = self.actor.tree(loaded, tracer, (shot.pose, &camera), moving)?;
        let actor = &mut self.actor;
        // Trees of different views may need stacks of different size.
        let compiled = actor.kernels.as_ref().is_some_and(|kernels| tree.stack <= kernels.stack());
        if !compiled {
            let kernels = actor.kernels.insert(Kernels::new(session, &tree, actor.variant, &actor.params)?);
            // The first launch may include compilation, and is none that anybody should see in the chart.
            kernels.sample(tracer, &tree, &camera, u32::MAX - 1)?;
        }
        let kernels = actor.kernels.as_ref().expect("compiled above");
        // Sample rays and warm-up have left light in the picture.
        if new || !compiled {
            self.progress.spoil();
        }
        let sample = self.progress.next(shot);
        match shot.shown {
            Shown::Light(_) => {
                if sample == 0 {
                    tracer.clear()?;
                }
                Ok(Some(kernels.sample(tracer, &tree, &camera, sample)?))
            }
            Shown::Cost(heatmap) => {
                let counts = tracer.primary_costs(&kernels.counting, &tree, &camera, sample)?;
                if sample == 0 {
                    self.costs = vec![0; counts.len()];
                }
                for (sum, counts) in self.costs.iter_mut().zip(&counts) {
                    *sum = sum.saturating_add(heatmap.of(counts));
                }
                Ok(None)
            }
        }
    }

    /// How many samples the picture has.
    pub fn samples(&self) -> u32 {
        self.progress.samples()
    }

    /// Whether the picture has to begin anew before anybody sees it.
    pub fn is_spoilt(&self) -> bool {
        self.progress.is_spoilt()
    }

    /// The picture so far, and of a heat map its scale.
    ///
    /// # Errors
    /// The device failed.
    pub fn picture(&self, shown: Shown, exposure: f32) -> anyhow::Result<(Picture, Option<Scale>)> {
        let width = self.room.0.0 as usize;
        match shown {
            Shown::Light(_) => {
                let sums = self.tracer.picture()?;
                Ok((Picture::tone_mapped(&sums, width, self.samples(), exposure), None))
            }
            Shown::Cost(_) => {
                let (picture, scale) = Picture::false_colours(&self.mean_costs(), width);
                Ok((picture, Some(scale)))
            }
        }
    }

    /// The same for a file, where a heat map has its scale below.
    ///
    /// # Errors
    /// The device failed.
    pub fn picture_to_keep(&self, shown: Shown, exposure: f32) -> anyhow::Result<Picture> {
        match shown {
            Shown::Light(_) => Ok(self.picture(shown, exposure)?.0),
            Shown::Cost(_) => Ok(Picture::heat_map(&self.mean_costs(), self.room.0.0 as usize).0),
        }
    }

    fn mean_costs(&self) -> Vec<u32> {
        let samples = self.samples().max(1);
        self.costs.iter().map(|sum| (sum + samples / 2) / samples).collect()
    }

    /// The device.
    pub fn gpu(&self) -> &'a Gpu {
        &self.session.gpu
    }

    /// Who traces.
    pub fn variant(&self) -> Variant {
        self.actor.variant
    }

    /// A point of a record for the variant, without views.
    pub fn point(&self) -> record::Point {
        record::Point {
            scene: describe::scene(&self.loaded.scene),
            variant: self.actor.variant.to_string(),
            parameters: self.actor.params.by_name(),
            build: self.actor.build.clone(),
            tree: self.actor.plant.statistics().clone(),
            kernels: self.actor.kernels.as_ref().map(Kernels::recorded).unwrap_or_default(),
            adopted: self.loaded.given().map(|given| given.adopted.clone()),
            views: Vec::new(),
            measurement: None,
        }
    }

    /// How the tree of the camera was made, where it has one of its own.
    ///
    /// # Errors
    /// The device failed.
    pub fn adaptation(&self) -> anyhow::Result<Option<Adaptation>> {
        let (Plant::Seedling(seedling), Some((_, grown))) = (&self.actor.plant, &self.actor.grown) else {
            return Ok(None);
        };
        Ok(Some(Adaptation {
            sampling_milliseconds: vec![grown.sampling_milliseconds],
            build: Build { repetitions: vec![describe::repetition(&grown.build)] },
            tree: seedling.measure(grown)?,
        }))
    }

    /// What the rays of a picture's first sample meet; nothing where the driver does not tell. The picture begins anew
    /// afterwards.
    ///
    /// # Errors
    /// The device failed.
    pub fn count(&mut self, pose: Pose) -> anyhow::Result<Option<Counters>> {
        let Some(kernels) = self.actor.kernels.as_ref().filter(|kernels| kernels.count()) else {
            return Ok(None);
        };
        let tree = match (&self.actor.plant, &self.actor.grown) {
            (Plant::Planted(planted), _) => planted.tree,
            (Plant::Seedling(_), Some((_, grown))) => grown.tree,
            (Plant::Seedling(_), None) => return Ok(None),
        };
        let ((width, height), ..) = self.room;
        let camera = Camera::new(&pose.view(""), width, height);
        let counts = self.tracer.count(&kernels.counting, &tree, &camera, 0)?;
        self.progress.spoil();
        let subgroup_size = self.session.gpu.info().subgroup_size;
        Ok(Some(Counters { depths: counts.iter().map(|c| describe::count(c, subgroup_size)).collect() }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_add_up_until_anything_changes() {
        let view = tracer::scene::View {
            name: String::new(),
            eye: [0.0; 3],
            target: [1.0; 3],
            up: [0.0, 1.0, 0.0],
            vfov_degrees: 40.0,
        };
        let pose = Pose::of(&view);
        let shot = Shot {
            pose,
            size: (4, 3),
            depth: 8,
            variant: Variant::BINARY,
            shown: Shown::Light(Integrator::Path),
        };
        let mut moved = pose;
        moved.orbit(0.1, 0.0);
        let mut progress = Progress::new();
        assert_eq!([progress.next(&shot), progress.next(&shot), progress.next(&shot)], [0, 1, 2]);
        assert_eq!(progress.samples(), 3);
        for other in [
            Shot { pose: moved, ..shot },
            Shot { size: (3, 4), ..shot },
            Shot { depth: 7, ..shot },
            Shot { variant: Variant::ALL[2], ..shot },
            Shot { shown: Shown::Light(Integrator::Phong), ..shot },
            Shot { shown: Shown::Cost(Heatmap::Nodes), ..shot },
            Shot { shown: Shown::Cost(Heatmap::Boxes), ..shot },
        ] {
            assert_eq!([progress.next(&other), progress.next(&other)], [0, 1], "{other:?}");
            assert_eq!([progress.next(&shot), progress.next(&shot)], [0, 1], "back from {other:?}");
        }
        assert!(!progress.is_spoilt());
        progress.spoil();
        assert!(progress.is_spoilt());
        assert_eq!(progress.next(&shot), 0);
        assert!(!progress.is_spoilt());
    }
}
