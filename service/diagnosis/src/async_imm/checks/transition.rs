//! Λ, Γ, the stay probability and μ₀.

use super::super::{
    design::{ImmDesign, ModeTransition},
    design_error::DesignError,
};
use nalgebra::DMatrix;

/// Tolerance of sums of probabilities.
const TOLERANCE: f64 = 1e-9;

pub(super) fn check(design: &ImmDesign) -> Result<(), DesignError> {
    let modes = design.modes.len();
    match &design.transition {
        ModeTransition::Stay {
            probability,
            period_s,
        } => {
            let least = if modes > 1 { 1.0 / modes as f64 } else { 0.0 };
            if !(*probability > least && *probability <= 1.0) {
                let allowed =
                    format!("with {modes} modes it must lie above {least:.4} (1 / modes), at most 1");
                return Err(DesignError::setting(
                    "transition.stay_probability",
                    probability,
                    allowed,
                ));
            }
            if !(*period_s > 0.0 && period_s.is_finite()) {
                let allowed = "a period above 0 s is needed";
                return Err(DesignError::setting(
                    "transition.stay_period_s",
                    period_s,
                    allowed,
                ));
            }
        }
        ModeTransition::Rate(gamma) => {
            let key = "transition.rate_per_second";
            square(key, gamma, modes)?;
            for row in 0..modes {
                let scale = gamma[(row, row)].abs().max(1e-300);
                let off = (0..modes).filter(|&column| column != row);
                if off.clone().any(|column| gamma[(row, column)] < 0.0) {
                    return Err(invalid(key, row, "has a negative rate to another mode"));
                }
                if gamma.row(row).sum().abs() > TOLERANCE * scale {
                    return Err(invalid(key, row, "does not sum to 0"));
                }
            }
        }
        ModeTransition::PerStep(lambda) => {
            let key = "transition.matrix";
            square(key, lambda, modes)?;
            for row in 0..modes {
                if lambda.row(row).iter().any(|entry| *entry < 0.0) {
                    return Err(invalid(key, row, "has a negative probability"));
                }
                if (lambda.row(row).sum() - 1.0).abs() > TOLERANCE {
                    return Err(invalid(key, row, "does not sum to 1"));
                }
            }
        }
    }
    let mu = &design.prior.mode_probability;
    let sum: f64 = mu.iter().sum();
    if mu.iter().any(|entry| *entry < 0.0) || (sum - 1.0).abs() > TOLERANCE {
        return Err(DesignError::ModeProbabilityInvalid);
    }
    Ok(())
}

fn square(key: &'static str, matrix: &DMatrix<f64>, modes: usize) -> Result<(), DesignError> {
    if matrix.shape() != (modes, modes) {
        return Err(DesignError::DimensionMismatch {
            name: key.to_owned(),
            actual: format!("{} x {}", matrix.nrows(), matrix.ncols()),
            expected: format!("{modes} x {modes} (modes x modes)"),
        });
    }
    if matrix.iter().all(|entry| entry.is_finite()) {
        Ok(())
    } else {
        Err(DesignError::NotFinite { name: key.to_owned() })
    }
}

fn invalid(key: &'static str, row: usize, what: &'static str) -> DesignError {
    DesignError::TransitionInvalid { key, row, what }
}
