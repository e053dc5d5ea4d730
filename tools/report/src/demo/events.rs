//! What the records say about faults and alarms.

use ftc_simulate::Trajectory;
use ftc_simulate::closed_loop::Record;

/// Whether a sensor is faulty in a record: something is added to it, or it gives no number.
pub fn is_faulty(record: &Record, sensor: usize) -> bool {
    record.fault[sensor] != 0.0 || !record.y[sensor].is_finite()
}

/// Half-open intervals of record indices during which the sensor is faulty.
pub fn fault_intervals(run: &Trajectory, sensor: usize) -> Vec<[usize; 2]> {
    intervals(run, |record| is_faulty(record, sensor))
}

/// Half-open intervals of record indices during which any sensor is faulty.
pub fn any_fault_intervals(run: &Trajectory) -> Vec<[usize; 2]> {
    intervals(run, |record| {
        (0..record.y.len()).any(|sensor| is_faulty(record, sensor))
    })
}

fn intervals(run: &Trajectory, holds: impl Fn(&Record) -> bool) -> Vec<[usize; 2]> {
    let mut found = Intervals::default();
    for (index, record) in run.records.iter().enumerate() {
        found.see(index, holds(record));
    }
    found.0
}

/// Half-open intervals in which something holds, gathered sample by sample.
#[derive(Clone, Debug, Default)]
pub(super) struct Intervals(Vec<[usize; 2]>);

impl Intervals {
    pub fn see(&mut self, index: usize, holds: bool) {
        match self.0.last_mut() {
            _ if !holds => {}
            Some([_, until]) if *until == index => *until += 1,
            _ => self.0.push([index, index + 1]),
        }
    }

    pub fn found(&self) -> &[[usize; 2]] {
        &self.0
    }
}

/// How well faults were found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Alarms {
    /// Faults that set in, over all sensors.
    pub onsets: usize,
    /// How many of them were flagged before they went away.
    pub found: usize,
    /// The longest time from onset to flag among those found, in samples.
    pub longest_delay: Option<u64>,
    /// Flags raised on a sensor that was healthy.
    pub false_alarms: usize,
}

/// [`Alarms`], gathered sample by sample.
#[derive(Clone, Debug)]
pub(super) struct AlarmWatch {
    alarms: Alarms,
    sensors: Vec<SensorWatch>,
}

#[derive(Clone, Debug, Default)]
struct SensorWatch {
    /// When the present fault set in, and whether it has been flagged.
    fault: Option<(u64, bool)>,
    flagged: bool,
}

impl AlarmWatch {
    pub fn new(sensors: usize) -> Self {
        Self {
            alarms: Alarms::default(),
            sensors: vec![SensorWatch::default(); sensors],
        }
    }

    pub fn see(&mut self, record: &Record) {
        let alarms = &mut self.alarms;
        for (sensor, watch) in self.sensors.iter_mut().enumerate() {
            let (faulty, flagged) = (is_faulty(record, sensor), record.flagged[sensor]);
            alarms.false_alarms += usize::from(flagged && !watch.flagged && !faulty);
            alarms.onsets += usize::from(faulty && watch.fault.is_none());
            watch.fault = faulty.then(|| {
                let (from, found) = watch.fault.unwrap_or((record.tick, false));
                if flagged && !found {
                    alarms.found += 1;
                    alarms.longest_delay = alarms.longest_delay.max(Some(record.tick - from));
                }
                (from, found || flagged)
            });
            watch.flagged = flagged;
        }
    }

    pub fn alarms(&self) -> Alarms {
        self.alarms
    }
}
