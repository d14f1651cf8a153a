//! Shapes, finite entries and ranges of a design.

use super::super::{design::ImmDesign, design_error::DesignError, plant::Plant};
use nalgebra::DMatrix;

pub(super) fn check(design: &ImmDesign) -> Result<(), DesignError> {
    let (nx, nu, nf) = design.plant.sizes();
    let p = design.slots();
    if nx == 0 {
        return Err(mismatch("plant.A", "0 x 0", "at least one state"));
    }
    for plant in design.plant.pieces() {
        shape("plant.A", &plant.a, (nx, nx))?;
        shape("plant.B", &plant.b, (nx, nu))?;
        shape("plant.F", &plant.f, (nx, nf))?;
        shape("plant.G", &plant.noise, (nx, nx))?;
    }
    if let Plant::Schedule(plants) = &design.plant
        && (plants.is_empty() || plants.windows(2).any(|pair| pair[0].0 >= pair[1].0))
    {
        return Err(DesignError::setting(
            "plant",
            "a schedule out of order",
            "give at least one plant, in order of time",
        ));
    }
    if design.sensors.is_empty() {
        return Err(mismatch("sensor", "an empty list", "at least one sensor"));
    }
    for (number, sensor) in design.sensors.iter().enumerate() {
        let key = |entry: &str| format!("sensor.{number}.{entry}");
        let d = sensor.measurement_matrix.nrows();
        if d == 0 {
            return Err(mismatch(
                &key("measurement_matrix"),
                "an empty list",
                "at least one row",
            ));
        }
        shape(&key("measurement_matrix"), &sensor.measurement_matrix, (d, nx))?;
        shape(&key("noise_covariance"), &sensor.noise_covariance, (d, d))?;
        if let Some(held) = &sensor.initial_held_value {
            list(&key("initial_held_value"), held, d)?;
        }
        let beta = sensor.arrival_probability;
        if !(beta > 0.0 && beta <= 1.0) {
            let allowed = "a probability above 0 and at most 1 is needed";
            return Err(DesignError::setting(key("arrival_probability"), beta, allowed));
        }
    }
    if design.modes.is_empty() {
        return Err(mismatch("mode", "an empty list", "at least the normal mode"));
    }
    for (number, mode) in design.modes.iter().enumerate() {
        shape(&format!("mode.{number}.direction"), &mode.direction, (nf, p))?;
        list("amplitude.random_walk_psd", &mode.random_walk_psd, p)?;
        if let Some(negative) = mode.random_walk_psd.iter().find(|density| **density < 0.0) {
            let allowed = "a power spectral density is not negative";
            return Err(DesignError::setting(
                "amplitude.random_walk_psd",
                negative,
                allowed,
            ));
        }
    }
    let prior = &design.prior;
    list("initial.state", &prior.state, nx)?;
    shape("initial.state_covariance", &prior.state_covariance, (nx, nx))?;
    list("amplitude.prior_mean", &prior.amplitude, p)?;
    shape(
        "amplitude.prior_standard_deviation",
        &prior.amplitude_covariance,
        (p, p),
    )?;
    list(
        "initial.mode_probability",
        &prior.mode_probability,
        design.modes.len(),
    )
}

fn mismatch(name: &str, actual: &str, expected: &str) -> DesignError {
    DesignError::DimensionMismatch {
        name: name.to_owned(),
        actual: actual.to_owned(),
        expected: expected.to_owned(),
    }
}

fn shape(name: &str, matrix: &DMatrix<f64>, expected: (usize, usize)) -> Result<(), DesignError> {
    let text = |(rows, columns): (usize, usize)| format!("{rows} x {columns}");
    if matrix.shape() != expected {
        return Err(mismatch(name, &text(matrix.shape()), &text(expected)));
    }
    finite(name, matrix.as_slice())
}

fn list(name: &str, entries: &[f64], length: usize) -> Result<(), DesignError> {
    if entries.len() != length {
        let text = |length| format!("a list of length {length}");
        return Err(mismatch(name, &text(entries.len()), &text(length)));
    }
    finite(name, entries)
}

fn finite(name: &str, entries: &[f64]) -> Result<(), DesignError> {
    if entries.iter().all(|entry| entry.is_finite()) {
        Ok(())
    } else {
        Err(DesignError::NotFinite {
            name: name.to_owned(),
        })
    }
}
