//! From continuous time to samples, and from a direct feedthrough to a state.

use super::{Mode, OperatingPoint, SwitchedPlant};
use nalgebra::DMatrix;

/// Below this share of the largest magnitude of an eigenvalue, a real part counts as zero.
const NEGLIGIBLE: f64 = 1e-9;

impl Mode {
    /// This mode, whose `A`, `B`, `E` describe `dx/dt`, sampled every `sample_time` seconds with input
    /// and disturbance held in between: exact, by the exponential of the augmented matrix
    ///
    /// ```text
    ///     [ A_d  B_d  E_d ]         [ A  B  E ]
    /// exp(                ) = exp ( [ 0  0  0 ] Te )
    ///     [  0    I    0  ]         [ 0  0  0 ]
    /// ```
    ///
    /// A steady state of the one is a steady state of the other, so the operating point stays.
    pub fn sampled(&self, sample_time: f64) -> Self {
        let (n, m, s) = (self.a.nrows(), self.b.ncols(), self.e.ncols());
        let mut augmented = DMatrix::zeros(n + m + s, n + m + s);
        augmented.view_mut((0, 0), (n, n)).copy_from(&self.a);
        augmented.view_mut((0, n), (n, m)).copy_from(&self.b);
        augmented.view_mut((0, n + m), (n, s)).copy_from(&self.e);
        let exponential = (augmented * sample_time).exp();
        let block =
            |from: usize, width: usize| exponential.view((0, from), (n, width)).into_owned();
        Self {
            a: block(0, n),
            b: block(n, m),
            e: block(n + m, s),
            ..self.clone()
        }
    }

    /// This mode with `D u` in its output, where `u` is the input held over the sample that ends when
    /// the output is read: the state is extended by that input,
    ///
    /// ```text
    /// x_a = [x; u(k-1)],  A_a = [A 0; 0 0],  B_a = [B; I],  C_a = [C D],  E_a = [E; 0].
    /// ```
    ///
    /// `feedthrough` is `D` (p x m).
    pub fn with_feedthrough(&self, feedthrough: &DMatrix<f64>) -> Self {
        let (n, m, p, s) = (
            self.a.nrows(),
            self.b.ncols(),
            self.c.nrows(),
            self.e.ncols(),
        );
        let a = self.a.clone().resize(n + m, n + m, 0.0);
        let mut b = self.b.clone().resize_vertically(n + m, 0.0);
        b.view_mut((n, 0), (m, m)).fill_with_identity();
        let mut c = self.c.clone().resize_horizontally(n + m, 0.0);
        c.view_mut((0, n), (p, m)).copy_from(feedthrough);
        let e = self.e.clone().resize(n + m, s, 0.0);
        let point = &self.operating_point;
        Self {
            a,
            b,
            c,
            e,
            operating_point: OperatingPoint {
                x: point.x.iter().chain(&point.u).copied().collect(),
                ..point.clone()
            },
            ..self.clone()
        }
    }
}

