//! How a filter finds back to a set that contains the state (method sheet 4.6).
//!
//! A falsified mode may take the set of the survivors, one of which is the truth. A mode that lost its set without
//! being falsified may itself be the truth; then only a mode that allows all its faults and more has a set that
//! contains the state. With the rule `none` no alarm leads to a reset and no episode ends; a lost set still
//! restarts from the measurement or from the state box.

use super::{
    bank::UnknownInputFilterBank, filter::state_bound, mode_filter::ModeFilter, options::ResetRule,
    parity_window::ParityWindow, strip_reset::reset_by_strip,
};

/// Where the new set of a mode can come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    /// The present measurement.
    Strip,
    /// The set of this mode.
    Mode(usize),
    /// The interval hull of the sets of all survivors.
    Hull,
    /// The box that contains the state at all times.
    StateBox,
}

impl UnknownInputFilterBank {
    /// Resets every mode that alarms now (its set may be empty) and every mode without a set. Returns whether
    /// any set was replaced.
    pub(super) fn reset_lost_sets(&mut self) -> bool {
        let mut any = false;
        for i in 0..self.modes.len() {
            let wrong = self.alarm(i) && self.rules.reset != ResetRule::None;
            if !self.has_guaranteed_set(i) || !(wrong || self.state.sets[i].void) {
                continue;
            }
            let source = if self.survives(i) {
                self.source_for_survivor(i)
            } else {
                self.source()
            };
            any |= source.is_some();
            self.take_set(i, source);
        }
        any
    }

    /// Ends an episode: every mode but a sole survivor takes a set that holds whatever happened, all flags are
    /// cleared. Returns false, with nothing changed, when there is no such set or resets are switched off.
    pub(super) fn end_episode(&mut self) -> bool {
        if !(0..self.modes.len()).any(|i| self.has_guaranteed_set(i)) {
            self.clear_flags();
            return true;
        }
        let survivors = (0..self.modes.len()).filter(|&i| self.survives(i)).count();
        let Some(source) = self.source().filter(|_| self.rules.reset != ResetRule::None) else {
            return false;
        };
        if source == Source::Hull {
            self.collect_hull();
        }
        let sole = (0..self.modes.len()).find(|&i| survivors == 1 && self.survives(i));
        for i in 0..self.modes.len() {
            if self.has_guaranteed_set(i) && Some(i) != sole {
                match source {
                    Source::Hull => self.state.sets[i].set_box(&self.hull.centre, &self.hull.radius),
                    _ => self.take_set(i, Some(source)),
                }
            }
        }
        self.clear_flags();
        true
    }

    fn clear_flags(&mut self) {
        self.state.windows.iter_mut().for_each(ParityWindow::restart);
        self.state.falsified.fill(false);
        self.state.quiet = 0;
    }

    fn has_guaranteed_set(&self, i: usize) -> bool {
        self.modes[i]
            .filter
            .as_ref()
            .is_some_and(ModeFilter::is_guaranteed)
    }

    /// Source of a set that contains the state if some survivor is the truth.
    fn source(&self) -> Option<Source> {
        self.strip_source()
            .or_else(|| self.copy_source())
            .or_else(|| self.box_source())
    }

    /// Source of a set for a mode that is itself a possible truth: another mode's set contains the state as well
    /// only if that mode allows all faults of this one.
    fn source_for_survivor(&self, target: usize) -> Option<Source> {
        let donor = (0..self.modes.len()).find(|&i| {
            self.modes[target].mode.is_proper_subset_of(self.modes[i].mode)
                && self.survives(i)
                && self.state.sets[i].is_bounded()
        });
        let copy = donor.filter(|_| self.may_copy()).map(Source::Mode);
        self.strip_source().or(copy).or_else(|| self.box_source())
    }

    fn strip_source(&self) -> Option<Source> {
        let allowed = self.rules.reset != ResetRule::Copy;
        let available = self.plant.strip.is_some() && self.measured.is_complete(&self.plant);
        (allowed && available).then_some(Source::Strip)
    }

    fn may_copy(&self) -> bool {
        matches!(self.rules.reset, ResetRule::Auto | ResetRule::Copy)
    }

    /// Every survivor may be the truth, so that all of them must have a bounded set.
    fn copy_source(&self) -> Option<Source> {
        let survivors = || (0..self.modes.len()).filter(|&i| self.survives(i));
        let usable = self.may_copy() && survivors().all(|i| self.state.sets[i].is_bounded());
        match (survivors().next(), survivors().nth(1)) {
            (Some(only), None) if usable => Some(Source::Mode(only)),
            (Some(_), Some(_)) if usable => Some(Source::Hull),
            _ => None,
        }
    }

    fn box_source(&self) -> Option<Source> {
        self.plant.state_box.is_some().then_some(Source::StateBox)
    }

    /// Gives mode `i` a new set, or none.
    fn take_set(&mut self, i: usize, source: Option<Source>) {
        match (source, &self.plant.strip, &self.plant.state_box) {
            (Some(Source::Strip), Some(strip), _) => {
                reset_by_strip(
                    &self.plant,
                    strip,
                    &self.measured.y,
                    &mut self.state.sets[i],
                    &mut self.work,
                );
            }
            (Some(Source::Mode(donor)), ..) if donor != i => {
                if let Ok([target, donor]) = self.state.sets.get_disjoint_mut([i, donor]) {
                    target.copy_from(donor);
                }
            }
            (Some(Source::Hull), ..) => {
                self.collect_hull();
                self.state.sets[i].set_box(&self.hull.centre, &self.hull.radius);
            }
            (Some(Source::StateBox), _, Some(bounds)) => {
                self.state.sets[i].set_box(&bounds.centre, &bounds.radius);
            }
            _ => self.state.sets[i].set_void(),
        }
        state_bound(&self.plant, &self.state.sets[i], &mut self.state_bound);
        self.state.windows[i].replace_state_bound(&self.state_bound);
    }

    /// Interval hull of the sets of all survivors into `hull`, rounded outward.
    fn collect_hull(&mut self) {
        for k in 0..self.plant.nx() {
            let (mut lower, mut upper) = (f64::INFINITY, f64::NEG_INFINITY);
            for i in (0..self.modes.len()).filter(|&i| self.survives(i)) {
                let set = &self.state.sets[i];
                let extent = set.radius[k] * (1.0 + self.plant.epsilon);
                lower = lower.min((set.centre[k] - extent).next_down());
                upper = upper.max((set.centre[k] + extent).next_up());
            }
            let centre = lower / 2.0 + upper / 2.0;
            self.hull.centre[k] = centre;
            self.hull.radius[k] = (upper - centre).max(centre - lower).next_up();
        }
    }
}
