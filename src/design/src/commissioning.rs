//! The healthy database and the predictor made from it (41)-(43), (55)-(60).
//!
//! A database holds, for one mode, the inputs and outputs of a healthy plant under an exciting
//! input. The predictor is the least-squares map from the last `j` inputs to the output,
//! obtained by QR factorisation; `R` is kept, since it tells how far any later input lies from
//! what the database has seen.

use ftc_control::parameters::Predictor;
use ftc_plant::noise;
use ftc_plant::{Mode, spectral_radius};
use ftc_record::{dense, plain};
use nalgebra::{DMatrix, DVector};

/// Healthy inputs and outputs of one mode, without a gap: row `k` holds `u(k)` (m) and `y(k)` (p).
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Database {
    /// Number of the first sample in the log it was taken from; it only tells the phase of a
    /// periodic disturbance between stretches of one log.
    pub first: usize,
    /// Inputs relative to the operating point (samples x m).
    pub inputs: DMatrix<f64>,
    /// Outputs relative to the operating point (samples x p).
    pub outputs: DMatrix<f64>,
}

impl Database {
    /// From rows of inputs (samples x m) and as many of outputs (samples x p).
    ///
    /// # Errors
    /// [`CommissioningError::Rows`] where there are more of one than of the other.
    pub fn new(
        first: usize,
        inputs: DMatrix<f64>,
        outputs: DMatrix<f64>,
    ) -> Result<Self, CommissioningError> {
        let rows = [inputs.nrows(), outputs.nrows()];
        if rows[0] != rows[1] {
            return Err(CommissioningError::Rows { rows });
        }
        Ok(Self {
            first,
            inputs,
            outputs,
        })
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.inputs.nrows()
    }
}

/// The truncation error allowed when a response length is chosen, relative to the response itself.
const TRUNCATION: f64 = 1e-7;

/// The longest response this estimator accepts.
pub const LONGEST_RESPONSE: usize = 2000;

/// The most response coefficients per output: beyond it a predictor is too large to ship.
const MOST_COEFFICIENTS: usize = 2000;

/// The longest response in samples that this estimator accepts of a plant with so many inputs.
pub fn longest_response(inputs: usize) -> usize {
    LONGEST_RESPONSE.min(MOST_COEFFICIENTS / inputs.max(1))
}

/// Why there is no response length, or no predictor.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CommissioningError {
    /// A mode is unstable.
    #[error(
        "mode {mode}: A has spectral radius {radius:.4}, but the estimator needs a stable mode (below 1): \
         choose the state-based method"
    )]
    Unstable {
        /// The mode, from 1.
        mode: usize,
        /// Its spectral radius.
        radius: f64,
    },
    /// A mode's response lasts longer than [`LONGEST_RESPONSE`].
    #[error(
        "mode {mode}: the response is still felt after {LONGEST_RESPONSE} samples (spectral radius {radius:.6}): \
         choose the state-based method, or a longer sample time for this loop"
    )]
    SlowResponse {
        /// The mode, from 1.
        mode: usize,
        /// Its spectral radius.
        radius: f64,
    },
    /// The database has fewer samples than unknowns.
    #[error(
        "{} are too few to identify {unknowns} response coefficients: record at least {needed}",
        shape(*samples, *stretches, *response_length)
    )]
    TooFewSamples {
        /// Samples found.
        samples: usize,
        /// Stretches they are in.
        stretches: usize,
        /// Samples at the start of each stretch that serve as past inputs only.
        response_length: usize,
        /// Coefficients to identify.
        unknowns: usize,
        /// Samples needed.
        needed: usize,
    },
    /// No input moves.
    #[error("the database excites nothing: every recorded input stays at its operating point")]
    NoExcitation,
    /// Inputs and outputs are not recorded at the same samples.
    #[error("the database has {} rows of inputs but {} of outputs: give one of each for every sample", rows[0], rows[1])]
    Rows {
        /// Rows of inputs and of outputs.
        rows: [usize; 2],
    },
    /// An input is infinite or no number.
    #[error("the database cannot be factorised: its inputs are not finite")]
    NotFinite,
}

/// The smallest `j` with `|C A^j| <= 1e-7 |C|` in every mode.
///
/// # Errors
/// Names the mode that is unstable or decays too slowly.
pub fn response_length(modes: &[Mode]) -> Result<usize, CommissioningError> {
    let mut longest = 1;
    for (index, mode) in modes.iter().enumerate() {
        let radius = spectral_radius(&mode.a);
        if radius >= 1.0 {
            return Err(CommissioningError::Unstable {
                mode: index + 1,
                radius,
            });
        }
        let target = TRUNCATION * mode.c.norm();
        let mut response = mode.c.clone();
        let mut length = 0;
        while response.norm() > target {
            response = &response * &mode.a;
            length += 1;
            if length > LONGEST_RESPONSE {
                return Err(CommissioningError::SlowResponse {
                    mode: index + 1,
                    radius,
                });
            }
        }
        longest = longest.max(length);
    }
    Ok(longest)
}

