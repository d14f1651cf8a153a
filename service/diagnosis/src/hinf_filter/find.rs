//! From the configured type of design to the gains, as far as no solver is needed (method sheet 3.2).

use super::{
    bank::{find_blind, find_estimate},
    certificate::{Gain, Time},
    error::HinfFilterError,
    gains::{BlindGains, EstimatorGains, HinfFilterGains, MainGains, post_filter, rows},
    main_filter::certified,
    options::{DesignType, HinfFilterOptions, RealisationType},
    plant::Plant,
    problem::Problem,
    synthesis::{RiccatiDesign, Weighted, matched_gain, synth_riccati_ct, synth_riccati_dt},
};
use crate::{decomposition::SingularDecomposition, tables::shaped_matrix};
use nalgebra::DMatrix;

/// The gains of a design that needs no solver.
///
/// # Errors
/// [`HinfFilterError::NeedsSolver`] for a design by matrix inequalities; otherwise the first condition that does not hold.
pub fn find_gains(
    problem: &Problem,
    options: &HinfFilterOptions,
) -> Result<HinfFilterGains, HinfFilterError> {
    let design = options.synthesis.design;
    let main = match design {
        DesignType::RiccatiDiscrete | DesignType::RiccatiContinuous => riccati_gains(problem, design)?,
        DesignType::Matched => matched_gains(problem, options)?,
        DesignType::Given => given_gains(problem, options)?,
        _ => {
            return Err(HinfFilterError::NeedsSolver {
                design: design.name(),
            });
        }
    };
    complete(problem, options, main)
}

/// Labels the gains of the detecting filter and adds the bank and the fault estimate.
///
/// # Errors
/// The first condition that does not hold; an uncertified gain unless that is allowed.
pub fn complete(
    problem: &Problem,
    options: &HinfFilterOptions,
    mut main: MainGains,
) -> Result<HinfFilterGains, HinfFilterError> {
    main.label = certified(problem, options, &main)?.label();
    let mut blind = Vec::new();
    for (index, set) in problem.faults.blind.iter().enumerate() {
        let weight = options
            .isolation
            .as_ref()
            .map_or(1.0, |isolation| isolation.blind_weight);
        let design = find_blind(problem, index, weight)?;
        blind.push(BlindGains {
            faults: set.iter().map(|j| problem.faults.names[*j].clone()).collect(),
            l: rows(&design.gain),
            v: rows(&design.v),
            riccati: rows(&design.solution.pi),
        });
    }
    let estimates = options
        .isolation
        .as_ref()
        .is_some_and(|isolation| isolation.fault_estimate);
    let estimator = match estimates {
        true => Some(EstimatorGains {
            l: rows(&find_estimate(problem)?),
        }),
        false => None,
    };
    Ok(HinfFilterGains {
        main,
        blind,
        estimator,
    })
}

/// The Riccati design of `design`, discrete or continuous: what every other design falls back to as well.
///
/// # Errors
/// [`HinfFilterError::Riccati`], [`HinfFilterError::Unbounded`].
pub fn riccati_gains(problem: &Problem, design: DesignType) -> Result<MainGains, HinfFilterError> {
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let refused = |source| HinfFilterError::Riccati {
        filter: "the filter".to_owned(),
        source,
    };
    let (time, found): (Time, RiccatiDesign) = match design {
        DesignType::RiccatiContinuous => {
            check_bounded(plant, problem)?;
            let weighted = weighted(problem, Time::Continuous);
            (
                Time::Continuous,
                synth_riccati_ct(plant, &weighted).map_err(refused)?,
            )
        }
        _ => {
            let weighted = weighted(problem, Time::Discrete);
            let found = synth_riccati_dt(&sampled.ad, &plant.c, &weighted, &sampled.bdd).map_err(refused)?;
            (Time::Discrete, found)
        }
    };
    let gain = Gain {
        time,
        matrix: found.gain,
        v: found.v,
    };
    Ok(MainGains {
        riccati: Some(rows(&found.solution.pi)),
        ..MainGains::new(design, &gain)
    })
}

fn matched_gains(problem: &Problem, options: &HinfFilterOptions) -> Result<MainGains, HinfFilterError> {
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let (time, input) = match options.filter.realisation {
        RealisationType::DiscreteObserver => (Time::Discrete, &sampled.bdd),
        _ => (Time::Continuous, &plant.bd),
    };
    let gain = Gain {
        time,
        matrix: matched_gain(input, &plant.dd).ok_or(HinfFilterError::NotMatched)?,
        v: configured_post_filter(problem, options)?,
    };
    Ok(MainGains::new(DesignType::Matched, &gain))
}

pub(super) fn given_gains(
    problem: &Problem,
    options: &HinfFilterOptions,
) -> Result<MainGains, HinfFilterError> {
    let synthesis = &options.synthesis;
    let (n, _, q, _, _) = problem.plant.dimensions();
    let (time, key, entries) = match (&synthesis.l, &synthesis.h) {
        (Some(entries), _) => (Time::Discrete, "synthesis.L", entries.as_slice()),
        (None, Some(entries)) => (Time::Continuous, "synthesis.H", entries.as_slice()),
        (None, None) => (Time::Discrete, "synthesis.L", &[][..]),
    };
    let gain = Gain {
        time,
        matrix: shaped_matrix(key, entries, (n, q), "states x outputs")?,
        v: configured_post_filter(problem, options)?,
    };
    Ok(MainGains {
        claimed_bound: synthesis.claimed_bound,
        ..MainGains::new(DesignType::Given, &gain)
    })
}

/// Weighted disturbance matrices of a design in one time domain.
pub(super) fn weighted(problem: &Problem, time: Time) -> Weighted {
    let input = match time {
        Time::Discrete => &problem.sampled.bdd,
        Time::Continuous => &problem.plant.bd,
    };
    let (weight, noise) = (&problem.disturbance_weight, &problem.noise_weight);
    Weighted::new(input, &problem.plant.dd, weight, noise)
}

pub(super) fn configured_post_filter(
    problem: &Problem,
    options: &HinfFilterOptions,
) -> Result<DMatrix<f64>, HinfFilterError> {
    let q = problem.plant.c.nrows();
    match &options.synthesis.v {
        None => Ok(DMatrix::identity(q, q)),
        Some(entries) => post_filter("synthesis.V", entries, q),
    }
}

/// Without any measurement noise the infimum is 0, and larger gains are always better.
fn check_bounded(plant: &Plant, problem: &Problem) -> Result<(), HinfFilterError> {
    match has_no_direct_disturbance(plant) && problem.noise_weight.amax() == 0.0 {
        true => Err(HinfFilterError::Unbounded),
        false => Ok(()),
    }
}

/// σ_max(Dd) <= 1e-12 σ_max(Bd).
pub(super) fn has_no_direct_disturbance(plant: &Plant) -> bool {
    let size = |matrix: &DMatrix<f64>| SingularDecomposition::new(matrix).largest();
    size(&plant.dd) <= 1e-12 * size(&plant.bd)
}
