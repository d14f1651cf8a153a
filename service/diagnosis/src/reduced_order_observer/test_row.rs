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
    /// h.
    pub half_width: f64,
    /// What rounding may add.
    pub tolerance: f64,
}

impl TestRow {
    /// Whether the residual is outside.
    pub fn alarm(&self) -> bool {
        self.evaluated && !((self.residual - self.centre).abs() <= self.half_width + self.tolerance)
    }

    /// |w'e - γ| / (h + tolerance): above 1 exactly if [`Self::alarm`].
    pub fn ratio(&self) -> f64 {
        let distance = (self.residual - self.centre).abs();
        if distance == 0.0 {
            0.0
        } else {
            distance / (self.half_width + self.tolerance)
        }
    }

    /// How far the residual is outside; negative inside.
    pub fn excess(&self) -> f64 {
        (self.residual - self.centre).abs() - self.half_width
    }

    /// (γ - h, w'e, γ + h).
    pub fn channel(&self) -> Channel {
        self.channel_of(self.centre, self.residual)
    }

    /// The interval of the fault that an estimator's row sees: w'e - γ ± h, in alarm if 0 is outside.
    pub fn estimate_channel(&self) -> Channel {
        let estimate = self.estimate();
        self.channel_of(estimate, estimate)
    }

    /// The centre of that interval.
    pub fn estimate(&self) -> f64 {
        self.residual - self.centre
    }

    fn channel_of(&self, middle: f64, residual: f64) -> Channel {
        if !self.evaluated {
            return Channel::NOT_EVALUATED;
        }
        Channel {
            lower: middle - self.half_width,
            residual,
            upper: middle + self.half_width,
            ratio: self.ratio(),
        }
    }
}