/// Samples a commissioning run needs after the first `j`: four per unknown and a hundred more.
pub fn commissioning_samples(inputs: usize, response_length: usize) -> usize {
    4 * inputs * response_length + 100
}

/// Runs the healthy plant model in one mode under a random binary input of the given amplitudes (m),
/// with measurement noise of the given standard deviations (p).
pub fn commission(
    mode: &Mode,
    amplitudes: &[f64],
    deviation: &[f64],
    samples: usize,
    seed: u64,
) -> Database {
    let (m, p) = (mode.b.ncols(), mode.c.nrows());
    let mut x = DVector::zeros(mode.a.nrows());
    let mut inputs = DMatrix::zeros(samples, m);
    let mut outputs = DMatrix::zeros(samples, p);
    let mut draws = vec![0.0; m + p];
    for k in 0..samples {
        noise::standard_normal(seed, k as u64, &mut draws);
        let (signs, errors) = draws.split_at(m);
        let u = DVector::from_fn(m, |i, _| amplitudes[i].copysign(signs[i]));
        let y = &mode.c * &x + DVector::from_fn(p, |i, _| deviation[i] * errors[i]);
        inputs.row_mut(k).tr_copy_from(&u);
        outputs.row_mut(k).tr_copy_from(&y);
        x = &mode.a * x + &mode.b * u;
    }
    Database {
        first: 0,
        inputs,
        outputs,
    }
}

/// A periodic disturbance present while a database was recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RecordedDisturbance {
    /// Period in samples.
    pub period: f64,
    /// Number of harmonics.
    pub count: usize,
}

impl RecordedDisturbance {
    /// Sine and cosine of each harmonic in turn, by `column`, at sample `k`.
    pub(crate) fn wave(self, k: usize, column: usize) -> f64 {
        let angle = core::f64::consts::TAU * (column / 2 + 1) as f64 * k as f64 / self.period;
        if column.is_multiple_of(2) {
            angle.sin()
        } else {
            angle.cos()
        }
    }
}

/// The predictor of a database by least squares: [`predictor_of_stretches`] with a single one.
///
/// # Errors
/// As [`predictor_of_stretches`].
pub fn predictor(
    database: &Database,
    response_length: usize,
    disturbance: Option<RecordedDisturbance>,
) -> Result<Predictor, CommissioningError> {
    let stretches = std::slice::from_ref(database);
    predictor_of_stretches(stretches, response_length, disturbance)
}

/// The predictor of one mode from every stretch of a log in which it was active, by least squares.
/// The first `response_length` samples of a stretch only serve as past inputs: what came before
/// them belongs to another mode.
///
/// A disturbance of known period is explained by sines and cosines of its own, which are then
/// dropped: their phases belong to the recording. They stand first in the factorisation, so the
/// trailing part of `R` belongs to what of the inputs they cannot explain.
///
/// A vanishing ridge keeps `R` regular when the database excites too little; such directions then
/// have an enormous leverage and are never trusted.
///
/// # Errors
/// The stretches have too few samples for `response_length`, or no input ever moves.
pub fn predictor_of_stretches(
    stretches: &[Database],
    response_length: usize,
    disturbance: Option<RecordedDisturbance>,
) -> Result<Predictor, CommissioningError> {
    let (m, p) = stretches.first().map_or((0, 0), |stretch| {
        (stretch.inputs.ncols(), stretch.outputs.ncols())
    });
    let waves = disturbance.map_or(0, |known| 2 * known.count);
    let inputs = m * response_length;
    let unknowns = waves + inputs;
    let windows = windows(stretches, response_length);
    let samples = windows.len();
    if samples <= unknowns {
        return Err(too_few(stretches, unknowns, response_length));
    }
    let regressors = DMatrix::from_fn(samples, unknowns, |row, column| {
        let (stretch, k) = windows[row];
        match column.checked_sub(waves) {
            None => disturbance.map_or(0.0, |known| known.wave(stretch.first + k, column)),
            Some(past) => stretch.inputs[(k + past / m, past % m)],
        }
    });
    let ridge = 1e-9 * regressors.columns(waves, inputs).norm() / (inputs as f64).sqrt();
    if ridge == 0.0 {
        return Err(CommissioningError::NoExcitation);
    }
    let mut stacked = regressors
        .clone()
        .resize_vertically(samples + unknowns, 0.0);
    stacked
        .view_mut((samples, 0), (unknowns, unknowns))
        .fill_diagonal(ridge);
    let targets = DMatrix::from_fn(samples, p, |row, output| {
        let (stretch, k) = windows[row];
        stretch.outputs[(k + response_length, output)]
    });
    let qr = stacked.qr();
    let mut rotated = targets.clone().resize_vertically(samples + unknowns, 0.0);
    qr.q_tr_mul(&mut rotated);
    let factor = qr.r();
    let solution = factor
        .solve_upper_triangular(&rotated.rows(0, unknowns).into_owned())
        .ok_or(CommissioningError::NotFinite)?;
    let error = targets - regressors * &solution;
    let freedom = (samples - unknowns) as f64;
    let deviation = error
        .column_iter()
        .map(|column| (column.norm_squared() / freedom).sqrt())
        .collect();
    Ok(Predictor {
        response: plain(&solution.rows(waves, inputs).transpose()),
        factor: plain(&factor.view((waves, waves), (inputs, inputs)).into_owned()),
        deviation,
        samples,
    })
}

