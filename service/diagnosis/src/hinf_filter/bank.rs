//! Filters that are blind to some faults, and the filter that estimates them (method sheet 4.5).

use super::{
    certificate::Time,
    error::HinfFilterError,
    find::weighted,
    plant::beside,
    problem::Problem,
    synthesis::{RiccatiDesign, Weighted, pseudo_inverse, synth_riccati_dt},
};
use crate::{
    decomposition::SingularDecomposition,
    norms::{System, h_infinity_discrete},
    spectrum::spectral_radius,
};
use nalgebra::{Complex, DMatrix};

/// Angles on the unit circle at which ranks are compared.
const ANGLES: [f64; 3] = [0.173, 0.911, 2.207];
/// Singular values below this part of the largest count as zero.
const RANK: f64 = 1e-9;

/// L, V and Π of the filter that is blind to the faults of set `index`.
///
/// # Errors
/// [`HinfFilterError::NotIsolable`], [`HinfFilterError::Riccati`], [`HinfFilterError::NotBlind`].
pub(super) fn find_blind(
    problem: &Problem,
    index: usize,
    weight: f64,
) -> Result<RiccatiDesign, HinfFilterError> {
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let blind = problem.faults.blind.get(index).map_or(&[][..], Vec::as_slice);
    check_isolable(problem, index, blind)?;
    let weighted = blind_weighted(problem, blind, weight);
    let design = synth_riccati_dt(&sampled.ad, &plant.c, &weighted, &sampled.bdd).map_err(|source| {
        HinfFilterError::Riccati {
            filter: format!("blind filter {index}"),
            source,
        }
    })?;
    let leak = blind_leak(problem, blind, &design.gain, &design.v);
    if !(leak <= largest_leak(weight)) {
        return Err(HinfFilterError::NotBlind { index, gain: leak });
    }
    Ok(design)
}

/// Weighted disturbance matrices with the blind faults as further disturbances of weight w_b.
pub(super) fn blind_weighted(problem: &Problem, blind: &[usize], weight: f64) -> Weighted {
    let (input, direct) = (
        problem.sampled.bfd.select_columns(blind),
        problem.plant.df.select_columns(blind),
    );
    weighted(problem, Time::Discrete).with_columns(&(input * weight), &(direct * weight))
}

/// Refuses a blind set from which some other fault cannot be told.
pub(super) fn check_isolable(
    problem: &Problem,
    index: usize,
    blind: &[usize],
) -> Result<(), HinfFilterError> {
    for j in (0..problem.plant.bf.ncols()).filter(|j| !blind.contains(j)) {
        let both = blind.iter().copied().chain([j]).collect::<Vec<_>>();
        if !adds_rank(problem, blind, &both) {
            return Err(HinfFilterError::NotIsolable {
                index,
                fault: problem.faults.names[j].clone(),
            });
        }
    }
    Ok(())
}

/// ‖V T_blind‖∞, infinite if the filter is not stable.
pub(super) fn blind_leak(problem: &Problem, blind: &[usize], gain: &DMatrix<f64>, v: &DMatrix<f64>) -> f64 {
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let (input, direct) = (sampled.bfd.select_columns(blind), plant.df.select_columns(blind));
    let system = System::new(
        &(&sampled.ad - gain * &plant.c),
        &(input - gain * &direct),
        &plant.c,
        &direct,
    );
    h_infinity_discrete(&system.filtered(v)).value
}

/// 1/w_b, with room for rounding.
pub(super) fn largest_leak(weight: f64) -> f64 {
    (1.0 + 1e-6) / weight
}

/// Whether the transfer matrix of the faults `more` has a larger rank than that of `few`.
fn adds_rank(problem: &Problem, few: &[usize], more: &[usize]) -> bool {
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let rank = |columns: &[usize], angle: f64| {
        let system = System::new(
            &sampled.ad,
            &sampled.bfd.select_columns(columns),
            &plant.c,
            &plant.df.select_columns(columns),
        );
        let response = system.response(Complex::from_polar(1.0, angle))?;
        let values = SingularDecomposition::new(&response);
        let limit = RANK * values.largest();
        Some(values.sigma.iter().filter(|sigma| **sigma > limit).count())
    };
    ANGLES
        .iter()
        .all(|angle| match (rank(few, *angle), rank(more, *angle)) {
            (Some(few), Some(more)) => more > few,
            _ => false,
        })
}

/// L_f with T_rf ≡ Df, so that Df⁺ r estimates f.
///
/// L_f = Bfd Df⁺ + N (I - Df Df⁺); N is the Riccati gain of the reduced pair.
///
/// # Errors
/// [`HinfFilterError::NoEstimate`].
pub(super) fn find_estimate(problem: &Problem) -> Result<DMatrix<f64>, HinfFilterError> {
    let impossible = |reason: String| HinfFilterError::NoEstimate { reason };
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let (_, _, q, _, l) = plant.dimensions();
    let values = SingularDecomposition::new(&plant.df);
    let inverse = fault_inverse(problem)?;
    let base = &sampled.bfd * &inverse;
    let gain = if l == q {
        base
    } else {
        // An orthonormal basis P of what no fault reaches: I - Df Df⁺ = P P'.
        let unreached = SingularDecomposition::new(&plant.df.transpose()).null_space(RANK * values.largest());
        let projected = weighted(problem, Time::Discrete);
        let reduced = Weighted {
            b: &projected.b - &base * &projected.d,
            d: unreached.tr_mul(&projected.d),
        };
        let a = &sampled.ad - &base * &plant.c;
        let c = unreached.tr_mul(&plant.c);
        let design = synth_riccati_dt(&a, &c, &reduced, &sampled.bdd)
            .map_err(|source| impossible(format!("the design failed ({source})")))?;
        base + design.gain * unreached.transpose()
    };
    let radius = spectral_radius(&(&sampled.ad - &gain * &plant.c)).unwrap_or(f64::INFINITY);
    if !(radius < 1.0 - 1e-9) {
        return Err(impossible(format!(
            "the filter with T_rf = Df has a pole of modulus {radius:.6}"
        )));
    }
    Ok(gain)
}

/// Df⁺ of a Df of full column rank.
///
/// # Errors
/// [`HinfFilterError::NoEstimate`].
pub(super) fn fault_inverse(problem: &Problem) -> Result<DMatrix<f64>, HinfFilterError> {
    let df = &problem.plant.df;
    let values = SingularDecomposition::new(df);
    if df.ncols() > df.nrows() || values.smallest() <= RANK * values.largest() {
        return Err(HinfFilterError::NoEstimate {
            reason: "Df has no full column rank".to_owned(),
        });
    }
    Ok(pseudo_inverse(df))
}

/// Columns of disturbances and of the given faults side by side.
pub(super) fn with_faults(
    disturbance: &DMatrix<f64>,
    fault: &DMatrix<f64>,
    columns: &[usize],
) -> DMatrix<f64> {
    beside(&[disturbance, &fault.select_columns(columns)])
}
