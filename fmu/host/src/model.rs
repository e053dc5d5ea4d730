//! Unpacked FMUs: the paper's example with gains made by hand, so that no solver is needed.

#[path = "../../../tests/common/mod.rs"]
mod common;

use common::Channel;
use ftc_control::Controller;
use ftc_record::{DesignRecord, Signals};
use ftc_simulate::PlantSimulator;
use ftc_simulate::plant::External;
use model_description::{CONTROLLER, DESIGN_FILE, Interface, PLANT, VariableTable};
use std::path::Path;
use tempfile::TempDir;

/// A folder of resources, removed when dropped, and what the XML would tell of it.
#[derive(Debug)]
pub struct Model {
    /// The resources.
    pub folder: TempDir,
    /// Their fingerprint.
    pub guid: String,
    /// The variables.
    pub table: VariableTable,
}

impl Model {
    /// The controller of a design.
    pub fn controller(design: &DesignRecord) -> Self {
        Self::unpacked(design, CONTROLLER, model_description::controller)
    }

    /// The plant of a design.
    pub fn plant(design: &DesignRecord) -> Self {
        Self::unpacked(design, PLANT, model_description::plant)
    }

    fn unpacked(
        design: &DesignRecord,
        identifier: &str,
        table: fn(&Interface) -> VariableTable,
    ) -> Self {
        let folder = tempfile::tempdir().expect("a folder for the resources");
        let bytes = model_description::write_design(design).expect("a design is plain data");
        std::fs::write(folder.path().join(DESIGN_FILE), &bytes).expect("the folder is writable");
        Self {
            folder,
            guid: model_description::guid(identifier, &bytes),
            table: table(&Interface::of(design)),
        }
    }

    /// The folder as an importer names it.
    pub fn location(&self) -> String {
        location(self.folder.path())
    }
}

/// A folder as a URI.
pub fn location(folder: &Path) -> String {
    format!("file://{}", folder.display())
}

/// The paper's example under noise, its modes switched at half time.
pub fn example() -> DesignRecord {
    let controller = common::controller_design(Channel::State, 0.005);
    let plant = common::plant(Channel::State);
    let signals = Signals::numbered(plant.dimensions());
    let scenario = common::scenario(common::reference("square"), 0.005, 1);
    DesignRecord::new("paper", plant, signals, controller, scenario)
}

/// Measurement and command of the native loop, controller first, at each of `ticks` ticks.
pub fn native(design: &DesignRecord, ticks: usize) -> Vec<(Vec<f64>, Vec<f64>)> {
    let controller = Controller::new(design.parameters()).expect("the example fits its plant");
    let plant = PlantSimulator::new(design.plant.clone(), design.scenario.clone());
    let (mut state, mut seen) = (controller.initial_state(0), plant.initial_state());
    let external = External::new(&[0.0; 2], &[0.0]);
    let tick = |_| {
        plant.observe(&mut seen, &external);
        let sample = controller
            .sample(seen.tick, seen.mode, &seen.y, &seen.reference)
            .expect("plant and controller have the same sizes");
        controller.tick(&mut state, &sample);
        let row = (seen.y.clone(), state.command.clone());
        plant
            .advance(&mut seen, &row.1)
            .expect("the example's plant can be integrated");
        row
    };
    (0..ticks).map(tick).collect()
}
