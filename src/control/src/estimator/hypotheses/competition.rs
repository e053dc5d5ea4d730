//! The competition: what may have happened, what it leaves, and who stays.

use super::candidates::{Action, Candidate};
use super::hypothesis::{Hypothesis, Kinds, Reading, Sensors, has};
use super::model::{Layout, ModeModel};
use super::{Bank, BankState, SlotsInUse};

impl Bank {
    /// Judges a sample that is not like the last.
    pub(super) fn compete(&self, state: &mut BankState, reading: Reading<'_>) {
        state.candidates.count = 0;
        for slot in state.in_use.slots() {
            self.propose(state, slot, self.model(state, slot), reading);
        }
        self.select(state);
        self.instantiate(state, reading);
    }

    /// Variance of what a plant unlike the model may have done to each state in a sample (n).
    pub(super) fn change_variance<'a>(
        &'a self,
        model: &'a ModeModel,
        h: &'a Hypothesis,
        u: &'a [f64],
    ) -> impl Iterator<Item = f64> + 'a {
        let Layout { n, m, .. } = self.layout;
        let error = self.settings.changed_error * self.settings.changed_error;
        (0..n).map(move |i| {
            let mut sum = 0.0;
            let row = &model.a[i * n..(i + 1) * n];
            for ((&a, &x), &x0) in row.iter().zip(&h.before).zip(&model.x0) {
                sum += a * a * (x - x0) * (x - x0);
            }
            let row = &model.b[i * m..(i + 1) * m];
            for ((&b, &u), &u0) in row.iter().zip(u).zip(&model.u0) {
                sum += b * b * (u - u0) * (u - u0);
            }
            error * sum
        })
    }

    pub(super) fn sets(&self, h: &Hypothesis, action: Action) -> Kinds {
        let now = h.kinds();
        match action {
            Action::Stay
            | Action::Load(_)
            | Action::PlantChanged
            | Action::PlantRestored
            | Action::Start => now,
            Action::Unloaded | Action::UsualLoad => Kinds {
                additive: 0,
                stuck: 0,
                scaled: 0,
            },
            Action::Drift(set) => Kinds {
                additive: set,
                stuck: 0,
                scaled: 0,
            },
            Action::Bias(set) | Action::Change(set) => {
                let rest = now.without(set);
                Kinds {
                    additive: rest.additive | set,
                    ..rest
                }
            }
            Action::Release(set) => now.without(set),
            Action::Freeze(q) => {
                let rest = now.without(1 << q);
                Kinds {
                    stuck: rest.stuck | 1 << q,
                    ..rest
                }
            }
            Action::Scale(q) => {
                let rest = now.without(1 << q);
                Kinds {
                    scaled: rest.scaled | 1 << q,
                    ..rest
                }
            }
        }
    }

    /// Which sensors a candidate takes for faulty, whether the plant is no longer the model, and the plant's mode.
    fn kind(&self, state: &BankState, candidate: &Candidate) -> (Sensors, bool, u32) {
        let parent = &state.slots[candidate.parent];
        let plant_changed = match candidate.action {
            Action::PlantChanged => true,
            Action::PlantRestored => false,
            _ => parent.plant_changed,
        };
        let flagged = self.sets(parent, candidate.action).all();
        (flagged, plant_changed, parent.mode)
    }

    /// Keeps the best candidates, few of a kind, and always one in which the plant is the model and no sensor
    /// is flagged, and which may be used: without it nothing might be left to use.
    fn select(&self, state: &mut BankState) {
        let order = |a: &Candidate, b: &Candidate| {
            b.score.total_cmp(&a.score).then(a.parent.cmp(&b.parent))
        };
        state.candidates.sort(order);
        let best = state
            .candidates
            .all()
            .iter()
            .filter(|c| c.convinced)
            .map(|c| c.score)
            .fold(f64::NEG_INFINITY, f64::max);
        // What has fallen further than a new fault costs, and the odds of a sensor fault, is dropped.
        let margin = self.settings.odds - self.log_rates.fault.min(self.log_rates.load);
        let mut kept = 0;
        let mut plain = false;
        for index in 0..state.candidates.count {
            let candidate = state.candidates.list[index];
            let kind = self.kind(state, &candidate);
            let unflagged = (kind.0, kind.1) == (0, false) && candidate.convinced;
            let most = self.tuning.kept as usize - usize::from(!plain);
            let stays = candidate.score >= best - margin && kept < most;
            if !stays && (plain || !unflagged) {
                continue;
            }
            let alike = state.candidates.list[..kept]
                .iter()
                .filter(|c| self.kind(state, c) == kind && c.convinced == candidate.convinced)
                .count();
            if alike >= self.tuning.per_sensor_set as usize || self.is_twin(state, &candidate, kept)
            {
                continue;
            }
            plain |= unflagged;
            let mut taken = candidate;
            taken.score = (candidate.score - best)
                .clamp(-self.tuning.unflagged_range, self.tuning.unflagged_range);
            state.candidates.list[kept] = taken;
            kept += 1;
        }
        state.candidates.count = kept;
    }

    /// Whether one of the `kept` candidates goes on as this one does, from the same estimate, and leaves the
    /// same of the readings.
    fn is_twin(&self, state: &BankState, candidate: &Candidate, kept: usize) -> bool {
        if candidate.action != Action::Stay {
            return false;
        }
        let (h, seen) = (
            &state.slots[candidate.parent],
            &state.seen[candidate.parent],
        );
        state.candidates.list[..kept].iter().any(|other| {
            let o = &state.slots[other.parent];
            other.action == Action::Stay
                && o.kinds() == h.kinds()
                && (o.plant_changed, o.convinced, o.mode) == (h.plant_changed, h.convinced, h.mode)
                && o.has_estimate(&self.tuning, &h.z)
                && state.seen[other.parent].leaves(&self.tuning, &seen.r)
        })
    }

    /// The candidates that stay become the hypotheses in competition.
    fn instantiate(&self, state: &mut BankState, reading: Reading<'_>) {
        let mut next = SlotsInUse::NONE;
        // Children first: they start from their parents' predictions.
        let mut free = 0;
        for index in 0..state.candidates.count {
            let candidate = state.candidates.list[index];
            if candidate.action == Action::Stay {
                next.add(candidate.parent);
                continue;
            }
            while state.in_use.contains(free) || next.contains(free) {
                free += 1;
            }
            next.add(free);
            let model = self.model(state, candidate.parent);
            self.take_effect(state, candidate, free, model, reading);
            let (seen, child) = (&mut state.seen[free], &state.slots[free]);
            seen.predict(self.layout, model, reading, child, self.output_error());
            seen.whiten(self.layout.p);
        }
        for index in 0..state.candidates.count {
            self.learn_from(state, usize::from(next.list[index]), index);
        }
        state.in_use = next;
        self.decide(state, reading);
    }

    /// The hypothesis in `slot`, which comes of the candidate `index`, takes the sample in.
    fn learn_from(&self, state: &mut BankState, slot: usize, index: usize) {
        let candidate = state.candidates.list[index];
        let h = &mut state.slots[slot];
        h.update(self.layout, &mut state.seen[slot], self.output_error());
        h.score = candidate.score;
        let penalty = match candidate.action {
            Action::Stay | Action::PlantRestored | Action::Release(_) => 0.0,
            Action::Load(_) | Action::PlantChanged => 0.0,
            Action::Bias(_)
            | Action::Scale(_)
            | Action::Freeze(_)
            | Action::Start
            | Action::Unloaded
            | Action::UsualLoad
            | Action::Drift(_) => -2.0 * self.log_rates.fault,
            Action::Change(_) => -2.0 * self.log_rates.change,
        };
        let square = state.seen[slot].square;
        h.misfit = self.tuning.averaged(h.misfit, square, penalty);
        h.convinced = candidate.convinced;
    }

    /// Which hypothesis is used: one with a sensor fault must beat the best one without by its odds.
    fn decide(&self, state: &mut BankState, reading: Reading<'_>) {
        let (p, fault, tuning) = (self.layout.p, self.layout.fault(), &self.tuning);
        let mode = self.decide_mode(state);
        let mut best = state.in_use.first();
        let mut top = f64::NEG_INFINITY;
        for slot in state.in_use.slots() {
            let h = &state.slots[slot];
            let value = if h.flagged() == 0 || self.settings.trusts_model() {
                h.score
            } else {
                h.score - self.settings.odds
            };
            let fits = h.flagged() == 0
                || h.misfit < tuning.misfit_of_fault(p)
                    && state.seen[slot].square < tuning.square_of_fault(p);
            if h.convinced && fits && h.mode as usize == mode && value > top {
                top = value;
                best = slot;
            }
        }
        state.best = best;
        state.suspect = 0;
        let decided = state.slots[best].flagged();
        for slot in state.in_use.slots() {
            let h = &state.slots[slot];
            if h.score < state.slots[best].score {
                continue;
            }
            for q in 0..p {
                if has(h.flagged() & !decided, q)
                    && (!has(h.additive, q)
                        || h.z[fault + q].abs() > tuning.suspect_deviations * reading.noise[q])
                {
                    state.suspect |= 1 << q;
                }
            }
        }
        // The best leads.
        state.in_use.lead(best);
    }
}
