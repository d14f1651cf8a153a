//! The plant in the coordinates x' = T_c x, in which C = [I 0] (method sheet 2 and 3.1).

use super::{error::ConstructionError, interval_box::IntervalBox, options::ModelOptions};
use crate::{
    decomposition::SingularDecomposition,
    tables::{matrix, shaped_matrix, vector},
};
use nalgebra::{DMatrix, DVector};

/// Below this multiple of the largest singular value a matrix counts as rank deficient (method sheet 3.1).
pub(super) const RANK_TOLERANCE: f64 = 1e-9;

/// A plant with bounded disturbance and noise. `a`, `b`, `d` are in the coordinates x' = T_c x.
#[derive(Clone, Debug, PartialEq)]
pub struct Plant {
    /// T_c = [C; N_c'], n x n.
    pub transformation: DMatrix<f64>,
    /// T_c⁻¹.
    pub inverse: DMatrix<f64>,
    /// T_c A T_c⁻¹, n x n.
    pub a: DMatrix<f64>,
    /// T_c B, n x m.
    pub b: DMatrix<f64>,
    /// T_c D, n x q.
    pub d: DMatrix<f64>,
    /// C in the configured coordinates, p x n.
    pub c: DMatrix<f64>,
    /// Box of x(0) in the configured coordinates, state units.
    pub initial_state: IntervalBox,
    /// Box of η, disturbance units.
    pub disturbance: IntervalBox,
    /// vbar, length p, output units.
    pub noise_bound: DVector<f64>,
    /// Box of u, input units, if one is known.
    pub input: Option<IntervalBox>,
}

impl Plant {
    /// Checks the entries and changes the coordinates.
    ///
    /// # Errors
    /// [`ConstructionError`]: a wrong shape, an empty box, a negative bound or dependent outputs.
    pub fn new(model: &ModelOptions) -> Result<Self, ConstructionError> {
        let c = matrix("model.C", &model.c)?;
        let completion = completion(&c)?;
        Self::with_completion(model, &completion)
    }

    /// The same with other coordinates of the part that is not measured: rows that complete C to a basis. The
    /// residuals and their bounds do not depend on it, K does.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_completion(
        model: &ModelOptions,
        completion: &DMatrix<f64>,
    ) -> Result<Self, ConstructionError> {
        let n = model.a.len();
        if n == 0 {
            return Err(ConstructionError::Missing {
                key: "model.A",
                reason: "the plant has no state; give its state matrix",
            });
        }
        let a = shaped_matrix("model.A", &model.a, (n, n), "states x states")?;
        let m = model.b.first().map_or(0, Vec::len);
        let b = shaped_matrix("model.B", &model.b, (n, m.max(1)), "states x actuators")?;
        let q = model.d.first().map_or(0, Vec::len);
        let d = shaped_matrix("model.D", &model.d, (n, q), "states x disturbances")?;
        let p = model.c.len();
        let c = shaped_matrix("model.C", &model.c, (p.max(1), n), "outputs x states")?;
        let noise = match model.measurement_noise_bound.is_empty() {
            true => DVector::zeros(p),
            false => non_negative("model.measurement_noise_bound", &model.measurement_noise_bound, p)?,
        };
        let transformation = stack(&c, completion);
        let inverse =
            transformation
                .clone()
                .try_inverse()
                .ok_or(ConstructionError::OutputMatrixRankDeficient {
                    smallest: 0.0,
                    largest: c.norm(),
                })?;
        Ok(Self {
            a: &transformation * a * &inverse,
            b: &transformation * b,
            d: &transformation * d,
            transformation,
            inverse,
            c,
            initial_state: IntervalBox::new(
                ("model.initial_state_lower", "model.initial_state_upper"),
                (&model.initial_state_lower, &model.initial_state_upper),
                n,
                "one per state",
            )?,
            disturbance: IntervalBox::new(
                ("model.disturbance_lower", "model.disturbance_upper"),
                (&model.disturbance_lower, &model.disturbance_upper),
                q,
                "one per disturbance",
            )?,
            noise_bound: noise,
            input: IntervalBox::optional(
                ("model.input_lower", "model.input_upper"),
                (&model.input_lower, &model.input_upper),
                m,
                "one per actuator",
            )?,
        })
    }

    /// n, the number of states.
    pub fn states(&self) -> usize {
        self.a.nrows()
    }

    /// p, the number of outputs.
    pub fn outputs(&self) -> usize {
        self.c.nrows()
    }

    /// nz = n - p, the number of states that are not measured.
    pub fn hidden(&self) -> usize {
        self.states() - self.outputs()
    }

    /// m, the number of actuators.
    pub fn actuators(&self) -> usize {
        self.b.ncols()
    }

    /// q, the number of disturbances.
    pub fn disturbances(&self) -> usize {
        self.d.ncols()
    }

    /// The blocks A11 (p x p), A12 (p x nz), A21 (nz x p), A22 (nz x nz).
    pub fn blocks(&self) -> [DMatrix<f64>; 4] {
        let (p, nz) = (self.outputs(), self.hidden());
        let block = |row, column, shape| self.a.view((row, column), shape).into_owned();
        [
            block(0, 0, (p, p)),
            block(0, p, (p, nz)),
            block(p, 0, (nz, p)),
            block(p, p, (nz, nz)),
        ]
    }

    /// Centre and generators of a box of x, in x'.
    pub(super) fn transformed(&self, states: &IntervalBox) -> (DVector<f64>, DMatrix<f64>) {
        (
            &self.transformation * &states.centre,
            &self.transformation * DMatrix::from_diagonal(&states.radius),
        )
    }
}

