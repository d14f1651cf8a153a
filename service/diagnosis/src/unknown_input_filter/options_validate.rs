//! Whether options fit together and fit the model.

use super::options::{
    Form, GainRule, Initialisation, Isolation, MissingPolicy, ResetRule, TestRule, UnknownInputFilterOptions,
};
use super::options_error::OptionsError;
use crate::model::LinearModel;

impl UnknownInputFilterOptions {
    /// Checks that the options fit together and fit the model.
    ///
    /// # Errors
    /// The first [`OptionsError`] found; its key points at the entry.
    pub fn validate(&self, model: &LinearModel) -> Result<(), OptionsError> {
        let strip_available = model.strip_gain().is_some();
        self.validate_counts()?;
        self.validate_bank(model, strip_available)?;
        self.validate_lists(model)?;
        self.validate_forms()?;
        self.validate_start(model, strip_available)?;
        self.validate_kalman(model)?;
        self.validate_certificates(model)?;
        if self.filter.form == Form::Coupled
            && self.missing.policy == MissingPolicy::BoundedFault
            && self.missing.fault_bound.is_none()
        {
            return Err(OptionsError::Missing {
                key: "missing.fault_bound",
                reason: "the policy \"bounded_fault\" predicts over missing samples with the largest possible \
                         fault; give one bound per actuator (its range, say), or set `missing.policy` to \
                         \"unbounded_fault\", which tests less after a loss",
            });
        }
        Ok(())
    }

    fn validate_bank(&self, model: &LinearModel, strip_available: bool) -> Result<(), OptionsError> {
        if !matches!(self.bank.simultaneous_faults.as_slice(), [1] | [1, 2] | [2, 1]) {
            return Err(OptionsError::SimultaneousFaults {
                orders: self.bank.simultaneous_faults.clone(),
            });
        }
        if self.bank.reset == ResetRule::Strip && !strip_available {
            return Err(OptionsError::StripUnavailable {
                key: "bank.reset",
                alternative: "\"auto\" or \"copy\"",
            });
        }
        let order = self.filter.effective_generator_order();
        if order <= model.state_count() {
            return Err(OptionsError::GeneratorOrderTooSmall {
                order,
                states: model.state_count(),
            });
        }
        Ok(())
    }

    fn validate_lists(&self, model: &LinearModel) -> Result<(), OptionsError> {
        let (nx, nu) = (model.state_count(), model.actuator_count());
        non_negative(
            "filter.nominal_state_magnitude",
            &self.filter.nominal_state_magnitude,
            nx,
            "states",
        )?;
        non_negative(
            "filter.fault_of_interest",
            &self.filter.fault_of_interest,
            nu,
            "actuators",
        )?;
        non_negative("missing.fault_bound", &self.missing.fault_bound, nu, "actuators")
    }

    fn validate_forms(&self) -> Result<(), OptionsError> {
        let filter = &self.filter;
        let needs = |key, value: &str, form| {
            Err(OptionsError::NeedsForm {
                key,
                value: value.to_owned(),
                form,
            })
        };
        if filter.form != Form::Paper {
            if self.bank.isolation == Isolation::Instantaneous {
                return needs("bank.isolation", "\"instantaneous\"", "paper");
            }
            if filter.test == TestRule::Printed {
                return needs("filter.test", "\"printed\"", "paper");
            }
        }
        if filter.form != Form::Coupled {
            if filter.gain == GainRule::Fixed {
                return needs("filter.gain", "\"fixed\"", "coupled");
            }
            if filter.gain_sweeps > 0 {
                return needs("filter.gain_sweeps", &filter.gain_sweeps.to_string(), "coupled");
            }
        }
        if filter.form != Form::Kalman3Sigma {
            if filter.initial_covariance.is_some() {
                return needs("filter.initial_covariance", "(a matrix)", "kalman_3sigma");
            }
            if let Some(threshold) = filter.residual_norm_threshold {
                return needs(
                    "filter.residual_norm_threshold",
                    &threshold.to_string(),
                    "kalman_3sigma",
                );
            }
        }
        Ok(())
    }

