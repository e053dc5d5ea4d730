//! Gains of a fixed linear loop: found in floating point, proved from enclosures.
//!
//! The proof of an l2 gain is the bounded-real lemma with a Lyapunov matrix `S`; that of the response
//! to white noise the Lyapunov inequality. A stated level needs nothing else: the matrix that proves it
//! comes from a Riccati or Lyapunov equation at that very level, and only its proof is trusted.

use super::frequency::Response;
use crate::certificate::{Coordinates, Enclosure, FactoredLyapunov};
use crate::riccati;
use crate::units::power_of_two;
use nalgebra::DMatrix;

/// One channel of a loop: `x+ = a x + b w`, `z = c x + d w`.
pub(crate) struct Channel<'a> {
    pub a: &'a Enclosure,
    pub b: &'a Enclosure,
    pub c: &'a Enclosure,
    pub d: &'a Enclosure,
}

/// A channel in coordinates of its own, `x = basis xi`.
struct Normalised {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    basis: DMatrix<f64>,
}

/// Strictness of the matrix that is sought, relative to coordinates in which it is near one; the
/// first that proves the level is taken.
const STRICTNESS: [f64; 3] = [1e-3, 1e-4, 1e-5];

/// By how much a level may lie above the norm, tried in turn.
const ALLOWANCES: [f64; 11] = [2e-4, 1e-3, 2e-3, 5e-3, 0.01, 0.02, 0.05, 0.1, 0.3, 1.0, 3.0];

/// By how much the energy of a response is raised, relatively, to leave room for rounding in its proof.
const ROUNDING: f64 = 1e-6;

/// A gain below this, in the units of the certificate, counts as zero.
const SMALLEST: f64 = 1e-9;

