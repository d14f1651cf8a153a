//! Members and estimators from gains alone, after every condition that they rely on has been checked anew (method sheet
//! 3.9; the conditions are listed in `verification`).

use super::{
    decoupling::Decoupling,
    error::ConstructionError,
    gains::{EstimatorGains, MemberGains},
    isolation_design::{SLOWEST, find_isolation_gains, unknown_inputs},
    observer::{Decoupled, Observer},
    observer_design::ObserverDesign,
    options::ReducedOrderObserverOptions,
    plant::Plant,
    verification::{designed, observer, refuse, unit_rows},
};
use crate::tables::vector;
use nalgebra::DMatrix;

/// Relative to the factors: what rounding may leave of W U1 and of φ U1.
const BLIND: f64 = 1e-12;

/// The members and the estimators: those of every actuator for which the closed form finds one.
///
/// # Errors
/// [`ConstructionError::GainsRefused`], or the condition of the plant that does not hold.
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
    let found = find_isolation_gains(plant, options);
    none_is_missing(
        "gains.members",
        found.members.iter().map(|gains| gains.actuator),
        |actuator| members.iter().any(|gains| gains.actuator == actuator),
    )?;
    none_is_missing(
        "gains.estimators",
        found.estimators.iter().map(|gains| gains.actuator),
        |actuator| estimators.iter().any(|gains| gains.actuator == actuator),
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

fn none_is_missing(
    key: &str,
    mut possible: impl Iterator<Item = usize>,
    is_there: impl Fn(usize) -> bool,
) -> Result<(), ConstructionError> {
    match possible.find(|actuator| !is_there(*actuator)) {
        None => Ok(()),
        Some(actuator) => refuse(
            key,
            format!("actuator {actuator} has none, but the configuration asks for it and there is one"),
        ),
    }
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
