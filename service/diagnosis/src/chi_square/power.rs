//! How surely a chi-square statistic exceeds its threshold when a fault gives it a non-centrality.
//!
//! λ with d degrees of freedom and non-centrality δ is a mixture: with the Poisson weights of mean δ/2 at j it is
//! central with d + 2j degrees of freedom.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Largest non-centrality that is looked at.
const LARGEST: f64 = 1e6;
/// Bisections; each halves an interval inside (0, `LARGEST`).
const BISECTIONS: usize = 100;
/// Spreads of the Poisson weights around their mean that are summed.
const SPREADS: f64 = 12.0;

/// P(λ > `threshold`).
pub(super) fn power(threshold: f64, degrees: usize, non_centrality: f64) -> f64 {
    if degrees == 0 || !threshold.is_finite() {
        return 0.0;
    }
    let mean = non_centrality / 2.0;
    let reach = SPREADS * mean.sqrt() + SPREADS;
    let first = (mean - reach).max(0.0).floor();
    let mut log_weight = -mean + first * mean.max(f64::MIN_POSITIVE).ln() - log_factorial(first);
    let (mut sum, mut j) = (0.0, first);
    while j <= mean + reach {
        let tail = ChiSquared::new(degrees as f64 + 2.0 * j).map_or(0.0, |central| central.sf(threshold));
        sum += log_weight.exp() * tail;
        j += 1.0;
        log_weight += mean.max(f64::MIN_POSITIVE).ln() - j.ln();
    }
    sum
}

/// ln n!.
fn log_factorial(n: f64) -> f64 {
    statrs::function::gamma::ln_gamma(n + 1.0)
}

/// The non-centrality from which on the threshold is exceeded with at least this probability; `None` if there is none.
pub(super) fn required_non_centrality(threshold: f64, degrees: usize, probability: f64) -> Option<f64> {
    let enough = |non_centrality: f64| power(threshold, degrees, non_centrality) >= probability;
    let mut high = 1.0;
    while !enough(high) {
        high *= 2.0;
        if high > LARGEST {
            return None;
        }
    }
    let mut low = 0.0;
    for _ in 0..BISECTIONS {
        let middle = (low + high) / 2.0;
        if enough(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::Normal;

    #[test]
    fn with_one_degree_of_freedom_the_power_is_that_of_a_shifted_normal_variable() {
        let normal = Normal::standard();
        for (threshold, delta) in [(7.879, 0.0), (7.879, 3.0), (18.5, 40.0), (3.84, 900.0)] {
            let (t, d) = (f64::sqrt(threshold), f64::sqrt(delta));
            let exact = normal.cdf(d - t) + normal.cdf(-d - t);
            assert!(
                (power(threshold, 1, delta) - exact).abs() < 1e-9,
                "{threshold} {delta}"
            );
        }
    }

    #[test]
    fn the_required_non_centrality_gives_the_probability() {
        for (threshold, degrees) in [(7.879, 1), (14.86, 4), (33.0, 12)] {
            let delta = required_non_centrality(threshold, degrees, 0.9).unwrap();
            assert!((power(threshold, degrees, delta) - 0.9).abs() < 1e-9);
        }
        assert_eq!(required_non_centrality(f64::INFINITY, 0, 0.9), None);
    }
}
