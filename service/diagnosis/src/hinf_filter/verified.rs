//! Gains of the bank and of the fault estimate, checked before they run (method sheet 4.5).

use super::{
    bank::{blind_leak, blind_weighted, check_isolable, fault_inverse, largest_leak},
    certificate::{Gain, Time},
    error::HinfFilterError,
    gains::{BlindGains, EstimatorGains, post_filter},
    main_filter::riccati_conditions,
    options::HinfFilterOptions,
    problem::Problem,
    synthesis::check_riccati,
};
use crate::{spectrum::spectral_radius, tables::shaped_matrix};
use nalgebra::DMatrix;

/// Largest part of Bfd that the estimating filter may leave in the state, relative.
const ESTIMATE: f64 = 1e-9;

/// A blind filter that keeps its conditions.
pub(super) struct CheckedBlind {
    /// L, n x q.
    pub gain: DMatrix<f64>,
    /// V, s x q.
    pub v: DMatrix<f64>,
    /// ‖V T_blind‖∞.
    pub leak: f64,
}

/// The filters of the bank: the configured sets, isolable, stable, and no more than 1/w_b of the blind faults passes.
pub(super) fn checked_bank(
    problem: &Problem,
    options: &HinfFilterOptions,
    gains: &[BlindGains],
) -> Result<Vec<CheckedBlind>, HinfFilterError> {
    let wanted = &problem.faults.blind;
    if gains.len() != wanted.len() {
        return Err(HinfFilterError::OtherFilters {
            key: "gains.blind".to_owned(),
            found: format!("{} blind filters", gains.len()),
            wanted: wanted.len().to_string(),
        });
    }
    let weight = options
        .isolation
        .as_ref()
        .map_or(1.0, |isolation| isolation.blind_weight);
    let (n, _, q, _, _) = problem.plant.dimensions();
    let mut checked = Vec::new();
    for (index, (set, gains)) in wanted.iter().zip(gains).enumerate() {
        let names: Vec<String> = set.iter().map(|j| problem.faults.names[*j].clone()).collect();
        if names != gains.faults {
            return Err(HinfFilterError::OtherFilters {
                key: format!("gains.blind.{index}.faults"),
                found: format!("a filter blind to {:?}", gains.faults),
                wanted: format!("one blind to {names:?}"),
            });
        }
        check_isolable(problem, index, set)?;
        let key = |name: &str| format!("gains.blind.{index}.{name}");
        let gain = shaped_matrix(&key("L"), &gains.l, (n, q), "states x outputs")?;
        let v = post_filter(&key("V"), &gains.v, q)?;
        let leak = blind_leak(problem, set, &gain, &v);
        if !(leak <= largest_leak(weight)) {
            let error = match leak.is_finite() {
                true => HinfFilterError::NotBlind { index, gain: leak },
                false => unstable(problem, &gain, format!("blind filter {index}")),
            };
            return Err(error.of_gains(key("L")));
        }
        let pi = shaped_matrix(&key("Pi"), &gains.riccati, (n, n), "states x states")?;
        let design = Gain {
            time: Time::Discrete,
            matrix: gain,
            v,
        };
        let weighted = blind_weighted(problem, set, weight);
        let check = check_riccati(&problem.plant, &problem.sampled, &design, &weighted, &pi);
        let check = check.map_err(|source| HinfFilterError::Riccati {
            filter: format!("blind filter {index}"),
            source,
        });
        let conditions = riccati_conditions(&check.map_err(|error| error.of_gains(key("Pi")))?);
        if let Some(violated) = conditions.iter().find(|condition| !condition.holds()) {
            let error = HinfFilterError::Certificate {
                reason: violated.violation.clone(),
                margin: violated.margin,
            };
            return Err(error.of_gains(key("L")));
        }
        checked.push(CheckedBlind {
            gain: design.matrix,
            v: design.v,
            leak,
        });
    }
    Ok(checked)
}

/// The filter of the fault estimate that keeps its conditions.
pub(super) struct CheckedEstimate {
    /// L, n x q.
    pub gain: DMatrix<f64>,
    /// Df⁺, l x q.
    pub inverse: DMatrix<f64>,
}

/// L of the estimating filter with Df⁺: T_rf ≡ Df, stable.
pub(super) fn checked_estimate(
    problem: &Problem,
    options: &HinfFilterOptions,
    gains: Option<&EstimatorGains>,
) -> Result<Option<CheckedEstimate>, HinfFilterError> {
    let wanted = options
        .isolation
        .as_ref()
        .is_some_and(|isolation| isolation.fault_estimate);
    let gains = match (gains, wanted) {
        (None, false) => return Ok(None),
        (Some(gains), true) => gains,
        (found, _) => {
            let words = |present: bool| {
                if present {
                    "a fault estimate"
                } else {
                    "no fault estimate"
                }
            };
            return Err(HinfFilterError::OtherFilters {
                key: "gains.estimator".to_owned(),
                found: words(found.is_some()).to_owned(),
                wanted: words(wanted).to_owned(),
            });
        }
    };
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let (n, _, q, _, _) = plant.dimensions();
    let gain = shaped_matrix("gains.estimator.L", &gains.l, (n, q), "states x outputs")?;
    let inverse = fault_inverse(problem)?;
    let rest = (&sampled.bfd - &gain * &plant.df).amax() / sampled.bfd.amax().max(f64::MIN_POSITIVE);
    if !(rest <= ESTIMATE) {
        return Err(HinfFilterError::NotTheEstimate {
            rest,
            margin: ESTIMATE - rest,
        });
    }
    let radius = spectral_radius(&(&sampled.ad - &gain * &plant.c)).unwrap_or(f64::INFINITY);
    if !(radius < 1.0 - 1e-9) {
        return Err(unstable(problem, &gain, "the fault estimate".to_owned()).of_gains("gains.estimator.L"));
    }
    Ok(Some(CheckedEstimate { gain, inverse }))
}

fn unstable(problem: &Problem, gain: &DMatrix<f64>, filter: String) -> HinfFilterError {
    let radius = spectral_radius(&(&problem.sampled.ad - gain * &problem.plant.c));
    HinfFilterError::FilterNotStable {
        filter,
        pole: radius.map_or_else(|| "unknown".to_owned(), |radius| format!("of modulus {radius}")),
    }
}