/// Every stretch and sample at which a window of past inputs begins.
fn windows(stretches: &[Database], response_length: usize) -> Vec<(&Database, usize)> {
    let of = |stretch| {
        let count = Database::samples(stretch).saturating_sub(response_length);
        (0..count).map(move |k| (stretch, k))
    };
    stretches.iter().flat_map(of).collect()
}

fn too_few(stretches: &[Database], unknowns: usize, response_length: usize) -> CommissioningError {
    let total: usize = stretches.iter().map(Database::samples).sum();
    let needed = unknowns + 1 + response_length * stretches.len().max(1);
    CommissioningError::TooFewSamples {
        samples: total,
        stretches: stretches.len(),
        response_length,
        unknowns,
        needed,
    }
}

fn shape(samples: usize, stretches: usize, response_length: usize) -> String {
    match stretches {
        0 | 1 => format!("{samples} samples"),
        count => format!(
            "{samples} samples in {count} stretches, each of which spends its first {response_length} on the past,"
        ),
    }
}

/// How well each input was excited: the smallest singular value of `R` over the largest, and the
/// input (0-based) and lag (samples, from 1) that weigh most in the direction excited least.
/// Inputs are measured in `units` (m), so that a kilovolt and an ampere can be compared.
pub fn weakest_direction(predictor: &Predictor, units: &[f64]) -> (f64, usize, usize) {
    let inputs = units.len();
    let mut factor = dense(&predictor.factor);
    for (column, mut entries) in factor.column_iter_mut().enumerate() {
        entries /= units[column % inputs];
    }
    let svd = factor.svd(false, true);
    let values = &svd.singular_values;
    let ratio = values.min() / values.max().max(f64::MIN_POSITIVE);
    let heaviest = svd
        .v_t
        .map_or(0, |v_t| v_t.row(values.imin()).transpose().iamax());
    let lag = predictor.factor.nrows() / inputs - heaviest / inputs;
    (ratio, heaviest % inputs, lag)
}

