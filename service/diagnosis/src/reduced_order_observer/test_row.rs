//! The result of one test row at one instant.

use crate::diagnoser::Channel;

/// w'(y - ẑ1) against the interval that it has without a fault.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TestRow {
    /// Whether every output of the row was there; otherwise the rest means nothing.
    pub evaluated: bool,
    /// w'e.
    pub residual: f64,
    /// γ = w'c.
    pub centre: f64,
    /// h and what rounding may add.
    pub half_width: f64,
}

impl TestRow {
    /// Whether the residual is outside.
    pub fn alarm(&self) -> bool {
        self.evaluated && !((self.residual - self.centre).abs() <= self.half_width)
    }

    /// |w'e - γ| / h: above 1 exactly if [`Self::alarm`].
    pub fn ratio(&self) -> f64 {
        let distance = (self.residual - self.centre).abs();
        if distance == 0.0 {
            0.0
        } else {
            distance / self.half_width
        }
    }

    /// How far the residual is outside; negative inside.
    pub fn excess(&self) -> f64 {
        (self.residual - self.centre).abs() - self.half_width
    }

    /// (γ - h, w'e, γ + h).
    pub fn channel(&self) -> Channel {
        if !self.evaluated {
            return Channel::NOT_EVALUATED;
        }
        Channel {
            lower: self.centre - self.half_width,
            residual: self.residual,
            upper: self.centre + self.half_width,
            ratio: self.ratio(),
        }
    }

    /// The fault that an estimator's row sees: w'e - γ.
    pub fn estimate(&self) -> f64 {
        self.residual - self.centre
    }

    /// The interval of that fault; for information, the row itself is the test.
    pub fn estimate_channel(&self) -> Channel {
        if self.evaluated {
            Channel::estimate(self.estimate(), self.half_width)
        } else {
            Channel::NOT_EVALUATED
        }
    }
}
