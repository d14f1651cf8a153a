//! Confirmed alarms, episodes and isolation by exoneration (method sheet 4).
//!
//! The rows of member i do not react to the fault of actuator i, so that its alarm exonerates actuator i for the rest
//! of the episode. The true single fault is never removed. An actuator without a member is never removed either.

use crate::diagnoser::{StepRecord, Verdict};
use serde::{Deserialize, Serialize};

/// What an episode remembers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct EpisodeState {
    /// Whether an alarm has been confirmed and not yet cleared.
    pub active: bool,
    /// Bit i: actuator i has been exonerated.
    pub exonerated: u64,
    /// Consecutive instants with any alarm.
    streak: u32,
    /// The same per member.
    member_streaks: Vec<u32>,
    /// Tested instants since the last alarm.
    quiet: u32,
}

impl EpisodeState {
    /// No episode, with so many members.
    pub fn new(members: usize) -> Self {
        Self {
            active: false,
            exonerated: 0,
            streak: 0,
            member_streaks: vec![0; members],
            quiet: 0,
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.active = false;
        self.exonerated = 0;
        self.streak = 0;
        self.member_streaks.fill(0);
        self.quiet = 0;
    }

    /// Whether a saved state belongs to as many members.
    pub fn fits(&self, other: &Self) -> bool {
        self.member_streaks.len() == other.member_streaks.len()
    }
}

/// What one instant found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Findings {
    /// Whether any row was tested.
    pub tested: bool,
    /// Whether any of them alarms.
    pub alarm: bool,
}

/// What one member found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MemberFindings {
    /// Whose fault it does not see.
    pub actuator: usize,
    /// Its rows.
    pub findings: Findings,
    /// Whether its silence towards that fault is guaranteed now.
    pub guaranteed: bool,
}

/// The rules of episodes and isolation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct EpisodeRules {
    /// Consecutive instants a test must alarm.
    pub alarm_samples: u32,
    /// Tested instants without alarm that end an episode; 0 = never.
    pub clear_samples: u32,
    /// m.
    pub actuators: usize,
    /// Whether actuators are isolated.
    pub isolate: bool,
}

impl EpisodeRules {
    /// Takes what all rows (`any`) and the members found; true if an alarm is confirmed at this instant.
    pub fn update(
        &self,
        state: &mut EpisodeState,
        any: Findings,
        members: impl Iterator<Item = MemberFindings>,
    ) -> bool {
        count(&mut state.streak, any);
        for (streak, member) in state.member_streaks.iter_mut().zip(members) {
            let alarm = member.findings.alarm && member.guaranteed;
            count(
                streak,
                Findings {
                    alarm,
                    ..member.findings
                },
            );
            if alarm && *streak >= self.alarm_samples {
                state.exonerated |= 1 << member.actuator;
            }
        }
        let confirmed = any.alarm && state.streak >= self.alarm_samples;
        state.active |= confirmed;
        if any.alarm {
            state.quiet = 0;
        } else if any.tested {
            state.quiet = state.quiet.saturating_add(1);
            if self.clear_samples > 0 && state.quiet >= self.clear_samples {
                state.active = false;
                state.exonerated = 0;
            }
        }
        confirmed
    }

    /// The actuators that may be faulty during an episode; all of them when every one is exonerated, because then
    /// several are faulty or a bound is violated.
    pub fn candidates(&self, state: &EpisodeState) -> u64 {
        let all = u64::MAX >> (64 - self.actuators.clamp(1, 64));
        match all & !state.exonerated {
            0 => all,
            left => left,
        }
    }

    /// The actuator that an episode has isolated.
    pub fn isolated(&self, state: &EpisodeState) -> Option<usize> {
        let candidates = self.candidates(state);
        let single = candidates.count_ones() == 1 && state.exonerated & candidates == 0;
        (state.active && self.isolate && single).then_some(candidates.trailing_zeros() as usize)
    }

    /// Writes verdict and fault sets; `quiet` is the verdict outside an episode. A lost guarantee goes before an
    /// episode, which cannot end any more.
    pub fn conclude(&self, state: &EpisodeState, quiet: Verdict, record: &mut StepRecord) {
        record.certainly_faulty = 0;
        record.possibly_faulty = 0;
        let mut verdict = quiet;
        if state.active {
            record.possibly_faulty = self.candidates(state);
            verdict = Verdict::Fault;
            if self.isolated(state).is_some() {
                record.certainly_faulty = record.possibly_faulty;
                verdict = Verdict::Isolated;
            }
        }
        if quiet == Verdict::GuaranteeLost {
            verdict = quiet;
        }
        record.verdict = verdict as u32;
    }
}

/// An instant without a test neither continues nor breaks a streak.
fn count(streak: &mut u32, findings: Findings) {
    if findings.alarm {
        *streak = streak.saturating_add(1);
    } else if findings.tested {
        *streak = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SILENT: Findings = Findings {
        tested: true,
        alarm: false,
    };
    const ALARM: Findings = Findings {
        tested: true,
        alarm: true,
    };

    fn rules(alarm_samples: u32) -> EpisodeRules {
        EpisodeRules {
            alarm_samples,
            clear_samples: 3,
            actuators: 3,
            isolate: true,
        }
    }

    fn update(rules: EpisodeRules, state: &mut EpisodeState, alarms: &[usize], guaranteed: bool) -> bool {
        let any = if alarms.is_empty() { SILENT } else { ALARM };
        let members = (0..2).map(|actuator| MemberFindings {
            actuator,
            findings: if alarms.contains(&actuator) { ALARM } else { SILENT },
            guaranteed,
        });
        rules.update(state, any, members)
    }

    #[test]
    fn an_actuator_without_member_stays_a_candidate() {
        let mut state = EpisodeState::new(2);
        assert!(update(rules(1), &mut state, &[0, 1], true));
        assert_eq!(rules(1).candidates(&state), 0b100);
        assert_eq!(rules(1).isolated(&state), Some(2));
    }

    #[test]
    fn an_alarm_counts_after_the_configured_number_of_samples() {
        let mut state = EpisodeState::new(2);
        assert!(!update(rules(2), &mut state, &[0], true));
        assert_eq!((state.active, state.exonerated), (false, 0));
        assert!(update(rules(2), &mut state, &[0], true));
        assert_eq!((state.active, state.exonerated), (true, 0b01));
    }

    #[test]
    fn a_member_without_guarantee_exonerates_nobody() {
        let mut state = EpisodeState::new(2);
        assert!(update(rules(1), &mut state, &[0], false));
        assert_eq!((state.active, state.exonerated), (true, 0));
    }

    #[test]
    fn an_episode_ends_after_the_quiet_instants_that_were_tested() {
        let mut state = EpisodeState::new(2);
        update(rules(1), &mut state, &[0], true);
        for _ in 0..2 {
            update(rules(1), &mut state, &[], true);
            rules(1).update(&mut state, Findings::default(), std::iter::empty());
        }
        assert!(state.active);
        update(rules(1), &mut state, &[], true);
        assert_eq!((state.active, state.exonerated), (false, 0));
    }

    #[test]
    fn when_everybody_is_exonerated_everybody_is_suspected() {
        let two = EpisodeRules {
            actuators: 2,
            ..rules(1)
        };
        let mut state = EpisodeState::new(2);
        update(two, &mut state, &[0, 1], true);
        assert_eq!((two.candidates(&state), two.isolated(&state)), (0b11, None));
    }
}
