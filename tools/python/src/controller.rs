//! The on-line controller, one sample at a time.

use ftc_control::{Compensate, ControllerState};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::sync::Arc;

/// A controller and its state.
#[pyclass(module = "ftc_fmu._core")]
pub struct Controller {
    controller: Arc<ftc_control::Controller>,
    /// Before the first sample the state is that at rest in the mode it names.
    state: ControllerState,
    tick: u64,
    ftc_enabled: bool,
}

impl Controller {
    /// At rest in the first mode.
    ///
    /// # Errors
    /// What the controller says of its parameters.
    pub fn of(design: &ftc_design::Design) -> PyResult<Self> {
        let controller = ftc_control::Controller::new(design.parameters())
            .map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok(Self {
            state: controller.initial_state(0),
            controller: Arc::new(controller),
            tick: 0,
            ftc_enabled: true,
        })
    }

    fn check(&self, what: &str, values: &[f64], wanted: usize) -> PyResult<()> {
        match values.len() == wanted {
            true => Ok(()),
            false => Err(PyValueError::new_err(format!(
                "{what} has {} values: give {wanted}",
                values.len()
            ))),
        }
    }

    /// A mode counted from 0.
    fn mode(&self, number: i64) -> PyResult<usize> {
        let modes = self.controller.parameters().modes.len();
        let index = usize::try_from(number)
            .ok()
            .and_then(|number| number.checked_sub(1));
        index.filter(|&index| index < modes).ok_or_else(|| {
            PyValueError::new_err(format!("mode is {number}: give one of 1 to {modes}"))
        })
    }
}

#[pymethods]
impl Controller {
    /// One sample; returns the command.
    fn step(&mut self, y: Vec<f64>, y_ref: Vec<f64>, mode: i64) -> PyResult<Vec<f64>> {
        let mode = self.mode(mode)?;
        let parameters = self.controller.parameters();
        self.check("y", &y, parameters.estimator.thresholds.len())?;
        self.check("y_ref", &y_ref, parameters.feedback.tracked.len())?;
        if let Some(at) = y_ref.iter().position(|value| !value.is_finite()) {
            let what = format!("y_ref[{at}] is {}: give a finite number", y_ref[at]);
            return Err(PyValueError::new_err(what));
        }
        if self.tick == 0 {
            self.state = self.controller.initial_state(mode);
        }
        let compensate = match self.ftc_enabled {
            true => Compensate::Estimate,
            false => Compensate::Nothing,
        };
        let sample = self
            .controller
            .sample(self.tick, mode, &y, &y_ref)
            .and_then(|sample| sample.compensating(compensate))
            .map_err(|error| PyValueError::new_err(error.to_string()))?;
        self.controller.tick(&mut self.state, &sample);
        self.tick += 1;
        Ok(self.state.command.clone())
    }

    fn u(&self) -> Vec<f64> {
        self.state.command.clone()
    }

    fn x_hat(&self) -> Vec<f64> {
        self.state.observer.estimate.clone()
    }

    fn f_hat(&self) -> Vec<f64> {
        self.state.estimator.fault.clone()
    }

    fn residual(&self) -> Vec<f64> {
        self.state.estimator.residual.clone()
    }

    fn fault(&self) -> Vec<bool> {
        self.state.estimator.flagged.clone()
    }

    /// Counted from 1.
    fn mode_hat(&self) -> Option<usize> {
        self.controller.found_mode(&self.state).map(|mode| mode + 1)
    }

    fn mode_probability(&self) -> Vec<f64> {
        let found = self.mode_hat().and(self.state.bank.as_ref());
        found.map_or_else(Vec::new, |bank| bank.probability.clone())
    }

    fn ftc_enabled(&self) -> bool {
        self.ftc_enabled
    }

    fn set_ftc_enabled(&mut self, value: bool) {
        self.ftc_enabled = value;
    }

    /// Back to rest in a mode (from 1).
    fn reset(&mut self, mode: i64) -> PyResult<()> {
        self.state = self.controller.initial_state(self.mode(mode)?);
        self.tick = 0;
        Ok(())
    }

    /// Another in the same state.
    fn copy(&self) -> Self {
        Self {
            controller: self.controller.clone(),
            state: self.state.clone(),
            tick: self.tick,
            ftc_enabled: self.ftc_enabled,
        }
    }
}
