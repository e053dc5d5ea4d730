//! The plant under a scenario, sample by sample: what the plant FMU runs.

mod derivative;

pub use derivative::Change;

use super::integrate::Stalled;
use super::noise;
use super::scenario::Scenario;
use super::truth::{self, Truth};
use crate::control::kernel;
use crate::plant::SwitchedPlant;
use crate::state::State;
use serde::{Deserialize, Serialize};

/// A plant and its scenario: immutable, shared by any number of [`PlantState`]s.
#[derive(Clone, Debug)]
pub struct PlantSimulator {
    plant: SwitchedPlant,
    truth: Truth,
    scenario: Scenario,
    /// `x0 - A x0 - B u0` per mode (n).
    state_offsets: Vec<Vec<f64>>,
    /// `y0 - C x0` per mode (p).
    output_offsets: Vec<Vec<f64>>,
}

/// Signals added from outside, or in place of the scenario.
#[derive(Clone, Copy, Debug)]
pub struct External<'a> {
    /// Fault added to each sensor (p).
    pub fault: &'a [f64],
    /// Disturbance added to each channel (s).
    pub disturbance: &'a [f64],
    /// When set, the scenario's reference, fault, disturbance and schedule are off and this mode (0-based) is active.
    pub mode: Option<usize>,
    /// Whether the scenario's measurement noise is on.
    pub noise: bool,
}

/// The plant at one tick, with every signal an outside observer may see.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct PlantState {
    /// Tick this state belongs to.
    pub tick: u64,
    /// Active mode (0-based).
    pub mode: usize,
    /// State `x` (n).
    pub x: Vec<f64>,
    /// Measured output `y` (p).
    pub y: Vec<f64>,
    /// True output, without fault and noise (p).
    pub y_true: Vec<f64>,
    /// Fault `f`: what the sensor's failure adds (p); zero where the sensor gives no number.
    pub fault: Vec<f64>,
    /// Disturbance `w` (s).
    pub disturbance: Vec<f64>,
    /// Reference `y_ref` (r).
    pub reference: Vec<f64>,
    /// Measurement noise (p).
    pub noise: Vec<f64>,
    /// Last reading outside any event (p), for sensors that get stuck.
    last: Vec<f64>,
    /// Scratch (n).
    next: Vec<f64>,
}

crate::state::state!(PlantState {
    parts: [
        x,
        y,
        y_true,
        fault,
        disturbance,
        reference,
        noise,
        last,
        next
    ],
    constants: [],
    counters: [tick, mode]
});

impl PlantSimulator {
    /// Prepares a plant that is what it was designed for; see [`with_truth`](Self::with_truth).
    pub fn new(plant: SwitchedPlant, scenario: Scenario) -> Self {
        Self::with_truth(plant, Truth::AsDesigned, scenario)
    }

    /// Prepares a plant; the scenario's signals and the truth must have the design's sizes.
    pub fn with_truth(designed: SwitchedPlant, truth: Truth, scenario: Scenario) -> Self {
        let plant = truth.linear(&designed).clone();
        let collect = |v: nalgebra::DVector<f64>| v.iter().copied().collect::<Vec<f64>>();
        let state_offsets = plant
            .modes
            .iter()
            .map(|mode| collect(mode.state_offset()))
            .collect();
        let output_offsets = plant
            .modes
            .iter()
            .map(|mode| collect(mode.output_offset()))
            .collect();
        Self {
            plant,
            truth,
            scenario,
            state_offsets,
            output_offsets,
        }
    }

    /// The plant simulated.
    pub fn plant(&self) -> &SwitchedPlant {
        &self.plant
    }

    /// The scenario.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// At rest in the scenario's first mode, tick 0, outputs not yet observed.
    pub fn initial_state(&self) -> PlantState {
        self.initial_state_in(self.scenario.mode(0, self.plant.sample_time))
    }

    /// At rest at the operating point of `mode` (0-based), tick 0, outputs not yet observed.
    pub fn initial_state_in(&self, mode: usize) -> PlantState {
        let dims = self.plant.dimensions();
        let point = &self.plant.modes[mode].operating_point;
        PlantState {
            tick: 0,
            mode,
            x: point.x.clone(),
            y: vec![0.0; dims.outputs],
            y_true: vec![0.0; dims.outputs],
            fault: vec![0.0; dims.outputs],
            disturbance: vec![0.0; dims.disturbances],
            reference: vec![0.0; self.scenario.reference.len()],
            noise: vec![0.0; dims.outputs],
            last: point.y.clone(),
            next: vec![0.0; dims.states],
        }
    }

