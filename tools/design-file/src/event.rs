//! Faults of sensors and actuators, as the user writes them.

use crate::complaint::{Complaint, at};
use crate::signal::{never, only, present};
use crate::values::Which;
use ftc_plant::scenario::{FaultEvent, FaultKind, FaultName};
use serde::Deserialize;

/// A fault of one sensor or actuator during `[from, until)` seconds.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Event {
    kind: FaultName,
    sensor: Option<Which>,
    input: Option<Which>,
    /// Seconds.
    from: f64,
    #[serde(default = "never")]
    until: f64,
    size: Option<f64>,
    slope: Option<f64>,
    loss: Option<f64>,
    period: Option<f64>,
}

/// The keys that describe a fault of this kind.
fn keys(kind: FaultName) -> &'static [&'static str] {
    match kind {
        FaultName::Bias => &["size"],
        FaultName::Drift => &["slope"],
        FaultName::GainLoss => &["loss"],
        FaultName::Intermittent => &["size", "period"],
        FaultName::Stuck | FaultName::Dropout => &[],
    }
}

impl Event {
    /// The event for a plant with sensors of these names.
    ///
    /// # Errors
    /// What is wrong with which of its keys.
    pub(crate) fn fault(&self, sensors: &[&str]) -> Result<FaultEvent, Complaint> {
        self.fault_of("sensor", sensors, "outputs")
    }

    /// The event for an actuator of a plant with inputs of these names.
    ///
    /// # Errors
    /// What is wrong with which of its keys.
    pub(crate) fn actuator_fault(&self, inputs: &[&str]) -> Result<FaultEvent, Complaint> {
        self.fault_of("input", inputs, "inputs")
    }

    /// The keys that not every kind has, and whether they are there.
    fn given(&self) -> [(&'static str, bool); 4] {
        // Taken apart whole: the compiler names a key that is missing below.
        let Self {
            kind: _,
            sensor: _,
            input: _,
            from: _,
            until: _,
            size,
            slope,
            loss,
            period,
        } = self;
        [
            ("size", size.is_some()),
            ("slope", slope.is_some()),
            ("loss", loss.is_some()),
            ("period", period.is_some()),
        ]
    }

    fn fault_of(&self, what: &str, names: &[&str], things: &str) -> Result<FaultEvent, Complaint> {
        only(self.kind.letters(), keys(self.kind), &self.given())?;
        let size = || present("size", self.size);
        let kind = match self.kind {
            FaultName::Bias => FaultKind::Bias { size: size()? },
            FaultName::Drift => FaultKind::Drift {
                slope: present("slope", self.slope)?,
            },
            FaultName::GainLoss => FaultKind::GainLoss {
                loss: present("loss", self.loss)?,
            },
            FaultName::Stuck => FaultKind::Stuck,
            FaultName::Intermittent => FaultKind::Intermittent {
                size: size()?,
                period: present("period", self.period)?,
            },
            FaultName::Dropout => FaultKind::Dropout,
        };
        Ok(FaultEvent {
            sensor: at(what, self.place(what)?.index(names, things))?,
            from: self.from,
            until: self.until,
            kind,
        })
    }

    /// Which sensor or which input's actuator fails.
    fn place(&self, what: &str) -> Result<&Which, Complaint> {
        let (own, other, others) = match what {
            "input" => (&self.input, "sensor", &self.sensor),
            _ => (&self.sensor, "input", &self.input),
        };
        match (own, others) {
            (_, Some(_)) => Err(Complaint::of(
                other,
                format!("does not say where this fault is: give {what} alone"),
            )),
            (Some(place), None) => Ok(place),
            (None, None) => Err(Complaint::of(
                what,
                "is missing: add its number or its name",
            )),
        }
    }
}
