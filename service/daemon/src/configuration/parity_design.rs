//! The parity tests of a bank of unknown-input filters: designed here, because their certificates need a solver.

use super::parity_words::{inert_thresholds, not_separable, sensitivities};
use nalgebra::DVector;
use residual_diagnosis::method::{Designed, MethodOptions, Refusal};
use residual_diagnosis::model::LinearModel;
use residual_diagnosis::unknown_input_filter::checks::check_modes;
use residual_diagnosis::unknown_input_filter::modes::FaultMode;
use residual_diagnosis::unknown_input_filter::options::Form;
use residual_diagnosis::unknown_input_filter::tables::UnknownInputFilterTables;
use residual_synthesis::certificates::{CertificateOptions, design};

/// The design of a bank with the parity tests that `parity.lengths` asks for, unless the tables bring their own.
pub(super) fn with_parity_tests(
    tables: &UnknownInputFilterTables,
    sample_time_s: f64,
) -> Result<Designed, Refusal> {
    let mut tables = tables.clone();
    let mut found = Findings::default();
    if let Some(note) = why_no_design(&tables) {
        found.notes.push(("parity tests", note));
        let none = tables.parity.certificates.as_ref().is_some_and(Vec::is_empty);
        if tables.filter.form == Form::Coupled && !tables.parity.lengths.is_empty() && none {
            found.warnings.push(
                "`parity.certificates` is empty, so that no test over several samples runs; leave it out to have them \
                 designed for `parity.lengths`, or set `parity.lengths` = [] as well"
                    .to_owned(),
            );
        }
    } else {
        add_certificates(&mut tables, sample_time_s, &mut found)?;
    }
    let mut designed = tables.design(sample_time_s)?;
    designed.notes.append(&mut found.notes);
    designed.warnings.append(&mut found.warnings);
    Ok(designed)
}

/// Why there are no certificates to design; `None` if there are.
fn why_no_design(tables: &UnknownInputFilterTables) -> Option<String> {
    match &tables.parity.certificates {
        Some(certificates) => Some(format!("{}, as configured", certificates.len())),
        None if tables.parity.lengths.is_empty() => Some("off".to_owned()),
        None if tables.filter.form != Form::Coupled => {
            Some("off, they belong to the coupled form".to_owned())
        }
        None => None,
    }
}

/// Notes and warnings for people.
#[derive(Default)]
struct Findings {
    notes: Vec<(&'static str, String)>,
    warnings: Vec<String>,
}

fn add_certificates(
    tables: &mut UnknownInputFilterTables,
    sample_time_s: f64,
    found: &mut Findings,
) -> Result<(), Refusal> {
    let model = LinearModel::new(&tables.model, sample_time_s)?;
    let options = tables.options();
    options.validate(&model)?;
    let modes = options.bank.modes(model.actuator_count());
    let report = check_modes(&model, &options, &modes)?;
    // Modes without filter are never falsified.
    let testable = modes
        .iter()
        .zip(&report.testable)
        .filter(|(_, testable)| **testable);
    let testable: Vec<FaultMode> = testable.map(|(mode, _)| *mode).collect();
    let nominal_state = match &options.filter.nominal_state_magnitude {
        Some(magnitude) => DVector::from_column_slice(magnitude),
        None => DVector::zeros(model.state_count()),
    };
    let request = CertificateOptions {
        lengths: options.parity.lengths.clone(),
        pre_samples: options.parity.pre_samples.count(model.strip_gain().is_some()),
        nominal_state,
    };
    let designed = design(&model, &testable, &request).map_err(|error| Refusal::new("parity", &error))?;
    found.notes.push((
        "parity tests",
        format!("{}, designed", designed.certificates.len()),
    ));
    found.notes.extend(sensitivities(&model, &modes, &designed));
    found.warnings.extend(not_separable(&model, &designed));
    if let Some(interest) = &options.filter.fault_of_interest {
        found
            .warnings
            .extend(inert_thresholds(&model, &designed, interest));
    }
    tables.parity.certificates = Some(designed.certificates);
    Ok(())
}
