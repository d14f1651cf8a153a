//! Members that do not react to one actuator, and estimators of one fault (method sheet 3.9). M = 0.

use super::{
    candidates::spread_poles,
    closed_form::closed_form,
    decoupling::Decoupling,
    gains::{EstimatorGains, MemberGains},
    observer::{Decoupled, Observer},
    observer_design::{ObserverDesign, blind_rows, convergence_reason, reach},
    options::ReducedOrderObserverOptions,
    plant::{Plant, beside},
};
use nalgebra::DMatrix;

/// F of members and estimators may be as slow as this.
pub(super) const SLOWEST: f64 = 1.0 - 1e-9;

/// The gains of the observers beside the main one.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct IsolationGains {
    /// At most one per actuator: its rows do not react to that actuator's fault.
    pub members: Vec<MemberGains>,
    /// At most one per actuator: one row φ, φ (y - ẑ1) is the fault one sample ago, up to the row's half width.
    pub estimators: Vec<EstimatorGains>,
    /// Actuators without member or estimator, and why.
    pub warnings: Vec<String>,
}

/// The gains of all members and estimators that the plant admits.
pub(super) fn find_isolation_gains(plant: &Plant, options: &ReducedOrderObserverOptions) -> IsolationGains {
    let isolation = &options.isolation;
    let mut out = IsolationGains::default();
    let poles = match isolation.poles.as_slice() {
        [one] => spread_poles(*one, plant.hidden()),
        all => all.to_vec(),
    };
    for actuator in 0..plant.actuators() {
        // A member needs an output more than its unknown inputs, an estimator as many.
        for (spare, kind) in [(1, "member"), (0, "estimator")] {
            // With one actuator there is nothing to isolate.
            let wanted = if spare == 1 {
                plant.actuators() > 1
            } else {
                isolation.fault_estimate
            };
            if !wanted {
                continue;
            }
            let attempt = |with_disturbances: bool| {
                let u = unknown_inputs(plant, actuator, with_disturbances);
                if plant.outputs() < u.ncols() + spare {
                    return Err(format!("{} outputs do not suffice", plant.outputs()));
                }
                let found = decoupled_observer(plant, &u, with_disturbances, actuator, &poles, spare == 1)?;
                match isolation
                    .fault_estimate_radius_max
                    .as_ref()
                    .and_then(|most| most.get(actuator))
                {
                    Some(most) if spare == 0 && found.steady()[0] > *most => Err(format!(
                        "its radius {:.6} exceeds `isolation.fault_estimate_radius_max`",
                        found.steady()[0]
                    )),
                    _ => Ok(found),
                }
            };
            let found = match attempt(true) {
                Err(_) if plant.disturbances() > 0 => attempt(false),
                first => first,
            };
            match found {
                Ok(design) if spare == 1 => out.members.push(MemberGains::new(&design, actuator)),
                Ok(design) => out.estimators.push(EstimatorGains::new(&design, actuator)),
                Err(reason) => out
                    .warnings
                    .push(format!("actuator {actuator} has no {kind}: {reason}")),
            }
        }
    }
    out
}

/// U: the column of an actuator's fault, with or without those of the disturbances beside it.
pub(super) fn unknown_inputs(plant: &Plant, actuator: usize, disturbances: bool) -> DMatrix<f64> {
    let own = plant.b.columns(actuator, 1).into_owned();
    if disturbances { beside(&own, &plant.d) } else { own }
}

/// The observer that keeps the columns of `u` out of z2, with the rows that do not see them (`member`) or with the
/// row that sees the first column alone; the reason if there is none.
fn decoupled_observer(
    plant: &Plant,
    u: &DMatrix<f64>,
    disturbances: bool,
    actuator: usize,
    poles: &[f64],
    member: bool,
) -> Result<ObserverDesign, String> {
    let decoupling = Decoupling::new(plant, u).map_err(|error| error.to_string())?;
    let k = closed_form(&decoupling, poles).map_err(|error| error.to_string())?;
    let k = decoupling.project(&k);
    if !decoupling.is_decoupled(&k) {
        return Err("its unknown inputs cannot be decoupled accurately".to_owned());
    }
    let p = plant.outputs();
    let decoupled = Decoupled {
        disturbances,
        actuator: Some(actuator),
    };
    let observer = Observer::new(plant, k, DMatrix::zeros(p, p), decoupled);
    if let Some((_, reason)) = convergence_reason(&observer, SLOWEST) {
        return Err(reason);
    }
    let reach = reach(plant, &observer)?;
    let rows = match member {
        true => blind_rows(&decoupling.u1),
        false => decoupling.u1_inverse.rows(0, 1).into_owned(),
    };
    Ok(ObserverDesign::new(observer, reach, rows, Some(actuator)))
}
