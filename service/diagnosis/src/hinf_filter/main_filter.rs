//! From the gains to the detecting filter: its certificate and its sampled form (method sheet 3.3, 3.5).

use super::{
    certificate::{Certificate, Gain, Time, certify},
    claims::{BoundOf, Claims, Region},
    conditions::Condition,
    error::HinfFilterError,
    find::{configured_post_filter, given_gains, weighted},
    gains::MainGains,
    observer::Correction,
    options::{DesignType, HinfFilterOptions, RealisationType},
    problem::Problem,
    realisation::{filter_foh, filter_zoh},
    synthesis::{RiccatiCheck, check_riccati, matched_rest},
};
use crate::tables::shaped_matrix;
use nalgebra::DMatrix;

/// Largest relative residual of a Riccati equation, and deviation of L and V from its solution.
const RICCATI: f64 = 1e-8;

/// The filter in force.
#[derive(Clone, Debug)]
pub(super) struct MainFilter {
    /// The design of its gains.
    pub design: DesignType,
    /// Its certificate: of L, or of H where the realisation holds the samples.
    pub certificate: Certificate,
    /// Of H, where its average is in force.
    pub continuous: Option<Certificate>,
    /// Matrix of the error from instant to instant: Ad - LC, or Φ.
    pub closed: DMatrix<f64>,
    /// How a sample enters the error: L, or Gy.
    pub gain: DMatrix<f64>,
    /// V.
    pub v: DMatrix<f64>,
    pub correction: Correction,
    /// ‖T_rw‖∞ of a Riccati design and what no gain undercuts, √λ_max(Ω).
    pub weighted: Option<(f64, Option<f64>)>,
}

impl MainFilter {
    /// The filter of these gains.
    ///
    /// # Errors
    /// The first condition that does not hold.
    pub fn new(
        problem: &Problem,
        options: &HinfFilterOptions,
        gains: &MainGains,
    ) -> Result<Self, HinfFilterError> {
        check_origin(problem, options, gains)?;
        let found = certified(problem, options, gains)?;
        let label = found.label();
        if gains.label != label {
            return Err(HinfFilterError::Label {
                stated: gains.label.clone(),
                found: label,
            });
        }
        let (plant, sampled) = (&problem.plant, &problem.sampled);
        let Certified {
            gain,
            discrete,
            certificate,
            weighted,
        } = found;
        let (closed, in_force, correction) = match options.filter.realisation {
            RealisationType::DiscreteObserver => {
                let l = discrete.as_ref().map_or(&gain.matrix, |(l, _)| l);
                (&sampled.ad - l * &plant.c, l.clone(), Correction::residual(l))
            }
            RealisationType::ZeroOrderHold => {
                let filter = filter_zoh(plant, &gain.matrix, sampled.sample_time_s);
                let correction = Correction::held(&filter);
                (filter.phi, filter.gy, correction)
            }
            RealisationType::FirstOrderHold => {
                let filter = filter_foh(plant, &gain.matrix, sampled.sample_time_s);
                let correction = Correction::interpolated(&filter);
                (filter.phi, &filter.g0 + &filter.g1, correction)
            }
        };
        let (certificate, continuous) = match discrete {
            Some((_, in_force)) => (in_force, Some(certificate)),
            None => (certificate, None),
        };
        Ok(Self {
            design: gains.design,
            certificate,
            continuous,
            closed,
            gain: in_force,
            v: gain.v,
            correction,
            weighted,
        })
    }

    /// Why the filter is uncertified, as a label and in words; `None` if it is certified.
    pub fn uncertified(&self) -> Option<(String, &str)> {
        let certificates = self.continuous.iter().chain([&self.certificate]);
        let mut found = certificates.filter_map(|certificate| {
            let violated = certificate.violated()?;
            Some((certificate.label(), violated.violation.as_str()))
        });
        found.next()
    }

    /// All conditions, of H before those of L.
    pub fn conditions(&self) -> impl Iterator<Item = &Condition> {
        let certificates = self.continuous.iter().chain([&self.certificate]);
        certificates.flat_map(|certificate| &certificate.conditions)
    }
}

/// A gain with everything that was recomputed of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Certified {
    /// L or H, and V.
    pub gain: Gain,
    /// L of a continuous gain in a discrete observer, ∫₀^Ts e^{Aτ} dτ H, with its own certificate.
    pub discrete: Option<(DMatrix<f64>, Certificate)>,
    /// Of the gain.
    pub certificate: Certificate,
    /// ‖T_rw‖∞ of a Riccati design and its lower bound.
    pub weighted: Option<(f64, Option<f64>)>,
}

