//! How a residual answers to a disturbance or a fault at each frequency.

use crate::norms::System;
use nalgebra::Complex;

/// A transfer matrix with its name and its time domain.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// From what to what.
    pub name: String,
    /// State space form.
    pub system: System,
    /// Period of a discrete-time system, s; `None` for a continuous-time one.
    pub sample_time_s: Option<f64>,
}

impl Response {
    /// Smallest and largest singular value at `frequency`, rad/s; `None` at a pole, and for a discrete-time system
    /// above half the sampling frequency.
    pub fn singular_values(&self, frequency: f64) -> Option<(f64, f64)> {
        let point = match self.sample_time_s {
            None => Complex::new(0.0, frequency),
            Some(period) if frequency * period <= std::f64::consts::PI => {
                Complex::from_polar(1.0, frequency * period)
            }
            Some(_) => return None,
        };
        self.system.gains_at(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn a_discrete_response_ends_at_half_the_sampling_frequency() {
        let one = dmatrix![1.0];
        let response = Response {
            name: "a first-order lag".to_owned(),
            system: System::new(&dmatrix![0.5], &one, &one, &dmatrix![0.0]),
            sample_time_s: Some(0.1),
        };
        let (_, slow) = response.singular_values(0.0).unwrap();
        let (_, fast) = response.singular_values(10.0 * std::f64::consts::PI).unwrap();
        assert!((slow - 2.0).abs() < 1e-14 && (fast - 1.0 / 1.5).abs() < 1e-12);
        assert_eq!(response.singular_values(32.0), None);
    }
}
