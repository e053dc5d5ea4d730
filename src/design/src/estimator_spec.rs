//! The fault estimator that is asked for, and the ranges of its numbers.

use crate::commissioning::Database;
use crate::defaults::DEBOUNCE;
use crate::harmonics::KnownDisturbance;
use crate::hypotheses::HypothesesSpec;
use crate::spec::{EstimatorNumber, SpecError, size_within, sizes_within, within};
use ftc_control::estimator::hypotheses::MOST_MODES;
use ftc_control::parameters::EstimatorMethod;
use ftc_control::tuning::DatabaseTuning;
use ftc_plant::Dimensions;

/// The fault estimator that is asked for.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct EstimatorSpec {
    /// Method.
    pub method: EstimatorMethod,
    /// `j` in samples; chosen by [`crate::commissioning::response_length`] when absent.
    pub response_length: Option<usize>,
    /// Where the predictor comes from.
    pub database: DatabaseSource,
    /// How large a residual must be to be called a fault.
    pub threshold: Threshold,
    /// Consecutive samples that raise or release a fault.
    pub debounce: u32,
    /// Repetitions of the very same reading after which a sensor is taken for frozen; 0: never.
    pub stuck_after: u32,
    /// Whether the response goes on being learned from healthy samples.
    pub adapt: bool,
    /// The periodic disturbance to be learned on line.
    pub disturbance: Option<KnownDisturbance>,
    /// What is asked of the state-based method.
    pub hypotheses: HypothesesSpec,
}

impl Default for EstimatorSpec {
    fn default() -> Self {
        Self {
            method: EstimatorMethod::Observer,
            response_length: None,
            database: DatabaseSource::Commission,
            threshold: Threshold::Sigmas(DatabaseTuning::default().threshold_deviations),
            debounce: DEBOUNCE,
            stuck_after: 0,
            adapt: false,
            disturbance: None,
            hypotheses: HypothesesSpec::default(),
        }
    }
}

/// The longest debounce in samples, and the most repetitions of a reading.
pub const LONGEST_DEBOUNCE: u32 = 10_000;

impl EstimatorSpec {
    /// Whether every number lies in its range, for a plant of these sizes; the response length is judged with
    /// the database.
    ///
    /// # Errors
    /// [`SpecError::Estimator`], [`SpecError::EstimatorSize`] or [`SpecError::EstimatorCount`].
    pub fn check(&self, dims: Dimensions) -> Result<(), SpecError> {
        let longest = f64::from(LONGEST_DEBOUNCE);
        within(
            EstimatorNumber::Debounce,
            self.debounce.into(),
            1.0..=longest,
        )?;
        within(
            EstimatorNumber::StuckAfter,
            self.stuck_after.into(),
            0.0..=longest,
        )?;
        match &self.threshold {
            Threshold::Given(sizes) => {
                sizes_within(EstimatorNumber::Threshold, sizes, dims.outputs)?;
            }
            Threshold::Sigmas(sigmas) => {
                size_within(EstimatorNumber::Sigmas, *sigmas)?;
            }
        }
        self.hypotheses.check(dims)
    }

    /// Whether a mode that is to be found from the readings is one of few enough.
    ///
    /// # Errors
    /// [`SpecError::TooManyModes`].
    pub fn check_modes(&self, modes: usize) -> Result<(), SpecError> {
        match self.hypotheses.mode_length.is_some() && modes > MOST_MODES {
            true => Err(SpecError::TooManyModes(modes)),
            false => Ok(()),
        }
    }
}

/// Where the healthy database comes from.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum DatabaseSource {
    /// A commissioning run on the plant model.
    Commission,
    /// The model's own Markov parameters.
    Model,
    /// Logs of healthy operation: for each mode, the stretches in which it was active.
    Recorded(Vec<Vec<Database>>),
}

/// How thresholds are chosen.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Threshold {
    /// One per sensor (p), in output units.
    Given(Vec<f64>),
    /// So many standard deviations of the healthy residual, and never below a thousandth of the
    /// nominal value of the output.
    Sigmas(f64),
}

#[cfg(test)]
mod tests {
    use super::*;

    type Change = fn(&mut EstimatorSpec);

    /// One number of the usual request changed.
    fn refusal(change: Change) -> Result<(), String> {
        let dims = Dimensions {
            states: 3,
            inputs: 1,
            outputs: 2,
            disturbances: 0,
        };
        let mut spec = EstimatorSpec::default();
        change(&mut spec);
        spec.check(dims).map_err(|error| error.to_string())
    }

    #[test]
    fn a_mode_is_found_among_few_enough() {
        let mut spec = EstimatorSpec::default();
        assert_eq!(spec.check_modes(MOST_MODES + 1), Ok(()));
        spec.hypotheses.mode_length = Some(500.0);
        assert_eq!(spec.check_modes(MOST_MODES), Ok(()));
        let said = spec.check_modes(10).unwrap_err().to_string();
        assert!(said.starts_with("the mode is to be found among 10, but at most 9"));
    }

    #[test]
    fn a_number_out_of_its_range_is_named_with_the_range() {
        assert_eq!(refusal(|_| ()), Ok(()));
        let cases: [(Change, &str); 9] = [
            (
                |spec| spec.hypotheses.model_error = f64::NAN,
                "the model error is NaN: give a number from 0 to 1",
            ),
            (
                |spec| spec.hypotheses.fault_rate = 0.0,
                "the rate of faults is 0",
            ),
            (
                |spec| spec.hypotheses.fault_length = 1.0,
                "the mean length of a fault is 1",
            ),
            (
                |spec| spec.hypotheses.mode_length = Some(f64::INFINITY),
                "the mean length of a mode is inf",
            ),
            (
                |spec| spec.hypotheses.authority = Some(vec![1.0]),
                "the authority of the compensation has 1 entry: give 2",
            ),
            (
                |spec| spec.hypotheses.input_load = Some(vec![-1.0]),
                "the size of a load on an input is -1",
            ),
            (
                |spec| spec.threshold = Threshold::Given(vec![1.0, 0.0]),
                "the threshold is 0",
            ),
            (
                |spec| spec.threshold = Threshold::Sigmas(-6.0),
                "the threshold in standard deviations is -6",
            ),
            (
                |spec| spec.debounce = 0,
                "the debounce is 0: give a number from 1 to 10000",
            ),
        ];
        for (change, words) in cases {
            let said = refusal(change).expect_err(words);
            assert!(said.starts_with(words), "{said}");
        }
    }
}
