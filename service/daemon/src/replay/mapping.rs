//! From the columns of a recording to the samples of the configured inputs.

use exmex::{Express, FlatEx};

use super::recording::Recording;
use super::run::Run;
use crate::configuration::{Configuration, ReplayConfiguration};

/// One sample to be sent: `elements` of `input`, `time_ns` after the start of the run.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedSample {
    /// Nanoseconds after the start of the run.
    pub time_ns: u64,
    /// The input.
    pub input: usize,
    /// Number of the sample among those of its input; a number left out is a lost sample.
    pub sequence: u64,
    /// One element per signal.
    pub elements: Vec<f64>,
}

/// Why a recording does not fit the configuration's `[replay]` section.
#[derive(Debug, thiserror::Error)]
pub enum MappingError {
    /// An expression cannot be parsed.
    #[error("value `{expression}` of `{input}` is not an expression: {reason}")]
    Expression {
        /// The input, or whatever else the value belongs to.
        input: String,
        /// The expression.
        expression: String,
        /// The parser's reason.
        reason: String,
    },
    /// An expression uses a column that is not there.
    #[error("value `{expression}` of `{input}` uses the column `{column}`; the recording has: {columns}")]
    NoColumn {
        /// The input, or whatever else the value belongs to.
        input: String,
        /// The expression.
        expression: String,
        /// The missing column.
        column: String,
        /// The columns there are.
        columns: String,
    },
}

/// An expression with the columns of its variables, in the parser's order.
pub(crate) struct Value {
    expression: FlatEx<f64>,
    columns: Vec<usize>,
}

/// What feeds one input.
struct Feed {
    input: usize,
    values: Vec<Value>,
    every_rows: usize,
    first_row: usize,
}

/// The mapping of one recording to the inputs of one configuration.
pub struct Mapping {
    feeds: Vec<Feed>,
}

impl Mapping {
    /// Resolves every expression against the recording's columns.
    pub fn new(
        configuration: &Configuration,
        replay: &ReplayConfiguration,
        recording: &Recording,
    ) -> Result<Self, MappingError> {
        let mut feeds = Vec::new();
        for mapped in &replay.inputs {
            let name = &configuration.inputs[mapped.input].name;
            let values = mapped.values.iter().map(|text| Value::new(name, text, recording));
            feeds.push(Feed {
                input: mapped.input,
                values: values.collect::<Result<_, _>>()?,
                every_rows: mapped.every_rows,
                first_row: mapped.first_row,
            });
        }
        Ok(Self { feeds })
    }

    /// The samples of a run in time order. A row whose expression has no value (an empty cell, a division by
    /// zero) sends no sample: what was not recorded is missing, not invented.
    pub fn samples(&self, run: &Run) -> Vec<TimedSample> {
        let mut samples = Vec::with_capacity(run.rows.len() * self.feeds.len());
        let mut sequences = vec![0; self.feeds.len()];
        let mut variables = Vec::new();
        for (index, (&time_ns, row)) in run.times_ns.iter().zip(&run.rows).enumerate() {
            for (feed, sequence) in self.feeds.iter().zip(&mut sequences) {
                if !feed.takes(index) {
                    continue;
                }
                let values = feed.values.iter();
                let elements: Vec<f64> = values.map(|value| value.of(row, &mut variables)).collect();
                if elements.iter().all(|element| element.is_finite()) {
                    samples.push(TimedSample {
                        time_ns,
                        input: feed.input,
                        sequence: *sequence,
                        elements,
                    });
                    *sequence += 1;
                }
            }
        }
        samples
    }
}

impl Feed {
    /// Whether the row with this index makes a sample.
    fn takes(&self, row: usize) -> bool {
        row.checked_sub(self.first_row)
            .is_some_and(|since| since.is_multiple_of(self.every_rows))
    }
}

impl Value {
    /// Resolves the expression of `input` against the recording's columns.
    pub(crate) fn new(input: &str, text: &str, recording: &Recording) -> Result<Self, MappingError> {
        let expression: FlatEx<f64> = exmex::parse(text).map_err(|error| MappingError::Expression {
            input: input.into(),
            expression: text.into(),
            reason: error.to_string(),
        })?;
        let column = |name: &String| {
            recording
                .columns
                .iter()
                .position(|column| column == name)
                .ok_or_else(|| MappingError::NoColumn {
                    input: input.into(),
                    expression: text.into(),
                    column: name.clone(),
                    columns: recording.columns.join(", "),
                })
        };
        let columns = expression
            .var_names()
            .iter()
            .map(column)
            .collect::<Result<_, _>>()?;
        Ok(Self { expression, columns })
    }

    /// The value in a row; NaN where a column is empty.
    pub(crate) fn of(&self, row: &[f64], variables: &mut Vec<f64>) -> f64 {
        variables.clear();
        variables.extend(self.columns.iter().map(|&column| row[column]));
        self.expression.eval(variables).unwrap_or(f64::NAN)
    }
}
