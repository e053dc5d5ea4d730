//! Everything the controller needs to know before its first tick: plain, serialisable data.

use crate::matrix::{Matrix, upper_triangle};
use crate::tuning::{LEVERAGE_LIMIT, Tuning};
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// A complete controller: the model it observes, its gains, its predictor, its decisions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ControllerParameters {
    /// Sample time `Te` in seconds.
    pub sample_time: f64,
    /// The plant's modes as designed for (physical units); mode number `i` of the user is `modes[i - 1]`.
    pub modes: Vec<ModeModel>,
    /// State feedback with integral action.
    pub feedback: StateFeedback,
    /// State observer.
    pub observer: Observer,
    /// Fault estimator.
    pub estimator: Estimator,
    /// How an estimated fault is taken out of the loop.
    pub compensation: Compensation,
    /// Limits of each input (m); the command is clamped to them.
    pub input_limits: Vec<Limits>,
}

impl ControllerParameters {
    /// A controller without fault estimator and without input limits. An estimator put in its place is
    /// compensated by a virtual sensor.
    pub fn new(
        sample_time: f64,
        modes: Vec<ModeModel>,
        feedback: StateFeedback,
        observer: Observer,
    ) -> Self {
        let (inputs, outputs) = modes
            .first()
            .map_or((0, 0), |mode| (mode.b.ncols(), mode.c.nrows()));
        Self {
            sample_time,
            modes,
            feedback,
            observer,
            estimator: Estimator::none(outputs),
            compensation: Compensation::VirtualSensor,
            input_limits: vec![Limits::default(); inputs],
        }
    }
}

/// One mode of the plant, linear about its operating point:
/// `x(k+1) = x0 + A (x - x0) + B (u - u0) + E w`, `y = y0 + C (x - x0) + F w`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ModeModel {
    /// State matrix `A` (n x n).
    pub a: Matrix,
    /// Input matrix `B` (n x m).
    pub b: Matrix,
    /// Output matrix `C` (p x n).
    pub c: Matrix,
    /// How the disturbance enters the state: `E` (n x s).
    pub e: Matrix,
    /// How the disturbance enters the outputs: `F` (p x s).
    pub f: Matrix,
    /// State `x0` of the operating point (n).
    pub x0: Vec<f64>,
    /// Input `u0` of the operating point (m).
    pub u0: Vec<f64>,
    /// Output `y0` of the operating point (p).
    pub y0: Vec<f64>,
}

impl ModeModel {
    /// A mode of these `A`, `B` and `C`, about the origin, without a known disturbance.
    pub fn new(a: Matrix, b: Matrix, c: Matrix) -> Self {
        let (n, m, p) = (a.nrows(), b.ncols(), c.nrows());
        Self {
            a,
            b,
            c,
            e: Matrix::zeros(n, 0),
            f: Matrix::zeros(p, 0),
            x0: vec![0.0; n],
            u0: vec![0.0; m],
            y0: vec![0.0; p],
        }
    }
}

/// A closed interval; an absent end is unbounded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(clippy::exhaustive_structs, reason = "an interval has two ends")]
pub struct Limits {
    /// Lower end.
    pub min: Option<f64>,
    /// Upper end.
    pub max: Option<f64>,
}

impl Limits {
    /// The nearest value inside the interval.
    pub fn clamp(&self, value: f64) -> f64 {
        let above = self.min.map_or(value, |min| value.max(min));
        self.max.map_or(above, |max| above.min(max))
    }
}

/// Bumpless transfer: at a switch an offset lets the command repeat its last value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[expect(
    clippy::exhaustive_structs,
    reason = "the offset's law has these two numbers"
)]
pub struct Transfer {
    /// Samples that must have passed since the offset was last set before a switch sets it again.
    pub samples: usize,
    /// What is left of the offset after a sample.
    pub decay: f64,
}

