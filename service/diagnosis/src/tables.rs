//! Lists of a configuration as matrices and vectors, with an error that names the entry.

use nalgebra::{DMatrix, DVector};

/// What is wrong with a list.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TableError {
    /// The rows have different lengths.
    #[error(
        "row {row} of `{key}` has {actual} entries, the rows before it {expected}; give every row the same length"
    )]
    RaggedRows {
        /// Dotted path of the matrix inside the diagnoser's table.
        key: String,
        /// Which row, counted from 0.
        row: usize,
        /// Its length.
        actual: usize,
        /// Length of the rows before it.
        expected: usize,
    },
    /// The shape is not the one that the other entries ask for.
    #[error("`{key}` is {actual}, but {expected} is needed ({meaning}); correct its shape")]
    Shape {
        /// Dotted path inside the diagnoser's table.
        key: String,
        /// Shape found.
        actual: String,
        /// Shape needed.
        expected: String,
        /// What rows and columns stand for.
        meaning: &'static str,
    },
    /// An entry is infinite or not a number.
    #[error("`{key}` holds {value} at {place}; use finite numbers")]
    NotFinite {
        /// Dotted path inside the diagnoser's table.
        key: String,
        /// Where.
        place: String,
        /// The entry.
        value: f64,
    },
}

impl TableError {
    /// Dotted path, inside the diagnoser's table, of the entry to look at.
    pub fn key(&self) -> String {
        match self {
            Self::RaggedRows { key, row, .. } => format!("{key}.{row}"),
            Self::Shape { key, .. } | Self::NotFinite { key, .. } => key.clone(),
        }
    }
}

/// A list of rows as a matrix of any shape; an empty list is a 0 x 0 matrix.
///
/// # Errors
/// [`TableError::RaggedRows`], [`TableError::NotFinite`].
pub fn matrix(key: &str, rows: &[Vec<f64>]) -> Result<DMatrix<f64>, TableError> {
    let columns = rows.first().map_or(0, Vec::len);
    for (row, entries) in rows.iter().enumerate() {
        if entries.len() != columns {
            return Err(TableError::RaggedRows {
                key: key.to_owned(),
                row,
                actual: entries.len(),
                expected: columns,
            });
        }
        if let Some(column) = entries.iter().position(|value| !value.is_finite()) {
            return Err(TableError::NotFinite {
                key: key.to_owned(),
                place: format!("row {row}, column {column}"),
                value: entries[column],
            });
        }
    }
    Ok(DMatrix::from_fn(rows.len(), columns, |i, j| rows[i][j]))
}

/// A list of rows as a matrix of the given shape; `meaning` tells what rows and columns stand for. A list of
/// empty rows, or none, serves wherever the shape has no element.
///
/// # Errors
/// [`TableError`]: what is wrong.
pub fn shaped_matrix(
    key: &str,
    rows: &[Vec<f64>],
    shape: (usize, usize),
    meaning: &'static str,
) -> Result<DMatrix<f64>, TableError> {
    let found = matrix(key, rows)?;
    if found.shape() == shape {
        Ok(found)
    } else if found.is_empty() && shape.0 * shape.1 == 0 {
        Ok(DMatrix::zeros(shape.0, shape.1))
    } else {
        Err(TableError::Shape {
            key: key.to_owned(),
            actual: format!("{} x {}", found.nrows(), found.ncols()),
            expected: format!("{} x {}", shape.0, shape.1),
            meaning,
        })
    }
}

/// A list as a vector of the given length; `meaning` tells what its entries stand for.
///
/// # Errors
/// [`TableError`]: what is wrong.
pub fn vector(
    key: &str,
    entries: &[f64],
    length: usize,
    meaning: &'static str,
) -> Result<DVector<f64>, TableError> {
    if entries.len() != length {
        return Err(TableError::Shape {
            key: key.to_owned(),
            actual: format!("a list of length {}", entries.len()),
            expected: format!("a list of length {length}"),
            meaning,
        });
    }
    match entries.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(TableError::NotFinite {
            key: key.to_owned(),
            place: format!("entry {index}"),
            value: entries[index],
        }),
        None => Ok(DVector::from_column_slice(entries)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_list_is_refused_with_its_place() {
        let ragged = matrix("model.A", &[vec![1.0, 2.0], vec![3.0]]).unwrap_err();
        assert_eq!(ragged.key(), "model.A.1");
        let infinite = matrix("model.A", &[vec![1.0, f64::INFINITY]]).unwrap_err();
        assert!(infinite.to_string().contains("row 0, column 1"), "{infinite}");
        let shape = shaped_matrix("model.B", &[vec![1.0]], (2, 1), "states x inputs").unwrap_err();
        assert!(
            shape.to_string().contains("1 x 1") && shape.to_string().contains("2 x 1"),
            "{shape}"
        );
        assert!(vector("x", &[1.0], 2, "states").is_err());
        assert!(vector("x", &[f64::NAN], 1, "states").is_err());
    }

    #[test]
    fn a_matrix_without_elements_may_be_written_as_an_empty_list() {
        assert_eq!(
            shaped_matrix("model.B", &[], (3, 0), "states x inputs")
                .unwrap()
                .shape(),
            (3, 0)
        );
        assert!(shaped_matrix("model.B", &[], (3, 1), "states x inputs").is_err());
    }
}
