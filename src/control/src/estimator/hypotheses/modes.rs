//! The plant's mode under each hypothesis: told with every sample, or found from the readings.
//!
//! Where it is not told, each sample may be the first in another mode, with the probability of a switch: beside
//! the leading hypothesis stands one for every other mode, made anew from it whenever it explains the
//! readings much worse than a switch at this sample would. So the evidence for another mode sums up over
//! samples, and begins again where it fails.

use super::hypothesis::{Hypothesis, Innovation};
use super::linear::dot;
use super::model::{Layout, ModeModel};
use super::{Bank, BankState, SlotsInUse};

/// Share of the noise below which the difference of two modes' offsets is that of their rounding.
const ROUNDING: f64 = 1e-6;

/// Whether two modes differ in what they make of one state, so that a switch shows in the sample of it, on sensors
/// with this `noise` (p).
pub(super) fn differ_at_once(one: &ModeModel, other: &ModeModel, noise: &[f64]) -> bool {
    let offsets = one.output_offset.iter().zip(&other.output_offset);
    let mut offsets = offsets.zip(noise);
    one.c != other.c
        || one.f != other.f
        || offsets.any(|((own, its), noise)| (own - its).abs() > ROUNDING * noise)
}

impl Bank {
    /// How many other modes the plant may be in.
    pub(super) fn others(&self) -> usize {
        match self.log_rates.mode {
            Some(_) => self.modes.len().saturating_sub(1),
            None => 0,
        }
    }

    /// The plant under the hypothesis in `slot`.
    pub(super) fn model(&self, state: &BankState, slot: usize) -> &ModeModel {
        &self.modes[state.slots[slot].mode as usize]
    }

    /// The plant is in `mode`, whatever else holds.
    pub(super) fn tell(&self, state: &mut BankState, mode: usize) {
        for slot in state
            .in_use
            .slots()
            .chain(self.in_use_without_repeats(state))
        {
            let h = &mut state.slots[slot];
            match state.first {
                true => (h.mode, h.moved_by) = (mode as u32, mode as u32),
                false if h.mode as usize != mode => {
                    self.enter(h, mode, &state.u, &state.model_share);
                }
                false => {}
            }
        }
    }

    /// The plant enters `mode` under the input `u` (m): what the model misses, and what a load does, may
    /// differ.
    fn enter(&self, h: &mut Hypothesis, mode: usize, u: &[f64], shares: &[f64]) {
        let Layout { n, m, .. } = self.layout;
        let stride = self.layout.stride();
        let load = self.layout.load() + self.layout.state_load();
        let model = &self.modes[mode];
        let error = self.model_error(shares, mode as u32);
        let at_once = self.at_once[h.mode as usize * self.modes.len() + mode];
        h.mode = mode as u32;
        let mean = dot(&h.z[load..load + n], &h.z[load..load + n]) / n.max(1) as f64;
        for i in 0..n {
            if at_once {
                let off = h.z[i] - model.x0[i];
                h.cov[i * stride + i] += error * off * off;
            }
            let mut sum = 0.0;
            for j in 0..n {
                let v = model.a[i * n + j] * (h.z[j] - model.x0[j]);
                sum += v * v;
            }
            for (j, u) in u.iter().enumerate().take(m) {
                let v = model.b[i * m + j] * (u - model.u0[j]);
                sum += v * v;
            }
            let k = load + i;
            h.cov[k * stride + k] +=
                error * sum + self.tuning.load_at_switch * (h.z[k] * h.z[k]).max(mean);
        }
    }

    /// Whether nothing stands beside the leading hypothesis but others of its kind in other modes, and
    /// explains the sample no better.
    pub(super) fn leads_alone(&self, state: &BankState) -> bool {
        if state.in_use.count == 1 {
            return true;
        }
        let p = self.layout.p;
        let after = |slot: usize| state.slots[slot].score + state.seen[slot].likelihood(p);
        let leading_slot = state.in_use.first();
        let lead = after(leading_slot);
        let mut rivals = state.in_use.slots().skip(1);
        rivals.all(|slot| {
            let (h, leading) = (&state.slots[slot], &state.slots[leading_slot]);
            stands_for(h, leading, h.mode) && h.mode != leading.mode && after(slot) <= lead
        })
    }

