//! The scenario on plants that are not quite the model: what is tried, what came of it, and what of that
//! is worth a warning. Values; the program that shows them adds the words.

use crate::Variant;
use crate::closed_loop::visit;
use crate::plant::PlantSimulator;
use ftc_control::Controller;
use ftc_plant::deviation::{Load, Port};
use ftc_plant::scenario::NEVER;
use ftc_plant::{Deviation, Dimensions, TruePlant};
use ftc_record::DesignRecord;

/// By how much every actuator is too strong or too weak.
const GAIN: f64 = 0.1;
/// Height of a step on an input, relative to its nominal value.
const STEP: f64 = 0.1;
/// Fault tolerance does worse than none where its true error is larger by more than this share.
pub const WORSE: f64 = 0.01;
/// Errors (root mean square, relative to the nominal value of the output) below this one do not matter.
const NEGLIGIBLE: f64 = 1e-3;
/// A loop is unstable where its true error is larger than that of the scenario as it is, and than the output's
/// nominal value, by this factor.
const UNSTABLE: f64 = 30.0;

/// How a plant differs from that of the scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Departure {
    /// Not at all.
    None,
    /// The gain of every actuator is larger by this share (negative: smaller).
    InputGain(f64),
    /// A constant is added from the middle of the scenario to its end.
    Step {
        /// Where.
        at: Port,
        /// In the units of the signal.
        size: f64,
    },
    /// Every reading is one sample later.
    LateReadings,
}

/// One departure and what came of it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Case {
    /// What differs from the scenario.
    pub departure: Departure,
    /// True mean square error per tracked output with fault tolerance; infinite where the plant could not be
    /// integrated.
    pub with: Vec<f64>,
    /// The same without.
    pub without: Vec<f64>,
}

impl Case {
    /// Whether fault tolerance makes the true error of a tracked output (from 0) larger.
    pub fn is_worse(&self, tracked: usize) -> bool {
        self.with[tracked] > (1.0 + WORSE) * self.without[tracked]
    }

    /// The same, where the error matters beside the output's nominal value.
    fn is_notably_worse(&self, tracked: usize, nominal: f64) -> bool {
        self.with[tracked].sqrt() > NEGLIGIBLE * nominal && self.is_worse(tracked)
    }

    /// Whether the loop is unstable: the true error is large beside the output's nominal value and beside that
    /// of the scenario as it is, with fault tolerance and without.
    fn is_unstable(&self, usual: &Self, tracked: usize, nominal: f64) -> bool {
        let least = |case: &Self| case.with[tracked].min(case.without[tracked]).sqrt();
        least(self) > UNSTABLE * least(usual).max(nominal)
    }
}

/// What is worth a warning.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum RobustnessWarning {
    /// The loop is unstable, whatever the fault tolerance does.
    Unstable(Departure),
    /// Fault tolerance does worse than none.
    Worse {
        /// On which plant.
        departure: Departure,
        /// The output, from 0.
        output: usize,
        /// True mean square error with fault tolerance.
        with: f64,
        /// The same without.
        without: f64,
    },
}

/// Tries the scenario as it is, actuators that are too strong and too weak, a step on each input and
/// each disturbance in the middle of the scenario, and readings that are one sample later.
pub fn cases(design: &DesignRecord, controller: &Controller) -> Vec<Case> {
    let departures = departures(design).into_iter();
    departures
        .map(|departure| {
            let deviation = deviation(design, departure);
            let true_plant = design.true_plant.clone().with_deviation(deviation);
            let errors = |variant| errors(design, controller, true_plant.clone(), variant);
            Case {
                departure,
                with: errors(Variant::Ftc),
                without: errors(Variant::NoFtc),
            }
        })
        .collect()
}

/// How many cases [`cases`] tries for a plant of these sizes.
pub fn count(size: Dimensions) -> usize {
    4 + size.inputs + size.disturbances
}

/// An unstable loop is told once, and nothing else of its case; else every output that fault tolerance makes worse.
/// The first case is the scenario as it is.
pub fn warnings(design: &DesignRecord, cases: &[Case]) -> Vec<RobustnessWarning> {
    let Some(usual) = cases.first() else {
        return Vec::new();
    };
    let tracked = &design.controller.feedback.tracked;
    let nominal = |row: usize| design.signals.outputs[row].nominal;
    let (unstable, stable): (Vec<&Case>, Vec<&Case>) = cases.iter().partition(|case| {
        let mut rows = tracked.iter().enumerate();
        rows.any(|(index, &row)| case.is_unstable(usual, index, nominal(row)))
    });
    let unstable = unstable.into_iter();
    let unstable = unstable.map(|case| RobustnessWarning::Unstable(case.departure));
    let worse = stable.into_iter().flat_map(|case| {
        let rows = tracked.iter().enumerate();
        let worse = rows.filter(|(index, row)| case.is_notably_worse(*index, nominal(**row)));
        worse.map(|(index, &output)| RobustnessWarning::Worse {
            departure: case.departure,
            output,
            with: case.with[index],
            without: case.without[index],
        })
    });
    unstable.chain(worse).collect()
}

