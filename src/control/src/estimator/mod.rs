//! The sensor-fault estimators: by default a bank of state-based hypotheses ([`hypotheses`]); as the paper has it,
//! data-based projection with a reference window (41)-(62).
//!
//! In the latter a healthy database of inputs `U1` and outputs `Y1` fixes, by projection, what the output must
//! be: `y_hat = y0 + Y1 U1^+ phi` (`predictor`). What the periodic disturbance adds is learned
//! on line while no sensor is flagged (`harmonics`). The residual is what remains; each sensor's residual
//! is judged against its own threshold (`decision`), widened by how far the present input lies
//! from those the database knows.

mod adaptation;
mod decision;
mod derivative;
mod harmonics;
#[expect(clippy::exhaustive_structs, reason = "made by the estimator alone")]
pub mod hypotheses;
mod least_squares;
mod predictor;
mod recovery;
mod window;

pub use adaptation::Adaptation;
use alloc::vec;
use alloc::vec::Vec;
pub use decision::{Decision, Verdict};
pub use harmonics::HarmonicState;
pub use predictor::{InputHistory, leverage};
pub use recovery::Recovery;
pub use window::SlidingWindow;

use super::compensation::is_measurement;
use super::kernel;
use super::parameters::{Estimator, EstimatorMethod};
use hypotheses::BankState;
use serde::{Deserialize, Serialize};

/// How far a residual is valid.
#[derive(Clone, Copy, Debug)]
struct Validity {
    /// By how much its threshold is widened: the prediction's deviation over that of the noise.
    widening: f64,
    /// Whether a residual within the widened threshold clears a flagged sensor.
    clears: bool,
    /// Whether something may be learned from it.
    informs: bool,
}

impl Validity {
    /// As much as a threshold assumes.
    const FULL: Self = Self {
        widening: 1.0,
        clears: true,
        informs: true,
    };

    /// What a threshold is multiplied by. Where little is known, the wide threshold keeps a healthy
    /// sensor from being flagged, but a flagged one is cleared by nothing less than the narrow one:
    /// its residual goes on being followed, since an estimate that stood still would leave the loop
    /// without feedback.
    fn factor(&self, flagged: bool) -> f64 {
        if flagged && !self.clears {
            1.0
        } else {
            self.widening
        }
    }
}

/// One sample as the estimator sees it.
#[derive(Clone, Copy, Debug)]
#[expect(
    clippy::exhaustive_structs,
    reason = "made anew in each tick, by the controller alone"
)]
pub struct Observation<'a> {
    /// Number of the tick.
    pub tick: u64,
    /// Active mode (0-based).
    pub mode: usize,
    /// Input of the mode's operating point (m).
    pub u0: &'a [f64],
    /// Output of the mode's operating point (p).
    pub y0: &'a [f64],
    /// Measurement (p).
    pub y: &'a [f64],
    /// Decision thresholds (p).
    pub thresholds: &'a [f64],
}

/// What the estimator remembers, and what it last said.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct EstimatorState {
    history: InputHistory,
    /// Ticks until the regressor again holds inputs of the present mode only.
    hold: usize,
    /// Whether the last residual could be judged, per sensor (p).
    judged: Vec<bool>,
    /// Per mode: the learned response to the periodic disturbance.
    harmonics: Vec<HarmonicState>,
    /// Watches flagged sensors for a wrongly learned disturbance.
    recovery: Option<Recovery>,
    /// Per mode: the adapted response; empty unless adaptation is on.
    adaptations: Vec<Adaptation>,
    decisions: Vec<Decision>,
    /// The window of the printed method, where it is chosen.
    window: Option<SlidingWindow>,
    /// Predicted output `y_hat` (p).
    pub prediction: Vec<f64>,
    /// Residual `r_c = y - y_hat` (p); keeps its last value where the measurement is not a number.
    pub residual: Vec<f64>,
    /// Fault estimate `f_hat` (p); zero while no fault is declared.
    pub fault: Vec<f64>,
    /// Whether a fault is declared, per sensor (p).
    pub flagged: Vec<bool>,
}

crate::state!(EstimatorState {
    parts: [
        history,
        harmonics,
        recovery,
        adaptations,
        decisions,
        window,
        judged,
        prediction,
        residual,
        fault,
        flagged
    ],
    constants: [],
    counters: [hold]
});

