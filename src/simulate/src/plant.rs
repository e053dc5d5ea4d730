//! The plant under a scenario, sample by sample: what the plant FMU runs.

mod departed;
mod departure;
mod derivative;
mod energy;
mod injection;
mod rectifier;
mod schedule;

pub use derivative::Change;
pub use ftc_plant::scenario::InjectedKind;
pub use injection::Injected;

use super::integrate::Stalled;
use departed::Departed;
use energy::Sampled;
use ftc_control::state::State;
use ftc_control::{Matrix, kernel};
use ftc_plant::TruePlant;
use ftc_plant::noise::Noise;
use ftc_plant::scenario::{FaultEvent, Scenario};
use ftc_plant::{Deviation, Mode, SwitchedPlant};
use ftc_record::plain;
use schedule::{Of, Schedule};
use serde::{Deserialize, Serialize};

/// A plant and its scenario: immutable, shared by any number of [`PlantState`]s.
#[derive(Clone, Debug)]
pub struct PlantSimulator {
    plant: SwitchedPlant,
    true_plant: TruePlant,
    deviation: Deviation,
    scenario: Scenario,
    schedule: Schedule,
    /// None where no sensor has any.
    noise: Option<Noise>,
    /// A rectifier's, prepared for its sample time.
    sampled: Option<Sampled>,
    modes: Vec<Dynamics>,
}

/// One mode as it runs: affine in physical units.
#[derive(Clone, Debug)]
struct Dynamics {
    /// `A` (n x n).
    a: Matrix,
    /// `B` (n x m).
    b: Matrix,
    /// `C` (p x n).
    c: Matrix,
    /// `E` (n x s).
    e: Matrix,
    /// `F` (p x s).
    f: Matrix,
    /// `x0 - A x0 - B u0` (n).
    state_offset: Vec<f64>,
    /// `y0 - C x0` (p).
    output_offset: Vec<f64>,
}

impl Dynamics {
    fn new(mode: &Mode) -> Self {
        Self {
            a: plain(&mode.a),
            b: plain(&mode.b),
            c: plain(&mode.c),
            e: plain(&mode.e),
            f: plain(&mode.f),
            state_offset: mode.state_offset().as_slice().to_vec(),
            output_offset: mode.output_offset().as_slice().to_vec(),
        }
    }
}

/// Signals added from outside, or in place of the scenario.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
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

impl<'a> External<'a> {
    /// A fault (p) and a disturbance (s) beside the scenario's own, with its schedule and its noise.
    pub fn new(fault: &'a [f64], disturbance: &'a [f64]) -> Self {
        Self {
            fault,
            disturbance,
            mode: None,
            noise: true,
        }
    }

    /// In this mode (0-based) in place of the scenario, where one is given.
    #[must_use]
    pub fn in_mode(self, mode: Option<usize>) -> Self {
        Self { mode, ..self }
    }

    /// With the scenario's measurement noise, or without.
    #[must_use]
    pub fn with_noise(self, noise: bool) -> Self {
        Self { noise, ..self }
    }
}

/// The plant at one tick, with every signal that can be observed from outside.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct PlantState {
    /// Tick this state belongs to.
    pub tick: u64,
    /// Active mode (0-based).
    pub mode: usize,
    /// The mode (0-based) that is told to whoever controls the plant.
    pub told: usize,
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
    /// The scenario's part of the disturbance (s) and of the faults (p), and the tick for which these and the
    /// reference were evaluated, if any.
    waves: Vec<f64>,
    scheduled: Vec<f64>,
    evaluated: Option<u64>,
    /// The ticks, end excluded, over which the scenario gives the same modes, events and constant signals.
    constant: (u64, u64),
    /// Whether one of its events is active in these ticks.
    event_active: bool,
    /// Measurement noise (p).
    pub noise: Vec<f64>,
    /// The tick that the noise was drawn for, if any was.
    drawn: Option<u64>,
    /// The noise of the next tick (p), if it is this one.
    next_noise: Vec<f64>,
    next_drawn: Option<u64>,
    /// Last reading outside any event (p), for sensors that get stuck.
    last: Vec<f64>,
    /// Scratch (n).
    next: Vec<f64>,
    /// What the true plant's departures carry.
    departed: Departed,
}

