//! The bounds of a model apart from the model.

use nalgebra::DVector;
use residual_diagnosis::model::LinearModel;
pub use residual_diagnosis::rounding::{round, round_up};

/// The bounds w of |d| and v of |v(k)| (method sheet 2).
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseBounds {
    /// w: bound of the disturbances, length nd, >= 0, units of d, per step.
    pub disturbance: DVector<f64>,
    /// v: bound of the measurement noise, length ny, >= 0, units of y.
    pub measurement: DVector<f64>,
}

impl From<&LinearModel> for NoiseBounds {
    fn from(model: &LinearModel) -> Self {
        Self {
            disturbance: model.w().clone(),
            measurement: model.v().clone(),
        }
    }
}