impl SwitchedPlant {
    /// Whether every eigenvalue of every `A` lies where those of stable continuous plants do and those
    /// of sampled ones hardly ever: in the closed left half plane, and not all of them at zero.
    pub fn looks_continuous(&self) -> bool {
        self.modes.iter().all(|mode| {
            let eigenvalues = crate::eigenvalues(&mode.a);
            let size = eigenvalues.iter().map(|l| l.norm()).fold(0.0, f64::max);
            let left = eigenvalues.iter().all(|l| l.re <= NEGLIGIBLE * size);
            left && eigenvalues.iter().any(|l| l.re < -NEGLIGIBLE * size)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DVector, dmatrix};
    use proptest::prelude::*;

    fn mode(a: DMatrix<f64>, b: DMatrix<f64>, e: DMatrix<f64>) -> Mode {
        let n = a.nrows();
        Mode {
            name: "only".into(),
            c: DMatrix::identity(n, n),
            f: DMatrix::zeros(n, e.ncols()),
            operating_point: OperatingPoint::zero(n, b.ncols(), n),
            a,
            b,
            e,
        }
    }

    /// A double integrator and a first-order lag, in closed form.
    #[test]
    fn sampling_is_exact() {
        let te = 0.3;
        let found = mode(
            dmatrix![0.0, 1.0; 0.0, 0.0],
            dmatrix![0.0; 1.0],
            dmatrix![1.0; 0.0],
        )
        .sampled(te);
        assert!((found.a - dmatrix![1.0, te; 0.0, 1.0]).norm() < 1e-15);
        assert!((found.b - dmatrix![te * te / 2.0; te]).norm() < 1e-15);
        assert!((found.e - dmatrix![te; 0.0]).norm() < 1e-15);
        let stiff = mode(dmatrix![-2e4], dmatrix![3.0], dmatrix![1.0]).sampled(te);
        assert!(stiff.a[0].abs() < 1e-12 && (stiff.b[0] - 1.5e-4).abs() < 1e-15);
    }

    proptest! {
        /// Two half samples under the same input are one whole sample.
        #[test]
        fn sampling_twice_as_fast_goes_the_same_way(entries in prop::collection::vec(-2.0..2.0f64, 18)) {
            let a = DMatrix::from_column_slice(3, 3, &entries[..9]);
            let b = DMatrix::from_column_slice(3, 2, &entries[9..15]);
            let e = DMatrix::from_column_slice(3, 1, &entries[15..]);
            let mode = mode(a, b, e);
            let (half, whole) = (mode.sampled(0.2), mode.sampled(0.4));
            let step = |half: &Mode, x: DVector<f64>| &half.a * x + &half.b * DVector::from_vec(vec![1.0, -0.5]) + &half.e * DVector::from_vec(vec![0.3]);
            let x = DVector::from_vec(vec![0.2, -0.1, 0.7]);
            let twice = step(&half, step(&half, x.clone()));
            let once = step(&whole, x);
            prop_assert!((twice - &once).norm() <= 1e-12 * (1.0 + once.norm()));
        }

        /// The extended plant's output is that of the plain one, and `D` times the input before.
        #[test]
        fn a_feedthrough_shows_the_input_of_the_last_sample(u in prop::collection::vec(-2.0..2.0f64, 5)) {
            let plain = mode(dmatrix![0.5, 0.1; 0.0, 0.4], dmatrix![1.0; 0.5], dmatrix![1.0; 1.0]);
            let d = dmatrix![2.0; -1.0];
            let extended = plain.with_feedthrough(&d);
            let (mut x, mut z) = (DVector::zeros(2), DVector::zeros(3));
            for (k, &input) in u.iter().enumerate() {
                let before = if k == 0 { 0.0 } else { u[k - 1] };
                let expected = &plain.c * &x + d.column(0) * before;
                prop_assert!((&extended.c * &z - expected).norm() < 1e-12);
                let held = DVector::from_vec(vec![input]);
                x = &plain.a * x + &plain.b * &held;
                z = &extended.a * z + &extended.b * held;
            }
        }
    }

    #[test]
    fn a_continuous_plant_is_told_from_a_sampled_one() {
        let plant = |a: DMatrix<f64>| SwitchedPlant {
            sample_time: 1.0,
            modes: vec![mode(a, dmatrix![0.0; 1.0], dmatrix![0.0; 0.0])],
        };
        assert!(plant(dmatrix![-0.5, 0.0; 0.2, -0.4]).looks_continuous());
        assert!(plant(dmatrix![0.0, 1.0; 0.0, -3.0]).looks_continuous());
        assert!(plant(dmatrix![0.0, 1.0; -4.0, -0.1]).looks_continuous());
        assert!(!plant(dmatrix![0.4, -0.3; 0.11, 0.0]).looks_continuous());
        assert!(!plant(dmatrix![0.0, 1.0; 0.0, 0.0]).looks_continuous());
        assert!(!plant(dmatrix![0.9, 0.1; 0.0, -0.2]).looks_continuous());
    }
}
