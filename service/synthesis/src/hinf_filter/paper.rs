//! The paper's synthesis, and what its claim is worth (method sheet 3.6).
//!
//! Theorem 1 claims J = ‖\[-T_rd, W_F - T_rf\]‖∞ of the filter with H = R⁻¹Z. The change of variables needs one gain,
//! Z = R X⁻¹Y', but nothing asks for it, so that the bound holds for X⁻¹Y' alone (and W_F = T_rf).

use super::{
    Candidate,
    lmi::{self, ErrorPlant, LmiError, PaperSolution},
};
use nalgebra::DMatrix;
use residual_diagnosis::{
    hinf_filter::{
        certificate::{Gain, Time, certify},
        claims::{BoundOf, Claims},
        gains::{MainGains, ReferenceModel, rows},
        options::{DesignType, HinfFilterOptions, Normalisation, Recovery},
        problem::Problem,
    },
    norms::System,
};

pub(super) fn search(
    problem: &Problem,
    options: &HinfFilterOptions,
    plant: &ErrorPlant<'_>,
) -> Result<Candidate, LmiError> {
    let normalisation = match options.synthesis.normalisation.unwrap_or_default() {
        Normalisation::Printed => lmi::Normalisation::Printed,
        Normalisation::Lemma1 => lmi::Normalisation::Lemma1,
    };
    let solution = lmi::paper(plant, &problem.plant.bf, &problem.plant.df, normalisation)?;
    let warnings = [Recovery::AsPrinted, Recovery::Sound]
        .map(|recovery| finding(problem, &solution, recovery))
        .to_vec();
    let recovery = options.synthesis.recovery.unwrap_or_default();
    let (gain, reference) = recovered(problem, &solution, recovery);
    Ok(Candidate {
        main: MainGains {
            claimed_bound: Some(solution.claimed_bound),
            reference: reference.map(|system| ReferenceModel {
                a: rows(&system.a),
                b: rows(&system.b),
                c: rows(&system.c),
                d: rows(&system.d),
            }),
            ..MainGains::new(DesignType::Paper, &gain)
        },
        runs: solution.runs,
        warnings,
    })
}

/// H with V = I, and W_F unless it is T_rf.
fn recovered(problem: &Problem, solution: &PaperSolution, recovery: Recovery) -> (Gain, Option<System>) {
    let q = problem.plant.c.nrows();
    let (matrix, reference) = match recovery {
        Recovery::AsPrinted => (&solution.printed_gain, Some(solution.reference.clone())),
        Recovery::Sound => (&solution.sound_gain, None),
    };
    let gain = Gain {
        time: Time::Continuous,
        matrix: matrix.clone(),
        v: DMatrix::identity(q, q),
    };
    (gain, reference)
}

/// The claim against the true norms of one recovery, in words.
fn finding(problem: &Problem, solution: &PaperSolution, recovery: Recovery) -> String {
    let (gain, reference) = recovered(problem, solution, recovery);
    let claim = solution.claimed_bound;
    let claims = Claims {
        bound: Some((BoundOf::Objective, claim)),
        reference,
        ..Claims::default()
    };
    let what = match recovery {
        Recovery::AsPrinted => "as printed, H = R⁻¹Z",
        Recovery::Sound => "soundly recovered, H = X⁻¹Y' and W_F = T_rf",
    };
    match certify(&problem.plant, &problem.sampled, &gain, &claims) {
        Err(error) => format!("{what}: {error}"),
        Ok(found) => {
            let (reference, objective) = found
                .paper
                .map_or((f64::NAN, f64::NAN), |norms| (norms.reference, norms.objective));
            format!(
                "{what}: claimed J <= {claim:.9}, true J = {objective:.9} with ‖T_rd‖∞ = {:.9}, ‖T_rf‖∞ = {:.6}, ‖W_F‖∞ = \
                 {reference:.6}: {}",
                found.disturbance,
                found.fault,
                found.label()
            )
        }
    }
}
