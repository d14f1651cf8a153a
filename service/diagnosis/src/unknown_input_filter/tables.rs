//! What the method reads from a diagnoser's table, and the way from there to a bank.

use super::UnknownInputFilterBank;
use super::checks::{CheckError, check_modes};
use super::error::ConstructionError;
use super::options::{BankOptions, FilterOptions, MissingOptions, ParityOptions, UnknownInputFilterOptions};
use super::options_error::OptionsError;
use crate::achieved::Achieved;
use crate::gains::{FoundGains, NoGains};
use crate::method::{Designed, MethodOptions, Refusal};
use crate::model::{LinearModel, ModelOptions, adopt_labels};
use serde::{Deserialize, Serialize};

/// The tables of `method = "unknown_input_filter"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnknownInputFilterTables {
    /// `[diagnoser.model]`: the plant.
    pub model: ModelOptions,
    /// `[diagnoser.bank]`: modes, isolation and resets.
    #[serde(default)]
    pub bank: BankOptions,
    /// `[diagnoser.filter]`: form and gain of the filters, what they publish.
    #[serde(default)]
    pub filter: FilterOptions,
    /// `[diagnoser.parity]`: tests over windows of several samples.
    #[serde(default)]
    pub parity: ParityOptions,
    /// `[diagnoser.missing]`: what a missing measurement means.
    #[serde(default)]
    pub missing: MissingOptions,
}

impl UnknownInputFilterTables {
    /// The options beside the model.
    pub fn options(&self) -> UnknownInputFilterOptions {
        UnknownInputFilterOptions {
            bank: self.bank.clone(),
            filter: self.filter.clone(),
            parity: self.parity.clone(),
            missing: self.missing.clone(),
        }
    }
}

impl MethodOptions for UnknownInputFilterTables {
    const METHOD: &'static str = "unknown_input_filter";

    type Gains = NoGains;

    fn signal_counts(&self) -> (usize, usize) {
        (self.model.c.len(), self.model.b.first().map_or(0, Vec::len))
    }

    fn name_signals(&mut self, measurements: &[(String, String)], commands: &[(String, String)]) {
        let model = &mut self.model;
        adopt_labels(measurements, &mut model.output_names, &mut model.output_units);
        adopt_labels(commands, &mut model.actuator_names, &mut model.actuator_units);
    }

    fn validate(&self, sample_time_s: f64) -> Result<(), Refusal> {
        let model = LinearModel::new(&self.model, sample_time_s)?;
        Ok(self.options().validate(&model)?)
    }

    fn find_gains(&self, _sample_time_s: f64) -> Result<FoundGains<NoGains>, Refusal> {
        Ok(FoundGains::closed_form(NoGains {}))
    }

    /// Parity tests are those that the options bring; who has a solver designs them before.
    fn with_gains(&self, sample_time_s: f64, _gains: &NoGains) -> Result<Designed, Refusal> {
        let model = LinearModel::new(&self.model, sample_time_s)?;
        let options = self.options();
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
        Ok(Designed {
            achieved: Achieved::default(),
            diagnoser: Box::new(UnknownInputFilterBank::new(model, &options)?),
            notes: vec![("fault modes", described.join(", "))],
            warnings,
        })
    }
}

impl From<OptionsError> for Refusal {
    fn from(error: OptionsError) -> Self {
        let key = match &error {
            OptionsError::NegativeBound { key, index, .. } => format!("{key}.{index}"),
            OptionsError::NonFinite { key, row, column, .. } => format!("{key}.{row}.{column}"),
            other => other.key(),
        };
        Self::new(key, &error)
    }
}

impl From<CheckError> for Refusal {
    fn from(error: CheckError) -> Self {
        Self::new(error.key(), &error)
    }
}

impl From<ConstructionError> for Refusal {
    fn from(error: ConstructionError) -> Self {
        let key = match error {
            ConstructionError::Options(error) => return error.into(),
            ConstructionError::Certificate(_) => "parity.certificates",
            ConstructionError::TooManyChannels { .. } => "filter.publish",
            ConstructionError::NoStableFixedGain { .. }
            | ConstructionError::FixedGainWithoutMode { .. }
            | ConstructionError::FixedGainShape { .. } => "filter.gain",
            _ => "method",
        };
        Self::new(key, &error)
    }
}
