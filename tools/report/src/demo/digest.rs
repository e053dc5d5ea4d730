//! What a page needs of one run, gathered sample by sample: a run may be too long to be kept.

use super::events::{AlarmWatch, Alarms, Intervals, is_faulty};
use crate::decimate::{Point, Thinned};
use ftc_design::Design;
use ftc_simulate::closed_loop::{MeritSums, Merits, ModeWatch, Record, WrongModes};
use ftc_simulate::{Trajectory, Variant};

/// One run as the page shows it.
#[derive(Clone, Debug)]
pub struct Digest {
    /// How the controller was run.
    pub variant: Variant,
    sample_time: f64,
    samples: u64,
    merits: MeritSums,
    /// Per sensor, and of any.
    faulty: (Vec<Intervals>, Intervals),
    alarms: AlarmWatch,
    found_modes: ModeWatch,
    /// Modes that were active, in ascending order.
    modes: Vec<usize>,
    /// Ticks at which another mode (0-based) becomes active; the first entry is the start.
    switches: Vec<(u64, usize)>,
    /// The first reference of each tracked output, and whether it ever moves.
    reference: Vec<(f64, bool)>,
    curves: Curves,
}

/// Signals over time, one curve for each component, thinned where they are long.
#[derive(Clone, Debug)]
pub(super) struct Curves {
    /// Reference (r).
    pub reference: Vec<Thinned>,
    /// Disturbance (s).
    pub disturbance: Vec<Thinned>,
    /// True fault (p); none where the sensor gives no number.
    pub fault: Vec<Thinned>,
    /// Measured output (p).
    pub y: Vec<Thinned>,
    /// True output (p).
    pub y_true: Vec<Thinned>,
    /// Command (m).
    pub u: Vec<Thinned>,
    /// Fault estimate (p).
    pub f_hat: Vec<Thinned>,
    /// Residual (p).
    pub residual: Vec<Thinned>,
}

impl Digest {
    /// Nothing seen yet of a run of the design's scenario.
    pub fn new(design: &Design, variant: Variant) -> Self {
        let dims = design.plant.dimensions();
        let tracked = &design.controller.feedback.tracked;
        let curves = |count: usize| vec![Thinned::new(design.scenario.steps); count];
        Self {
            variant,
            sample_time: design.plant.sample_time,
            samples: 0,
            merits: MeritSums::new(tracked),
            faulty: (
                vec![Intervals::default(); dims.outputs],
                Intervals::default(),
            ),
            alarms: AlarmWatch::new(dims.outputs),
            found_modes: ModeWatch::default(),
            modes: Vec::new(),
            switches: Vec::new(),
            reference: Vec::new(),
            curves: Curves {
                reference: curves(tracked.len()),
                disturbance: curves(dims.disturbances),
                fault: curves(dims.outputs),
                y: curves(dims.outputs),
                y_true: curves(dims.outputs),
                u: curves(dims.inputs),
                f_hat: curves(dims.outputs),
                residual: curves(dims.outputs),
            },
        }
    }

    /// Of a run that was kept.
    pub fn of(design: &Design, run: &Trajectory) -> Self {
        let mut digest = Self::new(design, run.variant);
        for record in &run.records {
            digest.see(record, run.stalled.is_none_or(|end| record.tick <= end));
        }
        digest
    }

    /// Looks at a sample; what follows one that the plant could not be integrated through is not `integrated`.
    pub fn see(&mut self, record: &Record, integrated: bool) {
        let tick = record.tick as usize;
        self.samples += 1;
        if integrated {
            self.merits.add(record);
        }
        let mut any = false;
        for (sensor, intervals) in self.faulty.0.iter_mut().enumerate() {
            let faulty = is_faulty(record, sensor);
            intervals.see(tick, faulty);
            any |= faulty;
        }
        self.faulty.1.see(tick, any);
        self.alarms.see(record);
        self.found_modes.see(record);
        if self
            .switches
            .last()
            .is_none_or(|last| last.1 != record.mode)
        {
            self.switches.push((record.tick, record.mode));
            if let Err(place) = self.modes.binary_search(&record.mode) {
                self.modes.insert(place, record.mode);
            }
        }
        if self.reference.is_empty() {
            self.reference = record
                .reference
                .iter()
                .map(|&first| (first, false))
                .collect();
        }
        for ((first, moves), now) in self.reference.iter_mut().zip(&record.reference) {
            *moves |= now != first;
        }
        self.curves
            .see(record, record.tick as f64 * self.sample_time);
    }

    /// Samples seen.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Figures of merit of each tracked output.
    pub fn merits(&self) -> Vec<Merits> {
        self.merits.merits()
    }

    /// Half-open intervals of ticks during which a sensor is faulty.
    pub fn fault_intervals(&self, sensor: usize) -> &[[usize; 2]] {
        self.faulty.0[sensor].found()
    }

    /// Half-open intervals of ticks during which any sensor is faulty.
    pub fn any_fault_intervals(&self) -> &[[usize; 2]] {
        self.faulty.1.found()
    }

    /// How well faults were found.
    pub fn alarms(&self) -> Alarms {
        self.alarms.alarms()
    }

    /// How often another mode was found than the plant was in; none where the mode was told.
    pub fn wrong_modes(&self) -> Option<WrongModes> {
        self.found_modes.wrong_modes()
    }

    /// How many different modes were active.
    pub fn modes_visited(&self) -> usize {
        self.modes.len()
    }

    /// Ticks at which another mode (0-based) becomes active.
    pub fn switches(&self) -> &[(u64, usize)] {
        self.switches.get(1..).unwrap_or_default()
    }

    /// Whether the reference of a tracked output ever moves.
    pub fn varies(&self, row: usize) -> bool {
        self.reference.get(row).is_some_and(|(_, moves)| *moves)
    }

    /// Its curves.
    pub(super) fn curves(&self) -> &Curves {
        &self.curves
    }
}

impl Curves {
    fn see(&mut self, record: &Record, time: f64) {
        let families: [(&mut Vec<Thinned>, &[f64]); 7] = [
            (&mut self.reference, &record.reference),
            (&mut self.disturbance, &record.disturbance),
            (&mut self.y, &record.y),
            (&mut self.y_true, &record.y_true),
            (&mut self.u, &record.u),
            (&mut self.f_hat, &record.f_hat),
            (&mut self.residual, &record.residual),
        ];
        for (curves, values) in families {
            for (curve, &value) in curves.iter_mut().zip(values) {
                curve.push([time, value]);
            }
        }
        let faults = record.fault.iter().zip(&record.y);
        for (curve, (&fault, y)) in self.fault.iter_mut().zip(faults) {
            let shown = if y.is_finite() { fault } else { f64::NAN };
            curve.push([time, shown]);
        }
    }
}

/// The points of a curve.
pub(super) fn points(curves: &[Thinned], index: usize) -> Vec<Point> {
    curves.get(index).map_or_else(Vec::new, Thinned::points)
}