/// The rows N_c', (n - p) x n and orthonormal, that complete C to T_c; the identity's last rows if C = [I 0].
///
/// Of all bases of null(C) the one that Gram and Schmidt's method finds in the projections of the unit vectors,
/// the longest first and of equal ones the first: so a K designed elsewhere means the same here.
///
/// # Errors
/// [`ConstructionError::OutputMatrixRankDeficient`].
pub fn completion(c: &DMatrix<f64>) -> Result<DMatrix<f64>, ConstructionError> {
    let (p, n) = c.shape();
    let svd = SingularDecomposition::new(&c.transpose());
    if p == 0 || svd.smallest() <= RANK_TOLERANCE * svd.largest() {
        return Err(ConstructionError::OutputMatrixRankDeficient {
            smallest: if p == 0 { 0.0 } else { svd.smallest() },
            largest: svd.largest(),
        });
    }
    let mut basis = svd.u;
    let mut rows = DMatrix::zeros(n - p, n);
    for target in 0..n - p {
        let rest = |i: usize| 1.0 - basis.row(i).norm_squared();
        // A later vector must be longer by more than rounding, so that rounding does not choose.
        let longest = (0..n).fold(0, |best, i| if rest(i) > rest(best) + 1e-9 { i } else { best });
        let mut vector = DVector::from_fn(n, |i, _| f64::from(u8::from(i == longest)));
        for _ in 0..2 {
            vector -= &basis * basis.tr_mul(&vector);
        }
        vector /= vector.norm();
        rows.row_mut(target).copy_from(&vector.transpose());
        let columns = basis.ncols();
        basis = basis.insert_column(columns, 0.0);
        basis.set_column(columns, &vector);
    }
    Ok(rows)
}

/// `upper` over `lower`.
pub(super) fn stack(upper: &DMatrix<f64>, lower: &DMatrix<f64>) -> DMatrix<f64> {
    let (above, columns) = upper.shape();
    DMatrix::from_fn(above + lower.nrows(), columns, |i, j| {
        match i.checked_sub(above) {
            None => upper[(i, j)],
            Some(row) => lower[(row, j)],
        }
    })
}

/// `left` beside `right`.
pub fn beside(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    let (rows, before) = left.shape();
    DMatrix::from_fn(rows, before + right.ncols(), |i, j| match j.checked_sub(before) {
        None => left[(i, j)],
        Some(column) => right[(i, column)],
    })
}

/// A list of finite numbers that are not negative.
pub(super) fn non_negative(
    key: &'static str,
    entries: &[f64],
    length: usize,
) -> Result<DVector<f64>, ConstructionError> {
    let found = vector(key, entries, length, "bounds that are not negative")?;
    match found.iter().find(|value| **value < 0.0) {
        None => Ok(found),
        Some(value) => Err(ConstructionError::OutOfRange {
            key,
            value: value.to_string(),
            allowed: "a bound must not be negative",
        }),
    }
}
