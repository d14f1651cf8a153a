//! A matrix as it is saved: its elements, and the room it had.

use super::Matrix;
use serde::{Deserialize, Serialize};

/// No matrix of the real-time path is larger.
const LARGEST_ROOM: usize = 1 << 24;

#[derive(Serialize, Deserialize)]
pub(super) struct StoredMatrix {
    rows: usize,
    columns: usize,
    stride: usize,
    room: usize,
    elements: Vec<f64>,
}

/// The numbers do not describe a matrix.
#[derive(Debug, thiserror::Error)]
#[error("{rows} x {columns} elements, {found} given, do not fit into a room of {room}")]
pub(super) struct NotAMatrix {
    rows: usize,
    columns: usize,
    room: usize,
    found: usize,
}

impl From<Matrix> for StoredMatrix {
    fn from(matrix: Matrix) -> Self {
        Self {
            rows: matrix.rows,
            columns: matrix.columns,
            stride: matrix.stride,
            room: matrix.data.len(),
            elements: matrix.iter_rows().flatten().copied().collect(),
        }
    }
}

impl TryFrom<StoredMatrix> for Matrix {
    type Error = NotAMatrix;

    fn try_from(stored: StoredMatrix) -> Result<Self, NotAMatrix> {
        let StoredMatrix {
            rows,
            columns,
            stride,
            room,
            elements,
        } = stored;
        let fits = columns <= stride
            && room <= LARGEST_ROOM
            && rows.checked_mul(stride).is_some_and(|used| used <= room)
            && rows.checked_mul(columns) == Some(elements.len());
        if !fits {
            return Err(NotAMatrix {
                rows,
                columns,
                room,
                found: elements.len(),
            });
        }
        let mut matrix = Self {
            rows,
            columns,
            stride,
            data: vec![0.0; room].into_boxed_slice(),
        };
        if columns > 0 {
            for (i, row) in elements.chunks_exact(columns).enumerate() {
                matrix.row_mut(i).copy_from_slice(row);
            }
        }
        Ok(matrix)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shape_room_and_elements_come_back() {
        let mut matrix = Matrix::with_capacity(2, 5);
        matrix.append_diagonal(&[1.0, -0.0]);
        let stored = StoredMatrix::from(matrix.clone());
        let back = Matrix::try_from(stored).unwrap();
        assert_eq!(back, matrix);
        assert!(back.has_room_of(&matrix));
        assert_eq!(back[(1, 1)].to_bits(), (-0.0_f64).to_bits());
    }

    #[test]
    fn numbers_that_do_not_fit_are_no_matrix() {
        let stored = |rows, columns, stride, room, elements: usize| StoredMatrix {
            rows,
            columns,
            stride,
            room,
            elements: vec![0.0; elements],
        };
        for wrong in [
            stored(2, 2, 1, 4, 4),
            stored(2, 2, 2, 3, 4),
            stored(2, 2, 2, 4, 3),
            stored(usize::MAX, 2, 2, 4, 4),
            stored(1, 1, 1, usize::MAX, 1),
        ] {
            assert!(Matrix::try_from(wrong).is_err());
        }
    }
}
