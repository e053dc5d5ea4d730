//! What a user should know of a design that is sound, and of a run that went through: one sentence each.
//!
//! A warning is no error: nothing that was proved depends on it.

use crate::text::number;
use design_file::healthy_log::file_of;
use design_file::schema::{DesignFile, EstimatorMethod as Asked};
use design_file::sentence::shorten;
use design_file::values::NameOrList;
use ftc_control::estimator::{InputHistory, leverage};
use ftc_control::parameters::{Estimator, EstimatorMethod, Predictor};
use ftc_design::Design;
use ftc_design::assembly::DatabaseSource;
use ftc_design::commissioning::{Database, model_predictor};
use ftc_plant::Mode;
use ftc_plant::Truth;
use ftc_plant::scenario::first_tick;
use ftc_simulate::closed_loop::Record;
use ftc_simulate::{Trajectory, Variant};
use nalgebra::{DMatrix, DVector};
use std::fmt::Write;

/// Relative distance from the model's response beyond which a log is doubted.
const FAR: f64 = 0.5;
/// Residual deviation, relative to what the output moves in the log, beyond which it is doubted.
const UNEXPLAINED: f64 = 0.3;
/// Share of the samples of a run that may lie outside the database before it is worth a word.
const FEW: f64 = 0.05;
/// Share of the samples of a run that mode switches may take before it is worth a word.
const MANY: f64 = 0.25;

/// How much each output moves in a log: standard deviation per mode and output.
pub struct Logged(Vec<Vec<f64>>);

impl Logged {
    /// Of recorded logs, if there are any.
    pub fn of(source: &DatabaseSource) -> Option<Self> {
        let DatabaseSource::Recorded(modes) = source else {
            return None;
        };
        Some(Self(modes.iter().map(|log| movements(log)).collect()))
    }
}

/// Standard deviation of every output over the stretches of a log.
fn movements(stretches: &[Database]) -> Vec<f64> {
    let outputs = stretches.first().map_or(0, |log| log.outputs.ncols());
    let deviation = |output: usize| {
        let columns = stretches.iter().map(|log| log.outputs.column(output));
        let values: Vec<f64> = columns
            .flat_map(|column| column.iter().copied().collect::<Vec<_>>())
            .collect();
        ftc_simulate::metrics::variance(&values).sqrt()
    };
    (0..outputs).map(deviation).collect()
}

/// Of a design and the file it was made from.
pub fn of_design(file: &DesignFile, logged: Option<&Logged>, design: &Design) -> Vec<String> {
    let lasting = Lasting::of(design);
    let mut warnings = Vec::new();
    warnings.extend(unknown_noise(file));
    warnings.extend(lasting.too_short_to_judge(&design.controller.estimator));
    warnings.extend(lasting.too_short_to_be_proved(design));
    warnings.extend(outside_the_database(design));
    if let (Some(logged), Some(files)) = (logged, &file.estimator.database) {
        warnings.extend(doubtful_logs(files, logged, design));
    }
    warnings
}

/// Of the runs of a design.
pub fn of_runs(design: &Design, runs: &[Trajectory]) -> Vec<String> {
    let ftc = runs.iter().find(|run| run.variant == Variant::Ftc);
    let unjudged = ftc.into_iter().flat_map(|run| unjudged(design, run));
    let stalled = runs.iter().filter_map(|run| stalled(design, run));
    let held_up = runs.iter().filter_map(|run| held_up(design, run));
    unjudged.chain(stalled).chain(held_up).collect()
}

/// The warnings as a person reads them below a report.
pub fn text(warnings: &[String]) -> String {
    warnings.iter().fold(String::new(), |mut text, warning| {
        let _ = writeln!(text, "warning: {warning}");
        text
    })
}

/// Thresholds that nothing was known for.
fn unknown_noise(file: &DesignFile) -> Option<String> {
    let estimator = &file.estimator;
    let logs = match &estimator.database {
        Some(NameOrList::Name(name)) => name != "commission" && name != "model",
        Some(NameOrList::List(_)) => true,
        None => false,
    };
    let unknown = file.scenario.noise.is_none() && estimator.threshold.is_none() && !logs;
    (unknown && estimator.method != Some(Asked::None)).then(|| {
        "neither scenario.noise nor estimator.threshold is given: a residual of a thousandth of an output's nominal \
         value is then a fault; give the noise of your sensors"
            .into()
    })
}

/// How long modes last in the scenario: samples from one switch to the next, the first from 0.
struct Lasting(Vec<u64>);