    /// Nothing happened: every hypothesis in competition stays what it is.
    pub(super) fn continue_all(&self, state: &mut BankState) {
        let (p, leading_slot) = (self.layout.p, state.in_use.first());
        let likelihood = |seen: &Innovation| match state.in_use.count {
            1 => 0.0,
            _ => seen.likelihood(p),
        };
        let lead = state.slots[leading_slot].score + likelihood(&state.seen[leading_slot]);
        for slot in state.in_use.slots() {
            let (h, seen) = (&mut state.slots[slot], &mut state.seen[slot]);
            h.score += likelihood(seen) - lead;
            h.update(self.layout, seen, self.output_error());
            h.misfit = self.tuning.averaged(h.misfit, seen.square, 0.0);
        }
        state.slots[leading_slot].score = 0.0;
        state.best = leading_slot;
        state.suspect = 0;
        if self.others() > 0 {
            self.weigh_modes(state);
        }
    }

    /// A hypothesis for every other mode: that the plant has entered it with this sample, or enters it now.
    /// What shows at once is looked for once the state has `moved` to the coming sample, the rest before.
    pub(super) fn branch(&self, state: &mut BankState, moved: bool) {
        let Some(log_rate) = self.log_rates.mode else {
            return;
        };
        let leading_slot = state.in_use.first();
        let (count, leading) = (self.modes.len(), state.slots[leading_slot].mode as usize);
        for mode in (0..count).filter(|&mode| mode != leading) {
            if self.at_once[leading * count + mode] != moved {
                continue;
            }
            let lead = &state.slots[leading_slot];
            let score = lead.score + log_rate;
            let standing = state.in_use.slots().skip(1);
            let standing = standing
                .filter(|&slot| stands_for(&state.slots[slot], lead, mode as u32))
                .max_by(|&a, &b| state.slots[a].score.total_cmp(&state.slots[b].score));
            let slot = match standing {
                Some(slot) if state.slots[slot].score >= score - self.tuning.switch_restart => {
                    continue;
                }
                Some(slot) => slot,
                None => match free(state.in_use, state.slots.len()) {
                    Some(slot) => slot,
                    None => return,
                },
            };
            let (parent, child) = super::effect::pair(&mut state.slots, leading_slot, slot);
            child.take(parent);
            child.score = score;
            self.enter(child, mode, &state.u, &state.model_share);
            if standing.is_none() {
                state.in_use.add(slot);
            }
        }
    }

    /// The mode (0-based) that is taken: another than before must have the odds of a sensor fault, all its
    /// hypotheses together.
    pub(super) fn decide_mode(&self, state: &mut BankState) -> usize {
        if self.others() == 0 {
            return state.slots[state.in_use.first()].mode as usize;
        }
        self.weigh_modes(state);
        let shares = state.probability.iter().enumerate();
        let (likeliest, &most) = shares
            .max_by(|a, b| a.1.total_cmp(b.1))
            .unwrap_or((0, &0.0));
        match most > libm::exp(self.settings.odds) * state.probability[state.mode] {
            true => likeliest,
            false => state.mode,
        }
    }

    /// The probability of each mode.
    pub(super) fn weigh_modes(&self, state: &mut BankState) {
        let convinced = |slot: &usize| state.slots[*slot].convinced;
        let scores = state.in_use.slots().filter(convinced);
        let most = scores
            .map(|slot| state.slots[slot].score)
            .fold(f64::NEG_INFINITY, f64::max);
        state.probability.fill(0.0);
        let mut sum = 0.0;
        for slot in state.in_use.slots() {
            let h = &state.slots[slot];
            if h.convinced {
                let weight = libm::exp((h.score - most).min(0.0));
                state.probability[h.mode as usize] += weight;
                sum += weight;
            }
        }
        for share in &mut state.probability {
            *share /= sum;
        }
    }
}

/// Whether `h` differs from `leading` by nothing but the mode, which is `mode`.
fn stands_for(h: &Hypothesis, leading: &Hypothesis, mode: u32) -> bool {
    h.mode == mode
        && h.kinds() == leading.kinds()
        && h.plant_changed == leading.plant_changed
        && h.convinced
}

/// A slot of so many that is not in use.
fn free(in_use: SlotsInUse, slots: usize) -> Option<usize> {
    (0..slots).find(|&slot| !in_use.contains(slot))
}
