//! Observers from gains alone, after every condition that they rely on has been checked anew (method sheet 3.6, 3.9).
//!
//! | observer | conditions |
//! |---|---|
//! | all | K U1 + U2 = 0 up to rounding; \|eig F\| below its limit; M Schur; finite tables |
//! | main | U = D; the first p rows of W are I_p, all of length 1; the certificate P, if there is one |
//! | member i | U = \[b_i D\] or b_i, M = 0; W U1 = 0, rows of length 1 |
//! | estimator i | U as there, M = 0; φ U1 = \[1 0 ... 0\] |

use super::{
    certificate::Certificate,
    decoupling::Decoupling,
    error::ConstructionError,
    gains::{EstimatorGains, MainGains, MemberGains},
    isolation_design::{SLOWEST, unknown_inputs},
    observer::{Decoupled, Observer},
    observer_design::{ObserverDesign, convergence_limit, convergence_reason, reach},
    options::ReducedOrderObserverOptions,
    plant::Plant,
};
use crate::tables::{matrix, shaped_matrix, vector};
use nalgebra::DMatrix;

/// What rounding may add to the length of a test row.
const UNIT: f64 = 1e-9;
/// Relative to the factors: what rounding may leave of W U1 and of φ U1.
const BLIND: f64 = 1e-12;

/// The main observer and its certificate.
///
/// # Errors
/// [`ConstructionError::GainsRefused`], or the condition of the plant that does not hold.
pub(super) fn main_observer(
    plant: &Plant,
    options: &ReducedOrderObserverOptions,
    gains: &MainGains,
) -> Result<(ObserverDesign, Option<Certificate>), ConstructionError> {
    let (n, p) = (plant.states(), plant.outputs());
    let decoupling = Decoupling::new(plant, &plant.d)?;
    let m = shaped_matrix("gains.main.M", &gains.m, (p, p), "outputs x outputs")?;
    let decoupled = Decoupled {
        disturbances: true,
        actuator: None,
    };
    let limit = convergence_limit(options);
    let observer = observer(plant, &decoupling, "gains.main", &gains.k, m, decoupled, limit)?;
    let tests = unit_rows("gains.main.W", &gains.w, p)?;
    let most = options.bounds.max_directions;
    if tests.nrows() < p || tests.rows(0, p) != DMatrix::identity(p, p) {
        return refuse(
            "gains.main.W",
            "its first rows must be the outputs, the unit matrix".to_owned(),
        );
    }
    if tests.nrows() > most {
        return refuse(
            "gains.main.W",
            format!(
                "it has {} rows, `bounds.max_directions` allows {most}",
                tests.nrows()
            ),
        );
    }
    let certificate = match &gains.p {
        None => None,
        Some(rows) => {
            let matrix = shaped_matrix("gains.main.P", rows, (n, n), "states x states")?;
            match Certificate::verify(plant, &observer, matrix) {
                Ok(certificate) => Some(certificate),
                Err(reason) => return refuse("gains.main.P", reason),
            }
        }
    };
    Ok((designed(plant, "gains.main", observer, tests, None)?, certificate))
}

/// The members and the estimators.
///
/// # Errors
/// As [`main_observer`].
pub(super) fn isolation_observers(
    plant: &Plant,
    options: &ReducedOrderObserverOptions,
    members: &[MemberGains],
    estimators: &[EstimatorGains],
) -> Result<[Vec<ObserverDesign>; 2], ConstructionError> {
    at_most_one_each("gains.members", members.iter().map(|gains| gains.actuator), plant)?;
    at_most_one_each(
        "gains.estimators",
        estimators.iter().map(|gains| gains.actuator),
        plant,
    )?;
    let members = members.iter().enumerate();
    let members = members.map(|(index, gains)| member(plant, &format!("gains.members.{index}"), gains));
    let estimators = estimators.iter().enumerate();
    let estimators = estimators
        .map(|(index, gains)| estimator(plant, options, &format!("gains.estimators.{index}"), gains));
    Ok([
        members.collect::<Result<_, _>>()?,
        estimators.collect::<Result<_, _>>()?,
    ])
}

fn at_most_one_each(
    key: &str,
    actuators: impl Iterator<Item = usize>,
    plant: &Plant,
) -> Result<(), ConstructionError> {
    let mut seen = vec![false; plant.actuators()];
    for (index, actuator) in actuators.enumerate() {
        let reason = match seen.get_mut(actuator) {
            None => format!("there is no actuator {actuator}, the model has {}", seen.len()),
            Some(true) => format!("actuator {actuator} has one already"),
            Some(known) => {
                *known = true;
                continue;
            }
        };
        return refuse(&format!("{key}.{index}.actuator"), reason);
    }
    Ok(())
}

fn member(plant: &Plant, key: &str, gains: &MemberGains) -> Result<ObserverDesign, ConstructionError> {
    let (decoupling, observer) =
        isolation_observer(plant, key, gains.actuator, gains.decouples_disturbance, &gains.k)?;
    let tests = unit_rows(&format!("{key}.W"), &gains.w, plant.outputs())?;
    let seen = (&tests * &decoupling.u1).amax();
    let limit = BLIND * (1.0 + decoupling.u1.norm());
    if tests.nrows() == 0 || !(seen <= limit) {
        return refuse(
            &format!("{key}.W"),
            format!(
                "its rows must not see the unknown inputs, W U1 = 0, but it reaches {seen:e}, above {limit:e}"
            ),
        );
    }
    designed(plant, key, observer, tests, Some(gains.actuator))
}

