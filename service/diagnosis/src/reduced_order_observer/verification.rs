//! The main observer from gains alone, after every condition that it relies on has been checked anew (method sheet
//! 3.6); members and estimators are in `isolation_verification`.
//!
//! | observer | conditions |
//! |---|---|
//! | all | K U1 + U2 = 0 up to rounding; \|eig F\| below its limit; M Schur; finite tables |
//! | main | U = D; K comes from its source, unless only a solver can tell; the first p rows of W are I_p, all of length 1; the certificate P, which may be missing only where none is found |
//! | member i | U = \[b_i D\] or b_i, M = 0; W U1 = 0, rows of length 1 |
//! | estimator i | U as there, M = 0; φ U1 = \[1 0 ... 0\] |

use super::{
    certificate::Certificate,
    decoupling::Decoupling,
    directions::orientation,
    error::ConstructionError,
    gains::MainGains,
    observer::{Decoupled, Observer},
    observer_design::{ObserverDesign, convergence_limit, convergence_reason, reach},
    options::ReducedOrderObserverOptions,
    plant::Plant,
};
use crate::tables::{matrix, shaped_matrix};
use nalgebra::DMatrix;

/// What rounding may add to the length of a test row.
const UNIT: f64 = 1e-9;

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
    if !gains.source.is_of(&observer.k, &decoupling, &options.design) {
        return refuse("gains.main.source", format!("K is not {}", gains.source));
    }
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
        None => match Certificate::find(plant, &observer) {
            Some(_) => return refuse("gains.main.P", "it is missing, and there is one".to_owned()),
            None => None,
        },
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

/// The observer with these gains, if they decouple and it converges.
pub(super) fn observer(
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
pub(super) fn designed(
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

/// Rows of length 1 with the sign of test directions.
pub(super) fn unit_rows(
    key: &str,
    rows: &[Vec<f64>],
    outputs: usize,
) -> Result<DMatrix<f64>, ConstructionError> {
    let count = matrix(key, rows)?.nrows();
    let rows = shaped_matrix(key, rows, (count, outputs), "directions x outputs")?;
    if let Some(row) = rows
        .row_iter()
        .position(|row| !((row.norm() - 1.0).abs() <= UNIT))
    {
        return refuse(key, format!("row {row} must have length 1"));
    }
    let mirrored = |row: &[f64]| orientation(row) < 0.0;
    let stated: Vec<Vec<f64>> = rows.row_iter().map(|row| row.iter().copied().collect()).collect();
    match stated.iter().position(|row| mirrored(row)) {
        None => Ok(rows),
        Some(row) => refuse(
            key,
            format!("the first entry of row {row} that is not negligible must be positive"),
        ),
    }
}

pub(super) fn refuse<T>(key: &str, reason: String) -> Result<T, ConstructionError> {
    Err(ConstructionError::GainsRefused {
        key: key.to_owned(),
        reason,
    })
}
