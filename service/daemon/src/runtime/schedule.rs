//! The fixed-timestep schedule: sampling instants on an integer grid that never drifts.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// When one diagnoser is stepped: instants t_k = epoch + phase + k·period, each due at t_k + margin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// Time between two sampling instants, nanoseconds, above 0.
    pub period_ns: u64,
    /// Offset of the first instant from the epoch, nanoseconds, below the period.
    pub phase_ns: u64,
    /// Transport allowance: how long after its instant a step waits for samples, nanoseconds.
    pub margin_ns: u64,
    /// Among steps due at the same moment the larger priority goes first.
    pub priority: i32,
}

impl Timing {
    /// The sampling instant t_k, nanoseconds.
    pub fn instant_ns(&self, epoch_ns: u64, step: u64) -> u64 {
        epoch_ns + self.phase_ns + step * self.period_ns
    }

    /// The number of the first sampling instant at or after `now_ns`.
    pub fn first_step_from(&self, epoch_ns: u64, now_ns: u64) -> u64 {
        let since_first_ns = now_ns.saturating_sub(epoch_ns.saturating_add(self.phase_ns));
        since_first_ns.div_ceil(self.period_ns)
    }

    /// The moment at which the step of t_k is due, nanoseconds.
    pub fn due_ns(&self, epoch_ns: u64, step: u64) -> u64 {
        self.instant_ns(epoch_ns, step) + self.margin_ns
    }
}

/// A step to come. The order of the fields is the order of execution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Due {
    due_ns: u64,
    priority: Reverse<i32>,
    unit: usize,
}

/// The next step of every diagnoser, earliest first. Allocates only at construction.
#[derive(Debug)]
pub struct Agenda {
    heap: BinaryHeap<Reverse<Due>>,
}

impl Agenda {
    /// An agenda with the first step of every diagnoser, in the order of `timings`.
    pub fn new(epoch_ns: u64, timings: &[Timing]) -> Self {
        let mut agenda = Self {
            heap: BinaryHeap::new(),
        };
        agenda.refill(epoch_ns, timings.iter().map(|timing| (*timing, 0)));
        agenda
    }

    /// Fills the agenda anew with the given next step of every diagnoser, in their order. Allocates only if there
    /// are more of them than before.
    pub fn refill(&mut self, epoch_ns: u64, steps: impl Iterator<Item = (Timing, u64)>) {
        let mut entries = std::mem::take(&mut self.heap).into_vec();
        entries.clear();
        entries.extend(steps.enumerate().map(|(unit, (timing, step))| {
            Reverse(Due {
                due_ns: timing.due_ns(epoch_ns, step),
                priority: Reverse(timing.priority),
                unit,
            })
        }));
        self.heap = entries.into();
    }

    /// When the next step is due, nanoseconds; none if there is no diagnoser.
    pub fn next_due_ns(&self) -> Option<u64> {
        self.heap.peek().map(|Reverse(due)| due.due_ns)
    }

    /// The diagnoser whose step is due at `now_ns` and goes first, if any.
    pub fn peek(&self, now_ns: u64) -> Option<usize> {
        let Reverse(due) = self.heap.peek()?;
        (due.due_ns <= now_ns).then_some(due.unit)
    }

    /// Replaces the first entry, which [`Agenda::peek`] named, by that diagnoser's next step.
    pub fn reschedule(&mut self, due_ns: u64) {
        if let Some(mut first) = self.heap.peek_mut() {
            first.0.due_ns = due_ns;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timing(period_ns: u64, phase_ns: u64, margin_ns: u64, priority: i32) -> Timing {
        Timing {
            period_ns,
            phase_ns,
            margin_ns,
            priority,
        }
    }

    #[test]
    fn an_instant_after_a_year_is_exact() {
        let timing = timing(3_333_333, 7, 0, 0);
        let steps = 365 * 24 * 3600 * 300;
        assert_eq!(timing.instant_ns(1_000, steps), 1_007 + steps * 3_333_333);
    }

    #[test]
    fn the_first_step_from_a_moment_on_is_not_before_it() {
        let timing = timing(10, 3, 0, 0);
        for (now_ns, step) in [(0, 0), (103, 0), (104, 1), (113, 1), (114, 2)] {
            assert_eq!(timing.first_step_from(100, now_ns), step, "{now_ns}");
        }
    }

    #[test]
    fn steps_come_by_due_time_then_priority_then_position() {
        let timings = [
            timing(10, 0, 5, 0),
            timing(10, 5, 0, 1),
            timing(20, 0, 0, -1),
            timing(10, 0, 5, 1),
        ];
        let mut agenda = Agenda::new(100, &timings);
        let mut steps = [0; 4];
        let mut order = Vec::new();
        while let Some(unit) = agenda.peek(115) {
            order.push((timings[unit].due_ns(100, steps[unit]), unit));
            steps[unit] += 1;
            agenda.reschedule(timings[unit].due_ns(100, steps[unit]));
        }
        let expected = [
            (100, 2),
            (105, 1),
            (105, 3),
            (105, 0),
            (115, 1),
            (115, 3),
            (115, 0),
        ];
        assert_eq!(order, expected);
        assert_eq!(agenda.next_due_ns(), Some(120));
    }
}