impl EstimatorState {
    /// Nothing seen yet: `inputs` is the command that has acted so far (m).
    pub fn new(estimator: &Estimator, inputs: &[f64], outputs: usize) -> Self {
        let modes = estimator.predictors.len().max(1);
        let harmonics = (0..modes)
            .filter_map(|_| {
                estimator
                    .harmonics
                    .as_ref()
                    .map(|h| HarmonicState::new(h, outputs))
            })
            .collect();
        Self {
            history: InputHistory::new(inputs, estimator.response_length),
            hold: estimator.response_length,
            judged: vec![false; outputs],
            harmonics,
            recovery: estimator
                .harmonics
                .as_ref()
                .map(|h| Recovery::new(h, outputs, &estimator.tuning.database)),
            adaptations: if estimator.adapt {
                estimator.predictors.iter().map(Adaptation::new).collect()
            } else {
                Vec::new()
            },
            window: (estimator.method == EstimatorMethod::Sliding).then(|| {
                SlidingWindow::new(
                    inputs.len() * estimator.response_length,
                    outputs,
                    estimator.window,
                    estimator.tuning.database.window_rank,
                )
            }),
            decisions: vec![Decision::default(); outputs],
            prediction: vec![0.0; outputs],
            residual: vec![0.0; outputs],
            fault: vec![0.0; outputs],
            flagged: vec![false; outputs],
        }
    }

    /// Called on leaving mode `from` for mode `to`: the regressor mixes modes for `response_length`
    /// samples, and a mode never learned in starts from what was learned in the other.
    pub fn mode_entered(
        &mut self,
        estimator: &Estimator,
        from: usize,
        to: usize,
        thresholds: &[f64],
    ) {
        let tuning = &estimator.tuning.database;
        self.hold = estimator.response_length;
        if let Some(window) = &mut self.window {
            window.clear();
        }
        let maps = estimator
            .harmonic_transfers
            .get(from)
            .and_then(|row| row.get(to));
        if let Some(maps) = maps
            && let Ok([left, entered]) = self.harmonics.get_disjoint_mut([from, to])
            && left.is_known(tuning)
            && !entered.is_known(tuning)
        {
            let deviations = thresholds
                .iter()
                .map(|t| (t / tuning.threshold_deviations).max(f64::MIN_POSITIVE));
            entered.carry_over(left, maps, deviations, tuning);
        }
    }

    /// Puts the prediction in place of `expected` outputs (p), where it can be trusted now.
    pub fn predict_into(&self, estimator: &Estimator, expected: &mut [f64]) {
        if estimator.method == EstimatorMethod::Observer {
            kernel::copy(expected, &self.prediction);
        }
        if estimator.method != EstimatorMethod::Reference {
            return;
        }
        let known = self.prediction.iter().zip(&self.judged);
        for (output, (&predicted, &judged)) in expected.iter_mut().zip(known) {
            if judged {
                *output = predicted;
            }
        }
    }

