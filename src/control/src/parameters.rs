//! Everything the controller needs to know before its first tick: plain, serialisable data.

use ftc_plant::SwitchedPlant;
use ftc_plant::rows;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// A complete controller: the model it observes, its gains, its predictor, its decisions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControllerParameters {
    /// The plant as designed for (physical units).
    pub plant: SwitchedPlant,
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

/// A closed interval; an absent end is unbounded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
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
pub struct Transfer {
    /// Samples that must have passed since the offset was last set before a switch sets it again.
    pub samples: usize,
    /// What is left of the offset after a sample.
    pub decay: f64,
}

/// State feedback with integral action, one gain set per mode (20).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
pub struct FeedbackGains {
    /// `K_i` (m x n).
    #[serde(with = "rows")]
    pub state_feedback: DMatrix<f64>,
    /// `G_i` (m x q); `q = r` without resonators.
    #[serde(with = "rows")]
    pub integral: DMatrix<f64>,
    /// `N_i` (m x r; zero columns without feedforward): what a new reference does to the command
    /// before the integrators have taken it in.
    #[serde(with = "rows")]
    pub feedforward: DMatrix<f64>,
    /// Gain on the command still acting (m x m; zero columns when latency is 0).
    #[serde(with = "rows")]
    pub previous_input: DMatrix<f64>,
    /// Back-calculation gain (q x m): how a saturated command unwinds the integrator.
    #[serde(with = "rows")]
    pub anti_windup: DMatrix<f64>,
    /// `K_i C_i^+` (m x p): what a fault does to the command at once, in the printed control (37).
    #[serde(with = "rows")]
    pub output_feedback: DMatrix<f64>,
}

/// Which observer was designed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
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
pub struct Observer {
    /// Its kind.
    pub kind: ObserverKind,
    /// Why this kind, where the user left the choice open.
    pub note: Option<String>,
    /// Output-injection gain `K_i*` of (13) per mode (n x p each).
    pub gains: Vec<Gain>,
    /// `H_ij` of (14): `decoupling[i][j]` corrects on entering mode `j` from mode `i` (n x p each).
    pub decoupling: Vec<Vec<Gain>>,
    /// Gains for each set of lost sensors from whose rest the state can be observed, the smallest
    /// sets first; a set that is not listed is not served. With none lost, the gains above are used.
    #[serde(default)]
    pub lost: Vec<LostSet>,
    /// Samples for which a set of lost sensors must last before it may change; 0: it may change at
    /// every sample.
    #[serde(default)]
    pub minimum_dwell: usize,
}

/// How to observe without some sensors: `x_hat = prior + H (y - C prior)`, no injection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LostSet {
    /// Which sensors (rows of `C`, from 0) are lost, in ascending order; never empty.
    pub sensors: Vec<usize>,
    /// `H` of each mode (n x p each); the columns of the lost sensors are zero.
    pub correction: Vec<Gain>,
}

/// A matrix on its own, written as its rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Gain(#[serde(with = "rows")] pub DMatrix<f64>);

/// How faults are estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EstimatorMethod {
    /// Least-squares predictor from a healthy database (55)-(60).
    Reference,
    /// The sliding window as printed (44).
    Sliding,
    /// No estimation: the estimate stays zero.
    None,
}

/// The data-based projection estimator (41)-(62).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimator {
    /// Method.
    pub method: EstimatorMethod,
    /// `j`: how many past inputs the output remembers.
    pub response_length: usize,
    /// `L`: samples in the window of [`EstimatorMethod::Sliding`], more than `m j`.
    pub window: usize,
    /// The predictor of each mode; none for the other methods.
    pub predictors: Vec<Predictor>,
    /// Whether the response goes on being learned while all is well.
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
    /// if it were silent; 0: never.
    pub stuck_after: u32,
    /// Above this leverage the input lies outside what the database spans, and no decision is taken.
    pub leverage_limit: f64,
    /// Largest magnitude an estimate may take, per sensor (p).
    pub largest_fault: Vec<f64>,
}

/// `y ~ y0 + response * phi`, with `phi` the last `j` inputs relative to `u0`, oldest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Predictor {
    /// `Y1 U1^+` (p x m j).
    #[serde(with = "rows")]
    pub response: DMatrix<f64>,
    /// `R` of the QR factorisation of `U1'` (m j x m j, upper triangular): gives the leverage.
    #[serde(with = "rows")]
    pub factor: DMatrix<f64>,
    /// Standard deviation of the residual on the database, per sensor (p).
    pub deviation: Vec<f64>,
    /// Samples in the database.
    pub samples: usize,
}

/// What is known of the periodic disturbance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
pub struct PhasorMap {
    /// Real part.
    #[serde(with = "rows")]
    pub real: DMatrix<f64>,
    /// Imaginary part.
    #[serde(with = "rows")]
    pub imaginary: DMatrix<f64>,
}

/// How the estimated fault is compensated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Compensation {
    /// Observer and integrator see the corrected measurement.
    VirtualSensor,
    /// The additive control as printed (37)-(40).
    Additive,
    /// The estimate is reported, not used.
    None,
}
