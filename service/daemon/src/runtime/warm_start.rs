//! A new life goes on where a checkpoint was made.
//!
//! Instants that passed in the meantime are told to the diagnosers as skipped ones, so a diagnoser goes on as if
//! the daemon had been running without samples. After a longer gap, and after another boot (whose clock began
//! anew), no state is of use.

use residual_diagnosis::diagnoser::RestoreError;
use residual_shared::counters::ScheduleCounters;

use super::assembler::AssemblerState;
use super::engine::Engine;
use super::inbox::InboxState;
use super::snapshot::{UnitState, read};

/// Longest time that may have passed since the checkpoint, nanoseconds.
pub const LONGEST_GAP_NS: u64 = 60_000_000_000;

/// Most instants that may have passed since the checkpoint.
pub const LONGEST_GAP_INSTANTS: u64 = 10_000;

/// Why a diagnoser does not go on from its saved state.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoWarmStart {
    /// The diagnoser refuses the state.
    #[error(transparent)]
    State(#[from] RestoreError),
    /// What was saved beside the diagnoser's state cannot be.
    #[error("its part of the checkpoint is damaged")]
    Damaged,
    /// Too much time has passed.
    #[error("{instants} sampling instants ({seconds} s) have passed, more than a state can bridge")]
    TooLongAgo {
        /// How many instants.
        instants: u64,
        /// How much time, whole seconds.
        seconds: u64,
    },
}

impl Engine {
    /// The inbox of `input` goes on from its part of a snapshot; false: that does not fit.
    ///
    /// To be called before the diagnosers are restored.
    pub fn restore_input(&mut self, input: usize, part: &[u8]) -> bool {
        let (Some(inbox), Some((state, []))) = (self.inboxes.get_mut(input), read::<InboxState>(part)) else {
            return false;
        };
        inbox.restore(state)
    }

    /// The diagnoser in `slot` goes on from its part of a snapshot, at `now_ns`; gives how many instants it was
    /// told to skip.
    ///
    /// # Errors
    /// [`NoWarmStart`]; the diagnoser then is as it was. Its alarm goes on if only too much time has passed.
    pub fn restore_diagnoser(&mut self, slot: usize, part: &[u8], now_ns: u64) -> Result<u64, NoWarmStart> {
        let epoch_ns = self.epoch_ns;
        let unit = self.units.get_mut(slot).ok_or(NoWarmStart::Damaged)?;
        let (state, own) = read::<UnitState<AssemblerState>>(part).ok_or(NoWarmStart::Damaged)?;
        // An instant whose step is not due yet has not passed.
        let first_step =
            (unit.timing).first_step_from(epoch_ns, now_ns.saturating_sub(unit.timing.margin_ns));
        // The step that is due now may have been done.
        let gap = match first_step.checked_sub(state.next_step) {
            Some(gap) => gap,
            None if state.next_step == first_step + 1 => 0,
            None => return Err(NoWarmStart::Damaged),
        };
        let gap_ns = gap.saturating_mul(unit.timing.period_ns);
        if gap > LONGEST_GAP_INSTANTS || gap_ns > LONGEST_GAP_NS {
            unit.lifecycle.restore(&state.lifecycle.without_steps());
            return Err(NoWarmStart::TooLongAgo {
                instants: gap,
                seconds: gap_ns / 1_000_000_000,
            });
        }
        let before = unit.assembler.state().clone();
        if !unit.assembler.restore(state.assembler, &self.inboxes) {
            return Err(NoWarmStart::Damaged);
        }
        if let Err(error) = unit.diagnoser.restore(own) {
            unit.assembler.restore(before, &self.inboxes);
            return Err(error.into());
        }
        unit.begun = state.begun;
        unit.was_reset = state.was_reset;
        unit.lifecycle.restore(&state.lifecycle);
        unit.next_step = state.next_step;
        unit.counters = ScheduleCounters::from_words(state.counters);
        unit.skip(gap);
        self.refill_agenda();
        Ok(gap)
    }

    /// Only the alarm of the diagnoser in `slot` goes on from its part of a snapshot.
    pub fn restore_only_alarm(&mut self, slot: usize, part: &[u8]) {
        let state = read::<UnitState<AssemblerState>>(part);
        if let (Some(unit), Some((state, _))) = (self.units.get_mut(slot), state) {
            unit.lifecycle.restore(&state.lifecycle.without_steps());
        }
    }

    /// The diagnoser in `slot` begins at its first instant from `now_ns` on, instead of the first one of all.
    pub fn begin_at(&mut self, slot: usize, now_ns: u64) {
        if let Some(unit) = self.units.get_mut(slot) {
            unit.next_step = unit.timing.first_step_from(self.epoch_ns, now_ns);
            unit.assembler.begin(&self.inboxes);
            self.refill_agenda();
        }
    }
}
