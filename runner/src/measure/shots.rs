//! What a sample is: whole paths of its own, or the rays of every bounce launched once more.

use super::{Plan, kernels::Kernels};
use crate::session::{Loaded, Seen, Session, TraceMemory};
use record::{Launch, Method};
use std::rc::Rc;
use tracer::{
    path::{Camera, PathTracer},
    scene::View,
    traverse::{Tree, Wave},
};

/// The samples of one view.
pub struct Shots<'a> {
    session: &'a Session,
    tracer: &'a PathTracer<'a>,
    kernels: &'a Kernels,
    tree: &'a Tree,
    camera: &'a Camera,
    /// Of the method that replays them, the rays of each bounce.
    bounces: Option<Rc<Vec<TraceMemory>>>,
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
                    // A traversal that counts meets the same rays, and is there whichever kernels are timed.
                    tracer.wavefronts(&kernels.counting, tree, camera, 0, |wave| {
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
    pub fn sample(&self, sample: u32) -> anyhow::Result<Vec<Launch>> {
        match &self.bounces {
            None => {
                let measured = self.kernels.sample(self.tracer, self.tree, self.camera, sample)?;
                let waves = measured.waves.iter();
                Ok(waves.map(|wave| Launch { rays: wave.rays, milliseconds: wave.milliseconds }).collect())
            }
            // Bounce after bounce in every sample, so that a slow change of the device meets all of them alike.
            Some(bounces) => {
                let traversal = self.kernels.separate()?;
                let launch = |(bounce, rays): (usize, &TraceMemory)| {
                    let wave = Wave::at(bounce);
                    let milliseconds = rays.launch(&self.session.gpu, traversal, self.tree, wave)?;
                    Ok(Launch { rays: rays.count() as u64, milliseconds })
                };
                bounces.iter().enumerate().map(launch).collect()
            }
        }
    }
}
