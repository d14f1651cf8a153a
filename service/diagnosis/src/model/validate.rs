//! Conversion of lists to matrices and vectors, with an error that names the entry.

use super::{Bounds, Label, ModelError};
use nalgebra::{DMatrix, DVector};

/// A list of rows as a matrix; an empty list is a 0 x 0 matrix.
pub(super) fn matrix(key: &'static str, rows: &[Vec<f64>]) -> Result<DMatrix<f64>, ModelError> {
    let columns = rows.first().map_or(0, Vec::len);
    for (row, entries) in rows.iter().enumerate() {
        if entries.len() != columns {
            return Err(ModelError::RaggedRows {
                key,
                row,
                actual: entries.len(),
                expected: columns,
            });
        }
        if let Some(column) = entries.iter().position(|value| !value.is_finite()) {
            let position = format!("row {row}, column {column}");
            return Err(ModelError::NonFinite {
                key,
                position,
                value: entries[column],
            });
        }
    }
    Ok(DMatrix::from_fn(rows.len(), columns, |i, j| rows[i][j]))
}

/// A finite vector of the given length.
pub(super) fn vector(
    key: &'static str,
    entries: &[f64],
    length: usize,
    meaning: &'static str,
) -> Result<DVector<f64>, ModelError> {
    require_length(key, entries.len(), length, meaning)?;
    if let Some(index) = entries.iter().position(|value| !value.is_finite()) {
        return Err(ModelError::NonFinite {
            key,
            position: format!("entry {index}"),
            value: entries[index],
        });
    }
    Ok(DVector::from_column_slice(entries))
}

fn require_length(
    key: &'static str,
    actual: usize,
    expected: usize,
    meaning: &'static str,
) -> Result<(), ModelError> {
    if actual == expected {
        return Ok(());
    }
    let [actual, expected] = [actual, expected].map(|length| format!("a list of length {length}"));
    Err(ModelError::DimensionMismatch {
        key,
        actual,
        expected,
        meaning,
    })
}

/// Demands a number of rows.
pub(super) fn require_rows(
    key: &'static str,
    matrix: &DMatrix<f64>,
    rows: usize,
    meaning: &'static str,
) -> Result<(), ModelError> {
    let columns = matrix.ncols();
    require_shape(key, matrix, (rows, columns), meaning)
}

/// Demands a number of columns.
pub(super) fn require_columns(
    key: &'static str,
    matrix: &DMatrix<f64>,
    columns: usize,
    meaning: &'static str,
) -> Result<(), ModelError> {
    let rows = matrix.nrows();
    require_shape(key, matrix, (rows, columns), meaning)
}

fn require_shape(
    key: &'static str,
    matrix: &DMatrix<f64>,
    shape: (usize, usize),
    meaning: &'static str,
) -> Result<(), ModelError> {
    if matrix.shape() == shape {
        return Ok(());
    }
    let [actual, expected] = [matrix.shape(), shape].map(|(rows, columns)| format!("{rows} x {columns}"));
    Err(ModelError::DimensionMismatch {
        key,
        actual,
        expected,
        meaning,
    })
}

/// Demands entries >= 0; `rows` is the number of rows of the column-major `entries`, 1 for a vector.
pub(super) fn non_negative(key: &'static str, entries: &[f64], rows: usize) -> Result<(), ModelError> {
    match entries.iter().position(|value| *value < 0.0) {
        None => Ok(()),
        Some(index) => {
            let position = match rows {
                1 => format!("entry {index}"),
                _ => format!("row {}, column {}", index % rows, index / rows),
            };
            Err(ModelError::NegativeBound {
                key,
                position,
                value: entries[index],
            })
        }
    }
}

/// A box given by both corners or by none.
pub(super) fn bounds(
    keys: [&'static str; 2],
    corners: [&Option<Vec<f64>>; 2],
    length: usize,
    meaning: &'static str,
) -> Result<Option<Bounds>, ModelError> {
    let (lower, upper) = match corners {
        [None, None] => return Ok(None),
        [Some(_), None] => {
            return Err(ModelError::MissingPartner {
                key: keys[1],
                present: keys[0],
            });
        }
        [None, Some(_)] => {
            return Err(ModelError::MissingPartner {
                key: keys[0],
                present: keys[1],
            });
        }
        [Some(lower), Some(upper)] => (
            vector(keys[0], lower, length, meaning)?,
            vector(keys[1], upper, length, meaning)?,
        ),
    };
    match (0..length).find(|&i| lower[i] > upper[i]) {
        Some(index) => Err(ModelError::LowerAboveUpper {
            key: keys[0],
            index,
            lower: lower[index],
            upper: upper[index],
        }),
        None => Ok(Some(Bounds { lower, upper })),
    }
}

/// Unique names of the given number, or `prefix_0`, `prefix_1`, ...
pub(super) fn names(
    key: &'static str,
    given: &Option<Vec<String>>,
    prefix: &str,
    count: usize,
) -> Result<Vec<String>, ModelError> {
    let Some(given) = given else {
        return Ok((0..count).map(|i| format!("{prefix}_{i}")).collect());
    };
    require_length(key, given.len(), count, "one name each")?;
    for (index, name) in given.iter().enumerate() {
        if name.is_empty() {
            return Err(ModelError::EmptyName { key, index });
        }
        if given[..index].contains(name) {
            return Err(ModelError::DuplicateName {
                key,
                name: name.clone(),
            });
        }
    }
    Ok(given.clone())
}

/// Joins names and units.
pub(super) fn labels(
    names: Vec<String>,
    key: &'static str,
    units: &Option<Vec<String>>,
) -> Result<Vec<Label>, ModelError> {
    let units = match units {
        None => vec![String::new(); names.len()],
        Some(units) => {
            require_length(key, units.len(), names.len(), "one unit each")?;
            units.clone()
        }
    };
    Ok(names
        .into_iter()
        .zip(units)
        .map(|(name, unit)| Label { name, unit })
        .collect())
}
