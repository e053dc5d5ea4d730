//! Frequency responses from the Hessenberg form of the state matrix: one reduction for all
//! frequencies, and at each of them a triangular solution by elimination along the subdiagonal.

use nalgebra::linalg::Hessenberg;
use nalgebra::{Complex, DMatrix, DVector};
use std::f64::consts::PI;

/// `c (z I - a)^-1 b + d` with `a` in upper Hessenberg form; transposed where that leaves fewer
/// columns to solve for.
pub(crate) struct Response {
    /// Rows of `a`, one after the other.
    a: Vec<f64>,
    /// Columns of `b`.
    b: Vec<DVector<f64>>,
    /// Rows of `c`.
    c: Vec<DVector<f64>>,
    d: DMatrix<f64>,
    /// Eigenvalues of `a`.
    poles: Vec<Complex<f64>>,
}

/// The triangular factor at one frequency, and the right-hand side on the way to the solution.
struct Elimination {
    size: usize,
    /// Real and imaginary parts of the rows.
    rows: [Vec<f64>; 2],
    /// The same of the right-hand sides, each a column.
    sides: Vec<[Vec<f64>; 2]>,
}

impl Response {
    /// All four matrices must be finite, and `a` not empty.
    pub fn new(a: &DMatrix<f64>, b: &DMatrix<f64>, c: &DMatrix<f64>, d: &DMatrix<f64>) -> Self {
        if c.nrows() < b.ncols() {
            let [a, b, c, d] = [a, b, c, d].map(DMatrix::transpose);
            return Self::narrow(&a, &c, &b, d);
        }
        Self::narrow(a, b, c, d.clone())
    }

    fn narrow(a: &DMatrix<f64>, b: &DMatrix<f64>, c: &DMatrix<f64>, d: DMatrix<f64>) -> Self {
        let (basis, reduced) = Hessenberg::new(a.clone()).unpack();
        let (b, c) = (basis.tr_mul(b), (c * &basis).transpose());
        let columns = |matrix: &DMatrix<f64>| matrix.column_iter().map(|x| x.into()).collect();
        Self {
            poles: ftc_plant::eigenvalues(&reduced).iter().copied().collect(),
            a: reduced.transpose().as_slice().to_vec(),
            b: columns(&b),
            c: columns(&c),
            d,
        }
    }

    /// The largest magnitude of an eigenvalue.
    pub fn spectral_radius(&self) -> f64 {
        self.poles
            .iter()
            .map(|pole| pole.norm())
            .fold(0.0, f64::max)
    }

    /// The largest singular value of the response on a grid that holds every resonance: a lower bound
    /// of the l2 gain.
    pub fn norm(&self) -> f64 {
        self.angles().fold(0.0, |largest: f64, angle| {
            largest.max(self.size_at(angle, largest))
        })
    }

    /// Angles per sample at which the response is looked at: a grid from slow to fast, and the angle
    /// of every eigenvalue and its neighbourhood.
    fn angles(&self) -> impl Iterator<Item = f64> {
        let slow = (0..60).map(|k| PI * 10f64.powf(-6.0 + 0.1 * f64::from(k)));
        let even = (0..=60).map(|k| PI * f64::from(k) / 60.0);
        let resonances = self
            .poles
            .iter()
            .filter(|pole| pole.im >= 0.0 && pole.norm() > 1e-3)
            .flat_map(|pole| {
                let width = (1.0 - pole.norm()).abs();
                let angle = pole.arg();
                [-1.0, -0.5, -0.2, 0.0, 0.2, 0.5, 1.0]
                    .map(|share| (angle + share * width).clamp(0.0, PI))
            });
        even.chain(slow).chain(resonances)
    }

    /// The largest singular value at an angle; what does not exceed `floor` may come back as any number
    /// up to it.
    fn size_at(&self, angle: f64, floor: f64) -> f64 {
        let Some(solved) = Elimination::new(self, angle).solve() else {
            return f64::INFINITY;
        };
        let response = DMatrix::from_fn(self.c.len(), self.b.len(), |row, column| {
            let [re, im] = &solved[column];
            let c = self.c[row].as_slice();
            Complex::new(self.d[(row, column)] + dot(c, re), dot(c, im))
        });
        // The decomposition panics on what is not a number.
        let finite = response.iter().all(|value| value.norm() < 1e150);
        let bound = response.norm();
        match (finite, bound > floor) {
            (false, _) => f64::INFINITY,
            (true, false) => bound,
            (true, true) if response.nrows().min(response.ncols()) > 1 => {
                response.singular_values().max()
            }
            (true, true) => bound,
        }
    }
}

impl Elimination {
    /// `z I - a` made upper triangular row by row, the larger of two entries being the pivot.
    fn new(of: &Response, angle: f64) -> Self {
        let size = of.a.len().isqrt();
        let mut made = Self {
            size,
            rows: [
                of.a.iter().map(|value| -value).collect(),
                vec![0.0; size * size],
            ],
            sides: of
                .b
                .iter()
                .map(|side| [side.as_slice().to_vec(), vec![0.0; size]])
                .collect(),
        };
        for k in 0..size {
            made.rows[0][k * size + k] += angle.cos();
            made.rows[1][k * size + k] += angle.sin();
        }
        for k in 1..size {
            made.eliminate(k);
        }
        made
    }