    fn validate_start(&self, model: &LinearModel, strip_available: bool) -> Result<(), OptionsError> {
        let filter = &self.filter;
        if filter.initialisation == Initialisation::Strip && !strip_available {
            return Err(OptionsError::StripUnavailable {
                key: "filter.initialisation",
                alternative: "\"prior\" with `model.initial_state_radius`",
            });
        }
        let prior = match filter.initialisation {
            Initialisation::Prior => true,
            Initialisation::Strip => false,
            Initialisation::Auto => !strip_available,
        };
        if prior && filter.form != Form::Kalman3Sigma && model.initial_state().is_none() {
            return Err(OptionsError::Missing {
                key: "model.initial_state_radius",
                reason: "without `filter.initialisation` = \"strip\" (which needs a C of full column rank) the \
                         filters start from a box that contains the state; give its radius",
            });
        }
        if let Some(s) = &filter.s {
            matrix_shape(
                "filter.S",
                s,
                (model.state_count(), model.output_count()),
                "states x outputs",
            )?;
        }
        Ok(())
    }

    fn validate_certificates(&self, model: &LinearModel) -> Result<(), OptionsError> {
        let certificates = self.parity.certificates.as_deref().unwrap_or_default();
        if !certificates.is_empty() && self.filter.form != Form::Coupled {
            return Err(OptionsError::NeedsForm {
                key: "parity.certificates",
                value: "(a list)".to_owned(),
                form: "coupled",
            });
        }
        let modes = self.bank.modes(model.actuator_count());
        for (index, certificate) in certificates.iter().enumerate() {
            certificate
                .validate(model)
                .map_err(|source| OptionsError::Certificate { index, source })?;
            if !modes.contains(&certificate.mode) {
                return Err(OptionsError::CertificateOfUnlistedMode {
                    index,
                    mode: certificate.mode,
                });
            }
        }
        Ok(())
    }

    fn validate_kalman(&self, model: &LinearModel) -> Result<(), OptionsError> {
        if self.filter.form != Form::Kalman3Sigma {
            return Ok(());
        }
        let reason = "the form \"kalman_3sigma\" has no default for it";
        let Some(threshold) = self.filter.residual_norm_threshold else {
            return Err(OptionsError::Missing {
                key: "filter.residual_norm_threshold",
                reason,
            });
        };
        if !(threshold.is_finite() && threshold > 0.0) {
            return Err(OptionsError::OutOfRange {
                key: "filter.residual_norm_threshold",
                value: threshold,
                allowed: "it must be a positive number in units of y",
            });
        }
        let Some(covariance) = &self.filter.initial_covariance else {
            return Err(OptionsError::Missing {
                key: "filter.initial_covariance",
                reason,
            });
        };
        let nx = model.state_count();
        matrix_shape(
            "filter.initial_covariance",
            covariance,
            (nx, nx),
            "states x states",
        )?;
        let matrix = nalgebra::DMatrix::from_fn(nx, nx, |i, j| covariance[i][j]);
        let symmetric = matrix == matrix.transpose();
        let shift = nalgebra::DMatrix::identity(nx, nx) * (1e-12 * matrix.amax() + f64::MIN_POSITIVE);
        if !symmetric || (matrix + shift).cholesky().is_none() {
            return Err(OptionsError::NotACovariance);
        }
        Ok(())
    }
}

fn non_negative(
    key: &'static str,
    list: &Option<Vec<f64>>,
    length: usize,
    meaning: &str,
) -> Result<(), OptionsError> {
    let Some(list) = list else { return Ok(()) };
    if list.len() != length {
        return Err(OptionsError::DimensionMismatch {
            key,
            actual: format!("a list of length {}", list.len()),
            expected: format!("a list of length {length} ({meaning})"),
        });
    }
    match list
        .iter()
        .position(|value| !(value.is_finite() && *value >= 0.0))
    {
        Some(index) => Err(OptionsError::NegativeBound {
            key,
            index,
            value: list[index],
        }),
        None => Ok(()),
    }
}

fn matrix_shape(
    key: &'static str,
    rows: &[Vec<f64>],
    shape: (usize, usize),
    meaning: &str,
) -> Result<(), OptionsError> {
    let columns = rows
        .iter()
        .map(Vec::len)
        .find(|&columns| columns != shape.1)
        .unwrap_or(shape.1);
    if (rows.len(), columns) != shape {
        return Err(OptionsError::DimensionMismatch {
            key,
            actual: format!("{} x {columns}", rows.len()),
            expected: format!("{} x {} ({meaning})", shape.0, shape.1),
        });
    }
    for (row, entries) in rows.iter().enumerate() {
        if let Some(column) = entries.iter().position(|value| !value.is_finite()) {
            return Err(OptionsError::NonFinite {
                key,
                row,
                column,
                value: entries[column],
            });
        }
    }
    Ok(())
}
