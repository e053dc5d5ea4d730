//! How much memory and arithmetic a design asks for, known before it begins.
//!
//! The state feedback's inequalities take by far the most. With augmented states `d`, `L` Lyapunov
//! matrices and a gain of `r` rows in each of `M` modes that are solved together, the Newton matrix has
//! `R = L d (d + 1) / 2 + 1` rows after `M` parts of `r d` rows each are eliminated.

use crate::{ControlSpec, Lyapunov};
use ftc_plant::Dimensions;

/// The most memory that a design may take for its Newton matrix, in bytes.
pub const MOST_BYTES: f64 = 4e9;

/// Iterations of a usual solution and of the one that centres it.
const ITERATIONS: f64 = 40.0;

/// Arithmetic operations in a second, roughly.
const PER_SECOND: f64 = 3e9;

/// Operations of the interior-point method beyond which a `dwell` design is left to Riccati equations, and the
/// iterations of all its solutions of one problem.
const LARGEST_BY_NEWTON: f64 = 6e11;
const DWELL_ITERATIONS: f64 = 45.0;

/// Seconds that Riccati equations and what follows them take for each mode, by the cube of its augmented states,
/// as often as `RESPONSES` and once more for each sensor that may be lost: measured with 40 to 64 states.
const PER_CUBE: f64 = 6e-7;
const RESPONSES: f64 = 12.0;

/// What a state feedback takes, within a factor of a few.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Work {
    /// Memory of the Newton matrix and its factors, in bytes.
    pub bytes: f64,
    /// Seconds of one processor.
    pub seconds: f64,
    /// Whether Riccati equations are asked first, so that this memory is not needed unless they have no solution.
    pub by_riccati: bool,
}

/// Whether a `dwell` design with so many augmented states, inputs and modes is left to Riccati equations.
pub(crate) fn is_left_to_riccati(states: usize, inputs: usize, modes: usize) -> bool {
    let (symmetric, full) = ((states * (states + 1) / 2) as f64, (states * inputs) as f64);
    let factors = (symmetric.powi(3) + full.powi(3)) / 3.0;
    let coupling = full * symmetric * (full + symmetric);
    DWELL_ITERATIONS * modes as f64 * (factors + coupling) > LARGEST_BY_NEWTON
}

/// A design that would exhaust a computer.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the inequalities of this design would take about {:.0} GB of memory and {}, but at most {:.0} GB are \
     taken: reduce the number of states, inputs or modes{}",
    .work.bytes / 1e9, .work.time(), MOST_BYTES / 1e9, others(*.lyapunov)
)]
#[non_exhaustive]
pub struct TooLarge {
    /// What it would take.
    pub work: Work,
    /// The guarantee that is asked for.
    pub lyapunov: Lyapunov,
}

fn others(lyapunov: Lyapunov) -> &'static str {
    match lyapunov {
        Lyapunov::Dwell => "",
        Lyapunov::Common | Lyapunov::Switched => {
            ", or ask for the dwell guarantee, which solves one mode at a time"
        }
    }
}

impl Work {
    /// Of a plant with these sizes and so many modes.
    pub fn new(dims: Dimensions, modes: usize, spec: &ControlSpec) -> Self {
        let tracked = spec.tracked.len() * (1 + 2 * spec.resonators.len());
        let order = dims.states + spec.latency * dims.inputs + tracked;
        let by_riccati =
            spec.lyapunov == Lyapunov::Dwell && is_left_to_riccati(order, dims.inputs, modes);
        let order = order as f64;
        let (modes, inputs) = (modes as f64, dims.inputs as f64);
        let (together, matrices, rows) = match spec.lyapunov {
            Lyapunov::Common => (modes, 1.0, inputs),
            Lyapunov::Dwell => (1.0, 1.0, inputs),
            Lyapunov::Switched => (modes, modes, order + inputs),
        };
        let reduced = matrices * order * (order + 1.0) / 2.0 + 1.0;
        let part = rows * order;
        // The matrix and its factor, of what is left and of every part, and what couples them.
        let numbers = reduced * reduced + together * part * (part + reduced);
        let elimination = part * part * part / 3.0 + part * reduced * (part + reduced);
        let operations = reduced * reduced * reduced / 3.0 + together * elimination;
        let seconds = match by_riccati {
            true => PER_CUBE * modes * order.powi(3) * (RESPONSES + dims.outputs as f64),
            false => modes / together * ITERATIONS * operations / PER_SECOND,
        };
        Self {
            bytes: 2.0 * 8.0 * numbers,
            seconds,
            by_riccati,
        }
    }

    /// Refuses what would exhaust a computer.
    ///
    /// # Errors
    /// The estimate, and what to change.
    pub fn check(&self, spec: &ControlSpec) -> Result<(), TooLarge> {
        match self.bytes <= MOST_BYTES {
            true => Ok(()),
            false => Err(TooLarge {
                work: *self,
                lyapunov: spec.lyapunov,
            }),
        }
    }

    /// The time in words.
    pub fn time(&self) -> String {
        in_words(self.seconds)
    }
}

/// A time in seconds, minutes or hours.
pub fn in_words(seconds: f64) -> String {
    match seconds {
        seconds if seconds < 90.0 => format!("{seconds:.0} s"),
        seconds if seconds < 5400.0 => format!("{:.0} minutes", seconds / 60.0),
        seconds => format!("{:.0} hours", seconds / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// States, modes and the processor seconds that a design under `dwell` took.
    const MEASURED: [(usize, usize, f64); 4] =
        [(24, 4, 11.0), (40, 2, 6.8), (48, 2, 15.8), (64, 4, 106.0)];

    fn work(states: usize, modes: usize, lyapunov: Lyapunov) -> Result<Work, TooLarge> {
        let half = (states / 2).max(1);
        let dims = Dimensions {
            states,
            inputs: half,
            outputs: half,
            disturbances: 1,
        };
        let spec = ControlSpec {
            lyapunov,
            ..ControlSpec::unweighted(dims)
        };
        let work = Work::new(dims, modes, &spec);
        work.check(&spec).map(|()| work)
    }

    #[test]
    fn what_exhausts_memory_is_refused_with_its_size() {
        let refused = work(64, 64, Lyapunov::Common).unwrap_err().to_string();
        assert!(refused.contains("GB"), "{refused}");
        assert!(refused.contains("dwell"), "{refused}");
        assert!(work(64, 64, Lyapunov::Switched).is_err());
    }

    #[test]
    fn what_is_practical_is_taken() {
        for (states, modes, lyapunov) in [
            (24, 2, Lyapunov::Common),
            (16, 4, Lyapunov::Common),
            (8, 4, Lyapunov::Switched),
            (48, 4, Lyapunov::Dwell),
            (64, 64, Lyapunov::Dwell),
        ] {
            work(states, modes, lyapunov).unwrap();
        }
        assert!(work(2, 2, Lyapunov::Common).unwrap().seconds < 0.1);
        assert!(work(40, 4, Lyapunov::Common).unwrap().seconds > 60.0);
        // Processor seconds measured for whole designs, within a factor of three.
        for (states, modes, measured) in MEASURED {
            let seconds = work(states, modes, Lyapunov::Dwell).unwrap().seconds;
            let off = seconds / measured;
            assert!(
                (1.0 / 3.0..3.0).contains(&off),
                "{states}, {modes}: {seconds}"
            );
        }
    }
}
