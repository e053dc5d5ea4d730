//! Plants the tests share.
#![allow(dead_code)] // each test file uses its own part

use ftc::design::{ControlSpec, Lyapunov};
use ftc::plant::{Mode, OperatingPoint, SwitchedPlant};
use nalgebra::DMatrix;

/// Where the paper's disturbance enters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Channel {
    State,
    Output,
}

/// A matrix from its rows.
pub fn rows<const R: usize, const C: usize>(rows: [[f64; C]; R]) -> DMatrix<f64> {
    DMatrix::from_fn(R, C, |r, c| rows[r][c])
}

/// A mode around the origin.
pub fn mode(
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    e: DMatrix<f64>,
    f: DMatrix<f64>,
) -> Mode {
    Mode {
        name: String::new(),
        operating_point: OperatingPoint::zero(a.nrows(), b.ncols(), c.nrows()),
        a,
        b,
        c,
        e,
        f,
    }
}

/// The plant of the paper's section VII-A.
pub fn paper(channel: Channel) -> SwitchedPlant {
    let (e, f) = match channel {
        Channel::State => (rows([[1.0], [1.0]]), rows([[0.0], [0.0]])),
        Channel::Output => (rows([[0.0], [0.0]]), rows([[1.0], [1.0]])),
    };
    let c = DMatrix::identity(2, 2);
    let first = mode(
        rows([[0.6, 0.45], [-0.2, 0.3]]),
        rows([[0.0, 1.0], [1.0, 0.0]]),
        c.clone(),
        e.clone(),
        f.clone(),
    );
    let second = mode(
        rows([[0.4, -0.3], [0.11, 0.0]]),
        rows([[1.0, 0.0], [0.0, 1.0]]),
        c,
        e,
        f,
    );
    SwitchedPlant {
        sample_time: 1.0,
        modes: vec![first, second],
    }
}

/// The weights of the reference table: 1 on the output, 0.3 on the integral, 0.1 on the input.
pub fn paper_spec(latency: usize, decay: f64, lyapunov: Lyapunov) -> ControlSpec {
    let dims = paper(Channel::State).dimensions();
    ControlSpec {
        latency,
        decay,
        lyapunov,
        output_weight: vec![1.0; 2],
        integral_weight: vec![0.3; 2],
        input_weight: vec![0.1; 2],
        ..ControlSpec::new(dims)
    }
}

/// A linear congruential generator: reproducible anywhere, good enough for matrices.
pub struct Lottery(pub u64);

impl Lottery {
    /// A number in [-1, 1).
    pub fn number(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// A whole number in `low..=high`.
    pub fn between(&mut self, low: usize, high: usize) -> usize {
        low + ((self.number() + 1.0) / 2.0 * (high - low + 1) as f64) as usize
    }

    /// A matrix of numbers in [-1, 1).
    pub fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| self.number())
    }
}

/// A plant of one to three similar modes, sampled from continuous time: `A = I + Te Ac`, where `Ac`
/// has its spectrum around -2 and may reach into the right half plane.
pub fn random_plant(seed: u64, sample_time: f64) -> SwitchedPlant {
    let mut lottery = Lottery(seed.wrapping_mul(0x9E3779B97F4A7C15) + 1);
    let n = lottery.between(2, 4);
    let m = lottery.between(1, 3);
    let p = lottery.between(1, 3);
    let s = lottery.between(1, p);
    let modes = lottery.between(1, 3);
    let (a, b, c) = (
        2.0 * lottery.matrix(n, n) - 1.5 * DMatrix::identity(n, n),
        lottery.matrix(n, m),
        lottery.matrix(p, n),
    );
    let e = lottery.matrix(n, s);
    let modes = (0..modes)
        .map(|_| {
            mode(
                DMatrix::identity(n, n) + sample_time * (&a + 0.2 * lottery.matrix(n, n)),
                sample_time * (&b + 0.1 * lottery.matrix(n, m)),
                c.clone(),
                sample_time * &e,
                DMatrix::zeros(p, s),
            )
        })
        .collect();
    SwitchedPlant { sample_time, modes }
}

/// A three-phase rectifier in amperes and volts, states (i_d, i_q, v_dc), sampled at 0.1 ms: 10 mH,
/// 0.3 ohm, 2 mF, 50 Hz, 311 V phase amplitude, 600 V on the DC side, one mode per load.
/// Linearised averaged model; inputs are the converter's modulation indices.
pub fn rectifier() -> SwitchedPlant {
    let (l, r, c, omega) = (10e-3, 0.3, 2e-3, 314.159);
    let (source, link, sample_time) = (311.0_f64, 600.0_f64, 1e-4);
    let modes = [80.0_f64, 40.0]
        .into_iter()
        .map(|load| {
            // Steady state with i_q = 0: 1.5 (source i_d - r i_d^2) = link^2 / load.
            let power = link * link / load;
            let current = (source - (source * source - 4.0 * r * power / 1.5).sqrt()) / (2.0 * r);
            let (m_d, m_q) = ((source - r * current) / link, -omega * l * current / link);
            let continuous = rows([
                [-r / l, omega, -m_d / l],
                [-omega, -r / l, -m_q / l],
                [1.5 * m_d / c, 1.5 * m_q / c, -1.0 / (load * c)],
            ]);
            let input = rows([[-link / l, 0.0], [0.0, -link / l], [1.5 * current / c, 0.0]]);
            let disturbance = rows([[0.0], [0.0], [-1.0 / c]]);
            let exponential = (sample_time * &continuous).exp();
            // Zero-order hold by the midpoint of the transition, accurate to O(Te^3).
            let hold = sample_time * (0.5 * sample_time * &continuous).exp();
            mode(
                exponential,
                &hold * input,
                rows([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]),
                &hold * disturbance,
                rows([[0.0], [0.0]]),
            )
        })
        .collect();
    SwitchedPlant { sample_time, modes }
}