/// State feedback with integral action, one gain set per mode (20).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct StateFeedback {
    /// Which outputs follow the reference (0-based rows of `C`), `r` of them.
    pub tracked: Vec<usize>,
    /// Samples between the computation of a command and its action: 0 or 1.
    pub latency: usize,
    /// Angle per sample, in radians, of each resonator of the internal model; usually none.
    #[serde(default)]
    pub resonators: Vec<f64>,
    /// How a mode switch leaves the command where it was; none: the command may jump.
    #[serde(default)]
    pub transfer: Option<Transfer>,
    /// Gains per mode.
    pub modes: Vec<FeedbackGains>,
}

impl StateFeedback {
    /// The gains of each mode for these tracked outputs, without latency, resonators and bumpless transfer.
    pub fn new(tracked: Vec<usize>, modes: Vec<FeedbackGains>) -> Self {
        Self {
            tracked,
            latency: 0,
            resonators: Vec::new(),
            transfer: None,
            modes,
        }
    }

    /// Size `q` of the integral part: one integrator per tracked output, and two states per
    /// tracked output and resonator.
    pub fn integral_size(&self) -> usize {
        self.tracked.len() * (1 + 2 * self.resonators.len())
    }

    /// Whether the reference acts on the command at once.
    pub fn has_feedforward(&self) -> bool {
        self.modes.iter().any(|gains| !gains.feedforward.is_empty())
    }
}

/// The gains of one mode: `u = u0 + K (x - x0) + G Z + N (y_ref - S y0) + V (u_prev - u0)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FeedbackGains {
    /// `K_i` (m x n).
    pub state_feedback: Matrix,
    /// `G_i` (m x q); `q = r` without resonators.
    pub integral: Matrix,
    /// `N_i` (m x r; zero columns without feedforward): what a new reference does to the command
    /// before the integrators have taken it in.
    pub feedforward: Matrix,
    /// Gain on the command still acting (m x m; zero columns when latency is 0).
    pub previous_input: Matrix,
    /// Back-calculation gain (q x m): how a saturated command unwinds the integrator.
    pub anti_windup: Matrix,
    /// `K_i C_i^+` (m x p): what a fault does to the command at once, in the printed control (37).
    pub output_feedback: Matrix,
}

impl FeedbackGains {
    /// `K` (m x n), `G` (m x q) and `K C^+` (m x p): no feedforward, no latency, no anti-windup.
    pub fn new(state_feedback: Matrix, integral: Matrix, output_feedback: Matrix) -> Self {
        let (m, q) = integral.shape();
        Self {
            state_feedback,
            integral,
            feedforward: Matrix::zeros(m, 0),
            previous_input: Matrix::zeros(m, 0),
            anti_windup: Matrix::zeros(q, m),
            output_feedback,
        }
    }
}

/// Which observer was designed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[expect(
    clippy::exhaustive_enums,
    reason = "a new kind must be proved and reported: the compiler says where"
)]
pub enum ObserverKind {
    /// Unknown input observer: the disturbance is decoupled from the estimate.
    Uio,
    /// Luenberger observer.
    Luenberger,
    /// Kalman filter in correction form: no injection, one `H_j` whatever mode was left.
    Kalman,
}

/// The observer (11), per mode and per pair of modes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Observer {
    /// Its kind.
    pub kind: ObserverKind,
    /// Why this kind, where the user left the choice open.
    pub note: Option<String>,
    /// Output-injection gain `K_i*` of (13) per mode (n x p each).
    pub gains: Vec<Matrix>,
    /// `H_ij` of (14): `decoupling[i][j]` corrects on entering mode `j` from mode `i` (n x p each).
    pub decoupling: Vec<Vec<Matrix>>,
    /// Matrices for each set of lost sensors from whose rest the state can be observed, the smallest
    /// sets first; a set that is not listed is not served. With none lost, the gains above are used.
    #[serde(default)]
    pub lost: Vec<LostSet>,
    /// Samples for which a set of lost sensors must last before it may change; 0: it may change at
    /// every sample.
    #[serde(default)]
    pub minimum_dwell: usize,
}

