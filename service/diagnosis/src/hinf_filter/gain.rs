//! From the configured type of design to the gain of the filter and its sampled form (method sheet 3.2, 3.3).

use super::{
    certificate::{Certificate, Claims, Gain, Time, certify},
    error::HinfFilterError,
    observer::Correction,
    options::{DesignType, HinfFilterOptions, RealisationType},
    plant::Plant,
    problem::Problem,
    realisation::{filter_foh, filter_zoh},
    synthesis::{RiccatiDesign, Weighted, matched_gain, synth_riccati_ct, synth_riccati_dt},
};
use crate::{
    decomposition::SingularDecomposition,
    tables::{matrix, shaped_matrix},
};
use nalgebra::DMatrix;

/// The gain of the filter in force.
#[derive(Clone, Debug)]
pub(super) struct MainDesign {
    /// Its certificate: of L, or of H where the realisation holds the samples.
    pub certificate: Certificate,
    /// Matrix of the error from instant to instant: Ad - LC, or Φ.
    pub closed: DMatrix<f64>,
    /// How a sample enters the error: L, or Gy.
    pub gain: DMatrix<f64>,
    /// V.
    pub v: DMatrix<f64>,
    pub correction: Correction,
    /// √λ_max(Ω) of a Riccati design.
    pub optimum: Option<f64>,
}

pub(super) fn design_main(
    problem: &Problem,
    options: &HinfFilterOptions,
) -> Result<MainDesign, HinfFilterError> {
    let (gain, optimum) = find_gain(problem, options)?;
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let synthesis = &options.synthesis;
    let claims = Claims {
        bound: synthesis.claimed_bound,
        pole_decay: synthesis.pole_decay,
        pole_radius: synthesis.pole_radius,
    };
    let mut certificate = accepted(problem, options, &gain, &claims)?;
    let sample_time_s = sampled.sample_time_s;
    let (closed, in_force, correction) = match (options.filter.realisation, gain.time) {
        (RealisationType::DiscreteObserver, time) => {
            let l = match time {
                Time::Discrete => gain.matrix.clone(),
                Time::Continuous => plant.averaged_gain(&gain.matrix, sample_time_s),
            };
            if time == Time::Continuous {
                let discrete = Gain {
                    time: Time::Discrete,
                    matrix: l.clone(),
                    v: gain.v.clone(),
                };
                let continuous = certificate.uncertified;
                certificate = accepted(problem, options, &discrete, &Claims::default())?;
                certificate.uncertified = continuous.or(certificate.uncertified);
            }
            (&sampled.ad - &l * &plant.c, l.clone(), Correction::residual(&l))
        }
        (RealisationType::ZeroOrderHold, _) => {
            let filter = filter_zoh(plant, &gain.matrix, sample_time_s);
            let correction = Correction::held(&filter);
            (filter.phi, filter.gy, correction)
        }
        (RealisationType::FirstOrderHold, _) => {
            let filter = filter_foh(plant, &gain.matrix, sample_time_s);
            let correction = Correction::interpolated(&filter);
            (filter.phi, &filter.g0 + &filter.g1, correction)
        }
    };
    Ok(MainDesign {
        certificate,
        closed,
        gain: in_force,
        v: gain.v,
        correction,
        optimum,
    })
}

/// The certificate of a gain; refuses unstable, too large and, unless allowed, uncertified ones.
fn accepted(
    problem: &Problem,
    options: &HinfFilterOptions,
    gain: &Gain,
    claims: &Claims,
) -> Result<Certificate, HinfFilterError> {
    let certificate = certify(&problem.plant, &problem.sampled, gain, claims)?;
    let limit = options.synthesis.max_gain;
    if !(certificate.gain <= limit) {
        return Err(HinfFilterError::GainTooLarge {
            norm: certificate.gain,
            limit,
        });
    }
    match &certificate.uncertified {
        Some(reason) if !options.synthesis.allow_uncertified => Err(HinfFilterError::Certificate {
            reason: reason.clone(),
        }),
        _ => Ok(certificate),
    }
}

