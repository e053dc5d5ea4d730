//! What may have happened to a hypothesis since the last sample.

use super::candidates::{Action, Candidate};
use super::hypothesis::{Hypothesis, Reading, Sensors, has};
use super::model::ModeModel;
use super::model_run::ModelRun;
use super::{Bank, BankState};

/// The hypothesis to which something may have happened.
#[derive(Clone, Copy)]
struct Parent {
    slot: usize,
    /// Before the sample.
    score: f64,
    /// After it, if nothing happened.
    stay: f64,
    flagged: Sensors,
    stuck: Sensors,
    plant_changed: bool,
    convinced: bool,
    /// Whether the sample is unlikely enough for something to have happened.
    unlikely: bool,
}

impl Parent {
    /// That `action` happened to it.
    const fn then(self, action: Action, score: f64, convinced: bool) -> Candidate {
        Candidate {
            score,
            parent: self.slot,
            action,
            convinced,
        }
    }
}

impl Bank {
    /// All that may have happened to the hypothesis in `slot`.
    pub(super) fn propose(
        &self,
        state: &mut BankState,
        slot: usize,
        model: &ModeModel,
        reading: Reading<'_>,
    ) {
        let p = self.layout.p;
        let (h, seen) = (&state.slots[slot], &state.seen[slot]);
        let mut parent = Parent {
            slot,
            score: h.score,
            stay: h.score + seen.likelihood(p),
            flagged: h.flagged(),
            stuck: h.stuck,
            plant_changed: h.plant_changed,
            convinced: h.convinced,
            unlikely: seen.square > self.tuning.unlikely(p),
        };
        state.expectation.stale = true;
        // What repeated its reading and does so no more has not frozen, unless in another way.
        parent.stay += f64::from((h.stuck & state.resumed).count_ones()) * self.log_rates.stuck;
        if slot != state.best && self.has_vanished(h, reading) {
            parent.stay -= self.tuning.fading;
        }
        state
            .candidates
            .add(parent.then(Action::Stay, parent.stay, parent.convinced));
        self.propose_changes(state, parent, model, reading);
        self.propose_faults(state, parent, model, reading);
        self.propose_ends(state, parent, model, reading);
    }

    /// Whether the faults of a hypothesis, biases all of them, are none any more.
    fn has_vanished(&self, h: &Hypothesis, reading: Reading<'_>) -> bool {
        let (fault, stride) = (self.layout.fault(), self.layout.stride());
        let biases = h.additive != 0 && h.additive == h.flagged() && h.convinced;
        let mut faults = (0..self.layout.p).filter(|&q| has(h.additive, q));
        biases
            && faults.all(|q| {
                let (k, noise) = (fault + q, reading.noise[q]);
                let most = h.cov[k * (stride + 1)].min(self.tuning.displaced * noise * noise);
                h.z[k] * h.z[k] <= most
            })
    }

    /// Whether another hypothesis with at least this `score` after the sample, which says of the sensors in
    /// `flagged` alone that they have a bias, leaves of the readings what `r` (p) leaves.
    fn is_said_already(
        &self,
        state: &BankState,
        parent: Parent,
        r: &[f64],
        flagged: Sensors,
        score: f64,
    ) -> bool {
        let p = self.layout.p;
        state.in_use.slots().any(|slot| {
            let (h, seen) = (&state.slots[slot], &state.seen[slot]);
            slot != parent.slot
                && h.flagged() == flagged
                && h.additive == flagged
                && h.convinced
                && (h.plant_changed, h.mode)
                    == (parent.plant_changed, state.slots[parent.slot].mode)
                && h.score + seen.likelihood(p) >= score
                && seen.leaves(&self.tuning, r)
        })
    }

    /// Adds a candidate with the logarithm of its probability; a fault counts as convinced only where the
    /// sample speaks for it at once.
    fn consider(
        &self,
        state: &mut BankState,
        parent: Parent,
        model: &ModeModel,
        reading: Reading<'_>,
        (action, log_rate, convinced): (Action, f64, bool),
    ) {
        let score =
            parent.score + log_rate + self.trial(state, parent.slot, model, reading, action);
        let by_residual = matches!(action, Action::Bias(_) | Action::Scale(_));
        let at_once = !by_residual || self.settings.trusts_model() || score > parent.stay;
        state
            .candidates
            .add(parent.then(action, score, convinced && at_once));
    }

    /// The plant: its loads, its matrices, where it started.
    fn propose_changes(
        &self,
        state: &mut BankState,
        parent: Parent,
        model: &ModeModel,
        reading: Reading<'_>,
    ) {
        let log_rates = self.log_rates;
        let consider = |state: &mut BankState, action: Action, log_rate: f64| {
            let told = (action, log_rate, parent.convinced);
            self.consider(state, parent, model, reading, told);
        };
        if parent.unlikely {
            for jump in 0..model.jumps.len() {
                consider(state, Action::Load(jump), model.jumps[jump].log_rate);
            }
            if !parent.plant_changed {
                consider(state, Action::PlantChanged, log_rates.changed);
            }
        }
        if parent.plant_changed {
            let score = parent.stay + log_rates.release;
            let restored = parent.then(Action::PlantRestored, score, parent.convinced);
            state.candidates.add(restored);
        }
        if state.first {
            if parent.flagged == 0 {
                consider(state, Action::Start, log_rates.fault);
            }
            return;
        }
        for back in [Action::Unloaded, Action::UsualLoad] {
            let run = back.run(&state.unloaded, &state.usual);
            let output = &state.seen[parent.slot].output;
            if parent.unlikely && run.displaced(output, self.tuning.returned) != 0 {
                // What stands against the loads that would then be gone makes up for the small probability of a fault.
                let z = &state.slots[parent.slot].z;
                let against = self.implausible(model, z, run);
                consider(state, back, (log_rates.fault + against).min(0.0));
            }
        }
        if parent.flagged == 0 {
            self.propose_drift(state, parent, model, reading);
        }
    }