impl Certified {
    /// `certified`, or `uncertified(word)`.
    pub fn label(&self) -> String {
        let certificates = [
            Some(&self.certificate),
            self.discrete.as_ref().map(|(_, found)| found),
        ];
        let violated = certificates
            .into_iter()
            .flatten()
            .find(|found| found.violated().is_some());
        violated.unwrap_or(&self.certificate).label()
    }
}

/// Recomputes the certificate of gains; refuses unstable, too large and, unless allowed, uncertified ones.
///
/// # Errors
/// The first condition that does not hold.
pub fn certified(
    problem: &Problem,
    options: &HinfFilterOptions,
    gains: &MainGains,
) -> Result<Certified, HinfFilterError> {
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let (n, _, q, _, _) = plant.dimensions();
    let gain = gains.gain(n, q)?;
    let mut certificate = certify(plant, sampled, &gain, &claims(problem, options, gains)?)?;
    let riccati = riccati_of(problem, &gain, gains)?;
    if let Some(check) = &riccati {
        certificate.conditions.extend(riccati_conditions(check));
    }
    if gains.design == DesignType::Matched {
        certificate
            .conditions
            .push(matched_condition(matched_rest(plant, sampled, &gain)));
    }
    if let Some(v) = fixed_post_filter(problem, options, gains.design)? {
        certificate.conditions.push(post_filter_condition(&gain.v, &v));
    }
    accept(&certificate, options)?;
    let averaged =
        gain.time == Time::Continuous && options.filter.realisation == RealisationType::DiscreteObserver;
    let discrete = if averaged {
        let l = plant.averaged_gain(&gain.matrix, sampled.sample_time_s);
        let averaged = Gain {
            time: Time::Discrete,
            matrix: l.clone(),
            v: gain.v.clone(),
        };
        let found = certify(plant, sampled, &averaged, &Claims::default())?;
        accept(&found, options)?;
        Some((l, found))
    } else {
        None
    };
    Ok(Certified {
        discrete,
        certificate,
        weighted: riccati.map(|check| (check.norm, check.optimum)),
        gain,
    })
}

fn accept(certificate: &Certificate, options: &HinfFilterOptions) -> Result<(), HinfFilterError> {
    let limit = options.synthesis.max_gain;
    if !(certificate.gain <= limit) {
        return Err(HinfFilterError::GainTooLarge {
            norm: certificate.gain,
            limit,
        });
    }
    match certificate.violated() {
        Some(condition) if !options.synthesis.allow_uncertified => Err(HinfFilterError::Certificate {
            reason: condition.violation.clone(),
            margin: condition.margin,
        }),
        _ => Ok(()),
    }
}

/// Whether these gains may stand for the configured design: of that design, or of the Riccati design of the same time
/// domain, which takes the place of a failed search by matrix inequalities; and whether they hold all that proves them
/// and nothing that nobody checks.
fn check_origin(
    problem: &Problem,
    options: &HinfFilterOptions,
    gains: &MainGains,
) -> Result<(), HinfFilterError> {
    let wanted = options.synthesis.design;
    let replaced = wanted.needs_solver() && gains.design == wanted.fallback();
    if gains.design != wanted && !replaced {
        return Err(HinfFilterError::OtherDesign {
            found: gains.design.name(),
            wanted: wanted.name(),
        });
    }
    if wanted == DesignType::Given {
        let given = MainGains {
            label: gains.label.clone(),
            ..given_gains(problem, options)?
        };
        if given != *gains {
            return Err(HinfFilterError::NotTheGivenGains);
        }
    }
    let certificates = [
        (
            "gains.main.Pi",
            gains.riccati.is_some(),
            gains.design.is_riccati(),
        ),
        (
            "gains.main.X",
            gains.lyapunov.is_some(),
            gains.design.has_lyapunov_matrix(),
        ),
        (
            "gains.main.claimed_bound",
            gains.claimed_bound.is_some(),
            gains.design.needs_solver(),
        ),
    ];
    for (key, present, needed) in certificates {
        if needed && !present {
            return Err(HinfFilterError::Missing {
                key,
                reason: "without it nothing proves the bound of this design; design the gains again",
            });
        }
    }
    check_unused(gains)
}

/// Refuses entries that belong to another design: nothing would check them.
fn check_unused(gains: &MainGains) -> Result<(), HinfFilterError> {
    let design = gains.design;
    let two_stages = matches!(
        design,
        DesignType::TwoStageDiscrete | DesignType::TwoStageContinuous
    );
    let entries = [
        ("gains.main.Pi", gains.riccati.is_some(), design.is_riccati()),
        (
            "gains.main.X",
            gains.lyapunov.is_some(),
            design.has_lyapunov_matrix(),
        ),
        ("gains.main.stage_one", gains.stage_one.is_some(), two_stages),
        (
            "gains.main.claimed_index",
            gains.claimed_index.is_some(),
            design == DesignType::Mixed,
        ),
        (
            "gains.main.reference",
            gains.reference.is_some(),
            design == DesignType::Paper,
        ),
    ];
    match entries.iter().find(|(_, present, used)| *present && !used) {
        None => Ok(()),
        Some((key, _, _)) => Err(HinfFilterError::Conflict {
            key,
            reason: "with gains of this design, which does not claim it; design the gains again",
        }),
    }
}

