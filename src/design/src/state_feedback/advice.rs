//! Which change of an infeasible request helps: each is followed to certified gains before it is given.

use crate::{Advice, ControlSpec};

/// Tries one change per kind, the smallest first; `works` says whether a changed request has certified gains.
pub(super) fn search(spec: &ControlSpec, works: &dyn Fn(&ControlSpec) -> bool) -> Vec<Advice> {
    let mut advice = Vec::new();
    let slower = fastest_feasible_decay(spec, works);
    advice.extend(slower.map(Advice::Decay));
    let other = spec.lyapunov.weaker().iter().find_map(|&lyapunov| {
        let candidate = ControlSpec {
            lyapunov,
            ..spec.clone()
        };
        if candidate.decay < 1.0 && works(&candidate) {
            return Some(Advice::Lyapunov(lyapunov));
        }
        fastest_feasible_decay(&candidate, works)
            .map(|decay| Advice::LyapunovAndDecay(lyapunov, decay))
    });
    advice.extend(other);
    advice.extend(fewer_outputs(spec, works).map(Advice::Tracked));
    let fewer_harmonics = (0..spec.resonators.len())
        .rev()
        .map(Advice::Harmonics)
        .find(|fewer| works(&fewer.apply(spec)));
    advice.extend(fewer_harmonics);
    advice
}

/// The fastest decay on a coarse grid, slower than asked, that is feasible.
fn fastest_feasible_decay(spec: &ControlSpec, works: &dyn Fn(&ControlSpec) -> bool) -> Option<f64> {
    Advice::DECAYS.into_iter().find(|&decay| {
        let slower = ControlSpec {
            decay,
            ..spec.clone()
        };
        decay > spec.decay && works(&slower)
    })
}

/// The tracked outputs without one of them, if that works.
fn fewer_outputs(spec: &ControlSpec, works: &dyn Fn(&ControlSpec) -> bool) -> Option<Vec<usize>> {
    if spec.tracked.len() < 2 {
        return None;
    }
    (0..spec.tracked.len()).rev().find_map(|left_out| {
        let mut fewer = spec.tracked.clone();
        fewer.remove(left_out);
        works(&Advice::Tracked(fewer.clone()).apply(spec)).then_some(fewer)
    })
}
