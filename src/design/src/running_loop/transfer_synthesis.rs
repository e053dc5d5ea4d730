//! The least time between resets of bumpless transfer that can be proved.

use super::subject::Subject;
use super::transfer::{Step, TRANSFER_DECAY, TransferCertificate, prove, steps};
use crate::Lyapunov;
use crate::blocks::{BlockKind, BlockName};
use crate::certificate::{FactoredLyapunov, largest_ratio};
use crate::lmi::{Inequality, Problem};
use crate::riccati;
use nalgebra::DMatrix;

/// Shares of what the slowest rate leaves to 1 that are tried as decay of the function.
const SHARES: [f64; 3] = [0.5, 0.25, 0.8];

/// Logarithms of the growth at a reset that are tried for one function.
const GROWTHS: [f64; 9] = [1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 18.0, 27.0];

/// Above this margin an inequality counts as strict.
const SMALLEST_MARGIN: f64 = 1e-9;

/// A proof of bumpless transfer; none where none is found.
pub(super) fn certify(subject: &Subject) -> Option<TransferCertificate> {
    let steps = steps(subject);
    let dwell = subject.control.spec.lyapunov == Lyapunov::Dwell
        || subject.observer.spec.lyapunov == Lyapunov::Dwell;
    let slowest = subject
        .control
        .spec
        .decay
        .max(subject.observer.spec.decay)
        .max(TRANSFER_DECAY);
    let found = SHARES.iter().filter_map(|share| {
        let decay = 1.0 - share * (1.0 - slowest);
        match dwell {
            true => for_each_mode(subject, &steps, decay),
            false => for_all(subject, &steps, decay),
        }
    });
    found.min_by_key(TransferCertificate::samples)
}

/// Raises `mu` until it can be proved.
fn proved(
    subject: &Subject,
    decay: f64,
    mu: f64,
    lyapunov: Vec<FactoredLyapunov>,
) -> Option<TransferCertificate> {
    [1e-9, 1e-6, 1e-3, 0.1].iter().find_map(|allowance| {
        let mu = mu.max(1.0) * (1.0 + allowance);
        let candidate = TransferCertificate {
            decay,
            mu,
            lyapunov: lyapunov.clone(),
        };
        prove(subject, &candidate).is_ok().then_some(candidate)
    })
}

/// `S = L L'` for the function `x' P x`, `P = (basis^-1)' core (basis^-1)`.
fn factored(basis: &DMatrix<f64>, core: &DMatrix<f64>) -> Option<FactoredLyapunov> {
    let root = core.clone().cholesky()?.unpack();
    Some(FactoredLyapunov {
        basis: basis * root.transpose().try_inverse()?,
        core: DMatrix::identity(root.nrows(), root.nrows()),
    })
}

/// One function per mode, from the Lyapunov equation.
fn for_each_mode(subject: &Subject, steps: &[Step], decay: f64) -> Option<TransferCertificate> {
    let size = steps[0].plain.shape().0;
    let identity = DMatrix::<f64>::identity(size, size);
    let own = |mode: usize| steps.iter().find(|step| step.mode == mode);
    let functions: Vec<DMatrix<f64>> = (0..subject.modes())
        .map(|mode| {
            let map = own(mode)?.plain.midpoint() / (decay * (1.0 - 1e-9));
            riccati::lyapunov(&map, &identity)
        })
        .collect::<Option<_>>()?;
    let mut mu = 1.0_f64;
    for step in steps {
        for before in (0..subject.modes()).filter(|&before| before != step.mode) {
            let map = step.reset.midpoint() / decay;
            let after = riccati::symmetric(map.transpose() * &functions[step.mode] * &map);
            mu = mu.max(largest_ratio(&after, &functions[before])?);
        }
    }
    let lyapunov = functions
        .iter()
        .map(|function| factored(&identity, function));
    proved(subject, decay, mu, lyapunov.collect::<Option<_>>()?)
}

/// One function for all modes, the least growth of those tried.
fn for_all(subject: &Subject, steps: &[Step], decay: f64) -> Option<TransferCertificate> {
    let size = steps[0].plain.shape().0;
    let identity = DMatrix::<f64>::identity(size, size);
    // Coordinates in which the mean function of the modes on their own is the identity.
    let mut mean = DMatrix::zeros(size, size);
    for step in steps {
        mean += riccati::lyapunov(&(step.plain.midpoint() / decay), &identity)?;
    }
    let inverse = riccati::symmetric(mean).cholesky()?.unpack().transpose();
    let basis = inverse.clone().try_inverse()?;
    let seen = |map: &DMatrix<f64>| &inverse * map * &basis;
    let plain: Vec<_> = steps.iter().map(|s| seen(s.plain.midpoint())).collect();
    let reset: Vec<_> = steps.iter().map(|s| seen(s.reset.midpoint())).collect();
    GROWTHS.iter().find_map(|growth: &f64| {
        let mu = growth.exp();
        let function = common(&plain, &reset, decay * (1.0 - 1e-9), mu * (1.0 - 1e-9))?;
        proved(subject, decay, mu, vec![factored(&basis, &function)?])
    })
}

/// One `P` that shrinks by `decay^2` under every plain step, and grows by no more than `mu decay^2` under
/// every reset.
fn common(
    plain: &[DMatrix<f64>],
    reset: &[DMatrix<f64>],
    decay: f64,
    mu: f64,
) -> Option<DMatrix<f64>> {
    let size = plain[0].nrows();
    let mut problem = Problem::new();
    let unknown = problem.symmetric(size);
    let name = || BlockName::new(BlockKind::Transfer, 0, 0);
    problem.require(Inequality::new(
        name(),
        vec![vec![Some(unknown.expression())]],
    ));
    let plain = plain.iter().map(|map| map / decay);
    let reset = reset.iter().map(|map| map / (decay * mu.sqrt()));
    for map in plain.chain(reset) {
        let after = &map.transpose() * unknown.expression() * &map;
        let left = unknown.expression() - after;
        problem.require(Inequality::new(name(), vec![vec![Some(left)]]));
    }
    problem.require_trace(&[unknown.expression()], size as f64);
    let margin = problem.margin().ok()?;
    (margin.margin > SMALLEST_MARGIN).then(|| riccati::symmetric(unknown.value(&margin.scalars)))
}
