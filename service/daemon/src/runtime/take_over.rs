//! One engine takes over from another: what stayed the same moves, the rest begins.

use super::engine::Engine;

/// For each input and each diagnoser of the new engine: its place in the old one, if it is the same there.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Correspondence {
    /// Inputs that are the same, with the same samples in the same inbox.
    pub inputs: Vec<Option<usize>>,
    /// Diagnosers that are the same, and go on.
    pub kept: Vec<Option<usize>>,
    /// Diagnosers that replace one of their name with the same instants: they begin with the instant that would
    /// have been the next one of the old one.
    pub replaced: Vec<Option<usize>>,
    /// Diagnosers of the same name, whatever else has changed: they go on counting how often their alarm was
    /// raised, so that an alarm that nobody has seen is never taken for an older one.
    pub named: Vec<Option<usize>>,
}

impl Engine {
    /// Takes over from `old`, between two sampling instants, at `now_ns`: inboxes and diagnosers that stayed the
    /// same move here with all they know, by swapping; others begin with their next instant of the same grid.
    ///
    /// Both must have the same epoch, and diagnosers that stayed the same must have all their inputs among those
    /// that did. No allocation, no release; `old` must not be stepped any more, and has the alarms of those that are
    /// gone or changed.
    pub fn take_over(&mut self, old: &mut Self, same: &Correspondence, now_ns: u64) {
        self.generation = old.generation + 1;
        std::mem::swap(&mut self.step_times_ns, &mut old.step_times_ns);
        std::mem::swap(&mut self.lateness_ns, &mut old.lateness_ns);
        for (inbox, place) in self.inboxes.iter_mut().zip(&same.inputs) {
            if let Some(before) = place.and_then(|place| old.inboxes.get_mut(place)) {
                before.accept_backward_like(inbox);
                std::mem::swap(inbox, before);
            }
        }
        for (slot, unit) in self.units.iter_mut().enumerate() {
            let place_in = |places: &[Option<usize>]| places.get(slot).copied().flatten();
            if let Some(before) = place_in(&same.kept).and_then(|place| old.units.get_mut(place)) {
                std::mem::swap(unit, before);
                unit.assembler.exchange_inputs(&mut before.assembler);
                std::mem::swap(&mut unit.enabling, &mut before.enabling);
                std::mem::swap(&mut unit.inputs, &mut before.inputs);
                continue;
            }
            let replaced = place_in(&same.replaced).and_then(|place| old.units.get(place));
            unit.next_step = match replaced {
                Some(before) => before.next_step,
                None => unit.timing.first_step_from(self.epoch_ns, now_ns),
            };
            if let Some(before) = place_in(&same.named).and_then(|place| old.units.get(place)) {
                unit.lifecycle.count_from(before.lifecycle.occurrences());
            }
            unit.assembler.begin(&self.inboxes);
        }
        self.refill_agenda();
    }
}
