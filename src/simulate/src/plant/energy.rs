//! The rectifier over one sample by its energy, where its diodes do not conduct: the usual case.
//!
//! The currents decay exponentially to their commands, `i(t) = u + (i_0 - u) E` with `E = exp(-t/tau)`, so
//! the power that goes into the link is known, `P(t) = p_0 + p_1 E + p_2 E^2`. The energy of its
//! capacitor `y = C v^2 / 2` then obeys
//!
//! ```text
//! dy/dt = -a y + P(t) - w v,     a = 2 / (R_load C),     v = sqrt(2 y / C)
//! ```
//!
//! which is linear but for the pulsating load `w`. The linear part is solved exactly, by factors prepared
//! once; what `w` takes by Gauss' collocation of order 16 about it, whose equations converge within a few
//! rounds, by a factor `|w| h / (C v)` each. Where anything of this does not hold, [`Sampled::advance`] says so and the
//! equations of motion are integrated as they stand.

use ftc_plant::rectifier::Rectifier;

/// Nodes of the collocation.
const NODES: usize = 8;

/// The positive nodes on [-1, 1] and their weights.
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_5),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_3),
];

/// A piece of a sample is no longer than this many time constants of the squared currents, for which the
/// collocation is exact to rounding errors.
const LONGEST: f64 = 2.5;

/// The most pieces a sample is divided into.
const MOST_PIECES: f64 = 16.0;

/// Rounds after which the collocation is given up.
const MOST_ROUNDS: usize = 12;

/// A change of the voltage, relative to it, after which the next one does not count.
const SETTLED: f64 = 1e-11;

/// A rectifier whose samples are advanced by its energy.
#[derive(Clone, Debug)]
pub(super) struct Sampled {
    rectifier: Rectifier,
    /// Pieces that a sample is divided into.
    pieces: usize,
    /// `E` after one piece.
    decay: f64,
    /// One for each mode.
    modes: Vec<Piece>,
}

/// A value at each node.
type Nodes = [f64; NODES];

/// The solution over a piece of length `h` in one mode: at its nodes and at its end.
#[derive(Clone, Debug)]
struct Piece {
    /// What is left of the energy: `exp(-a s)`.
    left: (Nodes, f64),
    /// What a power of `E^k`, k = 0, 1, 2, brings.
    brought: [(Nodes, f64); 3],
    /// What is taken by a power that is 1 W at one node: one entry for each such node.
    taken: [(Nodes, f64); NODES],
}

impl Sampled {
    /// Prepares it; none where a sample is many time constants long.
    pub(super) fn new(rectifier: &Rectifier, sample_time: f64) -> Option<Self> {
        let pieces = (2.0 * sample_time / rectifier.current_loop / LONGEST).ceil();
        if !(1.0..=MOST_PIECES).contains(&pieces) {
            return None;
        }
        let length = sample_time / pieces;
        let loads = rectifier.loads.iter();
        Some(Self {
            pieces: pieces as usize,
            decay: libm::exp(-length / rectifier.current_loop),
            modes: loads
                .map(|load| {
                    let rate = 2.0 / (load * rectifier.capacitance);
                    Piece::new(rate, 1.0 / rectifier.current_loop, length)
                })
                .collect(),
            rectifier: rectifier.clone(),
        })
    }

    /// The state `[i_d, i_q, v]` after a sample under held `u` and `w`; none where the diodes may conduct
    /// or the collocation does not converge.
    pub(super) fn advance(
        &self,
        mode: usize,
        [i_d, i_q, v]: [f64; 3],
        u: [f64; 2],
        w: f64,
    ) -> Option<[f64; 3]> {
        let piece = self.modes.get(mode)?;
        let Rectifier {
            inductance,
            resistance,
            capacitance,
            phase_voltage,
            current_loop,
            ..
        } = self.rectifier;
        let floor = self.rectifier.diode_voltage();
        let of_current = 1.5 * inductance / current_loop;
        let [u_d, u_q] = u;
        let (mut d, mut q) = (i_d - u_d, i_q - u_q);
        let mut voltage = v;
        for _ in 0..self.pieces {
            // (u + d E)^2 in both axes, and the power of the coils, L i di/dt = -L/tau (u + d E) d E.
            let (constant, mixed, square) =
                (u_d * u_d + u_q * u_q, u_d * d + u_q * q, d * d + q * q);
            let power = [
                1.5 * (phase_voltage * u_d - resistance * constant),
                1.5 * (phase_voltage * d - 2.0 * resistance * mixed) + of_current * mixed,
                (of_current - 1.5 * resistance) * square,
            ];
            voltage = piece.advance(voltage, power, w, capacitance, floor)?;
            (d, q) = (d * self.decay, q * self.decay);
        }
        Some([u_d + d, u_q + q, voltage])
    }
}

