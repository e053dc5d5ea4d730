//! Which references reach the paper's MSE and VAF, which cannot, and why.

use super::{ControllerKind, OutputMerits};
use ftc_simulate::Trajectory;
use ftc_simulate::metrics::{Merit, merit, variance};
use serde::Serialize;

/// The figures the paper reports for its proposed controller, without its reference.
pub const REPORTED: Merit = Merit {
    mse: 0.0028,
    vaf: 98.39,
};

/// The largest variance the paper's output can have had: `var(y) = var(e) / (1 - VAF)`, and
/// `var(e) <= MSE`.
pub fn largest_variance() -> f64 {
    REPORTED.mse / (1.0 - REPORTED.vaf / 100.0)
}

/// One reference against the reported figures; the first output stands for both.
#[derive(Clone, Debug, Serialize)]
pub struct Reference {
    /// Its name.
    pub name: &'static str,
    /// Its variance.
    pub variance: f64,
    /// The response one sample late: where the reference jumps, no causal controller has a smaller
    /// mean square error.
    pub deadbeat: Merit,
    /// The controller told the fault.
    pub told: Merit,
    /// The proposed controller.
    pub proposed: Merit,
}

/// A variance below this is rounding: the references are of the order of one.
const NO_VARIANCE: f64 = 1e-12;

impl Reference {
    /// Takes the first output of the runs without noise.
    pub fn new(
        name: &'static str,
        signals: &[Vec<f64>],
        found: &[(ControllerKind, Vec<OutputMerits>)],
    ) -> Self {
        let nothing = Merit {
            mse: f64::NAN,
            vaf: f64::NAN,
        };
        let of = |who: ControllerKind| {
            let mut all = found.iter().filter(|(controller, _)| *controller == who);
            let merits = all.next().and_then(|(_, merits)| merits.first());
            merits.map_or(nothing, |merits| merits.true_output)
        };
        let reference = signals.first().map_or(&[][..], |signal| signal);
        let late: Vec<f64> = std::iter::once(0.0)
            .chain(reference.iter().copied())
            .take(reference.len())
            .collect();
        Self {
            name,
            variance: variance(reference),
            deadbeat: merit(&late, reference),
            told: of(ControllerKind::ToldTheFault),
            proposed: of(ControllerKind::Proposed),
        }
    }

    /// Whether it stays where it is.
    pub fn is_constant(&self) -> bool {
        self.variance < NO_VARIANCE
    }

    /// Whether some causal controller may reach the reported error.
    pub fn error_possible(&self) -> bool {
        self.deadbeat.mse <= REPORTED.mse
    }

    /// Whether the response one sample late reaches the reported VAF.
    pub fn vaf_possible(&self) -> bool {
        self.deadbeat.vaf >= REPORTED.vaf
    }

    /// Whether the proposed controller is at least as good as both reported figures.
    pub fn reached(&self) -> bool {
        self.proposed.mse <= REPORTED.mse && self.proposed.vaf >= REPORTED.vaf
    }

    /// What holds for it, in a sentence.
    pub fn verdict(&self) -> String {
        let both = match (self.error_possible(), self.vaf_possible()) {
            _ if self.is_constant() => {
                "the error is possible, the VAF is 0 with every controller: about a constant reference \
                 the error varies exactly as the output does"
            }
            (false, _) => {
                "no causal controller reaches the error: its jumps cost more in the one sample the plant needs"
            }
            (true, false) => "the error is possible, the VAF is not",
            (true, true) if self.reached() => "both are reached, and surpassed",
            (true, true) => {
                "both are possible in one sample per jump, but not with these gains, which take several"
            }
        };
        let variance = if self.variance > largest_variance() {
            "; but it varies too much for exactly these two figures to come from one run"
        } else {
            ""
        };
        format!("{both}{variance}")
    }
}

/// The reference of each tracked output over time.
pub fn signals(run: &Trajectory) -> Vec<Vec<f64>> {
    let size = run
        .records
        .first()
        .map_or(0, |record| record.reference.len());
    let signal = |index: usize| run.records.iter().map(|r| r.reference[index]).collect();
    (0..size).map(signal).collect()
}
