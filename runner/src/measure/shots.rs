//! What a sample is: whole paths of its own, or the rays of every bounce launched once more.

use super::{Plan, kernels::Kernels};
use crate::{
    params::Params,
    session::{Bounces, Loaded, Plant, Planted, Seen, Session, TraceMemory},
    variant::Variant,
};
use record::{Launch, Method};
use std::{
    rc::Rc,
    time::{Duration, Instant},
};
use tracer::{
    gpu::Pass,
    path::{Camera, PathTracer, WaveTime},
    scene::View,
    traverse::{Counting, Queue, Traversal, Tree, Wave},
};

/// The samples of one view.
pub struct Shots<'a> {
    session: &'a Session,
    tracer: &'a PathTracer<'a>,
    kernels: &'a Kernels,
    tree: &'a Tree,
    camera: &'a Camera,
    /// Of the method that replays them, the rays of each bounce.
    bounces: Option<Rc<Bounces>>,
}

/// What a sample took.
pub struct Shot {
    /// The traversal of each wavefront.
    pub depths: Vec<Launch>,
    /// All kernels, where there are others.
    pub frame_milliseconds: Option<f64>,
}

/// What finds the hits of a scene, whatever is measured.
fn plain(session: &Session, loaded: &Loaded) -> anyhow::Result<(Box<Planted>, Traversal)> {
    let (variant, params) = (Variant::BINARY, Params::of(Variant::BINARY));
    let Plant::Planted(planted) = session.plant(loaded, variant, &params, None, 1, |_| ())? else {
        unreachable!("{variant} does not go by view")
    };
    // Tracers that count have room for that, and want it done.
    let traversal = session.traversal(&planted.tree, variant, &params, Counting::Rays)?;
    Ok((planted, traversal))
}

impl<'a> Shots<'a> {
    /// Of a view that is seen through a tree. The rays that are to be launched again and again are collected here where
    /// no variant before has met them: those of the first sample's paths, in the order of their pixels.
    ///
    /// # Errors
    /// Too little memory, or the device failed.
    pub fn new(
        plan: &Plan,
        (session, loaded): (&'a Session, &Loaded),
        tracer: &'a PathTracer<'a>,
        kernels: &'a Kernels,
        tree: &'a Tree,
        (view, camera): (&View, &'a Camera),
    ) -> anyhow::Result<Self> {
        let bounces = match plan.method {
            Method::Paths => None,
            Method::Replay => {
                let seen = Seen { view: view.name.clone(), size: plan.size, path: plan.path.clone() };
                Some(loaded.wavefronts(&session.gpu, &seen, || {
                    let mut bounces = Vec::new();
                    let mut failed = None;
                    // Where nothing is hit there are no bounces: they are those of another variant.
                    let other = if kernels.hit() { None } else { Some(plain(session, loaded)?) };
                    let (counting, tree) = match &other {
                        Some((planted, traversal)) => (traversal, &planted.tree),
                        None => (&kernels.counting, tree),
                    };
                    // A traversal that counts, or would if the driver told, meets the same rays, and is there whichever
                    // kernels are timed.
                    tracer.wavefronts(counting, tree, camera, 0, |wave| {
                        if !wave.rays.is_empty() {
                            match TraceMemory::new(&session.gpu, &wave.rays) {
                                Ok(memory) => bounces.push(memory),
                                Err(error) => failed = Some(error),
                            }
                        }
                        failed.is_none()
                    })?;
                    failed.map_or(Ok(bounces), Err)
                })?)
            }
        };
        Ok(Self { session, tracer, kernels, tree, camera, bounces })
    }

    /// Takes a sample; where paths are traced, those of this number.
    ///
    /// # Errors
    /// The device failed.
    pub fn sample(&self, sample: u32) -> anyhow::Result<Shot> {
        match &self.bounces {
            None => {
                let measured = self.kernels.sample(self.tracer, self.tree, self.camera, sample)?;
                let waves = measured.waves.iter();
                let launch = |wave: &WaveTime| Launch { rays: wave.rays, milliseconds: wave.milliseconds };
                Ok(Shot {
                    depths: waves.map(launch).collect(),
                    frame_milliseconds: Some(measured.milliseconds),
                })
            }
            // Bounce after bounce in every sample, so that a slow change of the device meets all of them alike, and in one
            // submission, so that it stays busy: with one each, an H100 idled for longer than it traced and fell to
            // a third of its clock.
            Some(bounces) => {
                let traversal = self.kernels.separate()?;
                let mut pass = Pass::new(&self.session.gpu)?;
                self.record_round(&mut pass, bounces, traversal);
                for (bounce, wave) in bounces.waves.iter().enumerate() {
                    wave.record_queue(&mut pass, &bounces.queues, bounce);
                }
                let timings = pass.submit()?;
                let queues: Vec<Queue> = bounces.queues.read(0, bounces.waves.len())?;
                let launch = |(bounce, wave): (usize, &TraceMemory)| {
                    traversal.check(bounce, &queues[bounce])?;
                    let milliseconds = timings.milliseconds(&bounce.to_string());
                    Ok(Launch { rays: wave.count() as u64, milliseconds })
                };
                let depths = bounces.waves.iter().enumerate().map(launch).collect::<anyhow::Result<_>>()?;
                Ok(Shot { depths, frame_milliseconds: None })
            }
        }
    }

    /// Keeps the device busy for about so long, by samples that nobody looks at.
    ///
    /// # Errors
    /// The device failed.
    pub fn work(&self, time: Duration) -> anyhow::Result<()> {
        let started = Instant::now();
        let mut rounds = 1;
        while started.elapsed() < time {
            match &self.bounces {
                None => drop(self.sample(u32::MAX - 1)?),
                Some(bounces) => {
                    let traversal = self.kernels.separate()?;
                    let mut pass = Pass::new(&self.session.gpu)?;
                    pass.time_dispatches(false);
                    for _ in 0..rounds {
                        self.record_round(&mut pass, bounces, traversal);
                    }
                    pass.submit()?;
                    rounds = (2 * rounds).min(64);
                }
            }
        }
        Ok(())
    }

    fn record_round(&self, pass: &mut Pass, bounces: &Bounces, traversal: &Traversal) {
        for (bounce, wave) in bounces.waves.iter().enumerate() {
            wave.record(pass, &bounce.to_string(), traversal, self.tree, Wave::at(bounce));
        }
    }
}
