//! How one tick's outputs follow a small change of its measurement and reference.
//!
//! Between its decisions a tick is affine: with `D` the diagonal of flagged sensors,
//!
//! ```text
//! dr = dy     df_hat = D dr     dy_c = dy - df_hat     dx_hat = H dy_c     du = K dx_hat + N dy_ref
//! ```
//!
//! and the printed additive control adds `-K C^+ df_hat`; a bumpless switch repeats the last command,
//! whatever the sample. Flags, lost
//! sensors and inputs at their limits do not move. Through the integrators a reference acts from
//! the next tick on: of this tick's outputs it moves the command alone, by the feedforward.

use super::{Compensate, Controller, ControllerState, Sample, readings};
use crate::compensation::is_measurement;
use crate::kernel;

/// A small change of what a tick is told.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::exhaustive_structs, reason = "the inputs of a tick")]
pub struct Change<'a> {
    /// `dy` (p).
    pub measurement: &'a [f64],
    /// `dy_ref` (r).
    pub reference: &'a [f64],
}

impl Controller {
    /// Runs a tick on `trial`, then turns its command, state estimate, residual and fault
    /// estimate into their changes for a small change of the sample.
    ///
    /// What else is in `trial` means nothing afterwards: give a copy.
    pub fn differentiate(
        &self,
        trial: &mut ControllerState,
        sample: &Sample<'_>,
        change: Change<'_>,
    ) {
        let dy = change.measurement;
        let [left, mode] = self.run(trial, sample);
        let (estimator, observer) = (&self.parameters.estimator, &self.parameters.observer);
        let screened = trial.repetition.screened();
        if let (Some(bank), Some(judged)) = (&self.bank, &mut trial.bank) {
            bank.differentiate(judged, dy);
            trial
                .estimator
                .adopt_change(estimator, judged, screened, dy);
        } else {
            trial.estimator.differentiate(estimator, mode, screened, dy);
        }
        self.differentiate_correction(trial, sample, dy);
        let corrected = &trial.corrected;
        trial
            .observer
            .differentiate(observer, left, mode, corrected);
        self.differentiate_command(trial, mode, sample.compensate, change.reference);
    }

    /// `dy_c`, where the measurement is one.
    fn differentiate_correction(
        &self,
        trial: &mut ControllerState,
        sample: &Sample<'_>,
        dy: &[f64],
    ) {
        let subtracted = self.takes_out_the_estimate(sample);
        let used = readings(&trial.repetition, sample);
        let changes = trial.estimator.fault.iter().zip(used).zip(dy);
        let readings = trial
            .corrected
            .iter_mut()
            .zip(trial.open_loop.contradicted());
        let expected = trial.estimator.prediction.iter();
        let stands_in = self.bank.is_some();
        for (((corrected, &overruled), ((&fault, &y), &dy)), &expected) in
            readings.zip(changes).zip(expected)
        {
            let change = if subtracted { dy - fault } else { dy };
            let seen = match (is_measurement(y), stands_in) {
                (true, _) if !(subtracted && overruled) => change,
                (false, true) => expected,
                _ => 0.0,
            };
            *corrected = kernel::bounded_change(*corrected, seen);
        }
    }

    /// `du`, zero where the command is at a limit.
    fn differentiate_command(
        &self,
        trial: &mut ControllerState,
        mode: usize,
        compensate: Compensate<'_>,
        reference: &[f64],
    ) {
        let Some(gains) = self.parameters.feedback.modes.get(mode) else {
            return;
        };
        let estimate = &trial.observer.estimate;
        let change = &mut trial.acting;
        change.fill(0.0);
        kernel::add_product(change, &gains.state_feedback, estimate);
        kernel::add_product(change, &gains.feedforward, reference);
        if self.parameters.feedback.transfer.is_some() && trial.since == 0 {
            change.fill(0.0);
        }
        if trial.additive.is_some() && compensate == Compensate::Estimate {
            trial.substitute.fill(0.0);
            kernel::add_scaled(&mut trial.substitute, -1.0, &trial.estimator.fault);
            kernel::add_product(change, &gains.output_feedback, &trial.substitute);
        }
        let changes = trial.excess.iter().zip(&trial.acting);
        for (command, (&excess, &change)) in trial.command.iter_mut().zip(changes) {
            let free = if excess == 0.0 { change } else { 0.0 };
            *command = kernel::bounded_change(*command, free);
        }
    }
}