impl Lasting {
    fn of(design: &Design) -> Self {
        let te = design.controller.plant.sample_time;
        let scenario = &design.scenario;
        let mut switches = vec![0];
        for pair in scenario.schedule.windows(2) {
            let tick = first_tick(pair[1].from, te);
            if pair[0].mode != pair[1].mode && tick < scenario.steps {
                switches.push(tick);
            }
        }
        Self(switches.windows(2).map(|pair| pair[1] - pair[0]).collect())
    }

    /// A residual means nothing until the regressor holds inputs of the present mode only.
    fn too_short_to_judge(&self, estimator: &Estimator) -> Option<String> {
        let length = estimator.response_length as u64;
        let short = self.0.iter().filter(|&&samples| samples <= length).count();
        (short > 0 && estimator.method != EstimatorMethod::None).then(|| {
            format!(
                "scenario.schedule: before {short} of {} switches a mode lasts no longer than response_length = {length} \
                 samples, and no sensor is judged in that time: let modes last longer, or set a shorter \
                 estimator.response_length",
                self.0.len()
            )
        })
    }

    /// Stability under `dwell` is proved for modes that last.
    fn too_short_to_be_proved(&self, design: &Design) -> Option<String> {
        let synthesis = design.synthesis.as_ref()?;
        let proved = [synthesis.state_feedback.dwell, synthesis.observer.dwell];
        let needed = proved.iter().flatten().map(|dwell| dwell.samples);
        let needed = needed.reduce(f64::max)?;
        let count = self.0.len();
        let mean = self.0.iter().sum::<u64>() as f64 / count.max(1) as f64;
        (count > 0 && mean <= needed).then(|| {
            format!(
                "scenario.schedule: modes last {mean:.2} samples on average, but stability is proved only where they \
                 last longer than {needed:.2}: let them last longer"
            )
        })
    }
}

/// The steady input per mode that takes the tracked outputs to a reference, and how far the
/// database spans.
struct Steady<'a> {
    mode: &'a Mode,
    tracked: &'a [usize],
    /// `du = gain (y_ref - y0)`, from `[A-I B; S C 0] [dx; du] = [0; y_ref - y0]`.
    gain: DMatrix<f64>,
    /// Leverage of `du` held for as long as the response lasts: `|spread du|^2`.
    spread: DMatrix<f64>,
}

impl<'a> Steady<'a> {
    fn new(mode: &'a Mode, predictor: &Predictor, tracked: &'a [usize]) -> Option<Self> {
        let (n, m) = mode.b.shape();
        let r = tracked.len();
        let mut system = DMatrix::zeros(n + r, n + m);
        system
            .view_mut((0, 0), (n, n))
            .copy_from(&(&mode.a - DMatrix::identity(n, n)));
        system.view_mut((0, n), (n, m)).copy_from(&mode.b);
        for (row, &output) in tracked.iter().enumerate() {
            system
                .view_mut((n + row, 0), (1, n))
                .copy_from(&mode.c.row(output));
        }
        let inverse = system.pseudo_inverse(1e-12).ok()?;
        let size = predictor.factor.nrows();
        let mut spread = DMatrix::zeros(size, m);
        for input in 0..m {
            let held: Vec<f64> = (0..size)
                .map(|entry| f64::from(u8::from(entry % m == input)))
                .collect();
            let mut whitened = vec![0.0; size];
            leverage(&predictor.factor, &held, &mut whitened);
            spread.column_mut(input).copy_from_slice(&whitened);
        }
        Some(Self {
            mode,
            tracked,
            gain: inverse.view((n, n), (m, r)).into_owned(),
            spread,
        })
    }

    /// The input `u` (m) and its leverage; an input stays within its limits.
    fn at(&self, reference: &[f64], design: &Design) -> (DVector<f64>, f64) {
        let point = &self.mode.operating_point;
        let step = self.tracked.iter().zip(reference);
        let step: Vec<f64> = step.map(|(&output, y)| y - point.y[output]).collect();
        let u0 = DVector::from_column_slice(&point.u);
        let mut u = &u0 + &self.gain * DVector::from_vec(step);
        for (value, limits) in u.iter_mut().zip(&design.controller.input_limits) {
            *value = value
                .min(limits.max.unwrap_or(f64::INFINITY))
                .max(limits.min.unwrap_or(f64::NEG_INFINITY));
        }
        let leverage = (&self.spread * (&u - u0)).norm_squared();
        (u, leverage)
    }
}

