//! What is claimed of the running loop under arbitrary switching, and its proof.

use super::subject::{Claim, Subject};
use crate::blocks::{BlockKind, BlockName};
use crate::certificate::{CertificateError, FactoredLyapunov, require};
use serde::{Deserialize, Serialize};

/// A gain that holds under arbitrary switching.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SwitchingGain {
    /// The gain.
    pub gamma: f64,
    /// One Lyapunov matrix of the whole loop for all modes, or one per mode.
    pub lyapunov: Vec<FactoredLyapunov>,
}

/// Proves the gain again.
pub(super) fn prove_switching(
    subject: &Subject,
    switching: &SwitchingGain,
) -> Result<(), CertificateError> {
    let loops = subject.models.switching(&subject.observer.observer);
    let arbitrary = subject.control.spec.lyapunov != crate::Lyapunov::Dwell
        && subject.observer.spec.lyapunov != crate::Lyapunov::Dwell;
    let size = |matrix: &FactoredLyapunov| [matrix.basis.shape(), matrix.core.shape()];
    let lyapunov = &switching.lyapunov;
    let Some(loops) = loops.filter(|_| arbitrary) else {
        return require(&[(
            false,
            "a gain is claimed under a switching that is not proved",
        )]);
    };
    let n = loops[0].2.a.shape().0;
    require(&[(
        (lyapunov.len() == 1 || lyapunov.len() == subject.modes())
            && lyapunov.iter().all(|matrix| size(matrix) == [(n, n); 2])
            && switching.gamma.is_finite(),
        "the Lyapunov matrices of the running loop do not have its size",
    )])?;
    let matrix = |mode: usize| &lyapunov[if lyapunov.len() == 1 { 0 } else { mode }];
    for (i, j, model) in &loops {
        let scaled = subject.scaled(model, &Claim::Disturbance);
        let level = switching.gamma / scaled.unit;
        let followers: Vec<usize> = match lyapunov.len() > 1 && i == j {
            true => (0..subject.modes()).collect(),
            false => vec![*j],
        };
        for next in followers {
            let after = (lyapunov.len() > 1).then(|| matrix(next));
            if !scaled.channel().proves_with(level, matrix(*i), after) {
                let name = BlockName::new(BlockKind::RunningLoop, *i, next);
                return Err(CertificateError::Unproved(name));
            }
        }
    }
    Ok(())
}
