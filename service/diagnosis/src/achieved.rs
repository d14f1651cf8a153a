//! What a design achieves, in the same words for all methods: norms, poles, inequalities, the faults it is sure to
//! see, and its false alarms.
//!
//! All of it is recomputed from the numbers of the gains whenever a diagnoser is constructed. A gains file states it
//! as well, so that people can read it and so that gains that were altered are found out.

use crate::decomposition::eigenvalues;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// What the gains of one diagnoser achieve on its model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Achieved {
    /// How often the diagnoser alarms without a fault.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub false_alarms: Option<FalseAlarms>,
    /// Norms of transfer matrices and of gains.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub norms: Vec<Norm>,
    /// Eigenvalues of the error dynamics.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub poles: Vec<Poles>,
    /// Conditions that the gains must fulfil.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub inequalities: Vec<Inequality>,
    /// Fault by fault, what is sure or likely to be seen.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<FaultSensitivity>,
    /// What `faults` does not say, and why.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_stated: Vec<NotStated>,
    /// Which faults can be told apart, pair by pair.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub isolability: Vec<Separation>,
    /// What the channels' residuals are compared with.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub thresholds: Vec<Threshold>,
}

/// How often a diagnoser alarms without a fault.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FalseAlarms {
    /// Probability of an alarm at one sampling instant; 0 where alarms without a fault are excluded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub probability_per_instant: Option<f64>,
    /// Expected alarms an hour; 0 where alarms without a fault are excluded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected_per_hour: Option<f64>,
    /// What must be true for it; without a rate, why the rate is unknown.
    pub provided_that: String,
}

/// A norm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Norm {
    /// Of what.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// No gain achieves less.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lower_bound: Option<f64>,
}

/// Eigenvalues of a matrix that governs errors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Poles {
    /// Of which filter or observer.
    pub name: String,
    /// Whether they must lie inside the unit circle or in the left half plane.
    pub time: TimeDomain,
    /// \[real part, imaginary part\] of each, by falling modulus.
    pub values: Vec<[f64; 2]>,
}

impl Poles {
    /// The eigenvalues of a matrix; `None` if they cannot be computed.
    pub fn of(name: String, time: TimeDomain, matrix: &DMatrix<f64>) -> Option<Self> {
        let mut values: Vec<[f64; 2]> = eigenvalues(matrix)?
            .iter()
            .map(|value| [value.re, value.im])
            .collect();
        values.sort_by(|a, b| {
            let modulus = |value: &[f64; 2]| value[0].hypot(value[1]);
            modulus(b)
                .total_cmp(&modulus(a))
                .then(b[0].total_cmp(&a[0]))
                .then(b[1].total_cmp(&a[1]))
        });
        Some(Self { name, time, values })
    }
}

/// The time domain of poles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TimeDomain {
    /// Stable inside the unit circle.
    Discrete,
    /// Stable in the left half plane; 1/s.
    Continuous,
}

/// A condition that the gains must fulfil. It holds while its margin is at least 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inequality {
    /// The condition in words or symbols.
    pub name: String,
    /// How far it is from being violated, in its own units; negative: violated.
    pub margin: f64,
}

/// What is sure, or likely, to be seen of one fault.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultSensitivity {
    /// The fault, as records name it.
    pub fault: String,
    /// Its unit.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// 1 where detection is guaranteed, otherwise the probability that the sizes below speak of.
    pub assurance: f64,
    /// What else must be true for it than for the false alarms; empty: nothing.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub provided_that: String,
    /// Smallest constant fault that is detected; none: no size is, unless [`Achieved::not_stated`] says otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detectable: Option<f64>,
    /// Smallest constant fault that is isolated; none: no size is, or nobody isolates, unless
    /// [`Achieved::not_stated`] says otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub isolable: Option<f64>,
    /// Sizes detected within growing delays, by growing delay ([`Delay::worth_stating`]); the last size is
    /// `detectable`, but for a part in a million, where the list has any.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub delays: Vec<Delay>,
}

/// A constant fault of at least this size is detected within this time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Delay {
    /// From the onset to the alarm at worst, s.
    pub within_s: f64,
    /// Size of the fault.
    pub size: f64,
}