impl Observer {
    /// An observer of this kind with its `K_i*` and `H_ij`, which serves no set of lost sensors.
    pub fn new(kind: ObserverKind, gains: Vec<Matrix>, decoupling: Vec<Vec<Matrix>>) -> Self {
        Self {
            kind,
            note: None,
            gains,
            decoupling,
            lost: Vec::new(),
            minimum_dwell: 0,
        }
    }

    /// A Luenberger observer with these gains: nothing is decoupled, every `H_ij` is zero.
    pub fn luenberger(gains: Vec<Matrix>) -> Self {
        let zeros = gains
            .iter()
            .map(|gain| Matrix::zeros(gain.nrows(), gain.ncols()));
        let decoupling = vec![zeros.collect(); gains.len()];
        Self::new(ObserverKind::Luenberger, gains, decoupling)
    }
}

/// How to observe without some sensors: `x_hat = prior + H (y - C prior)`, no injection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LostSet {
    /// Which sensors (rows of `C`, from 0) are lost, in ascending order; never empty.
    pub sensors: Vec<usize>,
    /// `H` of each mode (n x p each); the columns of the lost sensors are zero.
    pub correction: Vec<Matrix>,
}

impl LostSet {
    /// With these sensors lost, ascending, the `H` of each mode.
    pub fn new(sensors: Vec<usize>, correction: Vec<Matrix>) -> Self {
        Self {
            sensors,
            correction,
        }
    }
}

/// How faults are estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[expect(
    clippy::exhaustive_enums,
    reason = "a new method must be designed and reported: the compiler says where"
)]
pub enum EstimatorMethod {
    /// State-based: hypotheses about sensors and plant in competition.
    Observer,
    /// Least-squares predictor from a healthy database (55)-(60).
    Reference,
    /// The sliding window as printed (44).
    Sliding,
    /// No estimation: the estimate stays zero.
    None,
}

/// The data-based projection estimator (41)-(62).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Estimator {
    /// Method.
    pub method: EstimatorMethod,
    /// Sizes and rates for [`EstimatorMethod::Observer`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hypotheses: Option<Hypotheses>,
    /// `j`: how many past inputs the output depends on.
    pub response_length: usize,
    /// `L`: samples in the window of [`EstimatorMethod::Sliding`], more than `m j`.
    pub window: usize,
    /// The predictor of each mode; none for the other methods.
    pub predictors: Vec<Predictor>,
    /// Whether the response goes on being learned from healthy samples.
    #[serde(default)]
    pub adapt: bool,
    /// The periodic disturbance whose response is learned on line.
    pub harmonics: Option<Harmonics>,
    /// What a response learned in one mode tells of another, `[from][to][harmonic]`; may be empty.
    #[serde(default)]
    pub harmonic_transfers: Vec<Vec<Vec<PhasorMap>>>,
    /// Decision threshold per sensor (p), in output units, before widening by the leverage.
    pub thresholds: Vec<f64>,
    /// Consecutive samples needed to raise or release a fault.
    pub debounce: u32,
    /// Repetitions of the very same reading after which a sensor is taken for frozen, and then as
    /// if it gave no reading; 0: never.
    pub stuck_after: u32,
    /// Above this leverage the input lies outside what the database spans, and no decision is taken.
    pub leverage_limit: f64,
    /// Largest magnitude an estimate may take, per sensor (p).
    pub largest_fault: Vec<f64>,
    /// Tuning constants of the on-line path.
    pub tuning: Tuning,
}

/// Most harmonics of a known disturbance.
pub const MOST_HARMONICS: usize = 50;

/// The longest latency in samples.
pub const LONGEST_LATENCY: usize = 1;

impl Estimator {
    /// No estimation, for so many sensors. Before choosing a method, set what it needs: its predictors or
    /// hypotheses and the thresholds, which no residual exceeds here.
    pub fn none(outputs: usize) -> Self {
        Self {
            method: EstimatorMethod::None,
            hypotheses: None,
            response_length: 0,
            window: 0,
            predictors: Vec::new(),
            adapt: false,
            harmonics: None,
            harmonic_transfers: Vec::new(),
            thresholds: vec![f64::MAX; outputs],
            debounce: 1,
            stuck_after: 0,
            leverage_limit: LEVERAGE_LIMIT,
            largest_fault: vec![f64::MAX; outputs],
            tuning: Tuning::default(),
        }
    }

