//! What the fitted matrices leave: of which size, how white, and in percent.

use super::model::GreyBox;
use super::windows::{Window, samples_of};
use nalgebra::DVector;

impl GreyBox<'_> {
    /// Sum of squares of what is left of each output (p) in each mode, output units.
    pub(super) fn squares(&self, windows: &[Window], theta: &DVector<f64>) -> Vec<DVector<f64>> {
        let p = self.deviation[0].len();
        let modes = self.matrices(theta);
        let mut sums = vec![DVector::zeros(p); modes.len()];
        for window in windows {
            let rest = self.explain(window, &modes).rest;
            for (&mode, rest) in window.modes.iter().zip(rest.as_slice().chunks_exact(p)) {
                for (q, value) in rest.iter().enumerate() {
                    sums[mode][q] += (value * self.deviation[mode][q]).powi(2);
                }
            }
        }
        sums
    }

    /// Standard deviation of what is left of each sensor (p) in each mode, output units.
    pub(super) fn unexplained(
        &self,
        windows: &[Window],
        theta: &DVector<f64>,
    ) -> Vec<DVector<f64>> {
        let p = self.deviation[0].len() as f64;
        let s = self.modes[0].e.ncols();
        let n = self.modes[0].a.nrows();
        let free = |window: &Window| {
            let own = n + window.waves.ncols() * s;
            1.0 - own as f64 / (p * window.modes.len() as f64)
        };
        let squares = self.squares(windows, theta);
        let each = squares.into_iter().enumerate().map(|(mode, squares)| {
            let own = |window: &Window| {
                free(window) * samples_of(std::slice::from_ref(window), mode) as f64
            };
            let free: f64 = windows.iter().map(own).sum();
            squares.map(|sum| (sum / free).sqrt().max(f64::MIN_POSITIVE.sqrt()))
        });
        each.collect()
    }

    /// Standard deviation of each sensor's noise (p) in each mode: what is left moves slowly but for it, so that it
    /// is what one sample differs from the next by.
    pub(super) fn noise(&self, windows: &[Window], theta: &DVector<f64>) -> Vec<DVector<f64>> {
        let p = self.deviation[0].len();
        let modes = self.matrices(theta);
        let mut sums = vec![(DVector::<f64>::zeros(p), 0.0_f64); modes.len()];
        for window in windows {
            let rest = self.explain(window, &modes).rest;
            let rests: Vec<&[f64]> = rest.as_slice().chunks_exact(p).collect();
            for (pair, mode) in rests.windows(2).zip(window.modes.windows(2)) {
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
    pub(super) fn percent(&self, windows: &[Window], theta: &DVector<f64>) -> Vec<Vec<f64>> {
        let squares = self.squares(windows, theta);
        let each = squares.iter().enumerate().map(|(mode, left)| {
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
            let outputs = left.iter().enumerate().map(|(q, left)| {
                let read = read(q);
                let all = read.add_scalar(-read.mean()).norm_squared();
                100.0 * (1.0 - (left / all.max(f64::MIN_POSITIVE)).sqrt())
            });
            outputs.collect()
        });
        each.collect()
    }
}
