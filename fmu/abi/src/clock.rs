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
//! **Rounding.** Importers round: 0.0166667 s for 1/60 s, 0.333 for a third. Time is kept
//! as a whole number of ticks and a remainder of at most half a tick. Whenever the remainder is
//! no more than [`ROUNDING_OF_TIME`] of a tick (of the step, if that is longer), or the time since the start
//! agrees and is that near to the tick, the tick itself is taken for meant and the remainder is
//! dropped. So a step within a thousandth of `Te`, or of a whole multiple or fraction of it, is
//! taken for it, and ten million of them are as many ticks: nothing adds up. A start time of 1e9
//! costs no accuracy. Time follows the importer's own communication points.
//!
//! **What is late.** Inputs come at communication points only. A tick that begins within a step
//! runs on inputs from before it began: [`Clock::begins_within`].

use serde::{Deserialize, Serialize};

/// A deviation, in units of `Te`, that is taken for rounding.
pub const ROUNDING_OF_TIME: f64 = 1e-3;

/// The most that is taken for rounding in a step of many ticks.
const MOST_ROUNDING: f64 = 0.02;

/// How far a communication point may lie from the end of the last step, in units of `Te`.
const NEAR: f64 = 1e-2;

/// What a double may be off, in units in its last place.
const LAST_PLACES: f64 = 4.0;

/// No step runs more ticks than this: it could not be interrupted.
pub const MOST_TICKS: u64 = 100_000;

/// Where an instance stands in time. Plain data: it is part of a saved state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Clock {
    sample_time: f64,
    start: f64,
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

