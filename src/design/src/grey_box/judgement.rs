//! What the fitted matrices leave: of which size, how white, and in percent.

use super::model::GreyBox;
use super::windows::{Segment, samples_of};
use nalgebra::DVector;

impl GreyBox<'_> {
    /// Sum of squares of the residual of each output (p) in each mode, output units.
    pub(super) fn squares(&self, windows: &[Segment], theta: &DVector<f64>) -> Vec<DVector<f64>> {
        let p = self.deviation[0].len();
        let modes = self.matrices(theta);
        let mut sums = vec![DVector::zeros(p); modes.len()];
        for window in windows {
            let residual = self.explain(window, &modes).residual;
            let samples = residual.as_slice().chunks_exact(p);
            for (&mode, sample) in window.modes.iter().zip(samples) {
                for (q, value) in sample.iter().enumerate() {
                    sums[mode][q] += (value * self.deviation[mode][q]).powi(2);
                }
            }
        }
        sums
    }

    /// Standard deviation of the residual of each sensor (p) in each mode, output units.
    pub(super) fn residual_deviation(
        &self,
        windows: &[Segment],
        theta: &DVector<f64>,
    ) -> Vec<DVector<f64>> {
        let p = self.deviation[0].len() as f64;
        let s = self.modes[0].e.ncols();
        let n = self.modes[0].a.nrows();
        let free = |window: &Segment| {
            let nuisance = n + window.waves.ncols() * s;
            1.0 - nuisance as f64 / (p * window.modes.len() as f64)
        };
        let squares = self.squares(windows, theta);
        let each = squares.into_iter().enumerate().map(|(mode, squares)| {
            let of_window = |window: &Segment| {
                free(window) * samples_of(std::slice::from_ref(window), mode) as f64
            };
            let free: f64 = windows.iter().map(of_window).sum();
            squares.map(|sum| (sum / free).sqrt().max(f64::MIN_POSITIVE.sqrt()))
        });
        each.collect()
    }

    /// Standard deviation of each sensor's noise (p) in each mode: but for it the residual moves slowly, so that it
    /// is what one sample differs from the next by.
    pub(super) fn noise(&self, windows: &[Segment], theta: &DVector<f64>) -> Vec<DVector<f64>> {
        let p = self.deviation[0].len();
        let modes = self.matrices(theta);
        let mut sums = vec![(DVector::<f64>::zeros(p), 0.0_f64); modes.len()];
        for window in windows {
            let residual = self.explain(window, &modes).residual;
            let samples: Vec<&[f64]> = residual.as_slice().chunks_exact(p).collect();
            for (pair, mode) in samples.windows(2).zip(window.modes.windows(2)) {
                let [one, next] = [mode[0], mode[1]];
                if one == next {
                    let steps = pair[0]
                        .iter()
                        .zip(pair[1])
                        .map(|(before, after)| after - before);
                    let steps =
                        DVector::from_iterator(p, steps).component_mul(&self.deviation[one]);
                    sums[one].0 += steps.component_mul(&steps);
                    sums[one].1 += 2.0;
                }
            }
        }
        let each = sums.into_iter();
        each.map(|(sum, count)| sum.map(|sum| (sum / count.max(1.0)).sqrt()))
            .collect()
    }

    /// 100 (1 - |y - fitted| / |y - mean|) of each output in each mode over the windows.
    pub(super) fn percent(&self, windows: &[Segment], theta: &DVector<f64>) -> Vec<Vec<f64>> {
        let squares = self.squares(windows, theta);
        let each = squares.iter().enumerate().map(|(mode, squares)| {
            let read = |q: usize| {
                let windows = windows.iter().flat_map(move |window| {
                    let of = window
                        .modes
                        .iter()
                        .zip(window.y.row(q).iter().copied().collect::<Vec<_>>());
                    of.filter(|(of, _)| **of == mode)
                        .map(|(_, y)| y)
                        .collect::<Vec<_>>()
                });
                DVector::from_vec(windows.collect::<Vec<_>>())
            };
            let outputs = squares.iter().enumerate().map(|(q, squares)| {
                let read = read(q);
                let all = read.add_scalar(-read.mean()).norm_squared();
                100.0 * (1.0 - (squares / all.max(f64::MIN_POSITIVE)).sqrt())
            });
            outputs.collect()
        });
        each.collect()
    }
}
