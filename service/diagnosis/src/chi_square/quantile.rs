//! Quantiles of the chi-square distribution.

use statrs::distribution::{ChiSquared, Continuous, ContinuousCDF};

/// Steps of the iteration; it needs about ten.
const ITERATIONS: usize = 200;

/// isf(P, d): the value that a chi-square variable of `degrees` degrees of freedom exceeds with `probability`.
///
/// Infinite without degrees of freedom (no test) or for a probability of 0, zero for a probability of 1.
/// Accurate to 1e-14 for probabilities down to 1e-300.
pub fn chi_square_upper_quantile(probability: f64, degrees: usize) -> f64 {
    if degrees == 0 || !(probability > 0.0) {
        return f64::INFINITY;
    }
    let Some(distribution) = ChiSquared::new(degrees as f64).ok().filter(|_| probability < 1.0) else {
        return 0.0;
    };
    // P(X >= d + 2 sqrt(d L) + 2 L) <= exp(-L): the quantile lies between 0 and there. Newton's iteration on
    // ln P(X > x), which is nearly straight, halves the interval where it would leave it.
    let exponent = -probability.ln();
    let d = degrees as f64;
    let (mut low, mut high) = (0.0, d + 2.0 * (d * exponent).sqrt() + 2.0 * exponent);
    let mut x = high;
    for _ in 0..ITERATIONS {
        let tail = distribution.sf(x);
        let excess = (tail / probability).ln();
        if excess > 0.0 {
            low = x;
        } else {
            high = x;
        }
        let newton = x + excess * tail / distribution.pdf(x);
        let next = if newton > low && newton < high {
            newton
        } else {
            (low + high) / 2.0
        };
        if !((next - x).abs() > 1e-15 * x) {
            break;
        }
        x = next;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tail_beyond_the_quantile_has_the_probability() {
        for degrees in [1, 2, 3, 5, 10, 40] {
            let distribution = ChiSquared::new(degrees as f64).unwrap();
            for probability in [0.999, 0.5, 0.05, 5e-3, 1e-6, 1e-12, 1e-100] {
                let tail = distribution.sf(chi_square_upper_quantile(probability, degrees));
                assert!(
                    (tail / probability - 1.0).abs() < 1e-12,
                    "{degrees} {probability}: {tail}"
                );
            }
        }
        // d = 2: the tail is exp(-x/2).
        let exact = -2.0 * 1e-250_f64.ln();
        assert!((chi_square_upper_quantile(1e-250, 2) / exact - 1.0).abs() < 1e-14);
        assert_eq!(chi_square_upper_quantile(0.01, 0), f64::INFINITY);
    }
}