    /// Whether the mode is found from the readings.
    pub fn finds_the_mode(&self) -> bool {
        let settings = self.hypotheses.as_ref().map(|found| found.mode_rate);
        self.method == EstimatorMethod::Observer && settings.flatten().is_some()
    }

    /// The largest fault estimate of each sensor (p), output units.
    pub fn authority(&self) -> &[f64] {
        let hypotheses = self.hypotheses.as_ref();
        hypotheses.map_or(&self.largest_fault, |settings| &settings.authority)
    }
}

/// What is done about a divergence that could be a sensor's drift or a load.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[expect(clippy::exhaustive_enums, reason = "one of two is used")]
pub enum Ambiguous {
    /// The readings are used, and the alarm is up.
    TrustSensors,
    /// The model is used: the sensor is corrected.
    TrustModel,
}

/// Sizes and rates of what may happen to sensors and plant, for [`EstimatorMethod::Observer`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(
    clippy::exhaustive_structs,
    reason = "whoever makes these must choose each number: the compiler names a new one"
)]
pub struct Hypotheses {
    /// Standard deviation of the noise of each sensor (p), output units.
    pub noise: Vec<f64>,
    /// Faults per sample and sensor.
    pub fault_rate: f64,
    /// Freezes per sample and sensor.
    pub stuck_rate: f64,
    /// Ends of a fault per sample: one over its mean length.
    pub release_rate: f64,
    /// Jumps of a present fault per sample.
    pub change_rate: f64,
    /// Jumps of loads or of input gains per sample.
    pub load_rate: f64,
    /// Relative error of the matrices of a plant that is no longer the model.
    pub changed_error: f64,
    /// Switches per sample where the mode is found from the readings; none where it is told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mode_rate: Option<f64>,
    /// Log odds that a sensor's fault must have against the best explanation without one.
    pub odds: f64,
    /// Standard deviation of a new fault (p), output units.
    pub fault_size: Vec<f64>,
    /// How far a fault that came abruptly wanders per sample, in noise deviations.
    pub fault_walk: f64,
    /// The same for a fault that grew slowly.
    pub drift_walk: f64,
    /// Standard deviation of a load on each input (m), input units.
    pub input_load: Vec<f64>,
    /// Standard deviation of a load on each disturbance channel (s), its units.
    pub disturbance_load: Vec<f64>,
    /// How far a load on the states themselves displaces them at rest (n), state units.
    pub state_load: Vec<f64>,
    /// How far a load on an input or a state wanders per sample, relative to the size of its jumps.
    pub load_walk: f64,
    /// How far a load on each disturbance channel wanders per sample (s), its units.
    pub disturbance_walk: Vec<f64>,
    /// Relative error of the entries of the plant's matrices.
    pub model_error: f64,
    /// Standard deviation of the relative error of an input's gain.
    pub gain_error: f64,
    /// How far an input's gain wanders per sample.
    pub gain_walk: f64,
    /// Relative error of the disturbance's period.
    pub period_error: f64,
    /// Standard deviation of each state of the disturbance (2 x harmonics x s).
    pub disturbance_size: Vec<f64>,
    /// The disturbance's period, if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub period: Option<KnownPeriod>,
    /// Typical deviation of each state from its operating point (n).
    pub state_size: Vec<f64>,
    /// Standard deviation of the state at the start (n).
    pub start: Vec<f64>,
    /// The same where the plant was not at rest (n).
    pub start_elsewhere: Vec<f64>,
    /// Largest correction of each sensor (p), output units.
    pub authority: Vec<f64>,
    /// What is done about a slow divergence.
    pub ambiguous: Ambiguous,
    /// What logs say of each mode in place of the plant's matrices; empty without logs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fitted: Vec<FittedMode>,
}

