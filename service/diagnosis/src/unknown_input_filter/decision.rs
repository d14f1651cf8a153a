//! What falsified modes prove about the actuators (method sheet 4.5).
//!
//! A mode is falsified when a test of its filter alarms. Every mode that is not falsified may be the truth, and
//! one of them is, as long as the true mode is listed and the bounds hold.

use super::modes::FaultMode;

/// What the surviving modes say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// Nothing is falsified.
    None,
    /// Exactly one minimal mode survives: its actuators are certainly faulty, no other fault is needed.
    Isolated,
    /// A fault is certain; several minimal modes explain it.
    Ambiguous,
    /// No mode survives: several faults, a mode that is not listed, or a violated bound.
    OutsideModel,
}

/// The decision and the fault sets that it proves; bit j of a set is actuator j.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Conclusion {
    /// The decision.
    pub decision: Decision,
    /// The minimal mode that survives alone; only with [`Decision::Isolated`].
    pub isolated: Option<FaultMode>,
    /// Intersection of all surviving modes once something is falsified; else empty.
    pub certainly_faulty: u64,
    /// Union of all surviving modes once something is falsified; else empty. Empty under
    /// [`Decision::OutsideModel`] as well, where no listed mode explains the measurements.
    pub possibly_faulty: u64,
}

/// The modes that survive: neither falsified nor, once anything is, fault-free.
///
/// `falsified[i]` belongs to `modes[i]`; a mode without a flag counts as not falsified.
pub fn survivors(modes: &[FaultMode], falsified: &[bool]) -> impl Iterator<Item = FaultMode> + Clone {
    let any = falsified.contains(&true);
    let flags = falsified.iter().copied().chain(std::iter::repeat(false));
    modes
        .iter()
        .copied()
        .zip(flags)
        .filter(move |&(mode, out)| !(out || any && mode.is_empty()))
        .map(|(mode, _)| mode)
}

/// The surviving modes of which no proper subset survives.
pub fn minimal_survivors(modes: &[FaultMode], falsified: &[bool]) -> impl Iterator<Item = FaultMode> + Clone {
    let all = survivors(modes, falsified);
    all.clone()
        .filter(move |mode| !all.clone().any(|other| other.is_proper_subset_of(*mode)))
}

