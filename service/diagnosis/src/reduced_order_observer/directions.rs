//! Test directions: the rows of W (method sheet 3.8, rules 1 to 3).
//!
//! Any set of directions is sound, because thresholds are supports of the unreduced set; the facet normals of the
//! steady set make the test exact. For p >= 4 there are too many of them; directions that tell single faults best
//! (rule 4) come from linear programs and are handed in.

use super::{plant::Plant, reach::Reach};
use crate::decomposition::SingularDecomposition;
use nalgebra::{DMatrix, DVector};

/// Two unit vectors with |a'b| above this are one direction.
const PARALLEL: f64 = 1.0 - 1e-9;
/// Columns shorter than this share of the longest have no facet worth a test.
const NEGLIGIBLE: f64 = 1e-12;
/// Entries below this share of the largest do not decide the sign of a direction.
const SIGNED: f64 = 1e-9;
/// Columns whose pairs span the tested facets for p = 3.
const LONGEST: usize = 6;

/// Outputs up to which facet normals are used.
pub const MAX_FACET_OUTPUTS: usize = 3;

/// The rows of W, unit vectors: the outputs, then, with `set`, the directions that do not see the disturbance, the
/// facet normals and the `further` ones (length p); never more than `limit`, but always all outputs.
pub fn test_directions(
    plant: &Plant,
    reach: &Reach,
    set: bool,
    further: &[DVector<f64>],
    limit: usize,
) -> DMatrix<f64> {
    let p = plant.outputs();
    let mut rows: Vec<DVector<f64>> = DMatrix::<f64>::identity(p, p)
        .column_iter()
        .map(|column| column.into_owned())
        .collect();
    if set {
        let d1 = plant.d.rows(0, p).into_owned();
        let (blind, facets) = (null_space(&d1), facet_normals(plant, reach));
        let columns = blind.column_iter().chain(facets.column_iter());
        let others = columns.map(|column| column.into_owned());
        for mut direction in others.chain(further.iter().cloned()) {
            direction *= orientation(direction.as_slice());
            let known = rows.iter().any(|row| row.dot(&direction).abs() > PARALLEL);
            if !known && rows.len() < limit {
                rows.push(direction);
            }
        }
    }
    DMatrix::from_fn(rows.len(), p, |i, j| rows[i][j])
}

/// The sign that makes the first entry of a direction that is not negligible positive: w and -w are the same test, but
/// their channels are mirrored.
pub(super) fn orientation(direction: &[f64]) -> f64 {
    let largest = direction
        .iter()
        .fold(0.0, |most: f64, entry| most.max(entry.abs()));
    let first = direction.iter().find(|entry| entry.abs() > SIGNED * largest);
    first.map_or(1.0, |entry| entry.signum())
}

/// Orthonormal basis of the w with w' `columns` = 0, p x (p - rank): the directions in which `columns` are not seen.
pub fn null_space(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let svd = SingularDecomposition::new(&columns.transpose());
    svd.null_space(1e-9 * svd.largest())
}

/// Unit facet normals (columns) of the zonotope of V and the upper blocks of all X_j; none for p = 1 or p > 3.
fn facet_normals(plant: &Plant, reach: &Reach) -> DMatrix<f64> {
    let p = plant.outputs();
    if p == 1 || p > MAX_FACET_OUTPUTS {
        return DMatrix::zeros(p, 0);
    }
    let noise = DMatrix::from_diagonal(&plant.noise_bound);
    let columns = std::iter::once(noise).chain(reach.generators.iter().map(|x| x.rows(0, p).into_owned()));
    let merged = merge_parallel(columns);
    let normals: Vec<DVector<f64>> = if p == 2 {
        merged
            .iter()
            .map(|column| DVector::from_vec(vec![-column[1], column[0]]))
            .collect()
    } else {
        let longest = &merged[..merged.len().min(LONGEST)];
        let pairs = (0..longest.len()).flat_map(|i| (i + 1..longest.len()).map(move |j| (i, j)));
        pairs
            .map(|(i, j)| longest[i].cross(&longest[j]).normalize())
            .collect()
    };
    DMatrix::from_fn(p, normals.len(), |i, j| normals[j][i])
}

/// The directions of all columns, parallel ones merged, those of the longest sum first.
fn merge_parallel(matrices: impl Iterator<Item = DMatrix<f64>> + Clone) -> Vec<DVector<f64>> {
    let longest = matrices
        .clone()
        .flat_map(|matrix| {
            matrix
                .column_iter()
                .map(|column| column.norm())
                .collect::<Vec<_>>()
        })
        .fold(0.0, f64::max);
    let mut merged: Vec<(DVector<f64>, f64)> = Vec::new();
    for matrix in matrices {
        for column in matrix.column_iter() {
            let length = column.norm();
            if length <= NEGLIGIBLE * longest {
                continue;
            }
            let direction = column / length;
            match merged
                .iter_mut()
                .find(|(known, _)| known.dot(&direction).abs() > PARALLEL)
            {
                Some((_, sum)) => *sum += length,
                None => merged.push((direction, length)),
            }
        }
    }
    merged.sort_by(|left, right| right.1.total_cmp(&left.1));
    merged.into_iter().map(|(direction, _)| direction).collect()
}
