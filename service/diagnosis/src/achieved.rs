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
    /// What must be true for it.
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
    /// Smallest constant fault that is detected; none: no size is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detectable: Option<f64>,
    /// Smallest constant fault that is isolated; none: no size is, or nobody isolates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub isolable: Option<f64>,
    /// Sizes detected within growing delays, by growing delay; the last size is `detectable` where the list has any.
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
}

/// What a channel's residual is compared with once the start is over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Threshold {
    /// The channel.
    pub channel: String,
    /// Half width of its bounds, or its threshold, in the settled state.
    pub settled: f64,
    /// Why the channel can never alarm, if so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub never_fires: Option<String>,
}

impl Achieved {
    /// The first condition that does not hold. A margin that is not a number does not hold.
    pub fn violated(&self) -> Option<&Inequality> {
        self.inequalities
            .iter()
            .find(|inequality| !(inequality.margin >= 0.0))
    }
}
