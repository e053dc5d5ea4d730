//! What the real controller and plant binaries promise, loaded as an importer loads them.

#![allow(missing_docs, reason = "tests have names")]

mod derivatives;
mod initialization;
mod inputs;
mod random_calls;
mod resources;
mod states;
mod threads;
mod time;

use fmu_host::model::example;
use fmu_host::{Functions, Instance, Library, Loop, Model};

/// Both binaries and both models of the example.
pub(crate) struct Pair {
    pub libraries: [Library; 2],
    pub models: [Model; 2],
}

impl Pair {
    pub fn load() -> Self {
        let design = example();
        Self {
            libraries: [Library::load("ftc_controller"), Library::load("ftc_plant")],
            models: [Model::controller(&design), Model::plant(&design)],
        }
    }

    pub fn functions(&self) -> [Functions; 2] {
        self.libraries.each_ref().map(|library| library.functions)
    }

    /// An instance of the controller (0) or of the plant (1).
    pub fn fresh(&self, which: usize) -> Instance {
        Instance::new(self.functions()[which], &self.models[which]).unwrap()
    }

    /// A loop that begins at `start`.
    pub fn close(&self, start: f64) -> Loop {
        Loop::new(self.functions(), self.models.each_ref(), start)
    }
}
