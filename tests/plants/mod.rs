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
