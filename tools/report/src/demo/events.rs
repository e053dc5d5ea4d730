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
    let mut found: Vec<[usize; 2]> = Vec::new();
    for (index, record) in run.records.iter().enumerate() {
        match found.last_mut() {
            _ if !holds(record) => {}
            Some([_, until]) if *until == index => *until += 1,
            _ => found.push([index, index + 1]),
        }
    }
    found
}

/// How many different modes were active.
pub fn modes_visited(run: &Trajectory) -> usize {
    let mut modes: Vec<usize> = run.records.iter().map(|record| record.mode).collect();
    modes.sort_unstable();
    modes.dedup();
    modes.len()
}

/// How well faults were found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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

impl Alarms {
    /// Counts over all sensors of a run.
    pub fn of(run: &Trajectory) -> Self {
        let sensors = run.records.first().map_or(0, |record| record.y.len());
        let mut alarms = Self::default();
        for sensor in 0..sensors {
            for [from, until] in fault_intervals(run, sensor) {
                alarms.onsets += 1;
                let flag = (from..until).find(|k| run.records[*k].flagged[sensor]);
                if let Some(at) = flag {
                    alarms.found += 1;
                    alarms.longest_delay = alarms.longest_delay.max(Some((at - from) as u64));
                }
            }
            alarms.false_alarms += false_alarms(run, sensor);
        }
        alarms
    }
}

/// Flags that rise while the sensor is healthy.
fn false_alarms(run: &Trajectory, sensor: usize) -> usize {
    let mut before = false;
    let mut found = 0;
    for record in &run.records {
        let flagged = record.flagged[sensor];
        found += usize::from(flagged && !before && !is_faulty(record, sensor));
        before = flagged;
    }
    found
}