/// Concludes from the flags of all modes. Allocates nothing.
pub fn decide(modes: &[FaultMode], falsified: &[bool]) -> Conclusion {
    if !falsified.contains(&true) {
        return Conclusion {
            decision: Decision::None,
            isolated: None,
            certainly_faulty: 0,
            possibly_faulty: 0,
        };
    }
    let all = survivors(modes, falsified);
    let certainly_faulty = all
        .clone()
        .map(FaultMode::bits)
        .reduce(|left, right| left & right)
        .unwrap_or(0);
    let possibly_faulty = all.fold(0, |union, mode| union | mode.bits());
    let mut minimal = minimal_survivors(modes, falsified);
    let (decision, isolated) = match (minimal.next(), minimal.next()) {
        (None, _) => (Decision::OutsideModel, None),
        (Some(mode), None) => (Decision::Isolated, Some(mode)),
        (Some(_), Some(_)) => (Decision::Ambiguous, None),
    };
    Conclusion {
        decision,
        isolated,
        certainly_faulty,
        possibly_faulty,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unknown_input_filter::modes::enumerate_modes;
    use serde::Deserialize;

    #[derive(Deserialize)]
    struct UnitCases {
        isolation: Isolation,
    }

    #[derive(Deserialize)]
    struct Isolation {
        cases: Vec<Case>,
    }

    #[derive(Deserialize)]
    struct Case {
        modes: Vec<FaultMode>,
        falsified: Vec<u8>,
        decision: String,
        minimal: Option<Vec<FaultMode>>,
        certainly_faulty: Option<FaultMode>,
    }

    fn name(decision: Decision) -> &'static str {
        match decision {
            Decision::None => "none",
            Decision::Isolated => "isolated",
            Decision::Ambiguous => "ambiguous",
            Decision::OutsideModel => "outside_model",
        }
    }

    #[test]
    fn the_reference_cases_are_decided_as_listed() {
        let text = include_str!("../../tests/reference/unknown_input_filter/unit_cases.json");
        let reference: UnitCases = serde_json::from_str(text).unwrap();
        assert_eq!(reference.isolation.cases.len(), 10);
        for case in reference.isolation.cases {
            let falsified: Vec<bool> = case.falsified.iter().map(|&flag| flag == 1).collect();
            let conclusion = decide(&case.modes, &falsified);
            assert_eq!(name(conclusion.decision), case.decision);
            if let Some(minimal) = case.minimal {
                assert_eq!(
                    minimal_survivors(&case.modes, &falsified).collect::<Vec<_>>(),
                    minimal
                );
            }
            if let Some(certain) = case.certainly_faulty {
                assert_eq!(conclusion.certainly_faulty, certain.bits());
            }
        }
    }

    /// All flag patterns of banks with up to four actuators, with and without pairs and the fault-free mode.
    fn for_every_pattern(mut check: impl FnMut(&[FaultMode], &[bool])) {
        for actuators in 1..=4 {
            for (fault_free, pairs) in [(false, false), (true, false), (false, true), (true, true)] {
                let modes = enumerate_modes(actuators, fault_free, pairs);
                for pattern in 0..1_u32 << modes.len() {
                    let falsified: Vec<bool> = (0..modes.len()).map(|i| pattern >> i & 1 == 1).collect();
                    check(&modes, &falsified);
                }
            }
        }
    }

    #[test]
    fn certain_faults_are_possible_and_follow_from_the_minimal_modes() {
        let mut patterns = 0;
        for_every_pattern(|modes, falsified| {
            patterns += 1;
            let conclusion = decide(modes, falsified);
            assert_eq!(conclusion.certainly_faulty & !conclusion.possibly_faulty, 0);
            let minimal: Vec<FaultMode> = minimal_survivors(modes, falsified).collect();
            let common = minimal.iter().fold(u64::MAX, |bits, mode| bits & mode.bits());
            match conclusion.decision {
                Decision::None => assert!(!falsified.contains(&true)),
                Decision::OutsideModel => {
                    assert!(minimal.is_empty() && conclusion.possibly_faulty == 0);
                }
                Decision::Isolated => {
                    assert_eq!(minimal, [conclusion.isolated.unwrap()]);
                    assert_eq!(conclusion.certainly_faulty, minimal[0].bits());
                }
                Decision::Ambiguous => {
                    assert!(minimal.len() > 1);
                    assert_eq!(conclusion.certainly_faulty, common);
                }
            }
        });
        assert_eq!(patterns, 3384);
    }

    #[test]
    fn the_truth_lies_between_the_certain_and_the_possible_faults() {
        for_every_pattern(|modes, falsified| {
            let conclusion = decide(modes, falsified);
            let faulty = conclusion.decision != Decision::None;
            for truth in survivors(modes, falsified).filter(|_| faulty) {
                assert_eq!(conclusion.certainly_faulty & !truth.bits(), 0);
                assert_eq!(truth.bits() & !conclusion.possibly_faulty, 0);
                assert!(minimal_survivors(modes, falsified).any(|mode| mode.is_subset_of(truth)));
                assert!(!truth.is_empty());
            }
        });
    }

    #[test]
    fn one_more_falsified_mode_never_weakens_what_is_certain() {
        for_every_pattern(|modes, falsified| {
            let before = decide(modes, falsified);
            for i in (0..modes.len()).filter(|&i| !falsified[i]) {
                let mut more = falsified.to_vec();
                more[i] = true;
                let after = decide(modes, &more);
                if before.decision != Decision::None && after.decision != Decision::OutsideModel {
                    assert_eq!(before.certainly_faulty & !after.certainly_faulty, 0);
                    assert_eq!(after.possibly_faulty & !before.possibly_faulty, 0);
                }
            }
        });
    }
}
