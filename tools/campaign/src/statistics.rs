//! What many runs say together: integer counts, and the worst runs.

use crate::histogram::Histogram;
use crate::run::Outcome;
use ftc_simulate::robustness::WORSE;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How many of the worst runs are kept.
pub const WORST: usize = 10;

/// The statistics of a set of runs; their memory does not grow with their number.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Statistics {
    /// Runs counted.
    pub runs: u64,
    /// True error with fault tolerance, in nominal values (root mean square).
    pub error: Histogram,
    /// The same without.
    pub error_without: Histogram,
    /// The same told the fault.
    pub error_told: Histogram,
    /// True error over that of the loop that is told the fault.
    pub over_told: Histogram,
    /// True error over that of the loop without fault tolerance.
    pub over_none: Histogram,
    /// Runs with faults in which fault tolerance did worse than none, by more than one percent.
    pub worse_than_none: u64,
    /// Runs with faults.
    pub faulty_runs: u64,
    /// By kind of fault.
    pub kinds: BTreeMap<String, KindStatistics>,
    /// Of runs with one fault: `[faulty sensor][sensor flagged first, or p where none was]`.
    pub isolation: Vec<Vec<u64>>,
    /// How often healthy sensors were flagged, per sensor (p).
    pub false_alarms: Vec<u64>,
    /// Samples in which a sensor was healthy, per sensor (p).
    pub healthy_samples: Vec<u64>,
    /// Runs in which a healthy sensor was flagged.
    pub runs_with_false_alarm: u64,
    /// Of the runs without a fault.
    pub healthy: Healthy,
    /// Runs whose true plant is unstable in a mode in which the model is not.
    pub unstable_plants: u64,
    /// The most unstable of these plants.
    pub most_unstable: Option<Unstable>,
    /// The runs with the largest true error over that of the loop that is told the fault.
    pub worst: Vec<Worst>,
}

/// Of one kind of fault.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct KindStatistics {
    /// Faults that could be told from any other.
    pub count: u64,
    /// Of these, those whose sensor was flagged while they lasted.
    pub detected: u64,
    /// Samples until then, and one.
    pub delay: Histogram,
}

/// Of the runs without a fault: what fault tolerance costs a loop that needs none.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Healthy {
    /// Runs counted.
    pub runs: u64,
    /// True error with fault tolerance, in nominal values (root mean square).
    pub error: Histogram,
    /// The same over that of the loop without fault tolerance.
    pub over_none: Histogram,
    /// Runs in which fault tolerance did worse than none, by more than one percent.
    pub worse_than_none: u64,
    /// Runs in which a sensor was flagged.
    pub flagged: u64,
}

impl Healthy {
    fn add(&mut self, error: f64, over_none: f64, flagged: bool) {
        self.runs += 1;
        self.error.add(error);
        self.over_none.add(over_none);
        self.worse_than_none += u64::from(over_none > 1.0 + WORSE);
        self.flagged += u64::from(flagged);
    }

    fn merge(&mut self, other: &Self) {
        self.runs += other.runs;
        self.error.merge(&other.error);
        self.over_none.merge(&other.over_none);
        self.worse_than_none += other.worse_than_none;
        self.flagged += other.flagged;
    }
}

/// A run whose true plant is unstable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Unstable {
    /// Its number: replay it by that.
    pub run: u64,
    /// The mode, from 0.
    pub mode: usize,
    /// Spectral radius of the true plant's `A` in this mode.
    pub radius: f64,
}

/// The larger radius; of two alike the earlier run.
fn more_unstable(one: Unstable, other: Unstable) -> Unstable {
    let by_radius = other.radius.total_cmp(&one.radius);
    match by_radius.then(one.run.cmp(&other.run)).is_le() {
        true => one,
        false => other,
    }
}

/// One of the worst runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Worst {
    /// Its number: replay it by that.
    pub run: u64,
    /// True error over that of the loop that is told the fault.
    pub over_told: f64,
    /// True error over that of the loop without fault tolerance.
    pub over_none: f64,
    /// What happened, in words.
    pub faults: String,
}

impl Statistics {
    /// Nothing counted yet, of a plant with so many sensors.
    pub fn new(sensors: usize) -> Self {
        Self {
            isolation: vec![vec![0; sensors + 1]; sensors],
            false_alarms: vec![0; sensors],
            healthy_samples: vec![0; sensors],
            ..Self::default()
        }
    }

