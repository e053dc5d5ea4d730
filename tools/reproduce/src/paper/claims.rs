//! What the paper says, what is found, and why.

use super::printed::{self, Absorption, DoubledDisturbance, Latency};
use super::reachable::{REPORTED, largest_variance};
use super::{ControllerKind, NOISES, REFERENCES, Record};
use crate::Error;
use ftc_design::as_printed::PrintedVerdict;
use report::text::{aligned, number};
use serde::Serialize;

/// The numbers behind the claims, and the claims in words.
#[derive(Serialize)]
pub struct Claims {
    /// Theorem 1 (10) and Theorem 2 (36) as printed.
    pub theorems: [PrintedVerdict; 2],
    /// The sliding window under a fault that stays.
    pub sliding_window: Absorption,
    /// The disturbance that drives the integrator too.
    pub doubled_disturbance: DoubledDisturbance,
    /// One sample of delay.
    pub latency: Latency,
    /// The largest variance of the output that fits the reported figures.
    pub largest_variance: f64,
    /// In words.
    pub words: Vec<Claim>,
}

/// One row of the table.
#[derive(Serialize)]
pub struct Claim {
    /// What it is about, with equation numbers.
    pub subject: String,
    /// What the paper says.
    pub paper: String,
    /// What is found.
    pub found: String,
    /// Why.
    pub why: String,
}

fn claim(
    subject: impl Into<String>,
    paper: impl Into<String>,
    found: impl Into<String>,
    why: impl Into<String>,
) -> Claim {
    Claim {
        subject: subject.into(),
        paper: paper.into(),
        found: found.into(),
        why: why.into(),
    }
}

impl Claims {
    /// Puts every printed result to the test.
    pub fn find(record: &Record) -> Result<Self, Error> {
        let mut claims = Self {
            theorems: printed::theorems()?,
            sliding_window: printed::absorption(),
            doubled_disturbance: printed::doubled_disturbance()?,
            latency: printed::latency()?,
            largest_variance: largest_variance(),
            words: Vec::new(),
        };
        claims.words = vec![
            claims.theorem(0, "Theorem 1, (10)"),
            claims.theorem(1, "Theorem 2, (21) and (36)"),
            claims.disturbance(),
            claims.window(),
            estimation(record),
            compensation(record),
            metrics(record),
            claims.reported(record),
            claims.delay(),
        ];
        Ok(claims)
    }

    fn theorem(&self, index: usize, name: &str) -> Claim {
        let verdict = &self.theorems[index];
        let rounding = if verdict.margin.abs() < 1e-8 {
            ", zero but for rounding"
        } else {
            ""
        };
        let found = format!(
            "{}: the best margin of its inequalities is {}{rounding}",
            if verdict.feasible {
                "feasible"
            } else {
                "no strictly feasible point"
            },
            number(verdict.margin)
        );
        claim(
            name,
            "its solution gives the control gains",
            found,
            verdict.reason,
        )
    }

    fn disturbance(&self) -> Claim {
        let found = match self.doubled_disturbance.printed {
            Some(gamma) => format!(
                "taken at its word it attenuates to γ = {}; as it is, γ = {}",
                aligned(gamma, 4),
                aligned(self.doubled_disturbance.corrected, 4)
            ),
            None => format!(
                "taken at its word nothing attenuates it; as it is, γ = {}",
                aligned(self.doubled_disturbance.corrected, 4)
            ),
        };
        claim(
            "Augmented disturbance, (24)",
            "the disturbance enters as diag(E, E): the integrator gets a copy of its own",
            found,
            "the integrator sums y_r − y, so a disturbance reaches it through the output only: −Te S F w",
        )
    }

    fn window(&self) -> Claim {
        let window = &self.sliding_window;
        claim(
            "Sliding window, (44)–(46)",
            "the projection estimates the fault rapidly and accurately",
            format!(
                "a step of {} under constant input reads {} at once, {} after {} samples and {} once it fills the window of {}",
                number(window.fault),
                aligned(window.first, 3),
                aligned(window.after, 3),
                window.later,
                aligned(window.full, 3),
                window.window
            ),
            "the window projects on what its own inputs cannot explain; a fault that stays becomes part of the \
             window and is taken for normal. Built here: a window that is known to be healthy, as (55)–(60) need",
        )
    }

