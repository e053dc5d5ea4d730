//! What happened, done to the hypothesis to which it did.

use super::candidates::{Action, Candidate};
use super::hypothesis::{Hypothesis, Reading, has};
use super::model::ModeModel;
use super::model_run::ModelRun;
use super::{Bank, BankState};

impl Bank {
    /// The hypothesis in `slot` becomes what the candidate makes of its parent.
    pub(super) fn take_effect(
        &self,
        state: &mut BankState,
        candidate: Candidate,
        slot: usize,
        model: &ModeModel,
        reading: Reading<'_>,
    ) {
        let (layout, settings, tuning) = (self.layout, &self.settings, &self.tuning);
        let (p, fault, stride) = (layout.p, layout.fault(), layout.stride());
        let (parent, child) = pair(&mut state.slots, candidate.parent, slot);
        child.take(parent);
        let kinds = self.sets(child, candidate.action);
        (child.additive, child.stuck, child.scaled) = (kinds.additive, kinds.stuck, kinds.scaled);
        match candidate.action {
            Action::Load(jump) => {
                let jump = &model.jumps[jump];
                child.jump(layout, model, jump, &state.u, settings.gain_error);
            }
            Action::Bias(set) | Action::Change(set) => {
                for q in (0..p).filter(|&q| has(set, q)) {
                    let k = fault + q;
                    if self.opens_anew(parent, candidate.action, q) {
                        child.open(k, 0.0, self.fault_variance(q));
                    } else {
                        child.cov[k * stride + k] += self.fault_variance(q);
                    }
                }
            }
            Action::Release(set) => {
                for q in (0..p).filter(|&q| has(set, q)) {
                    child.open(fault + q, 0.0, self.healthy_variance(model, q));
                }
            }
            Action::Freeze(q) => {
                let variance = reading.noise[q] * reading.noise[q] / state.count[q].max(1.0);
                child.open(fault + q, state.mean[q], variance);
            }
            Action::Scale(q) => child.open(
                fault + q,
                tuning.gain_fault_mean,
                tuning.gain_fault_variance,
            ),
            Action::Start => {
                for (k, sd) in settings.start_elsewhere.iter().enumerate() {
                    child.cov[k * stride + k] += sd * sd;
                }
            }
            Action::Unloaded | Action::UsualLoad | Action::Drift(_) => {
                let run = candidate.action.run(&state.unloaded, &state.usual);
                for (k, &x) in run.x.iter().enumerate() {
                    child.open(k, x, run.variance(model, settings, tuning, k));
                    child.before[k] = x;
                }
                self.reset_loads(child, model, run);
                for q in 0..p {
                    let variance = match has(child.additive, q) {
                        true => self.fault_variance(q),
                        false => self.healthy_variance(model, q),
                    };
                    child.open(fault + q, 0.0, variance);
                }
            }
            Action::PlantChanged => {
                child.plant_changed = true;
                let load = layout.load() + layout.state_load();
                for (i, v) in self.change_variance(model, parent, &state.u).enumerate() {
                    for (row, column) in
                        [(i, i), (i, load + i), (load + i, i), (load + i, load + i)]
                    {
                        child.cov[row * stride + column] += v;
                    }
                }
            }
            Action::PlantRestored => child.plant_changed = false,
            Action::Stay => {}
        }
    }

    /// Loads and errors of the input gains are those of the model's `run`.
    fn reset_loads(&self, h: &mut Hypothesis, model: &ModeModel, run: &ModelRun) {
        for (k, size) in model.load_size.iter().enumerate() {
            let k = self.layout.load() + k;
            h.open(k, run.load(k), self.tuning.load_remainder * size * size);
        }
        let gain = self.settings.gain_error;
        for k in self.layout.gain()..self.layout.fault() {
            h.open(k, run.load(k), self.tuning.load_remainder * gain * gain);
        }
    }

    /// Whether nothing of the entry of the fault of sensor `q` is left: it held another kind of fault, or none.
    pub(super) fn opens_anew(&self, parent: &Hypothesis, action: Action, q: usize) -> bool {
        match action {
            Action::Bias(set) | Action::Change(set) => {
                let additive = self.output_error() || has(parent.additive, q);
                has(set, q) && (has(parent.stuck | parent.scaled, q) || !additive)
            }
            Action::Release(set) => has(set, q),
            _ => false,
        }
    }

    /// Variance of the fault of sensor `q` when it begins.
    pub(super) fn fault_variance(&self, q: usize) -> f64 {
        self.settings.fault_size[q] * self.settings.fault_size[q]
    }

    /// Variance of the fault entry of a healthy sensor.
    pub(super) fn healthy_variance(&self, model: &ModeModel, q: usize) -> f64 {
        match self.output_error() {
            true => model.most[self.layout.fault() + q],
            false => 0.0,
        }
    }
}

/// Two different slots at once.
pub(super) fn pair(
    slots: &mut [Hypothesis],
    from: usize,
    to: usize,
) -> (&Hypothesis, &mut Hypothesis) {
    if from < to {
        let (a, b) = slots.split_at_mut(to);
        (&a[from], &mut b[0])
    } else {
        let (a, b) = slots.split_at_mut(from);
        (&b[0], &mut a[to])
    }
}