fn claims(
    problem: &Problem,
    options: &HinfFilterOptions,
    gains: &MainGains,
) -> Result<Claims, HinfFilterError> {
    let (n, _, q, _, l) = problem.plant.dimensions();
    let of = match gains.design {
        DesignType::TwoStageDiscrete | DesignType::TwoStageContinuous => BoundOf::ProvenDisturbance,
        DesignType::Mixed => BoundOf::FilteredDisturbance,
        DesignType::Paper => BoundOf::Objective,
        _ => BoundOf::Disturbance,
    };
    for (key, value) in [
        ("gains.main.claimed_bound", gains.claimed_bound),
        ("gains.main.claimed_index", gains.claimed_index),
        ("gains.main.stage_one", gains.stage_one),
    ] {
        super::reading::positive(key, value)?;
    }
    let synthesis = &options.synthesis;
    Ok(Claims {
        bound: gains.claimed_bound.map(|bound| (of, bound)),
        stage_one: gains.stage_one,
        fault_index: gains.claimed_index,
        region: Region {
            decay: synthesis.pole_decay,
            radius: match gains.l {
                Some(_) => synthesis.radius_z,
                None => synthesis.pole_radius,
            },
        },
        lyapunov: match &gains.lyapunov {
            Some(rows) => Some(shaped_matrix("gains.main.X", rows, (n, n), "states x states")?),
            None => None,
        },
        reference: gains.reference(n, q, l)?,
    })
}

fn riccati_of(
    problem: &Problem,
    gain: &Gain,
    gains: &MainGains,
) -> Result<Option<RiccatiCheck>, HinfFilterError> {
    let Some(rows) = &gains.riccati else {
        return Ok(None);
    };
    let (n, _, _, _, _) = problem.plant.dimensions();
    let pi = shaped_matrix("gains.main.Pi", rows, (n, n), "states x states")?;
    let weighted = weighted(problem, gain.time);
    let check = check_riccati(&problem.plant, &problem.sampled, gain, &weighted, &pi);
    check.map(Some).map_err(|source| HinfFilterError::Riccati {
        filter: "the filter".to_owned(),
        source,
    })
}

pub(super) fn riccati_conditions(check: &RiccatiCheck) -> [Condition; 2] {
    let RiccatiCheck {
        residual, deviation, ..
    } = *check;
    [
        Condition {
            name: "relative residual of the Riccati equation at Π <= 1e-8".to_owned(),
            margin: RICCATI - residual,
            sharp: true,
            code: "riccati_residual",
            violation: format!("the residual of the Riccati equation at Π is {residual:e}"),
        },
        Condition {
            name: "L and V are those of Π within 1e-8".to_owned(),
            margin: RICCATI - deviation,
            sharp: true,
            code: "not_the_riccati_gain",
            violation: format!("the gain or V deviates by {deviation:e} from what belongs to Π"),
        },
    ]
}

/// V of the designs that do not find one: the configured one, or the identity.
fn fixed_post_filter(
    problem: &Problem,
    options: &HinfFilterOptions,
    design: DesignType,
) -> Result<Option<DMatrix<f64>>, HinfFilterError> {
    if design.is_riccati() || design == DesignType::Mixed {
        return Ok(None);
    }
    configured_post_filter(problem, options).map(Some)
}

fn post_filter_condition(v: &DMatrix<f64>, expected: &DMatrix<f64>) -> Condition {
    let deviation = match v.shape() == expected.shape() {
        true => (v - expected).amax() / expected.amax(),
        false => f64::INFINITY,
    };
    Condition {
        name: "V is that of the configuration within 1e-12".to_owned(),
        margin: 1e-12 - deviation,
        sharp: true,
        code: "other_post_filter",
        violation: format!(
            "V deviates by {deviation:e} from that of the configuration, the identity if it states none"
        ),
    }
}

fn matched_condition(rest: f64) -> Condition {
    Condition {
        name: "T_rd = Dd within 1e-9".to_owned(),
        margin: 1e-9 - rest,
        sharp: true,
        code: "not_matched",
        violation: format!("the disturbance reaches the state with a part {rest:e} of its input"),
    }
}
