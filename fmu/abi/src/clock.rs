//! Simulation time, counted in ticks.
//!
//! Tick `k` lasts from `k Te` to `(k + 1) Te`, counted from the start time. It *begins* when a
//! communication step goes beyond `k Te` and *ends* when a step reaches `(k + 1) Te`; with `t`
//! the time since the start in units of `Te`,
//!
//! ```text
//! begun(t) = ceil(t - eps)      ticks have begun at communication time t
//! ended(t) = floor(t + eps)     ticks have ended
//! ```
//!
//! and within one step the events come in the order begin(0), end(0), begin(1), ... A slave
//! that samples when a tick begins and publishes when it begins (a controller) or ends (a
//! plant) therefore gives the same values at common times whatever the steps: `Te/7`, `Te`,
//! `3.5 Te`, irregular.
//!
//! **No drift.** Time is kept as a whole number of ticks and a remainder of at most half a
//! tick, and follows the importer's own communication points. Whenever the remainder is no more
//! than what rounding explains, a millionth of the step just made and a few units in the last
//! place of the importer's time, the importer meant the tick itself and the remainder is
//! dropped. So a sum of ten million times 0.1 counts ten million ticks, and a start time of
//! 1e9 costs no accuracy.

use serde::{Deserialize, Serialize};

/// A deviation, relative to a step, that is taken for rounding.
const ROUNDING: f64 = 1e-6;

/// The same for the importer's time, in units in the last place.
const LAST_PLACES: f64 = 4.0;

/// No step may run more ticks than this; it would be a mistake of units.
const MOST_TICKS: f64 = 1e9;

/// Where an instance stands in time. Plain data: it is part of a saved state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Clock {
    sample_time: f64,
    stop: Option<f64>,
    /// The last communication point, as the importer counts.
    now: f64,
    /// Steps made so far.
    steps: u64,
    /// Where the importer wanted to go by a step that was refused; it may go on from there.
    wanted: f64,
    /// Whole ticks nearest to now, and what is left in units of `Te`, within half a tick.
    ticks: u64,
    remainder: f64,
    begun: u64,
    ended: u64,
}

/// What happens in a step, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Tick `k` begins: inputs are sampled.
    Begin(u64),
    /// Tick `k` ends: time has reached `(k + 1) Te`.
    End(u64),
}

impl Clock {
    /// A clock at time 0 with ticks of `sample_time` seconds.
    pub fn new(sample_time: f64) -> Self {
        Self {
            sample_time,
            stop: None,
            now: 0.0,
            steps: 0,
            wanted: 0.0,
            ticks: 0,
            remainder: 0.0,
            begun: 0,
            ended: 0,
        }
    }

    /// Sets the start and stop time.
    pub fn set_up(&mut self, start: f64, stop: Option<f64>) -> Result<(), String> {
        if !start.is_finite() {
            return Err(format!("startTime is {start}: give a finite number"));
        }
        if let Some(stop) = stop
            && (stop.is_nan() || stop < start)
        {
            return Err(format!("stopTime {stop} lies before startTime {start}"));
        }
        *self = Self {
            stop,
            now: start,
            wanted: start,
            ..Self::new(self.sample_time)
        };
        Ok(())
    }

    /// The last communication point.
    pub fn now(&self) -> f64 {
        self.now
    }