    /// The sensors that have left the model in open loop may have drifted, and no load acts. It is followed
    /// beside the explanation by loads, so that the end of the drift is recognised; it decides only where
    /// the model is trusted.
    fn propose_drift(
        &self,
        state: &mut BankState,
        parent: Parent,
        model: &ModeModel,
        reading: Reading<'_>,
    ) {
        let trusted = self.settings.trusts_model();
        let limit = if trusted {
            self.tuning.displaced
        } else {
            self.tuning.returned
        };
        let set = state
            .unloaded
            .displaced(&state.seen[parent.slot].output, limit)
            & reading.valid;
        let known =
            |other: usize| state.slots[other].additive == set && !state.slots[other].convinced;
        if set == 0 || !trusted && state.in_use.slots().any(known) {
            return;
        }
        let value = self.trial(state, parent.slot, model, reading, Action::Drift(set));
        if state.trial.square < self.tuning.quiet(self.layout.p) {
            let score = match trusted {
                true => parent.stay.max(parent.score + value) + self.tuning.drift_lead,
                false => parent.stay,
            };
            let drift = parent.then(Action::Drift(set), score, trusted);
            state.candidates.add(drift);
        }
    }

    /// Faults that begin: of one sensor, of two where there are few, of all.
    fn propose_faults(
        &self,
        state: &mut BankState,
        parent: Parent,
        model: &ModeModel,
        reading: Reading<'_>,
    ) {
        if !parent.unlikely {
            return;
        }
        let p = self.layout.p;
        let free = sensors(p) & !parent.flagged & reading.valid;
        let log_rate = if state.first {
            self.tuning.start_fault
        } else {
            self.log_rates.fault
        };
        let mut consider = |action: Action, log_rate: f64| {
            let told = (action, log_rate, parent.convinced);
            self.consider(state, parent, model, reading, told);
        };
        for q in (0..p).filter(|&q| has(free, q)) {
            consider(Action::Bias(1 << q), log_rate);
            consider(Action::Scale(q), log_rate);
            if p > 2 && p as f64 <= self.tuning.pairs_up_to {
                for other in (0..q).filter(|&other| has(free, other)) {
                    consider(
                        Action::Bias(1 << q | 1 << other),
                        self.tuning.several * log_rate,
                    );
                }
            }
        }
        if free.count_ones() > 1 {
            let together = self.tuning.together(free.count_ones());
            consider(Action::Bias(free), together * log_rate);
        }
    }

    /// Faults that change their kind or their size, or end.
    fn propose_ends(
        &self,
        state: &mut BankState,
        parent: Parent,
        model: &ModeModel,
        reading: Reading<'_>,
    ) {
        let (p, log_rates) = (self.layout.p, self.log_rates);
        let leads = parent.slot == state.in_use.first();
        let known = parent.flagged & reading.valid;
        for q in 0..p {
            let may_freeze = has(sensors(p) & !parent.stuck & reading.valid, q);
            if may_freeze && leads && state.evidence[q] > self.tuning.frozen_evidence {
                let log_rate = log_rates.stuck + state.evidence_before[q];
                let freeze = (Action::Freeze(q), log_rate, parent.convinced);
                let frozen = Parent {
                    slot: self.before_it_froze(state, q).unwrap_or(parent.slot),
                    ..parent
                };
                state.expectation.stale = true;
                self.consider(state, frozen, model, reading, freeze);
                state.expectation.stale = true;
            }
            if !has(known, q) {
                continue;
            }
            if parent.unlikely {
                let change = (Action::Change(1 << q), log_rates.change, parent.convinced);
                self.consider(state, parent, model, reading, change);
            }
            let last = parent.flagged.count_ones() == 1;
            let convinced = parent.convinced || last;
            let log_rate = match has(parent.stuck & state.resumed, q) {
                true => 0.0,
                false => log_rates.release,
            };
            let release = (1 << q, log_rate, convinced);
            self.propose_release(state, parent, model, reading, release);
        }
        if known.count_ones() > 1 {
            let together = self.tuning.together(parent.flagged.count_ones());
            let all = (parent.flagged, together * log_rates.release, true);
            self.propose_release(state, parent, model, reading, all);
        }
    }

    /// What a priori stands against the loads in `z` (N) where those of `run` are usual, in log likelihood.
    fn implausible(&self, model: &ModeModel, z: &[f64], run: &ModelRun) -> f64 {
        let mut sum = 0.0;
        for (k, &size) in (self.layout.load()..).zip(&model.load_size) {
            let off = z[k] - run.load(k);
            if size > 0.0 {
                sum += 0.5 * (off / size) * (off / size);
            }
        }
        sum
    }

    /// The recovery of the sensors in `set`, unless what it leaves is there already: it can be proposed
    /// again at every later sample.
    fn propose_release(
        &self,
        state: &mut BankState,
        parent: Parent,
        model: &ModeModel,
        reading: Reading<'_>,
        (set, log_rate, convinced): (Sensors, f64, bool),
    ) {
        let action = Action::Release(set);
        let value = self.trial(state, parent.slot, model, reading, action);
        let score = parent.score + log_rate + value;
        let left = parent.flagged & !set;
        if !self.is_said_already(state, parent, &state.trial.r, left, score) {
            state.candidates.add(parent.then(action, score, convinced));
        }
    }
}

/// All of `p` sensors.
const fn sensors(p: usize) -> Sensors {
    if p >= 64 { u64::MAX } else { (1 << p) - 1 }
}
