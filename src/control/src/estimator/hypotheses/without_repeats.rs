//! The leading hypothesis without the readings that repeat: what a sensor that has frozen showed meanwhile was no
//! measurement, and loads that follow it are none. When it is found frozen, this is what is known of the plant.

use super::effect::pair;
use super::hypothesis::{Reading, Sensors, has};
use super::{Bank, BankState};

impl Bank {
    /// Its slot, behind those of the competition.
    pub(super) fn slot_without_repeats(&self) -> usize {
        2 * self.tuning.kept as usize + self.others()
    }

    /// The same, while a reading repeats.
    pub(super) fn in_use_without_repeats(&self, state: &BankState) -> Option<usize> {
        (state.repeating != 0).then(|| self.slot_without_repeats())
    }

    /// Which readings repeat; from the first of them on, the leading hypothesis goes on without them beside the others.
    pub(super) fn predict_without_repeats(&self, state: &mut BankState, reading: Reading<'_>) {
        let (leading_slot, own_slot) = (state.in_use.first(), self.slot_without_repeats());
        let before = core::mem::take(&mut state.repeating);
        for (q, (y, last)) in reading.y.iter().zip(&state.repeated).enumerate() {
            let again = has(reading.valid, q) && y == last && !state.first;
            state.repeating |= Sensors::from(again) << (q & 63);
        }
        state.resumed = before & reading.valid & !state.repeating;
        if state.repeating == 0 {
            return;
        }
        if before == 0 || !self.agrees_without_repeats(state) {
            let (parent, child) = pair(&mut state.slots, leading_slot, own_slot);
            child.take(parent);
        }
        let others = Reading {
            valid: reading.valid & !state.repeating,
            ..reading
        };
        let (model, h) = (self.model(state, own_slot), &state.slots[own_slot]);
        let seen = &mut state.seen[own_slot];
        seen.predict(self.layout, model, others, h, self.output_error());
        seen.whiten(self.layout.p);
    }

    /// Whether it says of sensors and plant what the leading hypothesis says.
    fn agrees_without_repeats(&self, state: &BankState) -> bool {
        let (h, leading) = (
            &state.slots[self.slot_without_repeats()],
            &state.slots[state.in_use.first()],
        );
        h.kinds() == leading.kinds()
            && (h.plant_changed, h.mode) == (leading.plant_changed, leading.mode)
    }

    /// It takes in the readings that do not repeat.
    pub(super) fn update_without_repeats(&self, state: &mut BankState) {
        if let Some(slot) = self.in_use_without_repeats(state) {
            let (h, seen) = (&mut state.slots[slot], &mut state.seen[slot]);
            h.misfit = self.tuning.averaged(h.misfit, seen.square, 0.0);
            h.update(self.layout, seen, self.output_error());
        }
    }

    /// Its slot, where sensor `q` shows one reading exactly and the others' readings fit.
    pub(super) fn before_it_froze(&self, state: &BankState, q: usize) -> Option<usize> {
        let fits =
            |slot: &usize| state.slots[*slot].misfit < self.tuning.misfit_of_fault(self.layout.p);
        self.in_use_without_repeats(state)
            .filter(|slot| has(state.repeating, q) && fits(slot))
    }
}