impl Piece {
    /// Of an energy that decays at `rate`, under powers that decay at 0, 1 and 2 times `of_currents`.
    fn new(rate: f64, of_currents: f64, length: f64) -> Self {
        let (nodes, weights) = gauss();
        let ends = nodes.map(|node| 0.5 * (node + 1.0) * length);
        let at = |of: &dyn Fn(f64) -> f64| (ends.map(of), of(length));
        let left = at(&|s| libm::exp(-rate * s));
        let brought = [0.0, 1.0, 2.0].map(|times| {
            // The integral of exp(-a (s - t)) exp(-b t), stable where a and b are alike.
            let by = rate - times * of_currents;
            at(&|s| s * libm::exp(-rate * s) * relative_growth(by * s))
        });
        let whole = weights.map(|weight| 0.5 * weight * length);
        let taken = core::array::from_fn(|from| {
            let grown = libm::exp(rate * ends[from]);
            let to = core::array::from_fn(|to| {
                length * integral(nodes[from], weights[from], nodes[to]) * grown * left.0[to]
            });
            (to, whole[from] * grown * left.1)
        });
        Self {
            left,
            brought,
            taken,
        }
    }

    /// The voltage at the end, from that at the beginning.
    fn advance(
        &self,
        v: f64,
        power: [f64; 3],
        w: f64,
        capacitance: f64,
        floor: f64,
    ) -> Option<f64> {
        let by = 2.0 / capacitance;
        // In units of half the capacitance, so that a voltage is the root of an energy.
        let start = v * v;
        let mut free = self.left.0.map(|left| left * start);
        let mut end = self.left.1 * start;
        for ((at_nodes, at_end), power) in self.brought.iter().zip(power) {
            let power = by * power;
            for (sum, brought) in free.iter_mut().zip(at_nodes) {
                *sum += power * brought;
            }
            end += power * at_end;
        }
        let drawn = by * w;
        let mut inner = [v; NODES];
        if drawn == 0.0 {
            inner = free.map(f64::sqrt);
        } else {
            inner = self.collocated(&free, inner, drawn)?;
            for ((_, at_end), voltage) in self.taken.iter().zip(inner) {
                end -= drawn * voltage * at_end;
            }
        }
        let end = end.sqrt();
        let ends = [v.min(end), v.max(end)];
        let [low, high] = inner.iter().fold(ends, |[low, high], &voltage| {
            [low.min(voltage), high.max(voltage)]
        });
        // Between the nodes it may go beyond them by a part of its range.
        let above = low - 0.25 * (high - low) > floor;
        (above && end.is_finite() && inner.iter().all(|v| v.is_finite())).then_some(end)
    }

    /// The voltages at the nodes, from their squares without the pulsating load.
    fn collocated(&self, free: &Nodes, mut inner: Nodes, drawn: f64) -> Option<Nodes> {
        for _ in 0..MOST_ROUNDS {
            let mut next = *free;
            for ((at_nodes, _), voltage) in self.taken.iter().zip(inner) {
                let power = drawn * voltage;
                for (sum, taken) in next.iter_mut().zip(at_nodes) {
                    *sum -= power * taken;
                }
            }
            let next = next.map(f64::sqrt);
            let mut settled = true;
            for (old, new) in inner.iter().zip(next) {
                settled &= (new - old).abs() <= SETTLED * new;
            }
            inner = next;
            if settled {
                return Some(inner);
            }
        }
        None
    }
}

/// `(exp(x) - 1) / x`.
fn relative_growth(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { libm::expm1(x) / x }
}

/// Gauss' nodes on [-1, 1] in ascending order, and their weights.
fn gauss() -> (Nodes, Nodes) {
    let positive = |at: usize| GAUSS.get(at).copied().unwrap_or_default();
    let node = |at: usize| match at.checked_sub(NODES / 2) {
        Some(at) => positive(at),
        None => {
            let (node, weight) = positive(NODES / 2 - 1 - at);
            (-node, weight)
        }
    };
    let both = core::array::from_fn::<_, NODES, _>(node);
    (both.map(|(node, _)| node), both.map(|(_, weight)| weight))
}

/// The integral, from the beginning of [0, 1] to node `to`, of the polynomial that is 1 at node `from` and 0 at
/// the others; nodes on [-1, 1]. By Legendre's polynomials, which Gauss' nodes leave orthogonal.
fn integral(from: f64, weight: f64, to: f64) -> f64 {
    let (at_from, at_to) = (legendre(from), legendre(to));
    let mut sum = to + 1.0;
    for (k, of) in at_from.iter().enumerate().take(NODES).skip(1) {
        sum += of * (at_to[k + 1] - at_to[k - 1]);
    }
    0.25 * weight * sum
}