    /// Takes the entry left of the diagonal out of a row.
    fn eliminate(&mut self, row: usize) {
        let (size, column) = (self.size, row - 1);
        let mut entries = self.rows.each_mut().map(|part| {
            let (above, below) = part[column * size..(row + 1) * size].split_at_mut(size);
            (&mut above[column..], &mut below[column..])
        });
        let pivot = |which: bool, entries: &[(&mut [f64], &mut [f64]); 2]| {
            let of = |part: usize| {
                if which {
                    entries[part].0[0]
                } else {
                    entries[part].1[0]
                }
            };
            Complex::new(of(0), of(1))
        };
        let (upper, lower) = (pivot(true, &entries), pivot(false, &entries));
        let swap = lower.norm_sqr() > upper.norm_sqr();
        if swap {
            for (above, below) in &mut entries {
                above.swap_with_slice(below);
            }
            for side in &mut self.sides {
                side.iter_mut().for_each(|part| part.swap(column, row));
            }
        }
        let (pivot, other) = if swap { (lower, upper) } else { (upper, lower) };
        if other.norm_sqr() == 0.0 {
            return;
        }
        let factor = other / pivot;
        let [(above_re, below_re), (above_im, below_im)] = &mut entries;
        let above = above_re.iter().zip(above_im.iter());
        let below = below_re.iter_mut().zip(below_im.iter_mut());
        for ((re, im), (x, y)) in below.zip(above) {
            *re -= factor.re * x - factor.im * y;
            *im -= factor.re * y + factor.im * x;
        }
        for [re, im] in &mut self.sides {
            let moved = factor * Complex::new(re[column], im[column]);
            re[row] -= moved.re;
            im[row] -= moved.im;
        }
    }

    /// The solutions; `None` where the matrix is singular.
    fn solve(mut self) -> Option<Vec<[Vec<f64>; 2]>> {
        let (size, [real, imaginary]) = (self.size, &self.rows);
        for k in (0..size).rev() {
            let (start, end) = (k * size + k, (k + 1) * size);
            let pivot = Complex::new(real[start], imaginary[start]);
            if pivot.norm_sqr() == 0.0 {
                return None;
            }
            let (row_re, row_im) = (&real[start + 1..end], &imaginary[start + 1..end]);
            for [re, im] in &mut self.sides {
                let (known_re, known_im) = (&re[k + 1..], &im[k + 1..]);
                let taken = Complex::new(
                    dot(row_re, known_re) - dot(row_im, known_im),
                    dot(row_re, known_im) + dot(row_im, known_re),
                );
                let value = (Complex::new(re[k], im[k]) - taken) / pivot;
                (re[k], im[k]) = (value.re, value.im);
            }
        }
        Some(self.sides)
    }
}

/// The sum of products, in eight partial sums that a processor can keep side by side.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a, b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest = a.remainder().iter().zip(b.remainder());
    let rest: f64 = rest.map(|(a, b)| a * b).sum();
    for (a, b) in a.zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    rest + sums.iter().sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The largest singular value by a general solution of the linear equations.
    fn general(parts: &[DMatrix<f64>; 4], angle: f64) -> f64 {
        let [a, b, c, d] = parts.clone().map(|part| part.map(Complex::from));
        let turn = Complex::from_polar(1.0, angle);
        let inner = DMatrix::from_diagonal_element(a.nrows(), a.nrows(), turn) - a;
        let response = c * inner.lu().solve(&b).unwrap() + d;
        response.singular_values().max()
    }

    proptest! {
        /// At every angle the response is that of a general solution, whatever is wider, inputs or
        /// outputs; and no angle shows more than the norm.
        #[test]
        fn the_response_is_that_of_the_general_solution(
            entries in prop::collection::vec(-1.0..1.0f64, 400),
            size in 1..12usize,
            inputs in 1..4usize,
            outputs in 1..4usize,
            radius in 0.1..0.98f64,
            angle in 0.0..3.1f64,
        ) {
            let mut entries = entries.into_iter();
            let mut matrix = |rows: usize, columns: usize| {
                DMatrix::from_iterator(rows, columns, entries.by_ref().take(rows * columns))
            };
            let a = matrix(size, size);
            let a = &a * (radius / a.norm());
            let parts = [a, matrix(size, inputs), matrix(outputs, size), matrix(outputs, inputs)];
            let [a, b, c, d] = &parts;
            let response = Response::new(a, b, c, d);
            let expected = general(&parts, angle);
            let found = response.size_at(angle, 0.0);
            prop_assert!((found - expected).abs() <= 1e-9 * expected, "{found} for {expected}");
            let norm = response.norm();
            prop_assert!(norm >= general(&parts, 0.0) * (1.0 - 1e-9));
            prop_assert!(expected <= norm * 1.05, "{expected} above {norm}");
        }
    }
}