impl Channel<'_> {
    /// Whether the l2 gain is proved to be at most `level`.
    pub fn proves(&self, level: f64) -> bool {
        let normalised = self.normalised();
        normalised.is_some_and(|normalised| self.proves_in(&normalised, level))
    }

    /// The same in given coordinates.
    fn proves_in(&self, normalised: &Normalised, level: f64) -> bool {
        STRICTNESS.iter().any(|&strictness| {
            let Some(basis) = self.storage_in(normalised, level, strictness) else {
                return false;
            };
            let core = DMatrix::identity(basis.nrows(), basis.nrows());
            self.proves_with(level, &FactoredLyapunov { basis, core }, None)
        })
    }

    /// The same with a given `S` of this mode, and that of the next where it is another one.
    pub fn proves_with(
        &self,
        level: f64,
        own: &FactoredLyapunov,
        next: Option<&FactoredLyapunov>,
    ) -> bool {
        let (Some(own), next) = (Coordinates::new(own), next.map(Coordinates::new)) else {
            return false;
        };
        let next = match &next {
            Some(Some(next)) => next,
            Some(None) => return false,
            None => &own,
        };
        if level.is_nan() || level <= 0.0 {
            return false;
        }
        self.block(level, &own, next).is_positive_definite()
    }

    /// `[S (A S)' (C S)'; . gamma^2 I B' D'; . . S_next; . . . I]` with the disturbance in units of
    /// about `gamma`.
    fn block(&self, level: f64, own: &Coordinates, next: &Coordinates) -> Enclosure {
        let unit = power_of_two(level);
        let (size, inputs) = self.b.shape();
        let signals = self.c.shape().0;
        let scaled = |matrix: &Enclosure| {
            matrix.in_units(&vec![1.0; matrix.shape().0], &vec![1.0 / unit; inputs])
        };
        Enclosure::symmetric_blocks(&[
            vec![own.whole().clone()],
            vec![
                Enclosure::zeros(inputs, size),
                Enclosure::square_times_identity(level / unit, inputs),
            ],
            vec![
                own.after(&next.seen(self.a)),
                next.seen(&scaled(self.b)),
                next.whole().clone(),
            ],
            vec![
                own.after(self.c),
                scaled(self.d),
                Enclosure::zeros(signals, size),
                Enclosure::exact(DMatrix::identity(signals, signals)),
            ],
        ])
    }

    /// `L` with `S = L L'`, the inverse of the storage function of the bounded-real lemma at `level`
    /// for a performance signal enlarged by `strictness`.
    pub(super) fn storage(&self, level: f64, strictness: f64) -> Option<DMatrix<f64>> {
        self.storage_in(&self.normalised()?, level, strictness)
    }

    fn storage_in(
        &self,
        normalised: &Normalised,
        level: f64,
        strictness: f64,
    ) -> Option<DMatrix<f64>> {
        // The disturbance in units of the level, and coordinates smaller by as much.
        let (a, b) = (&normalised.a, &normalised.b);
        let (c, d) = (&normalised.c / level, self.d.midpoint() / level);
        let (n, inputs) = b.shape();
        let room = DMatrix::identity(inputs, inputs) - d.tr_mul(&d);
        let room = room.cholesky()?.inverse();
        let feedback = &room * d.tr_mul(&c);
        let cost = c.tr_mul(&c) + c.tr_mul(&d) * &feedback;
        let storage = riccati::solve(
            &(a + b * feedback),
            &(-(b * &room * b.transpose())),
            &(riccati::symmetric(cost) + DMatrix::identity(n, n) * (strictness * strictness)),
        )?;
        let root = storage.cholesky()?.unpack();
        Some(&normalised.basis * root.transpose().try_inverse()? / level)
    }

    /// Coordinates in which the disturbance reaches every direction alike.
    fn normalised(&self) -> Option<Normalised> {
        let (a, b) = (self.a.midpoint(), self.b.midpoint());
        let n = a.nrows();
        let reach = b * b.transpose();
        let floor = 1e-6 * reach.amax().max(f64::MIN_POSITIVE.sqrt());
        let gramian =
            riccati::lyapunov(&a.transpose(), &(reach + DMatrix::identity(n, n) * floor))?;
        let basis = gramian.cholesky()?.unpack();
        Some(Normalised {
            a: basis.solve_lower_triangular(&(a * &basis))?,
            b: basis.solve_lower_triangular(b)?,
            c: self.c.midpoint() * &basis,
            basis,
        })
    }

    /// The response over frequency; `None` where a number is not finite.
    pub fn response(&self) -> Option<Response> {
        let parts = [self.a, self.b, self.c, self.d].map(Enclosure::midpoint);
        let finite = parts.iter().all(|part| part.iter().all(|x| x.is_finite()));
        let [a, b, c, d] = parts;
        finite.then(|| Response::new(a, b, c, d))
    }

    /// A lower bound of the l2 gain, the peak of the response on a grid (see [`Response::norm`]).
    pub fn norm(&self) -> f64 {
        self.response().map_or(f64::INFINITY, |found| found.norm())
    }

    /// The least of the tried levels that is proved; `None` where none is.
    pub fn level(&self) -> Option<f64> {
        let norm = self.norm().max(SMALLEST);
        let normalised = self.normalised()?;
        let mut levels = ALLOWANCES.iter().map(|allowance| norm * (1.0 + allowance));
        levels.find(|&level| level.is_finite() && self.proves_in(&normalised, level))
    }

    /// Root of the mean square of the signal under white noise of deviation one in every input:
    /// floating point, no direct way.
    pub fn noise(&self) -> Option<f64> {
        let (a, b, c) = (self.a.midpoint(), self.b.midpoint(), self.c.midpoint());
        let covariance = riccati::lyapunov(&a.transpose(), &(b * b.transpose()))?;
        let direct = self.d.midpoint();
        Some(((c * covariance * c.transpose()).trace() + direct.norm_squared()).sqrt())
    }

    /// Whether that root is proved to be at most `level`; only for a channel with no direct way.
    pub fn proves_noise(&self, level: f64) -> bool {
        let Some(lyapunov) = self.observability(level) else {
            return false;
        };
        let Some(own) = Coordinates::new(&lyapunov) else {
            return false;
        };
        let unit = power_of_two(level);
        let (size, inputs) = self.b.shape();
        let signals = self.c.shape().0;
        let scale = vec![1.0 / unit; signals];
        let decay = Enclosure::symmetric_blocks(&[
            vec![own.whole().clone()],
            vec![own.after(&own.seen(self.a)), own.whole().clone()],
            vec![
                own.after(&self.c.in_units(&scale, &vec![1.0; size])),
                Enclosure::zeros(signals, size),
                Enclosure::exact(DMatrix::identity(signals, signals)),
            ],
        ]);
        let seen = own.seen(self.b);
        let energy = seen.midpoint().tr_mul(seen.midpoint());
        let floor = ROUNDING * energy.trace() / inputs as f64 + f64::MIN_POSITIVE.sqrt();
        let raised = riccati::symmetric(energy * (1.0 + ROUNDING));
        let energy = raised + DMatrix::identity(inputs, inputs) * floor;
        let trace = energy.trace() * (1.0 + 1e-12);
        let bound = Enclosure::symmetric_blocks(&[
            vec![Enclosure::exact(energy)],
            vec![seen, own.whole().clone()],
        ]);
        self.d.midpoint().amax() == 0.0
            && self.d.radius().amax() == 0.0
            && trace <= (level / unit) * (level / unit)
            && decay.is_positive_definite()
            && bound.is_positive_definite()
    }

    /// `S` whose inverse solves `P = A'P A + C'C` for a signal, in units of `level`, enlarged a little.
    fn observability(&self, level: f64) -> Option<FactoredLyapunov> {
        let Normalised { a, c, basis, .. } = self.normalised()?;
        let c = c / power_of_two(level);
        let n = a.nrows();
        let room = 1e-3 * c.norm_squared() / n as f64;
        let cost = riccati::symmetric(c.tr_mul(&c)) + DMatrix::identity(n, n) * room;
        let root = riccati::lyapunov(&a, &cost)?.cholesky()?.unpack();
        Some(FactoredLyapunov {
            basis: basis * root.transpose().try_inverse()?,
            core: DMatrix::identity(n, n),
        })
    }

    /// The least of the tried levels of the response to white noise that is proved.
    pub fn noise_level(&self) -> Option<f64> {
        let norm = self.noise()?.max(SMALLEST);
        let mut levels = ALLOWANCES.iter().map(|allowance| norm * (1.0 + allowance));
        levels.find(|&level| level.is_finite() && self.proves_noise(level))
    }
}