    /// Whether a state has the sizes of this plant; one that came as bytes may not.
    pub fn fits(&self, state: &PlantState) -> bool {
        state.mode < self.plant.modes.len() && state.same_shape(&self.initial_state())
    }

    /// Makes every output of the present tick from the present state.
    pub fn observe(&self, state: &mut PlantState, external: &External<'_>) {
        let te = self.plant.sample_time;
        let tick = state.tick;
        let scenario = &self.scenario;
        let built_in = external.mode.is_none();
        state.mode = self.active_mode(external, tick);
        let value =
            |signal: &super::scenario::Waveform| if built_in { signal.at(tick, te) } else { 0.0 };
        for (out, signal) in state.reference.iter_mut().zip(&scenario.reference) {
            *out = value(signal);
        }
        for ((out, signal), &added) in state
            .disturbance
            .iter_mut()
            .zip(&scenario.disturbance)
            .zip(external.disturbance)
        {
            *out = value(signal) + added;
        }
        for ((out, signal), &added) in state
            .fault
            .iter_mut()
            .zip(&scenario.fault)
            .zip(external.fault)
        {
            *out = value(signal) + added;
        }
        self.draw_noise(state, external.noise);
        let mode = &self.plant.modes[state.mode];
        kernel::affine(
            &mut state.y_true,
            &self.output_offsets[state.mode],
            &mode.c,
            &state.x,
        );
        kernel::add_product(&mut state.y_true, &mode.f, &state.disturbance);
        self.read_sensors(state, built_in);
    }

    /// The mode (0-based) at `tick`: the scenario's, unless another is given.
    fn active_mode(&self, external: &External<'_>, tick: u64) -> usize {
        external
            .mode
            .unwrap_or_else(|| self.scenario.mode(tick, self.plant.sample_time))
            .min(self.plant.modes.len() - 1)
    }

    /// Moves to the next tick under input `u` (m), held over the sample.
    ///
    /// # Errors
    /// [`Stalled`] where the nonlinear plant cannot be integrated; the tick then ends where that
    /// became so, and later ticks go on from there.
    pub fn advance(&self, state: &mut PlantState, u: &[f64]) -> Result<(), Stalled> {
        let result = match &self.truth {
            Truth::Rectifier(rectifier) => truth::advance_rectifier(
                rectifier,
                state.mode,
                &mut state.x,
                u,
                &state.disturbance,
                self.plant.sample_time,
            ),
            Truth::AsDesigned | Truth::Linear { .. } => {
                self.advance_linear(state, u);
                Ok(())
            }
        };
        kernel::bound(&mut state.x);
        state.tick = state.tick.saturating_add(1);
        result
    }

    fn advance_linear(&self, state: &mut PlantState, u: &[f64]) {
        let mode = &self.plant.modes[state.mode];
        kernel::affine(
            &mut state.next,
            &self.state_offsets[state.mode],
            &mode.a,
            &state.x,
        );
        kernel::add_product(&mut state.next, &mode.b, u);
        kernel::add_product(&mut state.next, &mode.e, &state.disturbance);
        kernel::copy(&mut state.x, &state.next);
    }

    fn draw_noise(&self, state: &mut PlantState, on: bool) {
        let deviation = &self.scenario.noise;
        if !on || deviation.iter().all(|&d| d == 0.0) {
            state.noise.fill(0.0);
            return;
        }
        noise::standard_normal(self.scenario.seed, state.tick, &mut state.noise);
        state
            .noise
            .iter_mut()
            .zip(deviation)
            .for_each(|(value, d)| *value *= d);
    }

    /// `y = y_true + f + noise`, unless an event replaces the reading.
    fn read_sensors(&self, state: &mut PlantState, events: bool) {
        let (tick, te) = (state.tick, self.plant.sample_time);
        for sensor in 0..state.y.len() {
            let healthy = state.y_true[sensor] + state.noise[sensor];
            let mut reading = healthy + state.fault[sensor];
            let mut struck = false;
            for event in self
                .scenario
                .events
                .iter()
                .filter(|e| events && e.sensor == sensor && e.active(tick, te))
            {
                reading = event.reading(reading, state.last[sensor], tick, te);
                struck = true;
            }
            if struck {
                state.fault[sensor] = if reading.is_finite() {
                    reading - healthy
                } else {
                    0.0
                };
            } else {
                state.last[sensor] = reading;
            }
            state.y[sensor] = reading;
        }
    }
}