/// Legendre's polynomials of degree 0 to [`NODES`].
fn legendre(x: f64) -> [f64; NODES + 1] {
    let mut values = [1.0; NODES + 1];
    values[1] = x;
    for k in 2..=NODES {
        let degree = k as f64;
        values[k] =
            ((2.0 * degree - 1.0) * x * values[k - 1] - (degree - 1.0) * values[k - 2]) / degree;
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::{self, Tolerance};
    use proptest::prelude::*;

    fn rectifier(current_loop: f64) -> Rectifier {
        Rectifier {
            inductance: 0.01,
            resistance: 0.3,
            capacitance: 2e-3,
            phase_voltage: 311.0,
            current_loop,
            dc_voltage: 600.0,
            loads: vec![80.0, 40.0],
        }
    }

    /// The same sample by the equations of motion, in short steps.
    fn wanted(
        plant: &Rectifier,
        mode: usize,
        x: [f64; 3],
        u: [f64; 2],
        w: f64,
        time: f64,
    ) -> [f64; 3] {
        let mut state = x;
        let tolerance = Tolerance::new(1e-14, 1e-13);
        for _ in 0..50 {
            let _ = integrate::advance(&mut state, time / 50.0, tolerance, |x| {
                plant.derivative(mode, x, u, w)
            });
        }
        state
    }

    proptest! {
        /// To 1e-11 of the voltage, wherever it answers at all; and it does where a link is in use.
        #[test]
        fn the_energy_says_what_the_motion_does(
            i_d in -40.0..60.0f64, i_q in -40.0..40.0f64, v in 560.0..700.0f64, w in prop_oneof![Just(0.0), -20.0..20.0f64],
            u_d in -40.0..60.0f64, u_q in -40.0..40.0f64, mode in 0usize..2,
            time in 1e-4..2e-2f64, tau in prop::sample::select(vec![1e-3, 2e-3, 5e-3]),
        ) {
            let plant = rectifier(tau);
            let Some(sampled) = Sampled::new(&plant, time) else {
                prop_assert!(2.0 * time / tau > 40.0);
                return Ok(());
            };
            let (x, u) = ([i_d, i_q, v], [u_d, u_q]);
            let wanted = wanted(&plant, mode, x, u, w, time);
            match sampled.advance(mode, x, u, w) {
                None => prop_assert!(w.abs() * time > 0.05 || wanted[2].min(v) < 600.0, "given up at {wanted:?}"),
                Some(found) => for (found, wanted) in found.iter().zip(wanted) {
                    prop_assert!((found - wanted).abs() <= 1e-11 * (wanted.abs() + 10.0), "{found} {wanted}");
                },
            }
        }
    }

    /// Where the link falls to the diodes, the equations of motion are left to answer.
    #[test]
    fn conducting_diodes_are_left_to_the_rectifier() {
        let plant = rectifier(2e-3);
        let sampled = Sampled::new(&plant, 5e-3).unwrap();
        let u = [-40.0, 40.0];
        for v in [
            545.0,
            540.0,
            538.0,
            500.0,
            0.0,
            -5.0,
            f64::NAN,
            f64::INFINITY,
        ] {
            assert_eq!(sampled.advance(1, [20.0, 0.0, v], u, 1.5), None, "{v}");
        }
        assert_eq!(sampled.advance(1, [20.0, 0.0, 600.0], u, f64::NAN), None);
        assert_eq!(sampled.advance(1, [20.0, 0.0, 600.0], u, 1e6), None);
        assert_eq!(sampled.advance(2, [20.0, 0.0, 600.0], u, 0.0), None);
        assert!(Sampled::new(&plant, 1.0).is_none());
    }

    /// Every polynomial that eight nodes tell apart is integrated, from its beginning and over the whole.
    #[test]
    fn polynomials_are_integrated() {
        let (nodes, weights) = gauss();
        for power in 0..8 {
            let primitive =
                |x: f64| (x.powi(power + 1) - (-1f64).powi(power + 1)) / f64::from(power + 1);
            let value = |node: f64| node.powi(power);
            let whole: f64 = nodes
                .iter()
                .zip(weights)
                .map(|(&x, weight)| weight * value(x))
                .sum();
            assert!((whole - primitive(1.0)).abs() < 1e-15);
            for to in nodes {
                let terms = nodes.iter().zip(weights);
                let sum: f64 = terms
                    .map(|(&x, weight)| 2.0 * integral(x, weight, to) * value(x))
                    .sum();
                assert!((sum - primitive(to)).abs() < 1e-14, "{power} {to}");
            }
        }
    }
}
