//! Names and bounds of the faults, and the sets to which filters are blind.

use super::{
    error::HinfFilterError,
    options::IsolationOptions,
    problem::{Sign, at_least, positive},
};
use nalgebra::DVector;
use residual_shared::record::MAX_FAULTS;

/// More faults are not told apart: the search for explanations must stay short.
const MAX_ISOLATED: usize = 24;

/// The faults of a plant.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultSet {
    /// One name per column of Bf and Df.
    pub names: Vec<String>,
    /// f̄, length l; zero without isolation.
    pub bound: DVector<f64>,
    /// ḟ̄, length l; zero where faults change at sampling instants only.
    pub slew: DVector<f64>,
    /// B_i: the columns to which filter i is blind, sorted.
    pub blind: Vec<Vec<usize>>,
}

impl FaultSet {
    /// Checks names, bounds and sets of `count` faults.
    pub(super) fn new(options: Option<&IsolationOptions>, count: usize) -> Result<Self, HinfFilterError> {
        if count > MAX_FAULTS {
            return Err(HinfFilterError::OutOfRange {
                key: "model.Bf".to_owned(),
                value: count as f64,
                allowed: "this is the number of its columns, at most 64 faults are possible",
            });
        }
        let default_names = || (1..=count).map(|j| format!("f{j}")).collect();
        let Some(options) = options else {
            return Ok(Self {
                names: default_names(),
                bound: DVector::zeros(count),
                slew: DVector::zeros(count),
                blind: Vec::new(),
            });
        };
        let names: Vec<String> = match options.fault_names.is_empty() {
            true => default_names(),
            false => options.fault_names.clone(),
        };
        check_names(&names, count)?;
        positive("isolation.blind_weight", Some(options.blind_weight))?;
        positive("isolation.isolation_wait", Some(options.isolation_wait))?;
        let bound = at_least(
            "isolation.fault_bound",
            &options.fault_bound,
            count,
            "faults",
            Sign::Positive,
        )?;
        let slew = match &options.fault_slew {
            Some(slew) => at_least("isolation.fault_slew", slew, count, "faults", Sign::NotNegative)?,
            None => DVector::zeros(count),
        };
        if !options.blind_sets.is_empty() && count > MAX_ISOLATED {
            return Err(HinfFilterError::OutOfRange {
                key: "isolation.blind_sets".to_owned(),
                value: count as f64,
                allowed: "this is the number of faults, at most 24 can be isolated",
            });
        }
        let mut blind = Vec::new();
        for (i, set) in options.blind_sets.iter().enumerate() {
            blind.push(read_set(i, set, &names)?);
        }
        Ok(Self {
            names,
            bound,
            slew,
            blind,
        })
    }
}

fn check_names(names: &[String], count: usize) -> Result<(), HinfFilterError> {
    if names.len() != count {
        return Err(HinfFilterError::OutOfRange {
            key: "isolation.fault_names".to_owned(),
            value: names.len() as f64,
            allowed: "this is the number of names, one per column of `model.Bf` is needed",
        });
    }
    let twice = names
        .iter()
        .enumerate()
        .find(|(i, name)| names[..*i].contains(name) || name.trim().is_empty());
    match twice {
        Some((i, name)) => Err(HinfFilterError::FaultName {
            key: format!("isolation.fault_names.{i}"),
            name: name.clone(),
            reason: "is empty or stands there twice; give every fault a name of its own",
        }),
        None => Ok(()),
    }
}

fn read_set(i: usize, set: &[String], names: &[String]) -> Result<Vec<usize>, HinfFilterError> {
    let key = format!("isolation.blind_sets.{i}");
    let wrong = |name: &str, reason| HinfFilterError::FaultName {
        key: key.clone(),
        name: name.to_owned(),
        reason,
    };
    let mut columns = Vec::new();
    for name in set {
        let column = names
            .iter()
            .position(|other| other == name)
            .ok_or_else(|| wrong(name, "is no fault; use the names of `isolation.fault_names`"))?;
        if columns.contains(&column) {
            return Err(wrong(name, "stands there twice; remove one"));
        }
        columns.push(column);
    }
    if columns.is_empty() || columns.len() == names.len() {
        let text = set.join("\", \"");
        return Err(wrong(
            &text,
            "is no part of the faults; name some of them, not all",
        ));
    }
    columns.sort_unstable();
    Ok(columns)
}