fn estimator(
    plant: &Plant,
    options: &ReducedOrderObserverOptions,
    key: &str,
    gains: &EstimatorGains,
) -> Result<ObserverDesign, ConstructionError> {
    let (decoupling, observer) =
        isolation_observer(plant, key, gains.actuator, gains.decouples_disturbance, &gains.k)?;
    let row_key = format!("{key}.phi");
    let row = vector(&row_key, &gains.phi, plant.outputs(), "one per output")?.transpose();
    let mut rest = &row * &decoupling.u1;
    rest[0] -= 1.0;
    let limit = BLIND * (1.0 + row.norm() * decoupling.u1.norm());
    if !(rest.amax() <= limit) {
        return refuse(
            &row_key,
            format!(
                "φ U1 must be [1 0 ... 0], so that the residual is the fault, but it differs by {:e}, above {limit:e}",
                rest.amax()
            ),
        );
    }
    let row = DMatrix::from_row_slice(1, row.len(), row.as_slice());
    let design = designed(plant, key, observer, row, Some(gains.actuator))?;
    let radii = options.isolation.fault_estimate_radius_max.as_deref();
    match radii.and_then(|most| most.get(gains.actuator)) {
        Some(most) if !(design.steady()[0] <= *most) => refuse(
            &row_key,
            format!(
                "its radius {:e} exceeds `isolation.fault_estimate_radius_max`",
                design.steady()[0]
            ),
        ),
        _ => Ok(design),
    }
}

/// The observer of a member or an estimator; M = 0.
fn isolation_observer(
    plant: &Plant,
    key: &str,
    actuator: usize,
    disturbances: bool,
    k: &[Vec<f64>],
) -> Result<(Decoupling, Observer), ConstructionError> {
    let inputs = unknown_inputs(plant, actuator, disturbances);
    let decoupling = match Decoupling::new(plant, &inputs) {
        Ok(decoupling) => decoupling,
        Err(reason) => return refuse(key, format!("its unknown inputs cannot be decoupled ({reason})")),
    };
    let p = plant.outputs();
    let decoupled = Decoupled {
        disturbances,
        actuator: Some(actuator),
    };
    let observer = observer(
        plant,
        &decoupling,
        key,
        k,
        DMatrix::zeros(p, p),
        decoupled,
        SLOWEST,
    )?;
    Ok((decoupling, observer))
}

/// The observer with these gains, if they decouple and it converges.
fn observer(
    plant: &Plant,
    decoupling: &Decoupling,
    key: &str,
    k: &[Vec<f64>],
    m: DMatrix<f64>,
    decoupled: Decoupled,
    limit: f64,
) -> Result<Observer, ConstructionError> {
    let k_key = format!("{key}.K");
    let shape = (plant.hidden(), plant.outputs());
    let k = shaped_matrix(&k_key, k, shape, "unmeasured states x outputs")?;
    if !decoupling.is_decoupled(&k) {
        let reason = format!(
            "K must keep its unknown inputs out of z2, K U1 + U2 = 0, but it reaches {:e}, above {:e}",
            decoupling.rest(&k),
            decoupling.allowed_rest(&k)
        );
        return refuse(&k_key, reason);
    }
    let observer = Observer::new(plant, k, m, decoupled);
    match convergence_reason(&observer, limit) {
        None => Ok(observer),
        Some((matrix, reason)) => refuse(&format!("{key}.{matrix}"), reason),
    }
}

/// Tables and test rows of a checked observer.
fn designed(
    plant: &Plant,
    key: &str,
    observer: Observer,
    tests: DMatrix<f64>,
    actuator: Option<usize>,
) -> Result<ObserverDesign, ConstructionError> {
    let design = match reach(plant, &observer) {
        Ok(reach) => ObserverDesign::new(observer, reach, tests, actuator),
        Err(reason) => return refuse(key, reason),
    };
    if !design.thresholds.iter().all(|value| value.is_finite()) {
        return refuse(key, "its half widths are not finite".to_owned());
    }
    Ok(design)
}

/// Rows of length 1.
fn unit_rows(key: &str, rows: &[Vec<f64>], outputs: usize) -> Result<DMatrix<f64>, ConstructionError> {
    let count = matrix(key, rows)?.nrows();
    let rows = shaped_matrix(key, rows, (count, outputs), "directions x outputs")?;
    match rows
        .row_iter()
        .position(|row| !((row.norm() - 1.0).abs() <= UNIT))
    {
        None => Ok(rows),
        Some(row) => refuse(key, format!("row {row} must have length 1")),
    }
}

fn refuse<T>(key: &str, reason: String) -> Result<T, ConstructionError> {
    Err(ConstructionError::GainsRefused {
        key: key.to_owned(),
        reason,
    })
}
