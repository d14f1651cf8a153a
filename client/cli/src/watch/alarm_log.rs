//! The alarm transitions that were heard.

use std::collections::VecDeque;

use residual_client::AlarmEvent;
use time::OffsetDateTime;

/// Events that are kept.
const KEPT: usize = 10_000;

/// An event, and for a transition when it was written.
#[derive(Clone, Debug)]
pub struct Heard {
    /// The event.
    pub event: AlarmEvent,
    /// On the wall clock; of use for transitions only.
    pub written: OffsetDateTime,
}

/// The newest alarm transitions, with gaps where some were missed.
#[derive(Debug, Default)]
pub struct AlarmLog {
    /// Newest first.
    events: VecDeque<Heard>,
    /// How many of the newest are scrolled out of sight.
    above: usize,
}

impl AlarmLog {
    /// Takes the next event. What the user looks at stays where it is, unless it is the newest.
    pub fn hear(&mut self, event: Heard) {
        self.events.push_front(event);
        self.events.truncate(KEPT);
        if self.above > 0 {
            self.scroll_to(self.above + 1);
        }
    }

    /// The events from the first one in sight, newest first.
    pub fn in_sight(&self) -> impl Iterator<Item = &Heard> {
        self.events.iter().skip(self.above)
    }

    /// How many events there are.
    pub fn count(&self) -> usize {
        self.events.len()
    }

    /// How many of the newest are scrolled out of sight.
    pub fn above(&self) -> usize {
        self.above
    }

    /// Scrolls until so many of the newest are out of sight.
    pub fn scroll_to(&mut self, above: usize) {
        self.above = above.min(self.events.len().saturating_sub(1));
    }
}
