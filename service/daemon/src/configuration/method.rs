//! The diagnosis methods: from the tables of a diagnoser to a method with its options.

use super::deserialise::{keys_of, read};
use super::locate::Mistakes;
use super::schema::Method;
use residual_diagnosis::model::{LinearModel, ModelError, ModelOptions};
use residual_diagnosis::unknown_input_filter::checks::CheckError;
use residual_diagnosis::unknown_input_filter::error::ConstructionError;
use residual_diagnosis::unknown_input_filter::options::UnknownInputFilterOptions;
use residual_diagnosis::unknown_input_filter::options_error::OptionsError;
use std::collections::HashSet;
use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// A method with its model and options.
#[derive(Clone, Debug, PartialEq)]
pub enum MethodConfiguration {
    /// `method = "unknown_input_filter"`: bank of zonotopic unknown-input set-membership filters.
    UnknownInputFilter {
        /// `[diagnoser.model]`.
        model: ModelOptions,
        /// `[diagnoser.bank]`, `[diagnoser.filter]`, `[diagnoser.parity]`, `[diagnoser.missing]`.
        options: UnknownInputFilterOptions,
    },
}

/// Why a method cannot run as configured.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct MethodError {
    /// Dotted path, inside the diagnoser's table, of the entry to look at.
    pub key: String,
    /// What is wrong.
    pub message: String,
    /// What to do; may be empty.
    pub help: String,
}

impl MethodError {
    /// Messages of the methods read "what is wrong; what to do".
    pub(super) fn new(key: String, message: &str) -> Self {
        let (message, help) = message.split_once("; ").unwrap_or((message, ""));
        Self {
            key,
            message: message.to_owned(),
            help: help.to_owned(),
        }
    }
}

impl From<ModelError> for MethodError {
    fn from(error: ModelError) -> Self {
        let key = match &error {
            ModelError::RaggedRows { key, row, .. } => format!("{key}.{row}"),
            ModelError::LowerAboveUpper { key, index, .. } | ModelError::EmptyName { key, index } => {
                format!("{key}.{index}")
            }
            ModelError::MissingPartner { present, .. } => (*present).to_owned(),
            other => other.key(),
        };
        Self::new(key, &error.to_string())
    }
}

impl From<OptionsError> for MethodError {
    fn from(error: OptionsError) -> Self {
        let key = match &error {
            OptionsError::NegativeBound { key, index, .. } => format!("{key}.{index}"),
            OptionsError::NonFinite { key, row, column, .. } => format!("{key}.{row}.{column}"),
            other => other.key(),
        };
        Self::new(key, &error.to_string())
    }
}

impl From<CheckError> for MethodError {
    fn from(error: CheckError) -> Self {
        Self::new(error.key(), &error.to_string())
    }
}

impl From<ConstructionError> for MethodError {
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
        Self::new(key.to_owned(), &error.to_string())
    }
}

impl MethodConfiguration {
    /// The method's name, as written in the configuration.
    pub fn name(&self) -> &'static str {
        match self {
            Self::UnknownInputFilter { .. } => "unknown_input_filter",
        }
    }

    /// How many measurements and commands the model speaks of: rows of C, columns of B.
    pub fn signal_counts(&self) -> (usize, usize) {
        match self {
            Self::UnknownInputFilter { model, .. } => (model.c.len(), model.b.first().map_or(0, Vec::len)),
        }
    }

    /// Checks all that needs no design: shapes, bounds, options that do not fit together.
    ///
    /// # Errors
    /// The first condition that does not hold.
    pub fn validate(&self, sample_time_s: f64) -> Result<(), MethodError> {
        match self {
            Self::UnknownInputFilter { model, options } => {
                let model = LinearModel::new(model, sample_time_s)?;
                Ok(options.validate(&model)?)
            }
        }
    }

    /// Fills in names and units of outputs and actuators, where the model states none, with those of the
    /// signals (name, unit); names only if they are unique.
    pub(super) fn name_signals(&mut self, measurements: &[(String, String)], commands: &[(String, String)]) {
        match self {
            Self::UnknownInputFilter { model, .. } => {
                adopt(measurements, &mut model.output_names, &mut model.output_units);
                adopt(commands, &mut model.actuator_names, &mut model.actuator_units);
            }
        }
    }
}

fn adopt(signals: &[(String, String)], names: &mut Option<Vec<String>>, units: &mut Option<Vec<String>>) {
    let distinct: HashSet<_> = signals.iter().map(|(name, _)| name).collect();
    if distinct.len() == signals.len() {
        names.get_or_insert_with(|| signals.iter().map(|(name, _)| name.clone()).collect());
    }
    units.get_or_insert_with(|| signals.iter().map(|(_, unit)| unit.clone()).collect());
}

impl Method {
    /// The keys of a diagnoser's table that belong to the method.
    pub(super) fn keys(self) -> Vec<&'static str> {
        match self {
            Self::UnknownInputFilter => [&["model"], keys_of::<UnknownInputFilterOptions>()].concat(),
        }
    }

    /// Reads the method's tables from the diagnoser's table; keys in `others` are not the method's.
    pub(super) fn read(
        self,
        table: &DeTable<'_>,
        span: Range<usize>,
        path: &str,
        others: &[String],
        mistakes: &mut Mistakes<'_>,
    ) -> Option<MethodConfiguration> {
        let Some(model) = table.get("model") else {
            mistakes.at_span(
                span,
                "missing table `[diagnoser.model]`",
                "add the model of the plant",
            );
            return None;
        };
        let DeValue::Table(entries) = model.get_ref() else {
            mistakes.at_span(
                model.span(),
                format!("expected a table, found {}", model.get_ref().type_str()),
                "write the model below a line [diagnoser.model]",
            );
            return None;
        };
        let model_path = format!("{path}.model");
        match self {
            Self::UnknownInputFilter => {
                let model = read(entries, model.span(), &model_path, &[], mistakes);
                let skip = [others, &["model".to_owned()]].concat();
                let options = read(table, span, path, &skip, mistakes);
                Some(MethodConfiguration::UnknownInputFilter {
                    model: model?,
                    options: options?,
                })
            }
        }
    }
}
