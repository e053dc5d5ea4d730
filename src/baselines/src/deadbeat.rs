//! What following a reference costs at least, when the plant needs a sample to answer: the bound of
//! every causal controller whose output rests on the reference whenever that jumps. A smooth
//! reference can be run ahead of, and what disturbs the output may happen to help.

use ftc_plant::{Mode, SwitchedPlant};
use std::collections::VecDeque;

/// The least mean square error of an output that can follow its reference only `delay` samples
/// late: each sample costs the square of what the reference moved meanwhile. Before the first
/// sample the output is taken to rest at `start`.
pub fn deadbeat_bound(reference: &[f64], start: f64, delay: usize) -> f64 {
    let mut sum = DeadbeatSum::new(start, delay);
    reference.iter().for_each(|&now| sum.add(now));
    sum.bound()
}

/// [`deadbeat_bound`], gathered sample by sample.
#[derive(Clone, Debug)]
pub struct DeadbeatSum {
    late: VecDeque<f64>,
    sum: f64,
    samples: u64,
}

impl DeadbeatSum {
    /// An output at rest.
    pub fn new(start: f64, delay: usize) -> Self {
        Self {
            late: std::iter::repeat_n(start, delay).collect(),
            sum: 0.0,
            samples: 0,
        }
    }

    /// Adds a sample of the reference.
    pub fn add(&mut self, now: f64) {
        self.late.push_back(now);
        let late = self.late.pop_front().unwrap_or(now);
        self.sum += (now - late) * (now - late);
        self.samples += 1;
    }

    /// The bound over the samples so far.
    pub fn bound(&self) -> f64 {
        self.sum / self.samples.max(1) as f64
    }
}

/// The fewest samples after which any input reaches the true output `output` (0-based) in any mode,
/// at least 1; the number of states where none ever does.
pub fn response_delay(plant: &SwitchedPlant, output: usize) -> usize {
    let states = plant.dimensions().states.max(1);
    let of = |mode: &Mode| {
        let mut row = mode.c.row(output).into_owned();
        (1..states)
            .find(|_| {
                let reaches = (&row * &mode.b).amax() > 0.0;
                row = &row * &mode.a;
                reaches
            })
            .unwrap_or(states)
    };
    plant.modes.iter().map(of).min().unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, dmatrix};

    /// A chain of three delays: the first state is reached after three samples, the last after one.
    #[test]
    fn a_chain_of_delays_is_counted() {
        let plant = SwitchedPlant::new(
            1.0,
            vec![
                Mode::new(
                    dmatrix![0.0, 1.0, 0.0; 0.0, 0.0, 1.0; 0.0, 0.0, 0.0],
                    dmatrix![0.0; 0.0; 1.0],
                    DMatrix::identity(3, 3),
                )
                .named("chain"),
            ],
        );
        assert_eq!(
            [0, 1, 2].map(|output| response_delay(&plant, output)),
            [3, 2, 1]
        );
    }

    #[test]
    fn a_step_costs_its_square_once_per_sample_of_delay() {
        let reference = [0.0, 0.0, 2.0, 2.0, 2.0];
        assert_eq!(deadbeat_bound(&reference, 0.0, 1), 4.0 / 5.0);
        assert_eq!(deadbeat_bound(&reference, 0.0, 2), 8.0 / 5.0);
        assert_eq!(deadbeat_bound(&reference, 0.0, 0), 0.0);
    }
}
