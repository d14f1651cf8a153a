//! A matrix as it is saved: its elements, and the room it had.

use super::Matrix;
use serde::ser::{SerializeSeq as _, SerializeStruct as _};
use serde::{Deserialize, Serialize, Serializer};

/// No matrix of the real-time path is larger.
const LARGEST_ROOM: usize = 1 << 24;

#[derive(Deserialize)]
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

/// The fields of a [`StoredMatrix`], without a copy of the elements: a state is saved without allocating.
impl Serialize for Matrix {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_struct("StoredMatrix", 5)?;
        fields.serialize_field("rows", &self.rows)?;
        fields.serialize_field("columns", &self.columns)?;
        fields.serialize_field("stride", &self.stride)?;
        fields.serialize_field("room", &self.data.len())?;
        fields.serialize_field("elements", &Elements(self))?;
        fields.end()
    }
}

/// The elements of a matrix, row by row.
struct Elements<'a>(&'a Matrix);

impl Serialize for Elements<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self(matrix) = self;
        let mut elements = serializer.serialize_seq(Some(matrix.rows * matrix.columns))?;
        for element in matrix.iter_rows().flatten() {
            elements.serialize_element(element)?;
        }
        elements.end()
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
        let format = bincode::config::standard();
        let stored = bincode::serde::encode_to_vec(&matrix, format).unwrap();
        let (back, _): (Matrix, usize) = bincode::serde::decode_from_slice(&stored, format).unwrap();
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
