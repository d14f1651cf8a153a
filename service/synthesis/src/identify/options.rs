//! What a user can set for an identification.

use super::IdentifyError;
use residual_diagnosis::unknown_input_filter::options::PreSamples;

/// How the noise scales of the outputs are combined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NoiseSearch {
    /// All outputs have the same scale.
    Common,
    /// The best common scale first, then the scale of one output after the other, until no change of a single
    /// scale is better. Outputs whose noise bounds were guessed badly relative to each other need this.
    #[default]
    PerOutput,
}

/// Options of [`identify_bounds`](super::identify_bounds).
#[derive(Clone, Debug, PartialEq)]
pub struct IdentifyOptions {
    /// Multiples of the model's noise bound to try, each finite and above zero.
    pub noise_scales: Vec<f64>,
    /// How they are combined.
    pub search: NoiseSearch,
    /// Relative margin on the disturbance bounds for what the training runs did not show, finite and >= 0.
    pub margin: f64,
    /// Up to this number of left-out failures, steps count as equally trustworthy and only the smallest detectable
    /// fault decides. There are never more failures than disturbances, since each bound rests on one run.
    pub tolerated_left_out_failures: usize,
    /// Significant digits of the bounds, 1 to 7; they are rounded up.
    pub significant_digits: usize,
    /// L: duration, in transitions, of the constant fault by whose smallest detectable size noise scales are
    /// compared; at most the longest training run.
    pub window: usize,
    /// Transitions before that fault in the same window.
    pub pre_samples: PreSamples,
}

impl Default for IdentifyOptions {
    fn default() -> Self {
        Self {
            noise_scales: vec![0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0],
            search: NoiseSearch::default(),
            margin: 0.05,
            tolerated_left_out_failures: 0,
            significant_digits: 3,
            window: 20,
            pre_samples: PreSamples::Auto,
        }
    }
}

impl IdentifyOptions {
    pub(super) fn validate(&self) -> Result<(), IdentifyError> {
        let positive = |value: &f64| value.is_finite() && *value > 0.0;
        let checks = [
            (
                "noise_scales",
                format!("{:?}", self.noise_scales),
                !self.noise_scales.is_empty() && self.noise_scales.iter().all(positive),
                "give at least one finite number above 0",
            ),
            (
                "margin",
                self.margin.to_string(),
                self.margin.is_finite() && self.margin >= 0.0,
                "use a finite number >= 0, for instance 0.05 for five per cent",
            ),
            (
                "significant_digits",
                self.significant_digits.to_string(),
                (1..=7).contains(&self.significant_digits),
                "use 1 to 7; the programs are solved to about that accuracy",
            ),
            (
                "window",
                self.window.to_string(),
                self.window > 0,
                "use at least one transition",
            ),
        ];
        match checks.into_iter().find(|check| !check.2) {
            None => Ok(()),
            Some((option, value, _, help)) => Err(IdentifyError::InvalidOption { option, value, help }),
        }
    }
}