ftc_control::state!(PlantState {
    parts: [
        x,
        y,
        y_true,
        fault,
        disturbance,
        reference,
        waves,
        scheduled,
        noise,
        next_noise,
        last,
        next,
        departed
    ],
    constants: [],
    counters: [
        tick,
        mode,
        told,
        evaluated,
        constant,
        event_active,
        drawn,
        next_drawn
    ]
});

impl PlantSimulator {
    /// Prepares a plant that is what it was designed for; see [`with_true_plant`](Self::with_true_plant).
    pub fn new(plant: SwitchedPlant, scenario: Scenario) -> Self {
        Self::with_true_plant(plant, TruePlant::AsDesigned, scenario)
    }

    /// Prepares a plant; the scenario's signals and the truth must have the design's sizes.
    pub fn with_true_plant(
        designed: SwitchedPlant,
        true_plant: TruePlant,
        scenario: Scenario,
    ) -> Self {
        let plant = true_plant.linear(&designed).clone();
        let (true_plant, deviation) = true_plant.into_parts();
        let sampled = match &true_plant {
            TruePlant::Rectifier(rectifier) => Sampled::new(rectifier, plant.sample_time),
            TruePlant::AsDesigned | TruePlant::Linear { .. } | TruePlant::Deviating { .. } => None,
        };
        Self {
            sampled,
            modes: plant.modes.iter().map(Dynamics::new).collect(),
            schedule: Schedule::new(&scenario, &deviation, plant.sample_time),
            noise: (scenario.noise.iter().any(|&d| d != 0.0)).then(|| Noise::new(scenario.seed)),
            plant,
            true_plant,
            deviation,
            scenario,
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

    /// The mode (0-based) in which the scenario begins.
    pub fn first_mode(&self) -> usize {
        self.scenario.mode(0, self.plant.sample_time)
    }

    /// At rest in the scenario's first mode, tick 0, outputs not yet observed.
    pub fn initial_state(&self) -> PlantState {
        self.initial_state_in(self.first_mode())
    }

    /// At rest at the operating point of `mode` (0-based), tick 0, outputs not yet observed.
    ///
    /// # Panics
    /// There is no such mode.
    pub fn initial_state_in(&self, mode: usize) -> PlantState {
        let dims = self.plant.dimensions();
        let point = &self.plant.modes[mode].operating_point;
        PlantState {
            tick: 0,
            mode,
            told: mode,
            x: point.x.clone(),
            y: vec![0.0; dims.outputs],
            y_true: vec![0.0; dims.outputs],
            fault: vec![0.0; dims.outputs],
            disturbance: vec![0.0; dims.disturbances],
            reference: vec![0.0; self.scenario.reference.len()],
            waves: vec![0.0; dims.disturbances],
            scheduled: vec![0.0; dims.outputs],
            evaluated: None,
            constant: (0, 0),
            event_active: false,
            noise: vec![0.0; dims.outputs],
            drawn: None,
            next_noise: vec![0.0; dims.outputs],
            next_drawn: None,
            last: point.y.clone(),
            next: vec![0.0; dims.states],
            departed: Departed::new(point, &self.deviation),
        }
    }

    /// Whether a state has the sizes of this plant; one that came as bytes may not.
    pub fn fits(&self, state: &PlantState) -> bool {
        state.mode < self.plant.modes.len() && state.same_shape(&self.initial_state())
    }

    /// Makes every output of the present tick from the present state.
    pub fn observe(&self, state: &mut PlantState, external: &External<'_>) {
        let tick = state.tick;
        let (first, end) = state.constant;
        if !(first <= tick && tick < end) || external.mode.is_some() {
            self.evaluate_constant(state, external);
        }
        // A tick is observed twice: when the one before it ends, and when it begins.
        if state.evaluated != Some(tick) && external.mode.is_none() {
            self.evaluate_moving(state);
        }
        let Some(mode) = self.modes.get(state.mode) else {
            return;
        };
        for ((out, wave), &added) in state
            .disturbance
            .iter_mut()
            .zip(&state.waves)
            .zip(external.disturbance)
        {
            *out = kernel::bounded(wave + added);
        }
        self.load_disturbance(state);
        self.draw_noise(state, external.noise);
        let seen = [(&mode.c, &*state.x), (&mode.f, &*state.disturbance)];
        kernel::affine_sum(&mut state.y_true, &mode.output_offset, seen);
        kernel::bound(&mut state.y_true);
        self.read_sensors(state, external.fault);
    }

    /// What the scenario holds for some ticks: modes, constant signals, whether an event is active. Nothing of it
    /// while a mode is given in its place.
    #[cold]
    fn evaluate_constant(&self, state: &mut PlantState, external: &External<'_>) {
        let (tick, te) = (state.tick, self.plant.sample_time);
        let built_in = external.mode.is_none();
        state.mode = self.active_mode(external, tick);
        state.told = self.told_mode(external, state.mode, tick);
        state.departed.scenario_enabled = built_in;
        state.evaluated = None;
        for (values, signals) in [
            (&mut state.reference, &self.schedule.reference),
            (&mut state.waves, &self.schedule.disturbance),
            (&mut state.scheduled, &self.schedule.fault),
        ] {
            for (value, signal) in values.iter_mut().zip(signals) {
                *value = if built_in { signal.at(tick, te) } else { 0.0 };
            }
        }
        let mut events = self.schedule.events.iter();
        state.event_active = built_in && events.any(|(lasts, _)| lasts.contains(&tick));
        state.constant = match built_in {
            true => self.schedule.constant_around(tick),
            false => (0, 0),
        };
    }

    /// The scenario's signals that move, at the present tick.
    fn evaluate_moving(&self, state: &mut PlantState) {
        let (tick, te) = (state.tick, self.plant.sample_time);
        for moving in &self.schedule.moving {
            let values = match moving.of {
                Of::Reference => &mut state.reference,
                Of::Fault => &mut state.scheduled,
                Of::Disturbance => &mut state.waves,
            };
            if let Some(value) = values.get_mut(moving.index) {
                *value = moving.waveform.at(tick, te);
            }
        }
        state.evaluated = Some(tick);
    }

    /// The mode (0-based) at `tick`: the scenario's, unless another is given.
    fn active_mode(&self, external: &External<'_>, tick: u64) -> usize {
        external
            .mode
            .unwrap_or_else(|| self.schedule.mode(tick))
            .min(self.plant.modes.len().saturating_sub(1))
    }

    /// Moves to the next tick under input `u` (m), held over the sample.
    ///
    /// # Errors
    /// [`Stalled`] where the nonlinear plant cannot be integrated; the tick then ends where that
    /// became so, and later ticks go on from there.
    pub fn advance(&self, state: &mut PlantState, u: &[f64]) -> Result<(), Stalled> {
        self.actuate(state, u);
        let result = match &self.true_plant {
            TruePlant::Rectifier(rectifier) => rectifier::advance_rectifier(
                (rectifier, self.sampled.as_ref()),
                state.mode,
                &mut state.x,
                &state.departed.applied,
                &state.disturbance,
                self.plant.sample_time,
            ),
            TruePlant::AsDesigned | TruePlant::Linear { .. } | TruePlant::Deviating { .. } => {
                self.advance_linear(state);
                Ok(())
            }
        };
        self.load_state(state);
        state.departed.read(&state.y_true);
        kernel::bound(&mut state.x);
        state.tick = state.tick.saturating_add(1);
        result
    }

    fn advance_linear(&self, state: &mut PlantState) {
        let Some(mode) = self.modes.get(state.mode) else {
            return;
        };
        let moved = [
            (&mode.a, &*state.x),
            (&mode.b, &*state.departed.applied),
            (&mode.e, &*state.disturbance),
        ];
        kernel::affine_sum(&mut state.next, &mode.state_offset, moved);
        core::mem::swap(&mut state.x, &mut state.next);
    }

    fn draw_noise(&self, state: &mut PlantState, on: bool) {
        let tick = state.tick;
        let Some(noise) = self.noise.as_ref().filter(|_| on) else {
            state.noise.fill(0.0);
            (state.drawn, state.next_drawn) = (None, None);
            return;
        };
        if state.drawn.replace(tick) == Some(tick) {
            return;
        }
        if state.next_drawn.take() == Some(tick) {
            core::mem::swap(&mut state.noise, &mut state.next_noise);
            return;
        }
        noise.draw(tick, [&mut state.noise, &mut state.next_noise]);
        let two = state.noise.iter_mut().zip(&mut state.next_noise);
        for ((now, next), d) in two.zip(&self.scenario.noise) {
            (*now, *next) = (*now * d, *next * d);
        }
        state.next_drawn = Some(tick.wrapping_add(1));
    }

    /// `y = y_true + f + noise`, unless an event replaces the reading; `f` is the scenario's and what is `added` (p).
    fn read_sensors(&self, state: &mut PlantState, added: &[f64]) {
        let (tick, te) = (state.tick, self.plant.sample_time);
        let clean = state.departed.seen(&state.y_true).iter().zip(&state.noise);
        let faults = state.scheduled.iter().zip(added);
        let read = state
            .y
            .iter_mut()
            .zip(&mut state.fault)
            .zip(&mut state.last);
        let sensors = read.zip(clean.zip(faults));
        for (sensor, (((y, fault), last), ((truth, noise), (scheduled, added)))) in
            sensors.enumerate()
        {
            let healthy = truth + noise;
            *fault = scheduled + added;
            let mut reading = healthy + *fault;
            let mut faulty = false;
            if state.event_active {
                for event in self.acting(sensor, tick, true) {
                    reading = event.reading(reading, *last, tick, te);
                    faulty = true;
                }
            }
            if !reading.is_finite() {
                *fault = 0.0;
            } else if faulty {
                *fault = reading - healthy;
            } else {
                *last = reading;
            }
            *y = reading;
        }
    }

    /// The events present at a sensor (0-based) at `tick`; none where `events` are off.
    fn acting(&self, sensor: usize, tick: u64, events: bool) -> impl Iterator<Item = &FaultEvent> {
        let all = self.schedule.events.iter();
        let present = all.filter(move |(lasts, event)| {
            events && event.sensor == sensor && lasts.contains(&tick)
        });
        present.map(|(_, event)| event)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ftc_plant::scenario::{FaultKind, Waveform};
    use nalgebra::dmatrix;
    use proptest::prelude::*;

    /// Two states, one input, two outputs, one disturbance; an event on either sensor.
    fn simulator() -> PlantSimulator {
        let mode = Mode::new(
            dmatrix![0.5, 0.1; 0.0, 0.4],
            dmatrix![1.0; 0.5],
            dmatrix![1.0, 0.0; 0.0, 1.0],
        )
        .named("only")
        .with_disturbance(dmatrix![1.0; 1.0], dmatrix![0.0; 0.5]);
        let event = |sensor, kind| FaultEvent {
            sensor,
            from: 0.0,
            until: 9.0,
            kind,
        };
        let plant = SwitchedPlant::new(1.0, vec![mode]);
        let mut scenario = Scenario::new(9, vec![Waveform::ZERO], plant.dimensions());
        scenario.noise = vec![0.1; 2];
        scenario.events = vec![event(0, FaultKind::Stuck), event(1, FaultKind::Dropout)];
        PlantSimulator::new(plant, scenario)
    }

    proptest! {
        /// What comes as bytes is compared with the plant's sizes; a tick must not rely on it.
        #[test]
        fn no_step_panics_whatever_the_sizes(
            sizes in prop::array::uniform11(0usize..4), mode in 0usize..3,
            given in prop::option::of(0usize..3), [m, p, s] in prop::array::uniform3(0usize..4),
        ) {
            let simulator = simulator();
            let [x, y, y_true, fault, disturbance, reference, scheduled, noise, next_noise, last, next] = sizes.map(|size| vec![1.0; size]);
            let mut state = PlantState { tick: 3, mode, x, y, y_true, fault, waves: disturbance.clone(), disturbance, reference, scheduled, evaluated: None, constant: (0, 0), event_active: false, noise, next_noise, next_drawn: None, last, next, told: mode, drawn: None, departed: Departed::default() };
            let (u, f, w) = (vec![1.0; m], vec![1.0; p], vec![1.0; s]);
            let external = External::new(&f, &w).in_mode(given);
            simulator.advance(&mut state, &u).unwrap();
            let mut trial = state.clone();
            let change = Change { command: &u, fault: &f, disturbance: &w };
            simulator.differentiate_outputs(&mut trial, &external, &change);
            trial.mode = mode;
            simulator.differentiate_tick(&mut trial, &external, &u, &change);
            simulator.observe(&mut state, &external);
            simulator.advance(&mut state, &u).unwrap();
        }
    }
}