/// Modes in which the references need inputs that the database does not span.
fn outside_the_database(design: &Design) -> Vec<String> {
    let controller = &design.controller;
    let (scenario, te) = (&design.scenario, controller.plant.sample_time);
    let modes = controller.plant.modes.iter();
    let steady: Vec<Option<Steady>> = modes
        .zip(&controller.estimator.predictors)
        .map(|(mode, predictor)| Steady::new(mode, predictor, &controller.feedback.tracked))
        .collect();
    let mut worst: Vec<Option<(DVector<f64>, f64)>> = vec![None; steady.len()];
    for tick in 0..scenario.steps {
        let mode = scenario.mode(tick, te);
        let Some(Some(steady)) = steady.get(mode) else {
            continue;
        };
        let reference: Vec<f64> = scenario.reference.iter().map(|r| r.at(tick, te)).collect();
        let found = steady.at(&reference, design);
        if worst[mode].as_ref().is_none_or(|worst| found.1 > worst.1) {
            worst[mode] = Some(found);
        }
    }
    let limit = controller.estimator.leverage_limit;
    let far = worst.iter().enumerate().filter_map(|(mode, worst)| {
        let (u, leverage) = worst.as_ref().filter(|(_, leverage)| *leverage > limit)?;
        Some(beyond(design, mode, u, (1.0 + leverage).sqrt()))
    });
    far.collect()
}

/// Names the input that goes farthest.
fn beyond(design: &Design, mode: usize, u: &DVector<f64>, times: f64) -> String {
    let inputs = &design.signals.inputs;
    let point = &design.controller.plant.modes[mode].operating_point.u;
    let farthest = |&input: &usize| ((u[input] - point[input]) / inputs[input].nominal).abs();
    let input = (0..u.len())
        .max_by(|a, b| farthest(a).total_cmp(&farthest(b)))
        .unwrap_or(0);
    format!(
        "mode {}: the reference needs {} = {} in steady state, far outside what the healthy database spans, and \
         thresholds open {} times there: raise its nominal (signals.inputs), or log a run there",
        mode + 1,
        inputs[input].name,
        number(u[input]),
        number(times.round())
    )
}

/// Outputs whose logged response is not the model's, or is no response at all.
fn doubtful_logs(files: &NameOrList, logged: &Logged, design: &Design) -> Vec<String> {
    let controller = &design.controller;
    let mut warnings = Vec::new();
    for (index, (mode, predictor)) in controller
        .plant
        .modes
        .iter()
        .zip(&controller.estimator.predictors)
        .enumerate()
    {
        let units: Vec<f64> = design.signals.inputs.iter().map(|i| i.nominal).collect();
        let length = controller.estimator.response_length;
        let model = model_predictor(mode, length, &units, &predictor.deviation).response;
        for (output, signal) in design.signals.outputs.iter().enumerate() {
            let row = |response: &DMatrix<f64>| -> Vec<f64> {
                let row = response.row(output);
                let scaled = row.iter().zip(units.iter().cycle());
                scaled.map(|(value, unit)| value * unit).collect()
            };
            let moved = logged.0[index][output];
            let doubt = disagreement(&row(&predictor.response), &row(&model))
                .or_else(|| unexplained(predictor.deviation[output], moved));
            warnings.extend(doubt.map(|doubt| {
                format!(
                    "{}: mode {} ({}), {}: {doubt}",
                    shorten(file_of(files, index)),
                    index + 1,
                    mode.name,
                    signal.name
                )
            }));
        }
    }
    warnings
}

/// How a logged response differs from that of the model, where it does by much.
fn disagreement(found: &[f64], model: &[f64]) -> Option<String> {
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let size = dot(model, model).sqrt();
    let difference: Vec<f64> = found.iter().zip(model).map(|(f, m)| f - m).collect();
    let distance = dot(&difference, &difference).sqrt() / size;
    if size == 0.0 || distance <= FAR {
        return None;
    }
    let scale = dot(found, model) / (size * size);
    let alike = dot(found, model).abs() / (size * dot(found, found).sqrt());
    let guess = match () {
        () if alike > 0.9 && scale < 0.0 => "the sensor's sign seems to be reversed",
        () if alike > 0.9 => "the unit seems to be another",
        () => "is it of this mode, with this sign and unit?",
    };
    Some(format!(
        "the response in the log differs from the model's by {distance:.2} times its size ({guess}): \
         check the log, or correct the model"
    ))
}

