//! Whether a design can run (method sheet 3): shapes, covariances, probabilities, observability.

mod observability;
mod shapes;
mod transition;

pub use observability::{amplitude_gap, detectability_gap};

use super::{
    design::{Form, ImmDesign},
    design_error::DesignError,
};
use crate::covariance::{positive_definite_factor, semidefinite_factor};
use nalgebra::DMatrix;

/// What the checks found beside errors.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CheckReport {
    /// Smallest singular value of the test of each fault mode, mode 1 first; 0 would be an error.
    pub amplitude_gaps: Vec<f64>,
    /// Pairs of modes that only transients tell apart.
    pub separable_by_transients_only: Vec<(usize, usize)>,
}

/// Checks a design.
///
/// # Errors
/// [`DesignError`]: the first condition that does not hold.
pub fn check(design: &ImmDesign) -> Result<CheckReport, DesignError> {
    shapes::check(design)?;
    check_modes(design)?;
    check_covariances(design)?;
    transition::check(design)?;
    let report = observability::check(design)?;
    let walks = design
        .modes
        .iter()
        .any(|mode| mode.random_walk_psd.iter().any(|density| *density != 0.0));
    if design.form == Form::BatchUnobserved && walks {
        return Err(DesignError::BatchFormNotApplicable {
            reason: "it has no term for a random walk of the amplitude (`amplitude.random_walk_psd`)"
                .to_owned(),
        });
    }
    Ok(report)
}

/// D_0 = 0 and no two modes equal.
fn check_modes(design: &ImmDesign) -> Result<(), DesignError> {
    let modes = &design.modes;
    if modes
        .first()
        .is_some_and(|mode| mode.direction.iter().any(|entry| *entry != 0.0))
    {
        return Err(DesignError::FirstModeNotNormal);
    }
    for j in 0..modes.len() {
        for i in 0..j {
            if modes[i].direction == modes[j].direction
                && modes[i].random_walk_psd == modes[j].random_walk_psd
            {
                return Err(DesignError::DuplicateModes { i, j });
            }
        }
    }
    Ok(())
}

fn check_covariances(design: &ImmDesign) -> Result<(), DesignError> {
    for (number, sensor) in design.sensors.iter().enumerate() {
        if positive_definite_factor(&sensor.noise_covariance).is_err() {
            return Err(DesignError::NoiseCovarianceNotPositiveDefinite {
                sensor: number,
                name: sensor.name.clone(),
            });
        }
    }
    let semidefinite = |name: &str, matrix: &DMatrix<f64>| match semidefinite_factor(matrix) {
        Ok(_) => Ok(()),
        Err(_) => Err(DesignError::CovarianceNotPositiveSemidefinite {
            name: name.to_owned(),
        }),
    };
    for plant in design.plant.pieces() {
        // G Q G' inherits its rounding errors from the product.
        semidefinite(
            "plant.process_noise_psd",
            &((&plant.noise + plant.noise.transpose()) / 2.0),
        )?;
    }
    semidefinite("initial.state_covariance", &design.prior.state_covariance)?;
    semidefinite(
        "amplitude.prior_standard_deviation",
        &design.prior.amplitude_covariance,
    )
}