    /// Counts one run.
    pub fn add(&mut self, outcome: &Outcome) {
        let [with, without, told] = outcome.error;
        let (over_told, over_none) = (ratio(with, told), ratio(with, without));
        self.runs += 1;
        self.error.add(with);
        self.error_without.add(without);
        self.error_told.add(told);
        self.over_told.add(over_told);
        self.over_none.add(over_none);
        let flagged = outcome.false_alarms.iter().any(|&n| n > 0);
        if outcome.faults.is_empty() {
            self.healthy.add(with, over_none, flagged);
        } else {
            self.faulty_runs += 1;
            self.worse_than_none += u64::from(over_none > 1.0 + WORSE);
        }
        if let Some((mode, radius)) = outcome.unstable {
            let run = outcome.run;
            self.unstable_plants += 1;
            self.rank_unstable(Some(Unstable { run, mode, radius }));
        }
        for fault in outcome.faults.iter().filter(|fault| !fault.hidden) {
            let kind = self.kinds.entry(fault.kind.clone()).or_default();
            kind.count += 1;
            if let Some(delay) = fault.delay {
                kind.detected += 1;
                kind.delay.add(delay as f64 + 1.0);
            }
        }
        if let Some((sensor, flagged)) = outcome.isolation {
            let row = &mut self.isolation[sensor];
            let none = row.len() - 1;
            row[flagged.unwrap_or(none)] += 1;
        }
        add_all(&mut self.false_alarms, &outcome.false_alarms);
        add_all(&mut self.healthy_samples, &outcome.healthy_samples);
        self.runs_with_false_alarm += u64::from(flagged);
        self.rank([Worst {
            run: outcome.run,
            over_told,
            over_none,
            faults: describe(outcome),
        }]);
    }

    /// Adds the counts of other runs.
    pub fn merge(&mut self, other: &Self) {
        self.runs += other.runs;
        self.error.merge(&other.error);
        self.error_without.merge(&other.error_without);
        self.error_told.merge(&other.error_told);
        self.over_told.merge(&other.over_told);
        self.over_none.merge(&other.over_none);
        self.worse_than_none += other.worse_than_none;
        self.faulty_runs += other.faulty_runs;
        for (name, other) in &other.kinds {
            let kind = self.kinds.entry(name.clone()).or_default();
            kind.count += other.count;
            kind.detected += other.detected;
            kind.delay.merge(&other.delay);
        }
        for (row, other) in self.isolation.iter_mut().zip(&other.isolation) {
            add_all(row, other);
        }
        add_all(&mut self.false_alarms, &other.false_alarms);
        add_all(&mut self.healthy_samples, &other.healthy_samples);
        self.runs_with_false_alarm += other.runs_with_false_alarm;
        self.healthy.merge(&other.healthy);
        self.unstable_plants += other.unstable_plants;
        self.rank_unstable(other.most_unstable);
        self.rank(other.worst.iter().cloned());
    }

    fn rank_unstable(&mut self, more: Option<Unstable>) {
        let known = self.most_unstable.into_iter().chain(more);
        self.most_unstable = known.reduce(more_unstable);
    }

    /// Keeps the worst of those known and these; of two that are equally bad the earlier run.
    fn rank(&mut self, more: impl IntoIterator<Item = Worst>) {
        self.worst.extend(more);
        self.worst.sort_by(|one, other| {
            let by_error = other.over_told.total_cmp(&one.over_told);
            by_error.then(one.run.cmp(&other.run))
        });
        self.worst.truncate(WORST);
    }
}

/// One error over another; one where both vanish.
fn ratio(error: f64, other: f64) -> f64 {
    const NEGLIGIBLE: f64 = 1e-12;
    (error + NEGLIGIBLE) / (other + NEGLIGIBLE)
}

fn add_all(counts: &mut [u64], more: &[u64]) {
    for (count, more) in counts.iter_mut().zip(more) {
        *count += more;
    }
}

fn describe(outcome: &Outcome) -> String {
    let faults: Vec<String> = outcome
        .faults
        .iter()
        .map(|fault| {
            let size = match fault.size == 0.0 {
                true => String::new(),
                false => format!(" {:.3}", fault.size),
            };
            format!(
                "{}{size} of sensor {} in samples {} to {}",
                fault.kind,
                fault.sensor + 1,
                fault.from,
                fault.until
            )
        })
        .collect();
    match faults.is_empty() {
        true => "no fault".into(),
        false => faults.join("; "),
    }
}