    /// Which sensors (p) are flagged and could not be judged anew, so that their estimate stands still.
    pub fn held<'a>(&'a self, estimator: &Estimator) -> impl Iterator<Item = bool> + Clone + 'a {
        let reference = estimator.method == EstimatorMethod::Reference;
        let sensors = self.flagged.iter().zip(&self.judged);
        sensors.map(move |(&flagged, &judged)| reference && flagged && !judged)
    }

    /// Whether a flagged sensor has no trusted prediction to stand in for it.
    pub fn needs_open_loop(&self, estimator: &Estimator) -> bool {
        if estimator.method == EstimatorMethod::Observer {
            return false;
        }
        let predicts = estimator.method == EstimatorMethod::Reference;
        let mut sensors = self.flagged.iter().zip(&self.judged);
        sensors.any(|(&flagged, &judged)| flagged && !(predicts && judged))
    }

    /// Takes over what the state-based estimator said of the readings `y` (p).
    pub(crate) fn adopt(&mut self, estimator: &Estimator, bank: &BankState, y: &[f64]) {
        let limits = estimator.authority();
        kernel::copy(&mut self.prediction, &bank.expected);
        self.judged.fill(true);
        let sensors = self
            .fault
            .iter_mut()
            .zip(&mut self.flagged)
            .zip(&mut self.residual);
        let said = y.iter().zip(&bank.residual).zip(&bank.expected).zip(limits);
        for (q, (((fault, flagged), residual), (((&y, &left), &expected), &largest))) in
            sensors.zip(said).enumerate()
        {
            *flagged = hypotheses::has(bank.flagged, q);
            if !is_measurement(y) {
                *fault = 0.0;
                continue;
            }
            *residual = left;
            *fault = if *flagged {
                (y - expected).clamp(-largest, largest)
            } else {
                0.0
            };
        }
    }

    /// Judges one sample, sensor by sensor.
    pub fn observe(&mut self, estimator: &Estimator, seen: &Observation<'_>) {
        self.history.regress(seen.u0);
        let validity = match estimator.method {
            EstimatorMethod::Reference => self.predict(estimator, seen),
            EstimatorMethod::Sliding => self.slide(seen),
            EstimatorMethod::Observer | EstimatorMethod::None => None,
        };
        let healthy = self.decide(estimator, seen, validity);
        let corrected = self.reconsider(estimator, seen);
        if healthy && !corrected {
            self.learn(estimator, seen.mode);
        }
        self.refine(estimator, seen);
        self.hold = self.hold.saturating_sub(1);
    }

    /// Adds what adaptation learned to prediction and residual, and to the estimate of every declared
    /// fault that was judged anew; the flags stay.
    fn refine(&mut self, estimator: &Estimator, seen: &Observation<'_>) {
        if estimator.method != EstimatorMethod::Reference {
            return;
        }
        let Some(adaptation) = self.adaptations.get(seen.mode) else {
            return;
        };
        let decided = self.flagged.iter().zip(&self.judged);
        let estimates = self.fault.iter_mut().zip(decided);
        let signals = self.prediction.iter_mut().zip(&mut self.residual);
        let limits = seen.y.iter().zip(&estimator.largest_fault);
        for (
            ((addition, (prediction, residual)), (fault, (&flagged, &judged))),
            (&value, &largest),
        ) in adaptation
            .additions(&estimator.tuning.database)
            .zip(signals)
            .zip(estimates)
            .zip(limits)
        {
            *prediction = kernel::bounded(*prediction + addition);
            if is_measurement(value) {
                *residual = value - *prediction;
                if flagged && judged {
                    *fault = residual.clamp(-largest, largest);
                }
            }
        }
    }

    /// The reference window: leaves prediction and residual, and returns how far they are valid;
    /// nothing while the regressor mixes modes.
    fn predict(&mut self, estimator: &Estimator, seen: &Observation<'_>) -> Option<Validity> {
        self.judged.fill(false);
        let predictor = estimator.predictors.get(seen.mode)?;
        let tuning = &estimator.tuning.database;
        kernel::affine(
            &mut self.prediction,
            seen.y0,
            &predictor.response,
            self.history.regressor(),
        );
        if let Some(adaptation) = self.adaptations.get_mut(seen.mode) {
            let regressor = self.history.regressor();
            adaptation.predict(predictor, regressor, seen.y0, &self.prediction, tuning);
        }
        let leverage = self.history.leverage(&predictor.factor);
        let mut spread = 1.0 + leverage;
        if let Some(learned) = self.harmonics.get_mut(seen.mode)
            && let Some(known) = &estimator.harmonics
        {
            learned.rotate(known, seen.tick);
            learned.add_response(&mut self.prediction);
            spread += learned.leverage();
        }
        kernel::bound(&mut self.prediction);
        let pairs = self.residual.iter_mut().zip(seen.y).zip(&self.prediction);
        for ((residual, &value), &predicted) in pairs {
            if is_measurement(value) {
                *residual = value - predicted;
            }
        }
        let spanned = leverage <= estimator.leverage_limit;
        let signals = self
            .prediction
            .iter()
            .zip(seen.y0)
            .zip(&predictor.deviation);
        for (judged, ((&predicted, &y0), deviation)) in self.judged.iter_mut().zip(signals) {
            let precise = libm::sqrt(leverage) * deviation
                <= tuning.extrapolation_error * (predicted - y0).abs();
            *judged = self.hold == 0 && (spanned || precise);
        }
        let most = 1.0 + estimator.leverage_limit;
        let validity = Validity {
            widening: libm::sqrt(spread),
            clears: spread <= most,
            informs: spanned,
        };
        (self.hold == 0).then_some(validity)
    }

    /// Takes a healthy sample in: the response to the disturbance first, the plant's own response
    /// only once the former is known, since the loop's input follows the disturbance too.
    fn learn(&mut self, estimator: &Estimator, mode: usize) {
        let mut settled = true;
        if let Some(learned) = self.harmonics.get_mut(mode)
            && let Some(known) = &estimator.harmonics
        {
            settled = learned.is_settled(known);
            learned.learn(known, &self.residual);
        }
        if settled && let Some(adaptation) = self.adaptations.get_mut(mode) {
            adaptation.learn(
                self.history.regressor(),
                &self.residual,
                &estimator.tuning.database,
            );
        }
    }

    /// Replaces what was learned of flagged sensors that showed nothing but the disturbance for a
    /// period; says whether there were any.
    fn reconsider(&mut self, estimator: &Estimator, seen: &Observation<'_>) -> bool {
        let (Some(recovery), Some(known)) = (&mut self.recovery, &estimator.harmonics) else {
            return false;
        };
        let Some(learned) = self.harmonics.get_mut(seen.mode) else {
            return false;
        };
        if self.hold > 0 || !seen.y.iter().all(|&value| is_measurement(value)) {
            recovery.restart(&estimator.tuning.database);
            return false;
        }
        let unexplained = self
            .residual
            .iter()
            .zip(learned.responses())
            .map(|(r, wave)| r + wave);
        let sensors = unexplained.zip(self.flagged.iter().copied());
        if !recovery.watch(known, learned.regressor(), sensors) {
            return false;
        }
        let settled = learned.is_settled(known);
        let share = estimator.tuning.database.recovery_share;
        let mut corrected = false;
        for (sensor, &threshold) in seen.thresholds.iter().enumerate() {
            if let Some(waves) = recovery.explanation(sensor, share * threshold, settled) {
                learned.replace(sensor, waves);
                corrected = true;
            }
        }
        recovery.restart(&estimator.tuning.database);
        corrected
    }

    /// The sliding window as printed: leaves the residual; nothing until the window is full.
    fn slide(&mut self, seen: &Observation<'_>) -> Option<Validity> {
        self.judged.fill(false);
        let window = self.window.as_mut().filter(|_| self.hold == 0)?;
        window.residual(self.history.regressor(), seen.y, &mut self.residual);
        self.judged.fill(window.full());
        window.full().then_some(Validity::FULL)
    }

    /// Remembers the input that acts over the coming sample (m).
    pub fn remember(&mut self, acting: &[f64]) {
        self.history.push(acting);
    }

    /// Decides sensor by sensor; `validity` is absent when the residual means nothing now.
    /// Returns whether the residual was judged and no sensor is flagged and every residual is small.
    fn decide(
        &mut self,
        estimator: &Estimator,
        seen: &Observation<'_>,
        validity: Option<Validity>,
    ) -> bool {
        let learning_share = estimator.tuning.database.learning_share;
        let mut healthy = validity.is_some_and(|validity| validity.informs);
        let sensors = self
            .decisions
            .iter_mut()
            .zip(&mut self.fault)
            .zip(self.flagged.iter_mut().zip(&self.judged));
        let signals = seen
            .y
            .iter()
            .zip(&self.residual)
            .zip(seen.thresholds.iter().zip(&estimator.largest_fault));
        for (((decision, fault), (flagged, &judged)), signals) in sensors.zip(signals) {
            let ((&value, &residual), (&threshold, &largest)) = signals;
            let validity = validity.filter(|_| judged);
            let verdict = if !is_measurement(value) {
                Some(Verdict::Lost)
            } else {
                validity
                    .map(|validity| Verdict::of(residual, validity.factor(*flagged) * threshold))
            };
            let Some(verdict) = verdict else { continue };
            decision.update(verdict, estimator.debounce);
            *flagged = decision.flagged();
            *fault = match (*flagged, verdict) {
                (false, _) => 0.0,
                (true, Verdict::Lost) => *fault,
                (true, _) => residual.clamp(-largest, largest),
            };
            let quiet =
                validity.is_some_and(|t| residual.abs() <= learning_share * t.widening * threshold);
            healthy &= !*flagged && verdict == Verdict::Healthy && quiet;
        }
        healthy
    }
}
