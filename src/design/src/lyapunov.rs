//! The three guarantees of stability under switching.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Which family of Lyapunov functions proves stability.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[expect(
    clippy::exhaustive_enums,
    reason = "the three guarantees that are proved"
)]
pub enum Lyapunov {
    /// One for all modes: stable under arbitrary switching.
    #[default]
    Common,
    /// One per mode, every pair of modes proved: stable under arbitrary switching, less
    /// conservative (Daafouz, Riedinger, Iung 2002).
    Switched,
    /// One per mode, each mode proved on its own: stable when modes last long enough on average.
    Dwell,
}

impl Lyapunov {
    /// How many Lyapunov matrices `modes` modes need.
    pub fn matrices(self, modes: usize) -> usize {
        match self {
            Self::Common => 1,
            Self::Switched | Self::Dwell => modes,
        }
    }

    /// The index of the Lyapunov matrix of a mode (both from 0).
    pub fn index(self, mode: usize) -> usize {
        match self {
            Self::Common => 0,
            Self::Switched | Self::Dwell => mode,
        }
    }

    /// Modes (indices from 0) that share a problem: each alone under `dwell`, else all together.
    pub fn groups(self, modes: usize) -> Vec<Vec<usize>> {
        match self {
            Self::Dwell => (0..modes).map(|mode| vec![mode]).collect(),
            Self::Common | Self::Switched => vec![(0..modes).collect()],
        }
    }

    /// The guarantees that ask for less, the strongest first.
    pub fn weaker(self) -> &'static [Self] {
        match self {
            Self::Common => &[Self::Switched, Self::Dwell],
            Self::Switched => &[Self::Dwell],
            Self::Dwell => &[],
        }
    }

    /// The pairs (mode, successor), from 0, whose inequalities must hold.
    pub fn pairs(self, modes: usize) -> Vec<(usize, usize)> {
        match self {
            Self::Common | Self::Dwell => (0..modes).map(|i| (i, i)).collect(),
            Self::Switched => all_pairs(modes),
        }
    }

    /// The same for an observer, whose `H` belongs to a pair of modes: a common matrix needs every
    /// pair as well.
    pub fn observer_pairs(self, modes: usize) -> Vec<(usize, usize)> {
        match self {
            Self::Dwell => self.pairs(modes),
            Self::Common | Self::Switched => all_pairs(modes),
        }
    }
}

/// Every pair of mode indices, equal ones included.
pub(crate) fn all_pairs(modes: usize) -> Vec<(usize, usize)> {
    (0..modes)
        .flat_map(|i| (0..modes).map(move |j| (i, j)))
        .collect()
}

impl fmt::Display for Lyapunov {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Common => "common",
            Self::Switched => "switched",
            Self::Dwell => "dwell",
        })
    }
}

/// How long modes must last on average under [`Lyapunov::Dwell`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct DwellTime {
    /// The factor `mu` by which a Lyapunov function may grow at a switch.
    pub mu: f64,
    /// `tau = ln mu / (-2 ln alpha)` in samples: the average dwell time must exceed it.
    pub samples: f64,
    /// The same in seconds.
    pub seconds: f64,
}

impl DwellTime {
    /// Relative amounts by which a computed `mu` is raised, in turn, until it can be proved.
    pub(crate) const ALLOWANCES: [f64; 4] = [1e-9, 1e-6, 1e-3, 1.0];

    /// From the proved factor `mu >= 1` and decay rate `0 < decay < 1`.
    pub fn new(mu: f64, decay: f64, sample_time: f64) -> Self {
        let samples = (mu.ln() / (-2.0 * decay.ln())).max(0.0);
        Self {
            mu,
            samples,
            seconds: samples * sample_time,
        }
    }
}