/// Times that make no sense to a slave. All are in seconds.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TimeError {
    /// The start time is infinite or no number.
    #[error("startTime is {0}: give a finite number")]
    Start(f64),
    /// The stop time lies before the start time.
    #[error("stopTime {stop} lies before startTime {start}")]
    Stop {
        /// The stop time.
        stop: f64,
        /// The start time.
        start: f64,
    },
    /// The length of a step is not positive and finite.
    #[error("communicationStepSize is {0}: give a positive number of seconds")]
    Step(f64),
    /// A step does not begin where the last one ended.
    #[error(
        "currentCommunicationPoint is {from}, but the last step ended at {last}: begin the step there"
    )]
    Point {
        /// Where it begins.
        from: f64,
        /// Where the last one ended.
        last: f64,
    },
    /// A step leads beyond the stop time.
    #[error(
        "the step ends at {to}, after stopTime {stop}: end it there, or set up the experiment without a stop time"
    )]
    BeyondStop {
        /// Where it ends.
        to: f64,
        /// The stop time.
        stop: f64,
    },
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
            start: 0.0,
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
    ///
    /// # Errors
    /// A start time that is not finite, a stop time before it.
    pub fn set_up(&mut self, start: f64, stop: Option<f64>) -> Result<(), TimeError> {
        if !start.is_finite() {
            return Err(TimeError::Start(start));
        }
        if let Some(stop) = stop
            && (stop.is_nan() || stop < start)
        {
            return Err(TimeError::Stop { stop, start });
        }
        *self = Self {
            start,
            stop,
            now: start,
            wanted: start,
            ..Self::new(self.sample_time)
        };
        Ok(())
    }

    /// The last communication point.
    #[inline]
    pub fn now(&self) -> f64 {
        self.now
    }

    /// Makes a step of length `step` from communication point `from`; a refusal changes nothing.
    ///
    /// The events of the step are then had from [`Clock::next_event`]. A step of more than
    /// [`MOST_TICKS`] ticks ends after as many.
    ///
    /// # Errors
    /// A step that is not positive and finite (the standard asks for more than 0), a point that
    /// does not continue the last, a step beyond the stop time.
    #[inline]
    pub fn advance(&mut self, from: f64, step: f64) -> Result<(), TimeError> {
        if self.is_one_tick(from, step) {
            (self.now, self.wanted) = (from + step, from + step);
            (self.steps, self.ticks) = (self.steps + 1, self.ticks + 1);
            return Ok(());
        }
        self.advance_anyhow(from, step)
    }

    /// The same for a step that is not just one tick.
    #[inline(never)]
    fn advance_anyhow(&mut self, from: f64, step: f64) -> Result<(), TimeError> {
        if !(step.is_finite() && step > 0.0) {
            return Err(TimeError::Step(step));
        }
        let resolution = LAST_PLACES * ulp(from) / self.sample_time;
        let gap = |last: f64| ((from - last) / self.sample_time).abs();
        let near = NEAR + resolution;
        if !(gap(self.now) <= near || gap(self.wanted) <= near) {
            let last = self.now;
            return Err(TimeError::Point { from, last });
        }
        let to = from + step;
        // A sum of steps may overshoot by its rounding errors, never by a good part of a tick.
        if let Some(stop) = self.stop
            && to - stop > 1e-3 * self.sample_time + self.steps as f64 * ulp(to)
        {
            return Err(TimeError::BeyondStop { to, stop });
        }
        let most = MOST_TICKS as f64;
        let length = (((from - self.now) + step) / self.sample_time).max(0.0);
        let (to, length) = if length > most {
            (self.now + most * self.sample_time, most)
        } else {
            (to, length)
        };
        (self.now, self.wanted, self.steps) = (to, to, self.steps + 1);
        self.move_on(length, resolution);
        Ok(())
    }

    /// Whether a step goes from the beginning of a tick to its end, but for a rounding error that
    /// [`Clock::move_on`] would drop: the usual case, which needs no division.
    #[inline]
    fn is_one_tick(&self, from: f64, step: f64) -> bool {
        let near = 1e-6 * self.sample_time;
        self.remainder == 0.0
            && (from - self.now).abs() <= near
            && (step - self.sample_time).abs() <= near
            && self.stop.is_none_or(|stop| from + step <= stop)
    }

    /// The sample time in seconds.
    #[inline]
    pub fn sample_time(&self) -> f64 {
        self.sample_time
    }

    /// Whether tick `k` begins after this communication point by more than is taken for rounding.
    #[inline]
    pub fn begins_within(&self, k: u64) -> bool {
        self.until(k) > ROUNDING_OF_TIME
    }

    /// From this communication point to the beginning of tick `k`, in units of `Te`.
    #[inline]
    pub fn until(&self, k: u64) -> f64 {
        k.wrapping_sub(self.ticks).cast_signed() as f64 - self.remainder
    }

    /// Notes that a step was refused: the importer may repeat it or go on after it.
    pub fn refuse(&mut self, from: f64, step: f64) {
        self.wanted = from + step;
    }

    /// Whether a tick is to begin by now, the inputs of which are about to be sampled.
    #[inline]
    pub fn begins_tick(&self) -> bool {
        self.begun
            < self.ticks + u64::from(self.remainder > 0.0 && self.remainder > self.tolerance())
    }

    /// Whether a tick is to end by now.
    #[inline]
    pub fn ends_tick(&self) -> bool {
        self.ended < self.complete()
    }

    /// The ticks that are complete by now.
    #[inline]
    fn complete(&self) -> u64 {
        let late = u64::from(self.remainder < 0.0 && self.remainder < -self.tolerance());
        self.ticks.saturating_sub(late)
    }

    /// The next event up to now; `None` when all have happened.
    #[inline]
    pub fn next_event(&mut self) -> Option<Event> {
        if self.begun == self.ended {
            self.begins_tick().then(|| {
                self.begun += 1;
                Event::Begin(self.begun - 1)
            })
        } else {
            self.ends_tick().then(|| {
                self.ended += 1;
                Event::End(self.ended - 1)
            })
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
        { *self }.next_event().is_none()
    }

    /// Whether this is a clock with ticks of `sample_time` seconds; one that came as bytes may
    /// be anything.
    pub fn is_sound(&self, sample_time: f64) -> bool {
        const MOST: u64 = 1 << 60;
        let known = [self.start, self.now, self.wanted]
            .iter()
            .all(|time| time.is_finite());
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
        // A step no longer than its own tolerance must not be undone, else time would not advance.
        let whole_step = (ROUNDING_OF_TIME * length.max(1.0)).min(MOST_ROUNDING);
        let by_steps = (whole_step + resolution).min(length / 4.0);
        let by_time = (ROUNDING_OF_TIME + resolution).min(length / 4.0);
        let elapsed = (self.now - self.start) / self.sample_time - self.ticks as f64;
        // Steps that were taken for others have left the time since the start behind.
        let agree = (elapsed - self.remainder).abs() <= 3.0 * ROUNDING_OF_TIME;
        if self.remainder.abs() <= by_steps || (agree && elapsed.abs() <= by_time) {
            self.remainder = 0.0;
        }
    }

    /// A remainder that counts as none, in units of `Te`.
    fn tolerance(&self) -> f64 {
        (ROUNDING_OF_TIME + LAST_PLACES * ulp(self.now) / self.sample_time).min(0.01)
    }
}

/// The distance from `|value|` to the next double.
fn ulp(value: f64) -> f64 {
    let magnitude = value.abs();
    magnitude.next_up() - magnitude
}
