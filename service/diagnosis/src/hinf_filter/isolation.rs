//! Which faults explain the alarms of the bank (method sheet 4.5).
//!
//! An alarm of filter i proves a fault outside its blind set B_i. A fault is ruled out when a filter that sees it has
//! kept silent for longer than the waiting time. The isolated set is the smallest set of faults that has one outside
//! B_i for every filter that has fired; several of the same size are ambiguous.

use serde::{Deserialize, Serialize};

/// Larger explanations are not sought.
const LARGEST: usize = 3;

/// The bank's sets, constant.
#[derive(Clone, Debug)]
pub(super) struct BlindSets {
    /// Faults outside B_i, bit by bit, for every filter.
    seen: Vec<u64>,
    /// All faults.
    all: u64,
    /// Waiting time in samples.
    wait: u64,
}

/// What the bank has said since the present episode began.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Episode {
    /// Filters that have fired, bit by bit.
    fired: u64,
    /// Instants since the first alarm.
    age: u64,
    /// Instants since the last alarm.
    quiet: u64,
    active: bool,
}

/// What follows for the faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Explanation {
    /// Faults that belong to every smallest explanation.
    pub certain: u64,
    /// Faults that belong to some smallest explanation.
    pub possible: u64,
    /// Whether there is exactly one smallest explanation.
    pub unique: bool,
}

impl BlindSets {
    /// The sets of `count` faults; `wait` in samples.
    pub fn new(blind: &[Vec<usize>], count: usize, wait: u64) -> Self {
        let all = (0..count).fold(0, |bits, j| bits | 1_u64 << j);
        Self {
            seen: blind
                .iter()
                .map(|set| all & !set.iter().fold(0, |bits, j| bits | 1_u64 << j))
                .collect(),
            all,
            wait,
        }
    }

    /// Takes the alarms of one instant: `any` of all filters, `fired` filter by filter.
    pub fn update(&self, episode: &mut Episode, any: bool, fired: impl Iterator<Item = bool>) {
        if episode.active {
            episode.age = episode.age.saturating_add(1);
            episode.quiet = episode.quiet.saturating_add(1);
            if !any && episode.quiet > self.wait {
                *episode = Episode::default();
            }
        }
        if any {
            episode.active = true;
            episode.quiet = 0;
            for (i, fired) in fired.enumerate() {
                episode.fired |= u64::from(fired) << i;
            }
        }
    }

    /// The smallest explanations of what has fired.
    pub fn explain(&self, episode: &Episode) -> Explanation {
        let nothing = Explanation {
            certain: 0,
            possible: self.all,
            unique: false,
        };
        if episode.fired == 0 {
            return nothing;
        }
        let mut candidates = self.all;
        if episode.age >= self.wait {
            let silent = |i: usize| episode.fired & (1 << i) == 0;
            for (_, seen) in self.seen.iter().enumerate().filter(|(i, _)| silent(*i)) {
                candidates &= !seen;
            }
        }
        for size in 1..=LARGEST {
            let mut found = Search {
                certain: u64::MAX,
                possible: 0,
                first: None,
                unique: true,
            };
            self.search(episode.fired, candidates, 0, size, &mut found);
            if found.first.is_some() {
                return Explanation {
                    certain: found.certain,
                    possible: found.possible,
                    unique: found.unique,
                };
            }
        }
        nothing
    }

    /// Extends `chosen` by at most `left` candidates until every filter that has fired is explained.
    fn search(&self, fired: u64, candidates: u64, chosen: u64, left: usize, found: &mut Search) {
        let open = self
            .seen
            .iter()
            .enumerate()
            .find(|(i, seen)| fired & (1 << i) != 0 && **seen & chosen == 0);
        let Some((_, seen)) = open else {
            found.add(chosen);
            return;
        };
        if left == 0 {
            return;
        }
        let mut rest = seen & candidates;
        while rest != 0 {
            let fault = rest & rest.wrapping_neg();
            rest ^= fault;
            self.search(fired, candidates, chosen | fault, left - 1, found);
        }
    }
}

/// Explanations of one size; the same set may be met more than once.
struct Search {
    certain: u64,
    possible: u64,
    first: Option<u64>,
    unique: bool,
}

impl Search {
    fn add(&mut self, set: u64) {
        self.certain &= set;
        self.possible |= set;
        match self.first {
            None => self.first = Some(set),
            Some(first) => self.unique &= first == set,
        }
    }
}

impl Episode {
    pub fn fits(&self, filters: usize) -> bool {
        filters >= 64 || self.fired >> filters == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn conclusion(sets: &BlindSets, fired: &[bool], instants: u64) -> Explanation {
        let mut episode = Episode::default();
        for _ in 0..=instants {
            sets.update(&mut episode, true, fired.iter().copied());
        }
        sets.explain(&episode)
    }

    #[test]
    fn two_filters_tell_two_faults_and_both_together() {
        let sets = BlindSets::new(&[vec![0], vec![1]], 2, 100);
        let isolated = |fired: &[bool]| conclusion(&sets, fired, 0);
        let only = |certain| Explanation {
            certain,
            possible: certain,
            unique: true,
        };
        assert_eq!(isolated(&[false, true]), only(0b01));
        assert_eq!(isolated(&[true, false]), only(0b10));
        assert_eq!(isolated(&[true, true]), only(0b11));
        assert_eq!(
            isolated(&[false, false]),
            Explanation {
                certain: 0,
                possible: 0b11,
                unique: false
            }
        );
    }

    #[test]
    fn waiting_rules_out_faults_whose_filters_keep_silent() {
        let sets = BlindSets::new(&[vec![0], vec![1], vec![2]], 3, 50);
        let young = conclusion(&sets, &[false, true, false], 10);
        assert_eq!((young.possible, young.unique), (0b101, false));
        let fired = [false, true, true];
        assert_eq!(conclusion(&sets, &fired, 10).possible, 0b001);
        // With every other filter silent for long no single fault is left.
        let old = conclusion(&sets, &[false, true, false], 60);
        assert_eq!((old.possible, old.unique), (0b111, false));
    }

    #[test]
    fn an_episode_ends_after_the_waiting_time_in_silence() {
        let sets = BlindSets::new(&[vec![0], vec![1]], 2, 5);
        let mut episode = Episode::default();
        sets.update(&mut episode, true, [true, false].into_iter());
        for _ in 0..5 {
            sets.update(&mut episode, false, [false, false].into_iter());
            assert!(sets.explain(&episode).unique);
        }
        sets.update(&mut episode, false, [false, false].into_iter());
        assert_eq!(episode, Episode::default());
    }
}
