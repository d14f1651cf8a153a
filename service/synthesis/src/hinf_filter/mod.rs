//! Gains of the robust fault detection filter by matrix inequalities (method sheet 3.3, 3.6).
//!
//! | design | gain | what proves it |
//! |---|---|---|
//! | `lmi_two_stage_dt`, `lmi_two_stage_ct` | L, H | X of the bounded-real inequality at the stated bound |
//! | `lmi_mixed` | H, V | the same for V T_rd |
//! | `lmi_paper` | H | nothing but the norms that are recomputed: the paper's theorem 1 does not hold |
//!
//! Whatever the solver says, a gain is accepted only with the certificate that the diagnosis recomputes. Where a program
//! fails, or its gain fails the certificate, the Riccati design of the same time domain takes its place, with a warning.

// A condition is written so that a value that is not a number fails it.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

pub mod lmi;
mod paper;

use lmi::{ErrorPlant, LmiError, Region};
use nalgebra::DMatrix;
use residual_diagnosis::{
    gains::{FoundGains, SolverRun},
    hinf_filter::{
        certificate::{Gain, Time},
        error::HinfFilterError,
        find::{complete, riccati_gains},
        gains::{HinfFilterGains, MainGains, rows},
        options::{DesignType, HinfFilterOptions},
        problem::Problem,
    },
    method::{MethodOptions, Refusal},
};

/// Default of the part of the optimum that the second stage gives up.
const SLACK: f64 = 0.01;

/// Gains that a solver found, not yet certified.
struct Candidate {
    main: MainGains,
    runs: Vec<SolverRun>,
    warnings: Vec<String>,
}

/// Finds the gains of any design; `progress` is told what is being worked on.
///
/// # Errors
/// The first condition that does not hold, also for the Riccati design where that took the place of a failed program.
pub fn find_gains(
    options: &HinfFilterOptions,
    sample_time_s: f64,
    progress: &mut dyn FnMut(&str),
) -> Result<FoundGains<HinfFilterGains>, Refusal> {
    let design = options.synthesis.design;
    if !design.needs_solver() {
        return options.find_gains(sample_time_s);
    }
    let problem = Problem::new(options, sample_time_s)?;
    let found = match search(&problem, options, progress) {
        Ok(candidate) => {
            progress("certifying the gain");
            match complete(&problem, options, candidate.main) {
                Ok(gains) => {
                    return Ok(FoundGains {
                        gains,
                        solver: candidate.runs,
                        warnings: candidate.warnings,
                    });
                }
                // The paper's claim is not to be hidden behind another design; an unstable or too large gain is refused.
                Err(error @ HinfFilterError::Certificate { .. }) if design != DesignType::Paper => {
                    error.to_string()
                }
                Err(error) => return Err(with_findings(error.into(), &candidate.warnings)),
            }
        }
        Err(error) => error.to_string(),
    };
    let fallback = design.fallback();
    progress("solving the Riccati equation instead");
    let gains = riccati_gains(&problem, fallback).and_then(|main| complete(&problem, options, main));
    let gains = gains.map_err(|error| Refusal {
        key: "synthesis.type".to_owned(),
        message: format!(
            "the design \"{}\" failed ({found}), and \"{}\" in its place is refused: {error}",
            design.name(),
            fallback.name()
        ),
    })?;
    Ok(FoundGains {
        gains,
        solver: Vec::new(),
        warnings: vec![format!(
            "the design \"{}\" failed, \"{}\" was tried in its place: {found}",
            design.name(),
            fallback.name()
        )],
    })
}

fn with_findings(refusal: Refusal, findings: &[String]) -> Refusal {
    let message = [&[refusal.message], findings].concat().join("; ");
    Refusal {
        key: refusal.key,
        message,
    }
}

fn search(
    problem: &Problem,
    options: &HinfFilterOptions,
    progress: &mut dyn FnMut(&str),
) -> Result<Candidate, LmiError> {
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let synthesis = &options.synthesis;
    let continuous = ErrorPlant {
        a: &plant.a,
        bd: &plant.bd,
        c: &plant.c,
        dd: &plant.dd,
    };
    let slack = synthesis.slack.unwrap_or(SLACK);
    let (time, found) = match synthesis.design {
        DesignType::Paper => {
            progress("solving the paper's matrix inequalities");
            return paper::search(problem, options, &continuous);
        }
        DesignType::Mixed => {
            progress("solving the mixed matrix inequalities");
            return mixed(problem, &continuous, &region(options, Time::Continuous, 0.0));
        }
        DesignType::TwoStageContinuous => {
            progress("solving the bounded-real inequalities in continuous time");
            let region = region(options, Time::Continuous, 0.0);
            (
                Time::Continuous,
                lmi::two_stage_continuous(&continuous, &region, slack)?,
            )
        }
        _ => {
            progress("solving the bounded-real inequalities in discrete time");
            let discrete = ErrorPlant {
                a: &sampled.ad,
                bd: &sampled.bdd,
                ..continuous
            };
            let region = region(options, Time::Discrete, sampled.sample_time_s);
            (
                Time::Discrete,
                lmi::two_stage_discrete(&discrete, &region, slack)?,
            )
        }
    };
    let q = plant.c.nrows();
    let gain = Gain {
        time,
        matrix: found.gain,
        v: DMatrix::identity(q, q),
    };
    Ok(Candidate {
        main: MainGains {
            stage_one: Some(found.stage_one),
            claimed_bound: Some(found.bound),
            lyapunov: Some(rows(&found.lyapunov)),
            ..MainGains::new(synthesis.design, &gain)
        },
        runs: found.runs,
        warnings: Vec::new(),
    })
}

/// The configured region in the time domain of the design.
fn region(options: &HinfFilterOptions, time: Time, sample_time_s: f64) -> Region {
    let synthesis = &options.synthesis;
    match time {
        Time::Continuous => Region {
            decay: synthesis.pole_decay,
            radius: synthesis.pole_radius,
        },
        Time::Discrete => {
            let from_decay = synthesis.pole_decay.map(|decay| (-decay * sample_time_s).exp());
            let radii = [synthesis.radius_z, from_decay];
            Region {
                decay: None,
                radius: radii.into_iter().flatten().reduce(f64::min),
            }
        }
    }
}

fn mixed(problem: &Problem, plant: &ErrorPlant<'_>, region: &Region) -> Result<Candidate, LmiError> {
    let found = lmi::mixed(plant, &problem.plant.bf, &problem.plant.df, region)?;
    let gain = Gain {
        time: Time::Continuous,
        matrix: found.gain,
        v: found.v,
    };
    Ok(Candidate {
        main: MainGains {
            claimed_bound: Some(found.bound),
            claimed_index: Some(found.index),
            lyapunov: Some(rows(&found.lyapunov)),
            ..MainGains::new(DesignType::Mixed, &gain)
        },
        runs: found.runs,
        warnings: Vec::new(),
    })
}
