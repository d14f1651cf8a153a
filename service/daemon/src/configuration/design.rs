//! The off-line design of a method: what is computed once from its options, before any diagnoser is constructed.

use super::build::BuiltDiagnoser;
use super::method::{MethodConfiguration, MethodError};
use super::parity_design::{inert_thresholds, not_separable, sensitivities};
use nalgebra::DVector;
use residual_diagnosis::model::LinearModel;
use residual_diagnosis::unknown_input_filter::UnknownInputFilterBank;
use residual_diagnosis::unknown_input_filter::checks::check_modes;
use residual_diagnosis::unknown_input_filter::modes::FaultMode;
use residual_diagnosis::unknown_input_filter::options::{Form, UnknownInputFilterOptions};
use residual_synthesis::certificates::{CertificateOptions, design};

/// A method with everything its diagnosers are constructed from.
#[derive(Clone, Debug)]
pub struct DesignedMethod {
    recipe: Recipe,
    /// What the design found, for people: name and value.
    pub notes: Vec<(&'static str, String)>,
    /// What is accepted but deserves a second look.
    pub warnings: Vec<String>,
}

#[derive(Clone, Debug)]
enum Recipe {
    UnknownInputFilter {
        model: LinearModel,
        options: UnknownInputFilterOptions,
    },
}

impl MethodConfiguration {
    /// Checks the conditions of the method and does its off-line design.
    ///
    /// # Errors
    /// The first condition that does not hold.
    pub fn design(&self, sample_time_s: f64) -> Result<DesignedMethod, MethodError> {
        match self {
            Self::UnknownInputFilter { model, options } => {
                unknown_input_filter(LinearModel::new(model, sample_time_s)?, options.clone())
            }
        }
    }
}

impl DesignedMethod {
    /// Constructs a diagnoser.
    ///
    /// # Errors
    /// The first condition of the method that does not hold.
    pub fn build(&self) -> Result<BuiltDiagnoser, MethodError> {
        let diagnoser = match &self.recipe {
            Recipe::UnknownInputFilter { model, options } => {
                Box::new(UnknownInputFilterBank::new(model.clone(), options)?)
            }
        };
        Ok(BuiltDiagnoser {
            diagnoser,
            notes: self.notes.clone(),
            warnings: self.warnings.clone(),
        })
    }
}

fn unknown_input_filter(
    model: LinearModel,
    mut options: UnknownInputFilterOptions,
) -> Result<DesignedMethod, MethodError> {
    options.validate(&model)?;
    let modes = options.bank.modes(model.actuator_count());
    let report = check_modes(&model, &options, &modes)?;
    let mut warnings: Vec<String> = report.warnings.iter().map(ToString::to_string).collect();
    if options.filter.fault_of_interest.is_none() {
        warnings.push(
            "`filter.fault_of_interest` is not set: no record will tell when thresholds become too wide to see a \
             fault"
                .to_owned(),
        );
    }
    let names: Vec<_> = model
        .actuators()
        .iter()
        .map(|actuator| actuator.name.as_str())
        .collect();
    let described: Vec<_> = modes.iter().map(|mode| mode.describe(&names)).collect();
    let mut notes = vec![("fault modes", described.join(", "))];
    // Modes without filter are never falsified.
    let testable = modes
        .iter()
        .zip(&report.testable)
        .filter(|(_, testable)| **testable);
    let testable: Vec<FaultMode> = testable.map(|(mode, _)| *mode).collect();
    add_certificates(&model, &modes, &testable, &mut options, &mut notes, &mut warnings)?;
    Ok(DesignedMethod {
        recipe: Recipe::UnknownInputFilter { model, options },
        notes,
        warnings,
    })
}

/// Designs the certificates that `parity.lengths` asks for, unless the options bring their own.
fn add_certificates(
    model: &LinearModel,
    modes: &[FaultMode],
    testable: &[FaultMode],
    options: &mut UnknownInputFilterOptions,
    notes: &mut Vec<(&'static str, String)>,
    warnings: &mut Vec<String>,
) -> Result<(), MethodError> {
    let parity = &mut options.parity;
    let coupled = options.filter.form == Form::Coupled;
    let given = match &parity.certificates {
        Some(certificates) => Some(format!("{}, as configured", certificates.len())),
        None if parity.lengths.is_empty() => Some("off".to_owned()),
        None if !coupled => Some("off, they belong to the coupled form".to_owned()),
        None => None,
    };
    if let Some(note) = given {
        notes.push(("parity tests", note));
        if coupled && !parity.lengths.is_empty() && parity.certificates.as_ref().is_some_and(Vec::is_empty) {
            warnings.push(
                "`parity.certificates` is empty, so that no test over several samples runs; leave it out to have them \
                 designed for `parity.lengths`, or set `parity.lengths` = [] as well"
                    .to_owned(),
            );
        }
        return Ok(());
    }
    let nominal_state = match &options.filter.nominal_state_magnitude {
        Some(magnitude) => DVector::from_column_slice(magnitude),
        None => DVector::zeros(model.state_count()),
    };
    let request = CertificateOptions {
        lengths: parity.lengths.clone(),
        pre_samples: parity.pre_samples.count(model.strip_gain().is_some()),
        nominal_state,
    };
    let designed = design(model, testable, &request)
        .map_err(|error| MethodError::new("parity".to_owned(), &error.to_string()))?;
    notes.push((
        "parity tests",
        format!("{}, designed", designed.certificates.len()),
    ));
    notes.extend(sensitivities(model, modes, &designed));
    warnings.extend(not_separable(model, &designed));
    if let Some(interest) = &options.filter.fault_of_interest {
        warnings.extend(inert_thresholds(model, &designed, interest));
    }
    parity.certificates = Some(designed.certificates);
    Ok(())
}