fn find_gain(problem: &Problem, options: &HinfFilterOptions) -> Result<(Gain, Option<f64>), HinfFilterError> {
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let (n, _, q, _, _) = plant.dimensions();
    let synthesis = &options.synthesis;
    let discrete = options.filter.realisation == RealisationType::DiscreteObserver;
    let designed = |time, design: RiccatiDesign| {
        let gain = Gain {
            time,
            matrix: design.gain,
            v: design.v,
        };
        (gain, Some(design.optimum))
    };
    let refused = |source| HinfFilterError::Riccati {
        filter: "the filter".to_owned(),
        source,
    };
    let v = || post_filter(&synthesis.v, q);
    let gain = match synthesis.design {
        DesignType::RiccatiDiscrete => {
            let weighted = weighted(problem);
            let design = synth_riccati_dt(&sampled.ad, &plant.c, &weighted, &sampled.bdd).map_err(refused)?;
            designed(Time::Discrete, design)
        }
        DesignType::RiccatiContinuous => {
            check_bounded(plant, problem)?;
            let (weight, noise) = (&problem.disturbance_weight, &problem.noise_weight);
            let weighted = Weighted::new(&plant.bd, &plant.dd, weight, noise);
            designed(
                Time::Continuous,
                synth_riccati_ct(plant, &weighted).map_err(refused)?,
            )
        }
        DesignType::Matched => {
            let (time, input) = match discrete {
                true => (Time::Discrete, &sampled.bdd),
                false => (Time::Continuous, &plant.bd),
            };
            let matrix = matched_gain(input, &plant.dd).ok_or(HinfFilterError::NotMatched)?;
            (
                Gain {
                    time,
                    matrix,
                    v: v()?,
                },
                None,
            )
        }
        DesignType::Given => {
            let (time, key, rows) = match (&synthesis.l, &synthesis.h) {
                (Some(rows), _) => (Time::Discrete, "synthesis.L", rows.as_slice()),
                (None, Some(rows)) => (Time::Continuous, "synthesis.H", rows.as_slice()),
                (None, None) => (Time::Discrete, "synthesis.L", &[][..]),
            };
            let matrix = shaped_matrix(key, rows, (n, q), "states x outputs")?;
            (
                Gain {
                    time,
                    matrix,
                    v: v()?,
                },
                None,
            )
        }
    };
    Ok(gain)
}

/// Weighted disturbance matrices of the discrete design.
pub(super) fn weighted(problem: &Problem) -> Weighted {
    Weighted::new(
        &problem.sampled.bdd,
        &problem.plant.dd,
        &problem.disturbance_weight,
        &problem.noise_weight,
    )
}

fn post_filter(rows: &Option<Vec<Vec<f64>>>, q: usize) -> Result<DMatrix<f64>, HinfFilterError> {
    let Some(rows) = rows else {
        return Ok(DMatrix::identity(q, q));
    };
    let shape = (matrix("synthesis.V", rows)?.nrows(), q);
    let v = shaped_matrix("synthesis.V", rows, shape, "residuals x outputs")?;
    match v.amax() > 0.0 {
        true => Ok(v),
        false => Err(HinfFilterError::Empty {
            key: "synthesis.V",
            what: "entry that is not zero",
        }),
    }
}

/// Without any measurement noise the infimum is 0, and larger gains are always better.
fn check_bounded(plant: &Plant, problem: &Problem) -> Result<(), HinfFilterError> {
    let size = |matrix: &DMatrix<f64>| SingularDecomposition::new(matrix).largest();
    let silent = size(&plant.dd) <= 1e-12 * size(&plant.bd);
    match silent && problem.noise_weight.amax() == 0.0 {
        true => Err(HinfFilterError::Unbounded),
        false => Ok(()),
    }
}