/// The predictor from the model's own Markov parameters `[C A^(j-1) B ... C B]` (48), with the
/// leverage a database of `samples` under the given amplitudes (m) would have.
pub fn model_predictor(
    mode: &Mode,
    response_length: usize,
    amplitudes: &[f64],
    deviation: &[f64],
) -> Predictor {
    let (m, p) = (mode.b.ncols(), mode.c.nrows());
    let unknowns = m * response_length;
    let samples = commissioning_samples(m, response_length);
    let mut response = DMatrix::zeros(p, unknowns);
    let mut markov = mode.b.clone();
    for lag in 0..response_length {
        let first = (response_length - 1 - lag) * m;
        response
            .columns_mut(first, m)
            .copy_from(&(&mode.c * &markov));
        markov = &mode.a * markov;
    }
    let spread = (samples as f64).sqrt();
    let factor = DMatrix::from_diagonal(&DVector::from_fn(unknowns, |i, _| {
        spread * amplitudes[i % m]
    }));
    Predictor {
        response: plain(&response),
        factor: plain(&factor),
        deviation: deviation.to_vec(),
        samples,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn stable_mode(entries: &[f64]) -> Mode {
        let (n, m, p) = (3, 2, 2);
        let mut at = entries.iter().copied();
        let mut matrix = |r, c| DMatrix::from_fn(r, c, |_, _| at.next().unwrap_or(0.5));
        let a = matrix(n, n);
        let radius = spectral_radius(&a).max(0.1);
        Mode::new(a * (0.6 / radius), matrix(n, m), matrix(p, n)).named("random")
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn a_noiseless_database_reconstructs_the_markov_parameters(entries in prop::collection::vec(-1.0..1.0f64, 21)) {
            let mode = stable_mode(&entries);
            let length = response_length(std::slice::from_ref(&mode)).unwrap();
            let samples = length + commissioning_samples(2, length);
            let found = predictor(&commission(&mode, &[1.0, 2.0], &[0.0, 0.0], samples, 3), length, None).unwrap();
            let exact = model_predictor(&mode, length, &[1.0, 2.0], &[0.0, 0.0]);
            let scale = dense(&exact.response).norm().max(1e-3);
            prop_assert!((dense(&found.response) - dense(&exact.response)).norm() <= 1e-5 * scale);
        }
    }

    #[test]
    fn the_residual_deviation_is_that_of_the_noise() {
        let mode = stable_mode(&[0.3; 21]);
        let samples = 4000;
        let found = predictor(
            &commission(&mode, &[1.0, 1.0], &[0.05, 0.2], samples, 9),
            10,
            None,
        )
        .unwrap();
        for (got, want) in found.deviation.iter().zip([0.05, 0.2]) {
            assert!((got / want - 1.0).abs() < 0.1, "{got} for {want}");
        }
    }

    #[test]
    fn a_direction_never_excited_has_enormous_leverage() {
        let mode = stable_mode(&[0.4; 21]);
        let found = predictor(
            &commission(&mode, &[1.0, 0.0], &[0.0, 0.0], 200, 1),
            5,
            None,
        )
        .unwrap();
        let mut scratch = vec![0.0; 10];
        let mut phi = vec![0.0; 10];
        phi[0] = 1.0;
        assert!(ftc_control::estimator::leverage(&found.factor, &phi, &mut scratch) < 1.0);
        phi[1] = 1.0;
        assert!(ftc_control::estimator::leverage(&found.factor, &phi, &mut scratch) > 1e6);
    }

    /// A sine on the outputs is explained away, not taken for the plant's response.
    #[test]
    fn a_recorded_disturbance_does_not_spoil_the_response() {
        let mode = stable_mode(&[0.3; 21]);
        let mut database = commission(&mode, &[1.0, 2.0], &[0.0, 0.0], 600, 3);
        let period = 37.0;
        for (k, mut row) in database.outputs.row_iter_mut().enumerate() {
            row[0] += 0.7 * (core::f64::consts::TAU * k as f64 / period + 0.4).sin();
        }
        let length = response_length(std::slice::from_ref(&mode)).unwrap();
        let exact = dense(&model_predictor(&mode, length, &[1.0, 2.0], &[0.0, 0.0]).response);
        let known = RecordedDisturbance { period, count: 1 };
        let error = |disturbance| {
            (dense(&predictor(&database, length, disturbance).unwrap().response) - &exact).norm()
                / exact.norm()
        };
        assert!(error(Some(known)) < 1e-5, "{}", error(Some(known)));
        assert!(error(None) > 1e-2);
    }

    /// Two stretches of a log with another mode between them identify what one long log does.
    #[test]
    fn stretches_are_joined_without_mixing_their_pasts() {
        let mode = stable_mode(&[0.3; 21]);
        let length = response_length(std::slice::from_ref(&mode)).unwrap();
        let exact = dense(&model_predictor(&mode, length, &[1.0, 2.0], &[0.0, 0.0]).response);
        let period = 37.0;
        let stretches = [(0, 1), (777, 2)].map(|(first, seed)| {
            let mut stretch = commission(&mode, &[1.0, 2.0], &[0.0, 0.0], 3 * length, seed);
            for (k, mut row) in stretch.outputs.row_iter_mut().enumerate() {
                row[1] += 0.3 * (core::f64::consts::TAU * (first + k) as f64 / period).sin();
            }
            Database { first, ..stretch }
        });
        let known = RecordedDisturbance { period, count: 1 };
        assert!(predictor(&stretches[0], length, Some(known)).is_err());
        let found = predictor_of_stretches(&stretches, length, Some(known)).unwrap();
        assert_eq!(found.samples, 4 * length);
        let error = (dense(&found.response) - &exact).norm() / exact.norm();
        assert!(error < 1e-5, "{error}");
        let mut shifted = stretches;
        shifted[1].first += 10;
        let mixed = predictor_of_stretches(&shifted, length, Some(known)).unwrap();
        assert!((dense(&mixed.response) - &exact).norm() / exact.norm() > 1e-3);
    }

    #[test]
    fn the_weakest_direction_is_the_input_that_never_moved() {
        let mode = stable_mode(&[0.4; 21]);
        let found = predictor(
            &commission(&mode, &[1.0, 0.0], &[0.0, 0.0], 200, 1),
            5,
            None,
        )
        .unwrap();
        let (ratio, input, _) = weakest_direction(&found, &[1.0, 1.0]);
        assert!(ratio < 1e-6 && input == 1);
    }

    #[test]
    fn an_unstable_mode_is_refused_by_number() {
        let mut mode = stable_mode(&[0.3; 21]);
        mode.a *= 2.0;
        let message = response_length(&[stable_mode(&[0.3; 21]), mode])
            .unwrap_err()
            .to_string();
        assert!(message.starts_with("mode 2:"), "{message}");
    }
}
