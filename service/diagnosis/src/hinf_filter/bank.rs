//! Filters that are blind to some faults, and the filter that estimates them (method sheet 4.5).

use super::{
    error::HinfFilterError,
    gain::weighted,
    plant::beside,
    problem::Problem,
    synthesis::{Weighted, pseudo_inverse, synth_riccati_dt},
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

/// L and V of one filter, and what it passes of its blind faults.
#[derive(Clone, Debug, PartialEq)]
pub struct BlindDesign {
    /// L, n x q.
    pub gain: DMatrix<f64>,
    /// V, q x q.
    pub v: DMatrix<f64>,
    /// ‖V T_blind‖∞.
    pub leak: f64,
}

/// The filter that is blind to the faults of set `index`.
///
/// # Errors
/// [`HinfFilterError::NotIsolable`], [`HinfFilterError::NotBlind`], [`HinfFilterError::Riccati`].
pub fn design_blind(problem: &Problem, index: usize, weight: f64) -> Result<BlindDesign, HinfFilterError> {
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let Some(blind) = problem.faults.blind.get(index) else {
        return Err(HinfFilterError::NotBlind {
            index,
            gain: f64::INFINITY,
        });
    };
    let (input, direct) = (sampled.bfd.select_columns(blind), plant.df.select_columns(blind));
    for j in (0..plant.bf.ncols()).filter(|j| !blind.contains(j)) {
        let both = blind.iter().copied().chain([j]).collect::<Vec<_>>();
        if !adds_rank(problem, blind, &both) {
            return Err(HinfFilterError::NotIsolable {
                index,
                fault: problem.faults.names[j].clone(),
            });
        }
    }
    let weighted = weighted(problem).with_columns(&(&input * weight), &(&direct * weight));
    let design = synth_riccati_dt(&sampled.ad, &plant.c, &weighted, &sampled.bdd).map_err(|source| {
        HinfFilterError::Riccati {
            filter: format!("blind filter {index}"),
            source,
        }
    })?;
    let closed = &sampled.ad - &design.gain * &plant.c;
    let system = System::new(
        &closed,
        &(input - &design.gain * &direct),
        &(&design.v * &plant.c),
        &(&design.v * direct),
    );
    let leak = h_infinity_discrete(&system).value;
    if !(leak <= (1.0 + 1e-6) / weight) {
        return Err(HinfFilterError::NotBlind { index, gain: leak });
    }
    Ok(BlindDesign {
        gain: design.gain,
        v: design.v,
        leak,
    })
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

/// L_f with T_rf ≡ Df, and Df⁺, so that Df⁺ r estimates f.
///
/// L_f = Bfd Df⁺ + N (I - Df Df⁺); N is the Riccati gain of the reduced pair.
///
/// # Errors
/// [`HinfFilterError::NoEstimate`].
pub fn design_estimate(problem: &Problem) -> Result<(DMatrix<f64>, DMatrix<f64>), HinfFilterError> {
    let impossible = |reason: String| HinfFilterError::NoEstimate { reason };
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let (_, _, q, _, l) = plant.dimensions();
    let values = SingularDecomposition::new(&plant.df);
    if l > q || values.smallest() <= RANK * values.largest() {
        return Err(impossible("Df has no full column rank".to_owned()));
    }
    let inverse = pseudo_inverse(&plant.df);
    let base = &sampled.bfd * &inverse;
    let gain = if l == q {
        base
    } else {
        // An orthonormal basis P of what no fault reaches: I - Df Df⁺ = P P'.
        let unreached = SingularDecomposition::new(&plant.df.transpose()).null_space(RANK * values.largest());
        let projected = weighted(problem);
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
    Ok((gain, inverse))
}

/// Columns of disturbances and of the given faults side by side.
pub(super) fn with_faults(
    disturbance: &DMatrix<f64>,
    fault: &DMatrix<f64>,
    columns: &[usize],
) -> DMatrix<f64> {
    beside(&[disturbance, &fault.select_columns(columns)])
}
