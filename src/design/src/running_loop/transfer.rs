//! Bumpless transfer: an offset `b` on the command that makes it continuous at a switch.
//!
//! At a switch `b` becomes what lets the command repeat its last value, and shrinks by
//! [`TRANSFER_DECAY`] a sample from then on. Under arbitrary switching that alone would undo every
//! proof: switched at each sample, the command would never move. Hence a switch resets the offset
//! only when [`TransferCertificate::samples`] have passed since the last reset; at others the command
//! may jump while the offset goes on shrinking.
//!
//! With `X = [x~; e; b; u_last]`, the step `F_i` of mode `i` and the reset `J_i`,
//!
//! ```text
//! F_i' P F_i < rho^2 P      (F_i J_i)' P (F_i J_i) < mu rho^2 P      tau >= ln mu / (-2 ln rho)
//! ```
//!
//! prove it: between resets the function shrinks by more than a reset lets it grow. With one `P` for
//! each mode (under `dwell`) the second inequality has `P` of the mode left on its right, and each mode must
//! last for `tau` samples.

use super::model::Loop;
use super::subject::Subject;
use crate::Lyapunov;
use crate::blocks::{BlockKind, BlockName};
use crate::certificate::{CertificateError, Coordinates, Enclosure, FactoredLyapunov, require};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// What is left of the offset after a sample.
pub const TRANSFER_DECAY: f64 = 0.5;

/// What proves bumpless transfer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct TransferCertificate {
    /// `rho`: the function shrinks by its square in a sample.
    pub decay: f64,
    /// `mu`: what a reset lets it grow by.
    pub mu: f64,
    /// One matrix for all modes, or one per mode.
    pub lyapunov: Vec<FactoredLyapunov>,
}

/// A step of the loop with its offset.
pub(super) struct Step {
    /// Mode that is active.
    pub mode: usize,
    /// Without a reset.
    pub plain: Enclosure,
    /// After a reset on entering the mode.
    pub reset: Enclosure,
}

pub(super) fn steps(subject: &Subject) -> Vec<Step> {
    let pairs = subject.models.pairs(&subject.observer.observer);
    pairs
        .iter()
        .map(|(mode, _, model)| step(*mode, model))
        .collect()
}

fn step(mode: usize, model: &Loop) -> Step {
    let (size, inputs) = model.input.shape();
    let identity = |scale: f64| Enclosure::exact(DMatrix::identity(inputs, inputs) * scale);
    let zero = Enclosure::zeros(inputs, inputs);
    let wide = Enclosure::zeros(inputs, size);
    let tall = Enclosure::zeros(size, inputs);
    let (one, shrunk) = (identity(1.0), identity(TRANSFER_DECAY));
    let command = &model.command.0;
    let plain = Enclosure::blocks(&[
        vec![&model.a, &model.input, &tall],
        vec![&wide, &shrunk, &zero],
        vec![command, &one, &zero],
    ]);
    // With b = u_last - c X, the command is u_last.
    let held = &model.a - &(&model.input * command);
    let released = (&shrunk * command).negative();
    let reset = Enclosure::blocks(&[
        vec![&held, &tall, &model.input],
        vec![&released, &zero, &shrunk],
        vec![&wide, &zero, &one],
    ]);
    Step { mode, plain, reset }
}

impl TransferCertificate {
    /// Whether each mode must last for that many samples; else modes may change at any.
    pub fn needs_dwell(&self) -> bool {
        self.lyapunov.len() > 1
    }

    /// Samples that must pass between resets (and where modes have to last, between switches).
    pub fn samples(&self) -> usize {
        let samples = self.mu.max(1.0).ln() / (-2.0 * self.decay.ln()) * (1.0 + 1e-12);
        // The cast saturates.
        (samples.ceil() as usize).max(1)
    }
}

/// Proves bumpless transfer.
pub(super) fn prove(
    subject: &Subject,
    certificate: &TransferCertificate,
) -> Result<(), CertificateError> {
    let steps = steps(subject);
    let size = steps[0].plain.shape().0;
    let lyapunov = &certificate.lyapunov;
    let each = lyapunov.len() > 1;
    let dwell = subject.control.spec.lyapunov == Lyapunov::Dwell
        || subject.observer.spec.lyapunov == Lyapunov::Dwell;
    let sized = lyapunov
        .iter()
        .all(|m| [m.basis.shape(), m.core.shape()] == [(size, size); 2]);
    require(&[(
        sized
            && (lyapunov.len() == 1 || (dwell && lyapunov.len() == subject.modes()))
            && certificate.decay > 0.0
            && certificate.decay < 1.0
            && certificate.mu >= 1.0,
        "the proof of bumpless transfer does not have the sizes of the loop",
    )])?;
    let unproved = |mode: usize, next: usize| {
        CertificateError::Unproved(BlockName::new(BlockKind::Transfer, mode, next))
    };
    let coordinates: Vec<Coordinates> = lyapunov
        .iter()
        .map(Coordinates::new)
        .collect::<Option<_>>()
        .ok_or_else(|| unproved(0, 0))?;
    let of = |mode: usize| &coordinates[if each { mode } else { 0 }];
    let shrunk = Enclosure::square_times_identity(certificate.decay, size);
    let mu = Enclosure::exact(DMatrix::from_diagonal_element(size, size, certificate.mu));
    let grown = &mu * &shrunk;
    for step in &steps {
        let own = of(step.mode);
        if !shrinks(&step.plain, own, own, &shrunk) {
            return Err(unproved(step.mode, step.mode));
        }
        let left = (0..subject.modes()).filter(|&mode| !each || mode != step.mode);
        for before in left.take(if each { usize::MAX } else { 1 }) {
            if !shrinks(&step.reset, of(before), own, &grown) {
                return Err(unproved(before, step.mode));
            }
        }
    }
    Ok(())
}

/// `[factor S (A S)'; . S_after]`: the function after the map is below `factor` times that before.
fn shrinks(map: &Enclosure, before: &Coordinates, after: &Coordinates, factor: &Enclosure) -> bool {
    let reduced = factor * before.whole();
    Enclosure::symmetric_blocks(&[
        vec![reduced.symmetric_part()],
        vec![before.after(&after.seen(map)), after.whole().clone()],
    ])
    .is_positive_definite()
}
