//! How residual and fault estimate follow a change of the measurement.

use super::EstimatorState;
use super::hypotheses::BankState;
use crate::compensation::is_measurement;
use crate::kernel;
use crate::parameters::{Estimator, EstimatorMethod};

impl EstimatorState {
    /// Right after a tick with measurement `y` (p): residual and fault estimate become their
    /// changes for a small change `dy` (p) of that measurement.
    ///
    /// A flag is a decision: it does not move.
    pub(crate) fn differentiate(
        &mut self,
        estimator: &Estimator,
        mode: usize,
        y: &[f64],
        dy: &[f64],
    ) {
        let slope = self.residual_slope(estimator, mode);
        let residuals = self.residual.iter_mut().zip(&mut self.fault);
        let decided = self.flagged.iter().zip(&self.judged);
        let limits = decided.zip(&estimator.largest_fault);
        for (((residual, fault), ((&flagged, &judged), &largest)), (&y, &dy)) in
            residuals.zip(limits).zip(y.iter().zip(dy))
        {
            let follows = judged && flagged && residual.abs() < largest;
            *residual = if is_measurement(y) { slope * dy } else { 0.0 };
            *fault = if follows { *residual } else { 0.0 };
        }
    }

    /// The same for what was taken over from the state-based estimator, whose `expected` outputs
    /// (p) have become their changes.
    pub(crate) fn adopt_change(
        &mut self,
        estimator: &Estimator,
        bank: &BankState,
        y: &[f64],
        dy: &[f64],
    ) {
        let limits = estimator.authority();
        kernel::copy(&mut self.prediction, &bank.expected);
        let sensors = self
            .residual
            .iter_mut()
            .zip(&mut self.fault)
            .zip(&self.flagged);
        let changes = y.iter().zip(dy).zip(&bank.expected).zip(limits);
        for (((residual, fault), &flagged), (((&y, &dy), &expected), &largest)) in
            sensors.zip(changes)
        {
            let change = if flagged { dy - expected } else { dy };
            let follows = flagged && fault.abs() < largest;
            *residual = if is_measurement(y) { change } else { 0.0 };
            *fault = if is_measurement(y) && follows {
                change
            } else {
                0.0
            };
        }
    }

    /// The change of each residual for a unit change of its measurement.
    fn residual_slope(&self, estimator: &Estimator, mode: usize) -> f64 {
        match (estimator.method, &self.window) {
            (EstimatorMethod::Reference, _) if mode < estimator.predictors.len() => 1.0,
            (EstimatorMethod::Sliding, Some(window)) => window.newest_weight(),
            _ => 0.0,
        }
    }
}