    fn reported(&self, record: &Record) -> Claim {
        let names = |wanted: &dyn Fn(&super::reachable::Reference) -> bool| {
            let names = record.references.iter().filter(|r| wanted(r));
            let names: Vec<String> = names.map(|r| r.name.to_string()).collect();
            if names.is_empty() {
                "none".into()
            } else {
                report::text::list(&names)
            }
        };
        claim(
            "MSE and VAF, (63), (64)",
            format!(
                "MSE {}, VAF {} %, for a reference that is not given",
                number(REPORTED.mse),
                number(REPORTED.vaf)
            ),
            format!(
                "both at once need var(y) ≤ {}. At least as good in both: {}; out of reach of every controller: {}",
                aligned(self.largest_variance, 3),
                names(&|r| r.reached()),
                names(&|r| !r.error_possible() || r.is_constant()),
            ),
            "var(e) ≤ MSE, so var(y) = var(e) / (1 − VAF) is bounded. A jump of height h costs h²/N of MSE in \
             the one sample the plant needs; about a constant reference VAF is 0 by definition",
        )
    }

    fn delay(&self) -> Claim {
        let latency = &self.latency;
        let radius = latency.ignored.iter().copied().fold(0.0, f64::max);
        let yes = |feasible: bool| if feasible { "feasible" } else { "infeasible" };
        let dwell = match (latency.dwell, latency.gamma) {
            (Some(samples), Some(gamma)) => format!(
                "proved mode by mode it works while modes last longer than {} samples (γ = {})",
                aligned(samples, 1),
                aligned(gamma, 3)
            ),
            _ => "proved mode by mode it is infeasible as well".into(),
        };
        claim(
            "Latency",
            "not mentioned: a command acts on the sample it was computed from",
            format!(
                "one sample late, the same gains give a spectral radius of {}. Designed for it, one Lyapunov \
                 function for all modes is {}, one per mode under arbitrary switching {}; {dwell}",
                aligned(radius, 3),
                yes(latency.common),
                yes(latency.switched),
            ),
            "the second mode permutes the inputs of the first, so a command decided in one mode is the wrong \
             one in the other; two FMUs stepped in parallel have exactly this delay",
        )
    }
}

fn range(record: &Record, controller: ControllerKind) -> String {
    format!(
        "{} to {} times",
        number(record.best_over_told(controller)),
        number(record.worst_over_told(controller))
    )
}

fn estimation(record: &Record) -> Claim {
    claim(
        "Fault estimate in the loop",
        "accurate estimation allows tracking and fault tolerance",
        format!(
            "true MSE over that of a controller told the fault: additive FTC with the window as printed {}, \
             with the reference window {}; proposed, at most {} times",
            range(record, ControllerKind::AdditiveSliding),
            range(record, ControllerKind::AdditiveReference),
            aligned(record.worst_over_told(ControllerKind::Proposed), 4)
        ),
        "the loop feeds the printed window inputs that the fault has already changed; the healthy database does not depend on them",
    )
}

fn compensation(record: &Record) -> Claim {
    claim(
        "Additive control, (37)–(40)",
        "u_adc = −K C⁺ f̂ − G f̃ takes the fault out of the loop",
        format!(
            "with the proposed gains and estimates, {} the true MSE of a controller told the fault; the same estimate \
             taken out of the measurement: at most {} times",
            range(record, ControllerKind::PrintedCompensation),
            aligned(record.worst_over_told(ControllerKind::Proposed), 4)
        ),
        "it is exact only where the state estimate is C⁺y at every instant; an observer with memory leaves a \
         transient at each edge of the fault, and f̃ keeps every error of f̂ for ever",
    )
}

/// Measured and true error without any fault tolerance, square reference, disturbance on the state.
fn metrics(record: &Record) -> Claim {
    let row = record.run("state", REFERENCES[1], NOISES[0], ControllerKind::NoFtc);
    let first = row.and_then(|run| run.outputs.first());
    let (measured, truth) = first.map_or((f64::NAN, f64::NAN), |m| {
        (m.measured.mse, m.true_output.mse)
    });
    claim(
        "Which y, (63), (64)",
        "y is the measured output; whether it contains the fault is not said",
        format!(
            "without any FTC and a square reference the first output has a measured MSE of {}, and a true one of {}",
            number(measured),
            number(truth)
        ),
        "integral action makes a faulty sensor follow the reference; what is wrong is the plant. Both are given \
         here, and compared is the true one",
    )
}
