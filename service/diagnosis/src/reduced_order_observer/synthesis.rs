//! The choice of K and M for the main observer (method sheet 3.2, 3.6).

use super::{
    decoupling::Decoupling,
    directions::test_directions,
    error::ConstructionError,
    gains::{closed_form, is_free},
    observer::{Decoupled, Observer},
    observer_design::{ObserverDesign, check_convergence, reach},
    options::{Gains, NamedM, Objective, ObserverM, ReducedOrderObserverOptions, Test},
    plant::Plant,
};
use crate::tables::shaped_matrix;
use nalgebra::DMatrix;

/// Eigenvalues of F that `gains = "auto"` tries.
const TRIED_POLES: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.8, 0.9];

/// Accepted gains and where they come from.
#[derive(Clone, Debug, PartialEq)]
pub struct Synthesis {
    /// The main observer.
    pub design: ObserverDesign,
    /// Which candidate it is.
    pub source: String,
    /// What is accepted but deserves a second look.
    pub warnings: Vec<String>,
}

/// A gain before its acceptance.
struct Candidate {
    source: String,
    gain: Result<DMatrix<f64>, String>,
}

/// Chooses the gains of the main observer as configured.
///
/// # Errors
/// [`ConstructionError`]: an assumption of method sheet 3.1 does not hold, or no gain is accepted.
pub fn synthesise(
    plant: &Plant,
    options: &ReducedOrderObserverOptions,
) -> Result<Synthesis, ConstructionError> {
    let decoupling = Decoupling::new(plant, &plant.d)?;
    let mut warnings = Vec::new();
    let m = observer_m(plant, options, &mut warnings)?;
    let candidates = candidates(plant, &decoupling, options, &mut warnings)?;
    let mut best: Option<(f64, ObserverDesign, String)> = None;
    let mut refused = Vec::new();
    for Candidate { source, gain } in candidates {
        match gain.and_then(|k| accept(plant, &decoupling, &k, &m, options)) {
            Ok(design) => {
                let value = objective(&design, options);
                if best.as_ref().is_none_or(|(least, ..)| value < *least) {
                    best = Some((value, design, source));
                }
            }
            Err(reason) => refused.push(format!("{source}: {reason}")),
        }
    }
    match best {
        Some((_, design, source)) => Ok(Synthesis {
            design,
            source,
            warnings,
        }),
        None => Err(ConstructionError::SynthesisRejected {
            key: match options.design.gains {
                Gains::Given => "design.K",
                Gains::ClosedForm => "design.poles",
                Gains::Auto | Gains::H2 | Gains::Lmi => "design.spectral_radius_max",
            },
            reason: format!(
                "{}; allow a larger `design.spectral_radius_max` below 1 or choose other gains",
                refused.join("; ")
            ),
        }),
    }
}

/// M as configured; zero with a warning where the paper's inequality is asked for.
fn observer_m(
    plant: &Plant,
    options: &ReducedOrderObserverOptions,
    warnings: &mut Vec<String>,
) -> Result<DMatrix<f64>, ConstructionError> {
    let p = plant.outputs();
    match &options.design.observer_m {
        ObserverM::Named(NamedM::Zero) => Ok(DMatrix::zeros(p, p)),
        ObserverM::Named(NamedM::Lmi) => {
            warnings.push(
                "`design.observer_M` = \"lmi\" needs a solver that is not at hand; M = 0 is used".to_owned(),
            );
            Ok(DMatrix::zeros(p, p))
        }
        ObserverM::Matrix(rows) => Ok(shaped_matrix(
            "design.observer_M",
            rows,
            (p, p),
            "outputs x outputs",
        )?),
    }
}

/// The gains to choose from, in the order in which equal ones are preferred.
fn candidates(
    plant: &Plant,
    decoupling: &Decoupling,
    options: &ReducedOrderObserverOptions,
    warnings: &mut Vec<String>,
) -> Result<Vec<Candidate>, ConstructionError> {
    let design = &options.design;
    let given = || {
        let shape = (plant.hidden(), plant.outputs());
        let rows = design.k.as_deref().unwrap_or_default();
        shaped_matrix("design.K", rows, shape, "unmeasured states x outputs").map(|k| Candidate {
            source: "given K".to_owned(),
            gain: Ok(k),
        })
    };
    let placed = |poles: &[f64]| Candidate {
        source: format!("closed form with poles {poles:?}"),
        gain: closed_form(decoupling, poles).map_err(|error| error.to_string()),
    };
    match design.gains {
        Gains::Given => Ok(vec![given()?]),
        Gains::ClosedForm => Ok(vec![placed(design.poles.as_deref().unwrap_or_default())]),
        Gains::Auto | Gains::H2 | Gains::Lmi => {
            if let Some(name) = match design.gains {
                Gains::H2 => Some("h2"),
                Gains::Lmi => Some("lmi"),
                _ => None,
            } {
                warnings.push(format!(
                    "`design.gains` = \"{name}\" needs a solver that is not at hand; the best closed-form gains are used"
                ));
            }
            let mut all = vec![Candidate {
                source: "K0".to_owned(),
                gain: Ok(decoupling.k0.clone()),
            }];
            if is_free(decoupling) {
                all.extend(
                    TRIED_POLES
                        .iter()
                        .map(|pole| placed(&spread_poles(*pole, plant.hidden()))),
                );
            }
            if design.gains == Gains::Auto && design.k.is_some() {
                all.push(given()?);
            }
            Ok(all)
        }
    }
}

/// ρ (1 - 0.1 l) for l = 0, 1, ...: distinct eigenvalues up to ρ.
pub(super) fn spread_poles(largest: f64, count: usize) -> Vec<f64> {
    (0..count).map(|l| largest * (1.0 - 0.1 * l as f64)).collect()
}

/// Projection, convergence and tables of one candidate (method sheet 3.6); the reason of a refusal.
fn accept(
    plant: &Plant,
    decoupling: &Decoupling,
    k: &DMatrix<f64>,
    m: &DMatrix<f64>,
    options: &ReducedOrderObserverOptions,
) -> Result<ObserverDesign, String> {
    let k = decoupling.project(k);
    if !decoupling.is_decoupled(&k) {
        return Err("K D1 + D2 does not vanish after projection".to_owned());
    }
    let decoupled = Decoupled {
        disturbances: true,
        actuator: None,
    };
    let observer = Observer::new(plant, k, m.clone(), decoupled);
    check_convergence(&observer, options.design.spectral_radius_max + 1e-9)?;
    let reach = reach(plant, &observer)?;
    let set = options.bounds.tests.contains(&Test::Set);
    let tests = test_directions(plant, &reach, set, options.bounds.max_directions);
    Ok(ObserverDesign::new(observer, reach, tests, None))
}

/// What the choice minimises. Without noise many floors are zero; the rounding tolerance of the test orders them.
fn objective(design: &ObserverDesign, options: &ReducedOrderObserverOptions) -> f64 {
    match options.design.objective {
        Objective::Width => design.hull().sum(),
        Objective::FaultFloor => {
            let steady = design.steady().add_scalar(options.bounds.rounding_tolerance);
            let floors = super::floors::fault_floors(&design.observer, &design.tests, &steady);
            let scale = options.design.fault_scale.as_deref().unwrap_or_default();
            let weighted = floors.iter().enumerate();
            weighted
                .map(|(j, floor)| floor / scale.get(j).copied().unwrap_or(1.0))
                .fold(0.0, f64::max)
        }
    }
}