/// The period of a disturbance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[expect(clippy::exhaustive_structs, reason = "a period and its harmonics")]
pub struct KnownPeriod {
    /// Period in seconds.
    pub seconds: f64,
    /// Harmonics, the fundamental included.
    pub harmonics: usize,
}

impl KnownPeriod {
    /// Angle per sample (radians) of each harmonic.
    pub fn angles(self, sample_time: f64) -> impl Iterator<Item = f64> + Clone {
        let fundamental = core::f64::consts::TAU * sample_time / self.seconds;
        (1..=self.harmonics).map(move |harmonic| harmonic as f64 * fundamental)
    }
}

/// A mode's matrices as logs of healthy operation have them, about the plant's operating point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FittedMode {
    /// `A` (n x n).
    pub a: Matrix,
    /// `B` (n x m).
    pub b: Matrix,
    /// `C` (p x n).
    pub c: Matrix,
    /// `E` (n x s).
    pub e: Matrix,
    /// `F` (p x s).
    pub f: Matrix,
    /// How much of what each output (p) did in the part of the log held back they explain, in percent.
    pub fit: Vec<f64>,
    /// The same of the plant's own matrices.
    pub fit_of_model: Vec<f64>,
}

impl FittedMode {
    /// `A`, `B`, `C`, `E` and `F`, and how much of the log held back they (`fit`) and the plant's own
    /// (`fit_of_model`) explain, in percent per output.
    pub fn new([a, b, c, e, f]: [Matrix; 5], fit: Vec<f64>, fit_of_model: Vec<f64>) -> Self {
        Self {
            a,
            b,
            c,
            e,
            f,
            fit,
            fit_of_model,
        }
    }
}

impl Hypotheses {
    /// Harmonics of the disturbance that are estimated.
    ///
    /// A call of its own: where it is inlined behind an `Option`, the period is read before it is known to be there, which
    /// is harmless but what memcheck complains of.
    #[inline(never)]
    pub fn harmonics(&self) -> usize {
        self.period.map_or(0, |known| known.harmonics)
    }

    /// Whether a slow divergence is taken for a sensor's fault.
    pub fn trusts_model(&self) -> bool {
        self.ambiguous == Ambiguous::TrustModel
    }
}

/// `y ~ y0 + response * phi`, with `phi` the last `j` inputs relative to `u0`, oldest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(
    clippy::exhaustive_structs,
    reason = "a least-squares solution and what it rests on"
)]
pub struct Predictor {
    /// `Y1 U1^+` (p x m j).
    pub response: Matrix,
    /// `R` of the QR factorisation of `U1'` (m j x m j, upper triangular): gives the leverage.
    #[serde(with = "upper_triangle")]
    pub factor: Matrix,
    /// Standard deviation of the residual on the database, per sensor (p).
    pub deviation: Vec<f64>,
    /// Samples in the database.
    pub samples: usize,
}

/// What is known of the periodic disturbance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[expect(
    clippy::exhaustive_structs,
    reason = "the parameters of the recursive least squares"
)]
pub struct Harmonics {
    /// Period in samples (need not be whole).
    pub period: f64,
    /// Number of harmonics.
    pub count: usize,
    /// Memory of the on-line learning in samples.
    pub memory: f64,
    /// Initial variance of each coefficient, in units of the noise variance.
    pub initial_variance: f64,
}

/// A complex matrix that turns the outputs' phasors in one mode into those in another (p x p).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(clippy::exhaustive_structs, reason = "a complex matrix")]
pub struct PhasorMap {
    /// Real part.
    pub real: Matrix,
    /// Imaginary part.
    pub imaginary: Matrix,
}

/// How the estimated fault is compensated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[expect(
    clippy::exhaustive_enums,
    reason = "a new one must be run and reported: the compiler says where"
)]
pub enum Compensation {
    /// Observer and integrator see the corrected measurement.
    VirtualSensor,
    /// The additive control as printed (37)-(40).
    Additive,
    /// The estimate is reported, not used.
    None,
}
