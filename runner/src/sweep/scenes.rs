//! Scenes that stay loaded while the points of a sweep go back and forth between them.

use crate::session::{Loaded, Session};
use std::rc::Rc;

/// Bytes of device memory that a triangle of a loaded scene takes: its corners and its material.
const BYTES_A_TRIANGLE: u64 = 40;

/// The scenes used last, with the rays that were collected in them, as many as leave most of the memory to trees.
pub struct Scenes<'a> {
    session: &'a Session,
    /// The one used last comes last.
    loaded: Vec<(String, Rc<Loaded>)>,
    budget: u64,
}

impl<'a> Scenes<'a> {
    /// None yet.
    pub fn new(session: &'a Session) -> Self {
        // Building takes several times the memory of the triangles.
        Self { session, loaded: Vec::new(), budget: session.gpu.info().memory_bytes / 4 }
    }

    /// A scene, loaded where it is not.
    ///
    /// # Errors
    /// It cannot be loaded.
    pub fn get(&mut self, spec: &str) -> anyhow::Result<Rc<Loaded>> {
        if let Some(place) = self.loaded.iter().position(|(name, _)| name == spec) {
            let found = self.loaded.remove(place);
            self.loaded.push(found);
        } else {
            let new = Rc::new(self.session.load(spec)?);
            self.loaded.push((spec.to_owned(), new));
            let bytes = |loaded: &Loaded| {
                loaded.scene.positions.len() as u64 * BYTES_A_TRIANGLE + loaded.wavefront_bytes()
            };
            while self.loaded.len() > 1
                && self.loaded.iter().map(|(_, loaded)| bytes(loaded)).sum::<u64>() > self.budget
            {
                self.loaded.remove(0);
            }
        }
        Ok(self.loaded.last().expect("put there above").1.clone())
    }
}
