//! The numbers on which the filters run, as a gains file holds them.
//!
//! Nothing in them is believed: a filter is constructed from the matrices, and norms, bounds, inequalities and thresholds
//! are recomputed (method sheet 3.5, 3.7). X and Π are certificates: they are checked by the eigenvalues of one matrix and
//! by the residual of one equation, without a solver.

use super::{
    certificate::{Gain, Time},
    error::HinfFilterError,
    options::DesignType,
};
use crate::norms::System;
use crate::tables::{matrix, shaped_matrix};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Gains of the filter, of the filters that are blind to some faults, and of the fault estimate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HinfFilterGains {
    /// The filter that detects.
    pub main: MainGains,
    /// The filters of the bank, in the order of `isolation.blind_sets`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub blind: Vec<BlindGains>,
    /// The filter whose residual estimates the faults.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub estimator: Option<EstimatorGains>,
}

/// The detecting filter: L or H, V, and what proves their bounds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MainGains {
    /// The design that found them; the Riccati design after a failed search by matrix inequalities.
    pub design: DesignType,
    /// `certified` or `uncertified(reason)`.
    pub label: String,
    /// L, n x q, discrete gain.
    #[serde(rename = "L", default, skip_serializing_if = "Option::is_none")]
    pub l: Option<Vec<Vec<f64>>>,
    /// H, n x q, continuous gain in 1/s, instead of L.
    #[serde(rename = "H", default, skip_serializing_if = "Option::is_none")]
    pub h: Option<Vec<Vec<f64>>>,
    /// V, s x q, post-filter of the residual.
    #[serde(rename = "V")]
    pub v: Vec<Vec<f64>>,
    /// γ₁, the optimum of the first stage of a design in two stages.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stage_one: Option<f64>,
    /// γ: what the design claims of ‖T_rd‖∞; of ‖V T_rd‖∞ for `lmi_mixed`, of J for `lmi_paper`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub claimed_bound: Option<f64>,
    /// β: what `lmi_mixed` claims of ‖V T_rf‖₋.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub claimed_index: Option<f64>,
    /// X ≻ 0, n x n, of the bounded-real inequality at the claimed bound.
    #[serde(rename = "X", default, skip_serializing_if = "Option::is_none")]
    pub lyapunov: Option<Vec<Vec<f64>>>,
    /// Π, n x n, of the Riccati equation.
    #[serde(rename = "Pi", default, skip_serializing_if = "Option::is_none")]
    pub riccati: Option<Vec<Vec<f64>>>,
    /// W_F that `lmi_paper` returns as printed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<ReferenceModel>,
}

/// W_F = C_F (sI - A_F)⁻¹ B_F + D_F of the paper, with n states, l inputs and q outputs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReferenceModel {
    /// A_F, n x n, 1/s.
    #[serde(rename = "A")]
    pub a: Vec<Vec<f64>>,
    /// B_F, n x l.
    #[serde(rename = "B")]
    pub b: Vec<Vec<f64>>,
    /// C_F, q x n.
    #[serde(rename = "C")]
    pub c: Vec<Vec<f64>>,
    /// D_F, q x l.
    #[serde(rename = "D")]
    pub d: Vec<Vec<f64>>,
}

/// A filter that is blind to some faults.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlindGains {
    /// Names of the faults to which it is blind.
    pub faults: Vec<String>,
    /// L, n x q.
    #[serde(rename = "L")]
    pub l: Vec<Vec<f64>>,
    /// V, q x q.
    #[serde(rename = "V")]
    pub v: Vec<Vec<f64>>,
    /// Π, n x n, of the Riccati equation.
    #[serde(rename = "Pi")]
    pub riccati: Vec<Vec<f64>>,
}

/// The filter that estimates the faults: T_rf ≡ Df.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorGains {
    /// L, n x q.
    #[serde(rename = "L")]
    pub l: Vec<Vec<f64>>,
}

/// A matrix row by row.
pub fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix
        .row_iter()
        .map(|row| row.iter().copied().collect())
        .collect()
}

impl MainGains {
    /// Gains of a design without any certificate beside them; their label is still to be found.
    pub fn new(design: DesignType, gain: &Gain) -> Self {
        let matrix = Some(rows(&gain.matrix));
        let (l, h) = match gain.time {
            Time::Discrete => (matrix, None),
            Time::Continuous => (None, matrix),
        };
        Self {
            design,
            label: String::new(),
            l,
            h,
            v: rows(&gain.v),
            stage_one: None,
            claimed_bound: None,
            claimed_index: None,
            lyapunov: None,
            riccati: None,
            reference: None,
        }
    }

    /// L or H with V for n states and q outputs.
    pub(super) fn gain(&self, n: usize, q: usize) -> Result<Gain, HinfFilterError> {
        let (time, key, matrix) = match (&self.l, &self.h) {
            (Some(l), None) => (Time::Discrete, "gains.main.L", l),
            (None, Some(h)) => (Time::Continuous, "gains.main.H", h),
            (None, None) => {
                return Err(HinfFilterError::Missing {
                    key: "gains.main.L",
                    reason: "give the discrete gain L or the continuous gain H; design the gains again",
                });
            }
            (Some(_), Some(_)) => {
                return Err(HinfFilterError::Conflict {
                    key: "gains.main.L",
                    reason: "beside `gains.main.H`; design the gains again",
                });
            }
        };
        Ok(Gain {
            time,
            matrix: shaped_matrix(key, matrix, (n, q), "states x outputs")?,
            v: post_filter("gains.main.V", &self.v, q)?,
        })
    }

    /// W_F for n states, q outputs and l faults.
    pub(super) fn reference(&self, n: usize, q: usize, l: usize) -> Result<Option<System>, HinfFilterError> {
        let Some(model) = &self.reference else {
            return Ok(None);
        };
        let read = |key: &str, rows, shape| {
            shaped_matrix(
                &format!("gains.main.reference.{key}"),
                rows,
                shape,
                "of the reference model",
            )
        };
        Ok(Some(System {
            a: read("A", &model.a, (n, n))?,
            b: read("B", &model.b, (n, l))?,
            c: read("C", &model.c, (q, n))?,
            d: read("D", &model.d, (q, l))?,
        }))
    }
}

/// V, some rows of one entry per output, not all zero.
pub(super) fn post_filter(key: &str, rows: &[Vec<f64>], q: usize) -> Result<DMatrix<f64>, HinfFilterError> {
    let shape = (matrix(key, rows)?.nrows(), q);
    let v = shaped_matrix(key, rows, shape, "residuals x outputs")?;
    match v.amax() > 0.0 {
        true => Ok(v),
        false => Err(HinfFilterError::Empty {
            key: key.to_owned(),
            what: "entry that is not zero",
        }),
    }
}