/// What the inputs leave unexplained, where it is much.
fn unexplained(deviation: f64, moved: f64) -> Option<String> {
    (deviation > UNEXPLAINED * moved).then(|| {
        format!(
            "the inputs do not explain {:.0} % of what the output moves in the log (deviation {deviation:.3e}): \
             look for a fault or a disturbance in it, or for a response_length that is too short",
            100.0 * deviation / moved
        )
    })
}

/// How much of a run the estimator spent without firm ground, and why.
fn unjudged(design: &Design, run: &Trajectory) -> Vec<String> {
    let estimator = &design.controller.estimator;
    let samples = run.records.len();
    let share = |count: usize| count as f64 / samples.max(1) as f64;
    let percent = |count: usize| format!("{:.1} % of the samples", 100.0 * share(count));
    let held = held(estimator, &run.records);
    let far = Far::of(design, run);
    let mut warnings = Vec::new();
    if estimator.method != EstimatorMethod::None && share(held) > MANY {
        warnings.push(format!(
            "ftc: in {} no sensor was judged, since a mode had just been entered: for response_length = {} \
             samples then no fault is found or cleared",
            percent(held),
            estimator.response_length
        ));
    }
    if share(far.samples) > FEW {
        warnings.push(format!(
            "ftc: in {} the inputs lay outside what the healthy database spans, and thresholds opened up to {} times: \
             raise the inputs' nominal values, or log a run there",
            percent(far.samples),
            number(far.widening.round())
        ));
    }
    warnings
}

/// Samples after the start or a switch in which the regressor does not hold one mode only.
fn held(estimator: &Estimator, records: &[Record]) -> usize {
    let visits = records.chunk_by(|one, next| one.mode == next.mode);
    visits
        .map(|visit| visit.len().min(estimator.response_length))
        .sum()
}

/// What of a run lay outside the healthy database.
struct Far {
    /// How many samples.
    samples: usize,
    /// The most by which it opened thresholds.
    widening: f64,
}

impl Far {
    /// Plays the inputs of a run once more.
    fn of(design: &Design, run: &Trajectory) -> Self {
        let controller = &design.controller;
        let (estimator, modes) = (&controller.estimator, &controller.plant.modes);
        let mut far = Self {
            samples: 0,
            widening: 1.0,
        };
        let Some(first) = run.records.first() else {
            return far;
        };
        let start = &modes[first.mode].operating_point.u;
        let mut history = InputHistory::new(start, estimator.response_length);
        let mut before = start;
        for record in &run.records {
            if let Some(predictor) = estimator.predictors.get(record.mode) {
                history.regress(&modes[record.mode].operating_point.u);
                let leverage = history.leverage(&predictor.factor);
                far.samples += usize::from(leverage > estimator.leverage_limit);
                far.widening = far.widening.max((1.0 + leverage).sqrt());
            }
            let delayed = controller.feedback.latency > 0;
            history.push(if delayed { before } else { &record.u });
            before = &record.u;
        }
        far
    }
}

/// A run that ended in equations without a solution.
fn stalled(design: &Design, run: &Trajectory) -> Option<String> {
    let time = run.stalled? as f64 * design.controller.plant.sample_time;
    Some(format!(
        "{}: the plant's equations cannot be integrated beyond {time} s: the figures end there",
        run.variant.key()
    ))
}

/// A rectifier that fell to where it no longer is the one of the design.
fn held_up(design: &Design, run: &Trajectory) -> Option<String> {
    let Truth::Rectifier(rectifier) = &design.truth else {
        return None;
    };
    let floor = rectifier.diode_voltage();
    let below = |record: &&Record| record.x[2] < floor;
    let first = run.records.iter().find(below)?;
    let count = run.records.iter().filter(below).count();
    Some(format!(
        "{}: the DC link fell to where its diodes conduct, below {floor:.1} V, at {} s, and was there in {:.1} % of \
         the samples",
        run.variant.key(),
        first.tick as f64 * design.controller.plant.sample_time,
        100.0 * count as f64 / run.records.len() as f64
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_response_is_doubted_by_what_is_wrong_with_it() {
        let model = [1.0, 2.0, -1.0];
        let doubt = |found: [f64; 3]| disagreement(&found, &model);
        assert_eq!(doubt([1.1, 1.9, -1.0]), None);
        assert!(doubt([-1.0, -2.1, 1.0]).unwrap().contains("sign"));
        assert!(doubt([1000.0, 2000.0, -1000.0]).unwrap().contains("unit"));
        assert!(doubt([0.0, -1.0, -2.0]).unwrap().contains("of this mode"));
        assert_eq!(disagreement(&[1.0], &[0.0]), None);
    }
}