fn departures(design: &DesignRecord) -> Vec<Departure> {
    let inputs = design.signals.inputs.iter().enumerate();
    let inputs = inputs.map(|(index, input)| Departure::Step {
        at: Port::Input(index),
        size: STEP * input.nominal,
    });
    let disturbances = 0..design.plant.dimensions().disturbances;
    let disturbances = disturbances.map(|channel| Departure::Step {
        at: Port::Disturbance(channel),
        size: height(design, channel),
    });
    [
        Departure::None,
        Departure::InputGain(GAIN),
        Departure::InputGain(-GAIN),
    ]
    .into_iter()
    .chain(inputs)
    .chain(disturbances)
    .chain([Departure::LateReadings])
    .collect()
}

/// On top of what departs in the scenario anyway.
fn deviation(design: &DesignRecord, departure: Departure) -> Deviation {
    let (_, mut deviation) = design.true_plant.clone().into_parts();
    match departure {
        Departure::None => {}
        Departure::InputGain(change) => {
            let inputs = design.plant.dimensions().inputs;
            deviation.input_gain.resize(inputs, 1.0);
            for gain in &mut deviation.input_gain {
                *gain *= 1.0 + change;
            }
        }
        Departure::Step { at, size } => deviation.loads.push(Load {
            at,
            from: (design.scenario.steps / 2) as f64 * design.plant.sample_time,
            until: NEVER,
            size,
        }),
        Departure::LateReadings => deviation.sensor_delay += 1,
    }
    deviation
}

/// The largest value of a disturbance in the scenario, or one.
fn height(design: &DesignRecord, channel: usize) -> f64 {
    let signal = &design.scenario.disturbance[channel];
    let [low, high] = signal.range(design.scenario.steps, design.plant.sample_time);
    let largest = high.max(-low);
    if largest > 0.0 { largest } else { 1.0 }
}

/// True mean square error per tracked output; infinite where the plant could not be integrated.
fn errors(
    design: &DesignRecord,
    controller: &Controller,
    true_plant: TruePlant,
    variant: Variant,
) -> Vec<f64> {
    let plant =
        PlantSimulator::with_true_plant(design.plant.clone(), true_plant, design.scenario.clone());
    let tracked = &design.controller.feedback.tracked;
    let mut squares = vec![0.0; tracked.len()];
    let stalled = visit(&plant, controller, variant, &mut |seen| {
        let outputs = tracked.iter().zip(&seen.plant.reference);
        for (sum, (&row, reference)) in squares.iter_mut().zip(outputs) {
            let error = seen.plant.y_true[row] - reference;
            *sum += error * error;
        }
    });
    for sum in &mut squares {
        *sum = match stalled {
            None => *sum / design.scenario.steps.max(1) as f64,
            Some(_) => f64::INFINITY,
        };
    }
    squares
}

#[cfg(test)]
mod tests {
    use super::{Case, Departure};

    fn case(with: f64, without: f64) -> Case {
        Case {
            departure: Departure::None,
            with: vec![with],
            without: vec![without],
        }
    }

    #[test]
    fn a_loop_is_unstable_where_both_variants_are() {
        let usual = case(0.01, 0.02);
        assert!(case(1e4, f64::INFINITY).is_unstable(&usual, 0, 1.0));
        assert!(!case(0.5, 1e9).is_unstable(&usual, 0, 1.0));
        assert!(!case(1e4, 1e4).is_unstable(&case(1e4, 1e4), 0, 1.0));
        assert!(!case(1e4, 1e4).is_unstable(&usual, 0, 1e3));
    }

    #[test]
    fn worse_is_what_is_larger_and_matters() {
        let is_worse = |with, without, nominal| case(with, without).is_notably_worse(0, nominal);
        assert!(is_worse(0.02, 0.01, 1.0) && is_worse(f64::INFINITY, 1.0, 1.0));
        assert!(!is_worse(0.01, 0.01, 1.0) && !is_worse(0.01, 0.02, 1.0));
        assert!(!is_worse(1e-8, 1e-9, 1.0) && is_worse(1e-8, 1e-9, 1e-3));
        assert!(!is_worse(0.010_05, 0.01, 1.0));
    }
}