/// Part by which a size must fall to be worth a row of its own.
const WORTH_STATING: f64 = 1e-6;

impl Delay {
    /// The delays, given by growing time, at which a smaller size is detected than in all the time before. Infinite
    /// sizes are left out.
    pub fn worth_stating(delays: impl IntoIterator<Item = Self>) -> Vec<Self> {
        let mut falling: Vec<Self> = Vec::new();
        for delay in delays {
            let before = falling.last().map_or(f64::INFINITY, |delay| delay.size);
            if delay.size.is_finite() && delay.size < before * (1.0 - WORTH_STATING) {
                falling.push(delay);
            }
        }
        falling
    }
}

/// A size of faults that the method has no sound statement of. It is unknown, neither guaranteed nor excluded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NotStated {
    /// Which size.
    pub size: SizeOf,
    /// Of which faults; empty: of all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<String>,
    /// Why.
    pub because: String,
}

/// The sizes that a [`FaultSensitivity`] states.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SizeOf {
    /// [`FaultSensitivity::detectable`] and its delays.
    Detectable,
    /// [`FaultSensitivity::isolable`].
    Isolable,
}

/// Whether one fault can be told from another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Separation {
    /// The fault that is there.
    pub fault: String,
    /// The fault that is to be excluded.
    pub from: String,
    /// Sampling instants that are needed; none: never, whatever the size.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub instants: Option<u64>,
    /// What else they depend on.
    #[serde(default, skip_serializing_if = "Need::is_met_by_instants")]
    pub need: Need,
}

/// What it takes to tell one fault from another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Need {
    /// The stated instants, and a fault that is large enough.
    #[default]
    Instants,
    /// The stated instants at least; how many more depends on the data.
    AtLeast,
    /// The stated instants at least, and the transients of the onset: once they are over the two faults look alike.
    Transients,
}

impl Need {
    fn is_met_by_instants(&self) -> bool {
        *self == Self::Instants
    }
}

/// What a channel's residual is compared with once the start is over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Threshold {
    /// The channel.
    pub channel: String,
    /// Half width of its bounds, or its threshold, in the settled state.
    pub settled: f64,
    /// Why the channel can never alarm, whatever happens, if so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub never_fires: Option<String>,
    /// Why the channel, although it may alarm, is not sure to see any of the faults that matter, or not before another
    /// channel, if so: no alarm of it can be relied on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub insensitive: Option<String>,
}

impl Achieved {
    /// Whether nothing is stated of this size of a fault.
    pub fn is_not_stated(&self, size: SizeOf, fault: &str) -> bool {
        self.not_stated.iter().any(|not| {
            not.size == size && (not.faults.is_empty() || not.faults.iter().any(|name| name == fault))
        })
    }

    /// The first condition that does not hold. A margin that is not a number does not hold.
    pub fn violated(&self) -> Option<&Inequality> {
        self.inequalities
            .iter()
            .find(|inequality| !(inequality.margin >= 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_that_gains_nothing_is_not_worth_stating() {
        let delays = [
            (0.0, f64::INFINITY),
            (0.1, 3.0),
            (0.2, 3.0),
            (0.3, 3.0 - 1e-9),
            (0.5, 2.0),
            (0.6, 2.5),
        ];
        let delays = delays.map(|(within_s, size)| Delay { within_s, size });
        let found = Delay::worth_stating(delays);
        assert_eq!(found, [delays[1], delays[4]]);
    }

    #[test]
    fn what_is_not_stated_is_so_for_the_named_faults_or_for_all() {
        let not_stated = |size, faults: &[&str]| NotStated {
            size,
            faults: faults.iter().map(|name| (*name).to_owned()).collect(),
            because: String::new(),
        };
        let achieved = Achieved {
            not_stated: vec![
                not_stated(SizeOf::Detectable, &["a"]),
                not_stated(SizeOf::Isolable, &[]),
            ],
            ..Achieved::default()
        };
        assert!(achieved.is_not_stated(SizeOf::Detectable, "a"));
        assert!(!achieved.is_not_stated(SizeOf::Detectable, "b"));
        assert!(achieved.is_not_stated(SizeOf::Isolable, "b"));
    }
}
