//! Sizes and rates for the state-based estimator, from the plant and its signals.

use crate::augmented;
use crate::defaults::{
    AUTHORITY, CHANGE_RATE, CHANGED_ERROR, DISTURBANCE, DISTURBANCE_WALK, DRIFT_WALK, FAULT_LENGTH,
    FAULT_OF_RANGE, FAULT_RATE, FAULT_SIZE, FAULT_WALK, GAIN_ERROR, GAIN_WALK, INPUT_LOAD,
    LOAD_RATE, LOAD_WALK, MODEL_ERROR, ODDS, PERIOD_ERROR, START, STATE_LOAD, STUCK_RATE,
};
use crate::harmonics::KnownDisturbance;
use crate::spec::{EstimatorNumber, SpecError, sizes_within, within};
use crate::steady_state::steady_state;
use crate::{Signal, Signals};
use ftc_control::parameters::{Ambiguous, Hypotheses};
use ftc_plant::{Dimensions, Mode, Scenario, SwitchedPlant};
use nalgebra::DVector;
use std::ops::RangeInclusive;

/// What may be asked of the state-based estimator; the rest follows from the design.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct HypothesesSpec {
    /// Relative error of the entries of the plant's matrices.
    pub model_error: f64,
    /// Faults per sample and sensor.
    pub fault_rate: f64,
    /// Mean length of a fault in samples.
    pub fault_length: f64,
    /// What is done about a slow divergence.
    pub ambiguous: Ambiguous,
    /// Mean length of a mode in samples, where the mode is to be found from the readings; it is told when absent.
    pub mode_length: Option<f64>,
    /// Largest correction of each sensor (p), output units; when absent the sensor's range, or a multiple of what is usual.
    pub authority: Option<Vec<f64>>,
    /// Size of a load on each input (m), input units; a fifth of the nominal value when absent.
    pub input_load: Option<Vec<f64>>,
}

/// Relative errors of a model that may be asked for.
pub(crate) const MODEL_ERRORS: RangeInclusive<f64> = 0.0..=1.0;
/// Faults per sample and sensor that may be asked for.
pub(crate) const FAULT_RATES: RangeInclusive<f64> = 1e-12..=0.1;
/// Mean lengths of a fault or of a mode in samples that may be asked for.
pub(crate) const LENGTHS: RangeInclusive<f64> = 2.0..=1e9;

impl Default for HypothesesSpec {
    fn default() -> Self {
        Self {
            model_error: MODEL_ERROR,
            fault_rate: FAULT_RATE,
            fault_length: FAULT_LENGTH,
            ambiguous: Ambiguous::TrustSensors,
            mode_length: None,
            authority: None,
            input_load: None,
        }
    }
}

impl HypothesesSpec {
    /// Whether every number lies in its range, for a plant of these sizes.
    ///
    /// # Errors
    /// [`SpecError::Estimator`], [`SpecError::EstimatorSize`] or [`SpecError::EstimatorCount`].
    pub fn check(&self, dims: Dimensions) -> Result<(), SpecError> {
        use EstimatorNumber::{
            Authority, FaultLength, FaultRate, InputLoad, ModeLength, ModelError,
        };
        within(ModelError, self.model_error, MODEL_ERRORS)?;
        within(FaultRate, self.fault_rate, FAULT_RATES)?;
        within(FaultLength, self.fault_length, LENGTHS)?;
        if let Some(length) = self.mode_length {
            within(ModeLength, length, LENGTHS)?;
        }
        if let Some(sizes) = &self.authority {
            sizes_within(Authority, sizes, dims.outputs)?;
        }
        if let Some(sizes) = &self.input_load {
            sizes_within(InputLoad, sizes, dims.inputs)?;
        }
        Ok(())
    }

    /// The estimator's sizes and rates for `plant` with these signals and this `noise` of the sensors (p), under
    /// the disturbance that is `known`. Where the references take an output further from
    /// its operating points than its nominal value, that distance stands in for it: `reach` (p), or empty.
    pub fn settings(
        &self,
        plant: &SwitchedPlant,
        signals: &Signals,
        noise: Vec<f64>,
        reach: &[f64],
        known: Option<&KnownDisturbance>,
    ) -> Hypotheses {
        let scaling = signals.scaling();
        let mut outputs = signals.outputs.clone();
        for (output, reach) in outputs.iter_mut().zip(reach) {
            output.nominal = output.nominal.max(*reach);
        }
        let outputs = &outputs;
        let amplitude = known
            .and_then(|known| known.amplitude.clone())
            .filter(|sizes| sizes.iter().all(|&size| size > 0.0));
        let disturbance = amplitude.unwrap_or_else(|| unknown_disturbance(plant, &scaling.outputs));
        let period = known.map(KnownDisturbance::known_period);
        let harmonics = period.map_or(0, |known| known.harmonics);
        let waves = disturbance
            .iter()
            .flat_map(|&size| vec![size; 2 * harmonics]);
        Hypotheses {
            noise,
            fault_rate: self.fault_rate,
            stuck_rate: STUCK_RATE,
            release_rate: 1.0 / self.fault_length,
            change_rate: CHANGE_RATE,
            load_rate: LOAD_RATE,
            changed_error: CHANGED_ERROR,
            mode_rate: self.mode_length.map(f64::recip),
            odds: ODDS,
            fault_size: per_sensor(plant, outputs, FAULT_OF_RANGE, FAULT_SIZE),
            fault_walk: FAULT_WALK,
            drift_walk: DRIFT_WALK,
            input_load: self
                .input_load
                .clone()
                .unwrap_or_else(|| scaled(&scaling.inputs, INPUT_LOAD)),
            disturbance_size: waves.collect(),
            disturbance_walk: scaled(&disturbance, DISTURBANCE_WALK),
            disturbance_load: disturbance,
            state_load: scaled(&scaling.states, STATE_LOAD),
            load_walk: LOAD_WALK,
            model_error: self.model_error,
            gain_error: GAIN_ERROR,
            gain_walk: GAIN_WALK,
            period_error: PERIOD_ERROR,
            period,
            start: scaled(&scaling.states, START),
            start_elsewhere: scaling.states.clone(),
            state_size: scaling.states,
            authority: self
                .authority
                .clone()
                .unwrap_or_else(|| per_sensor(plant, outputs, 1.0, AUTHORITY)),
            ambiguous: self.ambiguous,
            fitted: Vec::new(),
        }
    }
}

