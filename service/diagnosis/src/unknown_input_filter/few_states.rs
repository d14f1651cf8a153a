//! The predicted centre of a plant with few states, inputs and outputs, all its elements at once.

use super::plant::Command;
use crate::matrix::Matrix;
use crate::matrix::columns::Columns;
use crate::matrix::vectors::{Lanes, Work, lanes_of, vectorised};
use pulp::Simd;

/// A0, A⁺, B and C by columns.
#[derive(Clone, Debug)]
pub(crate) struct FewStates {
    a0: Columns,
    a_plus: Columns,
    b: Columns,
    c: Columns,
}

/// Parts of the predicted centre, for every state.
pub(crate) struct CentreParts {
    /// A⁺ m (1 + ε).
    pub uncertainty: Lanes,
    /// A0 p + B u.
    pub centre: Lanes,
    /// |A0| m + |B| (|u| + r_u).
    pub size: Lanes,
}

impl FewStates {
    /// `None` for a plant that does not fit.
    pub fn new(a0: &Matrix, a_plus: &Matrix, b: &Matrix, c: &Matrix) -> Option<Self> {
        Some(Self {
            a0: Columns::of(a0)?,
            a_plus: Columns::of(a_plus)?,
            b: Columns::of(b)?,
            c: Columns::of(c)?,
        })
    }

    /// From the centre p, the bound m of |x| and the command; `enlarge` is 1 + ε.
    pub fn predict(&self, centre: &[f64], magnitude: &[f64], command: &Command, enlarge: f64) -> CentreParts {
        vectorised(Predict {
            few: self,
            centre,
            magnitude,
            command,
            enlarge,
        })
    }

    /// C c and |C| κ for the centre c and the size κ.
    pub fn outputs(&self, centre: &[f64], size: &[f64]) -> [Lanes; 2] {
        vectorised(Outputs {
            c: &self.c,
            centre,
            size,
        })
    }
}

struct Predict<'a> {
    few: &'a FewStates,
    centre: &'a [f64],
    magnitude: &'a [f64],
    command: &'a Command,
    enlarge: f64,
}

impl Work for Predict<'_> {
    type Output = CentreParts;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> CentreParts {
        let FewStates { a0, a_plus, b, .. } = self.few;
        let (p, m) = (self.centre, self.magnitude);
        let (u, radius) = (&self.command.centre, &self.command.radius);
        let uncertainty = simd.mul_f64s(a_plus.dot(simd, m), simd.splat_f64s(self.enlarge));
        let centre = simd.add_f64s(a0.dot(simd, p), b.dot(simd, u));
        let influence = simd.add_f64s(b.dot_size(simd, u), b.absolute_dot(simd, radius));
        let size = simd.add_f64s(a0.absolute_dot(simd, m), influence);
        CentreParts {
            uncertainty: lanes_of::<S>(uncertainty),
            centre: lanes_of::<S>(centre),
            size: lanes_of::<S>(size),
        }
    }
}

struct Outputs<'a> {
    c: &'a Columns,
    centre: &'a [f64],
    size: &'a [f64],
}

impl Work for Outputs<'_> {
    type Output = [Lanes; 2];

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> [Lanes; 2] {
        let (outputs, sizes) = (
            self.c.dot(simd, self.centre),
            self.c.absolute_dot(simd, self.size),
        );
        [lanes_of::<S>(outputs), lanes_of::<S>(sizes)]
    }
}