    /// The clock after a step of length `step` from communication point `from`.
    ///
    /// The events of the step are then had from [`Clock::next_event`]. Errors: a step that is
    /// not positive and finite (the standard asks for more than 0), a point that does not
    /// continue the last, a step beyond the stop time, a step of absurdly many ticks.
    pub fn advanced(&self, from: f64, step: f64) -> Result<Self, String> {
        if !(step.is_finite() && step > 0.0) {
            return Err(format!(
                "communicationStepSize is {step}: give a positive number of seconds"
            ));
        }
        let resolution = LAST_PLACES * ulp(from) / self.sample_time;
        let gap = |last: f64| ((from - last) / self.sample_time).abs();
        let near = 10.0 * ROUNDING + resolution;
        if !(gap(self.now) <= near || gap(self.wanted) <= near) {
            return Err(format!(
                "currentCommunicationPoint is {from}, but the last step ended at {}",
                self.now
            ));
        }
        let to = from + step;
        // A sum of steps may overshoot by its rounding errors, never by a good part of a tick.
        if let Some(stop) = self.stop
            && to - stop > 1e-3 * self.sample_time + self.steps as f64 * ulp(to)
        {
            return Err(format!("the step ends at {to}, after stopTime {stop}"));
        }
        let length = (((from - self.now) + step) / self.sample_time).max(0.0);
        if length > MOST_TICKS {
            return Err(format!(
                "a step of {step} s runs {length:.3e} ticks of {} s, more than {MOST_TICKS:.0e}",
                self.sample_time
            ));
        }
        let mut next = self.clone();
        (next.now, next.wanted, next.steps) = (to, to, self.steps + 1);
        next.move_on(length, resolution);
        Ok(next)
    }

    /// Notes that a step was refused: the importer may repeat it or go on after it.
    pub fn refuse(&mut self, from: f64, step: f64) {
        self.wanted = from + step;
    }

    /// Whether a tick is to begin by now, the inputs of which are about to be sampled.
    pub fn begins_tick(&self) -> bool {
        self.begun < self.ticks + u64::from(self.remainder > self.tolerance())
    }

    /// The next event up to now; `None` when all have happened.
    pub fn next_event(&mut self) -> Option<Event> {
        let late = u64::from(self.remainder < -self.tolerance());
        let ended = self.ticks.saturating_sub(late);
        if self.begun == self.ended && self.begins_tick() {
            self.begun += 1;
            Some(Event::Begin(self.begun - 1))
        } else if self.ended < self.begun.min(ended) {
            self.ended += 1;
            Some(Event::End(self.ended - 1))
        } else {
            None
        }
    }

    /// The event that comes next, however far it is.
    pub fn upcoming(&self) -> Event {
        if self.begun == self.ended {
            Event::Begin(self.begun)
        } else {
            Event::End(self.ended)
        }
    }

    /// Whether all that has come by now has happened, as between two steps.
    pub fn is_at_rest(&self) -> bool {
        self.clone().next_event().is_none()
    }

    /// Whether this is a clock with ticks of `sample_time` seconds; one that came as bytes may
    /// be anything.
    pub fn is_sound(&self, sample_time: f64) -> bool {
        const MOST: u64 = 1 << 60;
        let known = [self.now, self.wanted].iter().all(|time| time.is_finite());
        let counts = [self.ticks, self.begun, self.ended, self.steps];
        self.sample_time == sample_time
            && known
            && self.remainder.abs() <= 0.5
            && counts.iter().all(|&count| count < MOST)
            && self.ended <= self.begun
            && self.begun <= self.ended + 1
            && self.begun <= self.ticks + 1
    }

    /// Adds `length` ticks, and drops what rounding explains.
    fn move_on(&mut self, length: f64, resolution: f64) {
        let sum = self.remainder + length;
        let whole = (sum + 0.5).floor().max(0.0);
        self.ticks += whole as u64;
        self.remainder = sum - whole;
        // A step no longer than its own tolerance must not be undone, else time stood still.
        let explained = (ROUNDING * length + resolution).min(length / 4.0);
        if self.remainder.abs() <= explained {
            self.remainder = 0.0;
        }
    }

    /// A remainder that counts as none, in units of `Te`.
    fn tolerance(&self) -> f64 {
        (ROUNDING + LAST_PLACES * ulp(self.now) / self.sample_time).min(0.01)
    }
}

/// The distance from `|value|` to the next double.
fn ulp(value: f64) -> f64 {
    let magnitude = value.abs();
    magnitude.next_up() - magnitude
}
