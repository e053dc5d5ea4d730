//! Whether faults are seen: flags beside the faults that are there.

use crate::closed_loop::Seen;
use ftc_plant::scenario::{FaultEvent, FaultKind, first_tick};
use serde::{Deserialize, Serialize};

/// Samples after the end of a fault in which its sensor may still be flagged without a false alarm.
const DETECTION_WINDOW: u64 = 50;

/// One fault and whether it was seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FaultDetection {
    /// Name of its kind.
    pub kind: String,
    /// Sensor (0-based).
    pub sensor: usize,
    /// First sample.
    pub from: u64,
    /// Sample after the last.
    pub until: u64,
    /// Size in output units; the loss of a gain; zero for kinds without a size.
    pub size: f64,
    /// Samples until its sensor was flagged, if it was.
    pub delay: Option<u64>,
    /// Whether another fault of the same sensor, or a flag raised before it, leaves it open
    /// whether this one was seen.
    pub hidden: bool,
}

impl FaultDetection {
    /// Of an event that is not seen yet.
    fn new(event: &FaultEvent, sample_time: f64) -> Self {
        let size = match event.kind {
            FaultKind::Bias { size } | FaultKind::Intermittent { size, .. } => size,
            FaultKind::Drift { slope } => slope * (event.until - event.from),
            FaultKind::GainLoss { loss } => loss,
            FaultKind::Stuck | FaultKind::Dropout => 0.0,
        };
        Self {
            kind: event.kind.name().letters().into(),
            sensor: event.sensor,
            from: first_tick(event.from, sample_time),
            until: first_tick(event.until, sample_time),
            size,
            delay: None,
            hidden: false,
        }
    }

    fn is_present(&self, tick: u64) -> bool {
        (self.from..self.until).contains(&tick)
    }
}

/// Which sensor was flagged when, gathered sample by sample.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Detection {
    /// The faults, in the order in which they were given.
    pub faults: Vec<FaultDetection>,
    /// Per sensor (p): how often it was flagged while it was healthy.
    pub false_alarms: Vec<u64>,
    /// Per sensor (p): samples in which it was healthy.
    pub healthy_samples: Vec<u64>,
    flagged: Vec<bool>,
    flagged_first: Option<usize>,
}

impl Detection {
    /// Of a run with these faults, before its first sample.
    pub fn new(events: &[FaultEvent], sensors: usize, sample_time: f64) -> Self {
        let mut faults: Vec<FaultDetection> = events
            .iter()
            .map(|event| FaultDetection::new(event, sample_time))
            .collect();
        for at in 0..faults.len() {
            let (sensor, from) = (faults[at].sensor, faults[at].from);
            faults[at].hidden = faults.iter().enumerate().any(|(other, fault)| {
                other != at
                    && fault.sensor == sensor
                    && (fault.from..fault.until + DETECTION_WINDOW).contains(&from)
            });
        }
        Self {
            faults,
            flagged: vec![false; sensors],
            false_alarms: vec![0; sensors],
            healthy_samples: vec![0; sensors],
            flagged_first: None,
        }
    }

    /// Counts a sample; the samples come in their order.
    pub fn see(&mut self, seen: &Seen<'_>) {
        let tick = seen.plant.tick;
        for (sensor, &flagged) in seen.report.flagged.iter().enumerate() {
            let raised = flagged && !self.flagged[sensor];
            let mut own = self.faults.iter().filter(|fault| fault.sensor == sensor);
            let excused =
                own.any(|fault| (fault.from..fault.until + DETECTION_WINDOW).contains(&tick));
            if !excused {
                self.healthy_samples[sensor] += 1;
                self.false_alarms[sensor] += u64::from(raised);
            }
            let before = self.flagged[sensor];
            for fault in self
                .faults
                .iter_mut()
                .filter(|fault| fault.sensor == sensor)
            {
                fault.hidden |= tick == fault.from && before;
                if flagged && fault.delay.is_none() && fault.is_present(tick) {
                    fault.delay = Some(tick - fault.from);
                }
            }
            if let [fault] = &self.faults[..]
                && raised
                && fault.is_present(tick)
            {
                self.flagged_first.get_or_insert(sensor);
            }
            self.flagged[sensor] = flagged;
        }
    }

    /// Where there was one fault, and it is not hidden: its sensor, and the first sensor flagged while it lasted.
    pub fn isolation(&self) -> Option<(usize, Option<usize>)> {
        match &self.faults[..] {
            [fault] if !fault.hidden => Some((fault.sensor, self.flagged_first)),
            _ => None,
        }
    }
}
