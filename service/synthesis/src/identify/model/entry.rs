//! Entries of a structure: numbers, free entries, and expressions of named parameters.

use super::error::StructureError;
use exmex::{Express, FlatEx};
use nalgebra::DMatrix;
use residual_diagnosis::tables::TableError;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Where the search for a free entry begins, and where it may go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FreeOptions {
    /// Start; default: the middle of the range if both ends are given, otherwise 0 or the end next to it.
    pub start: Option<f64>,
    /// Smallest value.
    pub lower: Option<f64>,
    /// Largest value.
    pub upper: Option<f64>,
}

/// One entry of a matrix as a user writes it down.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number, \"free\", an expression of the parameters, or { start, lower, upper }"
)]
pub enum EntryOptions {
    /// Fixed.
    Number(f64),
    /// `"free"`, or an expression of the named parameters.
    Text(String),
    /// Free, with start and range.
    Free(FreeOptions),
}

/// A free parameter.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Parameter {
    pub name: String,
    pub start: f64,
    pub range: (f64, f64),
}

/// The parameters of a structure, while its entries are read.
pub(super) struct Parameters {
    pub all: Vec<Parameter>,
    named: BTreeMap<String, usize>,
    used: Vec<bool>,
}

impl Parameters {
    /// The named ones.
    pub(super) fn new(named: &BTreeMap<String, FreeOptions>) -> Result<Self, StructureError> {
        let mut parameters = Self {
            all: Vec::new(),
            named: BTreeMap::new(),
            used: vec![false; named.len()],
        };
        for (name, options) in named {
            if name == "free"
                || FlatEx::<f64>::parse(name).map_or(true, |parsed| parsed.var_names() != [name.clone()])
            {
                return Err(StructureError::ParameterName { name: name.clone() });
            }
            let index = parameters.add(name.clone(), options)?;
            parameters.named.insert(name.clone(), index);
        }
        Ok(parameters)
    }

    fn add(&mut self, name: String, options: &FreeOptions) -> Result<usize, StructureError> {
        let (lower, upper) = (
            options.lower.unwrap_or(f64::NEG_INFINITY),
            options.upper.unwrap_or(f64::INFINITY),
        );
        let middle = match (options.lower, options.upper) {
            (Some(lower), Some(upper)) => 0.5 * (lower + upper),
            _ => 0.0_f64.max(lower).min(upper),
        };
        let start = options.start.unwrap_or(middle);
        // `nan` in either fails the comparison.
        if !(lower < upper && lower <= start && start <= upper && start.is_finite()) {
            return Err(StructureError::Range {
                name,
                start,
                lower,
                upper,
            });
        }
        self.all.push(Parameter {
            name,
            start,
            range: (lower, upper),
        });
        Ok(self.all.len() - 1)
    }

    /// Refuses a named parameter that no entry uses.
    pub(super) fn all_used(&self) -> Result<(), StructureError> {
        match self.used.iter().position(|used| !used) {
            None => Ok(()),
            Some(unused) => Err(StructureError::Unused {
                name: self.all[unused].name.clone(),
            }),
        }
    }
}

#[derive(Clone, Debug)]
enum Entry {
    Fixed(f64),
    Free(usize),
    Expression(Box<FlatEx<f64>>, Vec<usize>),
}

/// A matrix of entries.
#[derive(Clone, Debug)]
pub(super) struct EntryMatrix {
    columns: usize,
    rows: Vec<Vec<Entry>>,
}

impl EntryMatrix {
    /// Reads the entries of the matrix `key`.
    pub(super) fn new(
        key: &str,
        rows: &[Vec<EntryOptions>],
        parameters: &mut Parameters,
    ) -> Result<Self, StructureError> {
        let columns = rows.first().map_or(0, Vec::len);
        if let Some(row) = rows.iter().position(|row| row.len() != columns) {
            return Err(TableError::RaggedRows {
                key: key.to_owned(),
                row,
                actual: rows[row].len(),
                expected: columns,
            }
            .into());
        }
        let mut read = Vec::with_capacity(rows.len());
        for (i, row) in rows.iter().enumerate() {
            let entries = row.iter().enumerate().map(|(j, entry)| {
                let place = format!("{key}[{i}][{j}]");
                entry_of(place, entry, parameters)
            });
            read.push(entries.collect::<Result<_, _>>()?);
        }
        Ok(Self { columns, rows: read })
    }

    /// Rows and columns.
    pub(super) fn shape(&self) -> (usize, usize) {
        (self.rows.len(), self.columns)
    }

    /// Whether any entry of the column depends on a parameter.
    pub(super) fn is_column_free(&self, column: usize) -> bool {
        self.rows.iter().any(|row| {
            row.get(column)
                .is_some_and(|entry| !matches!(entry, Entry::Fixed(_)))
        })
    }

    /// The numbers for these parameters; NaN where an expression has no value.
    pub(super) fn evaluate(&self, parameters: &[f64]) -> DMatrix<f64> {
        let value = |entry: &Entry| match entry {
            Entry::Fixed(value) => *value,
            Entry::Free(index) => parameters.get(*index).copied().unwrap_or(f64::NAN),
            Entry::Expression(expression, indices) => {
                let values: Vec<f64> = indices
                    .iter()
                    .map(|&index| parameters.get(index).copied().unwrap_or(f64::NAN))
                    .collect();
                expression.eval(&values).unwrap_or(f64::NAN)
            }
        };
        DMatrix::from_row_iterator(
            self.rows.len(),
            self.columns,
            self.rows.iter().flatten().map(value),
        )
    }
}

fn entry_of(
    place: String,
    entry: &EntryOptions,
    parameters: &mut Parameters,
) -> Result<Entry, StructureError> {
    match entry {
        EntryOptions::Number(value) if value.is_finite() => Ok(Entry::Fixed(*value)),
        EntryOptions::Number(value) => Err(StructureError::NotFinite { place, value: *value }),
        EntryOptions::Free(options) => parameters.add(place, options).map(Entry::Free),
        EntryOptions::Text(text) if text == "free" => {
            parameters.add(place, &FreeOptions::default()).map(Entry::Free)
        }
        EntryOptions::Text(text) => {
            let expression: FlatEx<f64> = exmex::parse(text).map_err(|error| StructureError::Expression {
                place: place.clone(),
                expression: text.clone(),
                reason: error.to_string(),
            })?;
            let mut indices = Vec::new();
            for name in expression.var_names() {
                let &index = parameters
                    .named
                    .get(name)
                    .ok_or_else(|| StructureError::UnknownParameter {
                        place: place.clone(),
                        expression: text.clone(),
                        name: name.clone(),
                    })?;
                parameters.used[index] = true;
                indices.push(index);
            }
            if indices.is_empty() {
                let value = expression.eval(&[]).unwrap_or(f64::NAN);
                return entry_of(place, &EntryOptions::Number(value), parameters);
            }
            Ok(Entry::Expression(Box::new(expression), indices))
        }
    }
}
