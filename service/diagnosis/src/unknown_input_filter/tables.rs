//! What the method reads from a diagnoser's table, and the way from there to a bank.

use super::UnknownInputFilterBank;
use super::achieved::Inspection;
use super::checks::CheckError;
use super::error::ConstructionError;
use super::gains::UnknownInputFilterGains;
use super::options::{
    BankOptions, FilterOptions, Form, MissingOptions, ParityOptions, UnknownInputFilterOptions,
};
use super::options_error::OptionsError;
use crate::gains::FoundGains;
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

    type Gains = UnknownInputFilterGains;

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

    fn needs_solver(&self) -> Option<Refusal> {
        let designed = self.filter.form == Form::Coupled
            && !self.parity.lengths.is_empty()
            && self.parity.certificates.is_none();
        designed.then(|| Refusal {
            key: "parity.lengths".to_owned(),
            message: "the certificates of parity tests come from linear programs; design the gains with a program that \
                      has a solver, give `parity.certificates`, or set `parity.lengths` = []"
                .to_owned(),
        })
    }

    /// Certificates are those that the options bring; who has a solver adds others.
    fn find_gains(&self, sample_time_s: f64) -> Result<FoundGains<UnknownInputFilterGains>, Refusal> {
        let model = LinearModel::new(&self.model, sample_time_s)?;
        let mut found = FoundGains::closed_form(UnknownInputFilterGains::find(&model, &self.options())?);
        let none = self.parity.certificates.as_ref().is_some_and(Vec::is_empty);
        if self.filter.form == Form::Coupled && !self.parity.lengths.is_empty() && none {
            found.warnings.push(
                "`parity.certificates` is empty, so that no test over several samples runs; leave it out to have them \
                 designed for `parity.lengths`, or set `parity.lengths` = [] as well"
                    .to_owned(),
            );
        }
        Ok(found)
    }

    fn with_gains(&self, sample_time_s: f64, gains: &UnknownInputFilterGains) -> Result<Designed, Refusal> {
        let model = LinearModel::new(&self.model, sample_time_s)?;
        let options = self.options();
        let bank = UnknownInputFilterBank::with_gains(model.clone(), &options, gains)?;
        let inspection = Inspection::new(&model, &options, gains, &bank);
        Ok(Designed {
            achieved: inspection.achieved(sample_time_s),
            notes: inspection.notes(),
            warnings: inspection.warnings(),
            diagnoser: Box::new(bank),
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
            ConstructionError::Check(error) => return error.into(),
            ConstructionError::Gains(error) => return Self::new(error.key(), &error),
            ConstructionError::TooManyChannels { .. } => "filter.publish",
            ConstructionError::NoStableFixedGain { .. } => "filter.gain",
        };
        Self::new(key, &error)
    }
}