/// How far the scenario's references take each output (p) from its operating points, at rest in any mode and
/// with each reference at its furthest; 0 where none moves it.
pub(crate) fn reach(
    plant: &SwitchedPlant,
    signals: &Signals,
    tracked: &[usize],
    scenario: &Scenario,
) -> Vec<f64> {
    // Per unit: with more inputs than references the state at rest is the least one, in no one's units.
    let unit = signals.scaling();
    let references = scenario.reference.iter();
    let ranges: Vec<[f64; 2]> = references
        .map(|signal| signal.range(scenario.steps, plant.sample_time))
        .collect();
    let mut reach = vec![0.0f64; unit.outputs.len()];
    for mode in &plant.modes {
        // Nothing is asked of an output without a reference.
        let asked = DVector::from_fn(tracked.len(), |at, _| {
            let [low, high] = ranges.get(at).copied().unwrap_or([f64::NAN; 2]);
            let point = mode.operating_point.y[tracked[at]];
            finite((high - point).max(point - low) / unit.outputs[tracked[at]])
        });
        let mode = Mode::new(
            augmented::scaled(&mode.a, &unit.states, &unit.states),
            augmented::scaled(&mode.b, &unit.states, &unit.inputs),
            augmented::scaled(&mode.c, &unit.outputs, &unit.states),
        );
        let rests = steady_state(&mode, tracked);
        let moved = (&mode.c * rests.rows(0, mode.c.ncols())).abs() * &asked;
        for (reach, &moved) in reach.iter_mut().zip(&moved) {
            *reach = reach.max(finite(moved));
        }
        // A mode that cannot rest there is asked for it all the same.
        for (&output, &asked) in tracked.iter().zip(&asked) {
            reach[output] = reach[output].max(asked);
        }
    }
    let physical = reach.iter().zip(&unit.outputs);
    physical.map(|(reach, unit)| reach * unit).collect()
}

/// Nothing in place of what is no number.
fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}

fn scaled(values: &[f64], factor: f64) -> Vec<f64> {
    values.iter().map(|value| factor * value).collect()
}

/// A size for each sensor: a share of its range, or shares of nominal value and operating point.
fn per_sensor(
    plant: &SwitchedPlant,
    outputs: &[Signal],
    share: f64,
    [nominal, point]: [f64; 2],
) -> Vec<f64> {
    let size = |(q, output): (usize, &Signal)| {
        let away = plant
            .modes
            .iter()
            .map(|mode| mode.operating_point.y[q].abs())
            .fold(0.0, f64::max);
        let range = output
            .max
            .zip(output.min)
            .map(|(max, min)| share * (max - min));
        range.unwrap_or(nominal * output.nominal + point * away)
    };
    outputs.iter().enumerate().map(size).collect()
}

/// The size of each disturbance channel that moves an output by [`DISTURBANCE`] of its nominal value.
fn unknown_disturbance(plant: &SwitchedPlant, nominal: &[f64]) -> Vec<f64> {
    let channels = plant.dimensions().disturbances;
    let effect = |mode: &Mode, channel: usize| {
        let outputs = nominal.iter().enumerate().map(|(q, nominal)| {
            let direct = mode.f[(q, channel)].abs();
            (mode.c.row(q).norm() * mode.e.column(channel).norm() + direct) / nominal
        });
        outputs.fold(0.0, f64::max)
    };
    (0..channels)
        .map(|channel| {
            let most = plant
                .modes
                .iter()
                .map(|mode| effect(mode, channel))
                .fold(0.0, f64::max);
            if most > 0.0 { DISTURBANCE / most } else { 0.0 }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ftc_plant::Dimensions;
    use ftc_plant::scenario::Waveform;
    use nalgebra::dmatrix;

    /// Of two inputs and one reference, one input in a unit that is `size` times as small.
    fn reach_in(size: f64) -> Vec<f64> {
        let mode = Mode::new(
            dmatrix![0.5, 0.1; 0.0, 0.4],
            dmatrix![1.0, 0.5 / size; 0.2, 1.0 / size],
            dmatrix![1.0, 0.0; 0.0, 1.0],
        );
        let plant = SwitchedPlant::new(1.0, vec![mode]);
        let dims = Dimensions::check(&plant).unwrap();
        let mut signals = Signals::numbered(dims);
        signals.inputs[1].nominal *= size;
        let reference = vec![Waveform::Constant { value: 2.0 }];
        reach(&plant, &signals, &[0], &Scenario::new(10, reference, dims))
    }

    #[test]
    fn the_unit_of_an_input_does_not_decide_how_far_references_move_an_output() {
        let [one, other] = [1.0, 1000.0].map(reach_in);
        assert!((one[0] - 2.0).abs() < 1e-9 && one[1] > 0.1, "{one:?}");
        for (one, other) in one.iter().zip(&other) {
            assert!((one - other).abs() < 1e-9, "{one} {other}");
        }
    }
}
