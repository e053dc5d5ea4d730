//! What the true plant's departures do from tick to tick: actuators, loads, late readings, a mode
//! that is told late or wrong.

use super::{External, PlantSimulator, PlantState};
use ftc_control::kernel;
use ftc_plant::deviation::{Load, Port};
use ftc_plant::scenario::FaultKind;

impl PlantSimulator {
    /// The mode that is told while `mode` is active.
    pub(super) fn told_mode(&self, external: &External<'_>, mode: usize, tick: u64) -> usize {
        if external.mode.is_some() {
            return mode;
        }
        let (te, deviation) = (self.plant.sample_time, &self.deviation);
        let wrong = deviation.told.iter().find(|told| told.active(tick, te));
        let told = match wrong {
            Some(told) => told.mode,
            None if deviation.mode_delay == 0 => mode,
            None => self
                .schedule
                .mode(tick.saturating_sub(deviation.mode_delay)),
        };
        told.min(self.plant.modes.len().saturating_sub(1))
    }

    /// What the actuators make of the command `u` (m).
    #[inline]
    pub(super) fn actuate(&self, state: &mut PlantState, u: &[f64]) {
        let departed = &mut state.departed;
        kernel::copy(&mut departed.applied, u);
        for (value, gain) in departed.applied.iter_mut().zip(&self.deviation.input_gain) {
            *value *= gain;
        }
        if departed.scenario_enabled && self.moves_inputs() {
            self.move_inputs(state);
        }
    }

    /// Faults of actuators and loads on inputs.
    #[inline(never)]
    fn move_inputs(&self, state: &mut PlantState) {
        let (tick, te) = (state.tick, self.plant.sample_time);
        let departed = &mut state.departed;
        for (input, (value, held)) in departed
            .applied
            .iter_mut()
            .zip(&mut departed.held)
            .enumerate()
        {
            let faults = self.deviation.actuator_faults.iter();
            let mut faulty = false;
            for fault in faults.filter(|fault| fault.sensor == input && fault.active(tick, te)) {
                faulty = true;
                *value = match fault.kind {
                    FaultKind::Dropout => 0.0,
                    FaultKind::Bias { .. }
                    | FaultKind::Drift { .. }
                    | FaultKind::GainLoss { .. }
                    | FaultKind::Stuck
                    | FaultKind::Intermittent { .. } => fault.reading(*value, *held, tick, te),
                };
            }
            if !faulty {
                *held = *value;
            }
            *value += self.load(Port::Input(input), tick);
        }
        kernel::bound(&mut departed.applied);
    }

    /// Whether anything acts on inputs while the scenario runs.
    fn moves_inputs(&self) -> bool {
        !(self.deviation.actuator_faults.is_empty() && self.deviation.loads.is_empty())
    }

    /// What the actuators make of a small change of the command (m): leaves it in the scratch.
    pub(super) fn actuate_change(&self, state: &mut PlantState, change: &[f64]) {
        let (tick, te) = (state.tick, self.plant.sample_time);
        let departed = &mut state.departed;
        kernel::copy(&mut departed.change, change);
        for (value, gain) in departed.change.iter_mut().zip(&self.deviation.input_gain) {
            *value *= gain;
        }
        if !departed.scenario_enabled {
            return;
        }
        for fault in &self.deviation.actuator_faults {
            if let Some(value) = departed.change.get_mut(fault.sensor)
                && fault.active(tick, te)
            {
                match fault.kind {
                    FaultKind::GainLoss { loss } => *value *= 1.0 - loss,
                    FaultKind::Stuck | FaultKind::Dropout => *value = 0.0,
                    FaultKind::Bias { .. }
                    | FaultKind::Drift { .. }
                    | FaultKind::Intermittent { .. } => {}
                }
            }
        }
    }

    /// The sum of the loads at `port`.
    fn load(&self, port: Port, tick: u64) -> f64 {
        let te = self.plant.sample_time;
        let here = |load: &&Load| load.at == port && load.active(tick, te);
        let loads = self.deviation.loads.iter().filter(here);
        loads.map(|load| load.size).sum()
    }

    /// Adds loads to the disturbance.
    pub(super) fn load_disturbance(&self, state: &mut PlantState) {
        if self.deviation.loads.is_empty() || !state.departed.scenario_enabled {
            return;
        }
        for (channel, value) in state.disturbance.iter_mut().enumerate() {
            *value += self.load(Port::Disturbance(channel), state.tick);
        }
    }

    /// Adds loads to the state.
    pub(super) fn load_state(&self, state: &mut PlantState) {
        if self.deviation.loads.is_empty() || !state.departed.scenario_enabled {
            return;
        }
        for (index, value) in state.x.iter_mut().enumerate() {
            *value += self.load(Port::State(index), state.tick);
        }
    }
}
