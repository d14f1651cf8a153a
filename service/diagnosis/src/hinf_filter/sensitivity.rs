//! Smallest constant faults that the peak test is sure to see, and after how many instants.
//!
//! A fault f that lasts from instant 0 on moves the residual by s_t f, s_t = V (C e_t + Df), e⁺ = Ac e + Bfd - L Df. Without
//! it |r̃_i| <= ρ_i, so that an alarm at t is certain from |s_t f| > 2 ρ_i on (method sheet 3.5: f_min for t → ∞).

use nalgebra::DMatrix;

/// The step response counts as settled when e changes by less than this part.
const SETTLED: f64 = 1e-9;
/// A size that falls by less than this part adds nothing to the list.
const WORTH_NOTING: f64 = 1e-6;
/// Longest response that is followed.
const LONGEST: usize = 100_000;
/// A response below this part of the largest of all counts as none.
const NO_RESPONSE: f64 = 1e-12;

/// A filter's error dynamics and the settled bounds of its tested residuals.
pub(super) struct StepResponse<'a> {
    /// Ac, n x n.
    pub closed: &'a DMatrix<f64>,
    /// Bfd - L Df, n x l.
    pub input: DMatrix<f64>,
    /// VC, s x n.
    pub output: DMatrix<f64>,
    /// V Df, s x l.
    pub direct: DMatrix<f64>,
}

/// What the peak test of one filter is sure to see of one fault.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Visibility {
    /// (instants since the onset, smallest size seen by then), sizes falling; empty: no size is seen.
    pub delays: Vec<(usize, f64)>,
    /// Instants, that of the onset included, until the residual moves at all.
    pub first: Option<usize>,
    /// Smallest size that each row is sure to see at last; infinite: none.
    pub by_row: Vec<f64>,
}

impl Visibility {
    /// The smallest size that is seen at last.
    pub fn smallest(&self) -> Option<f64> {
        self.delays.last().map(|(_, size)| *size)
    }
}

/// 1, 2, 5, 10, 20, 50, ...
fn is_listed(instant: usize) -> bool {
    let mut rest = instant;
    while rest > 0 && rest.is_multiple_of(10) {
        rest /= 10;
    }
    matches!(rest, 1 | 2 | 5)
}

impl StepResponse<'_> {
    /// Fault by fault; `bound` is ρ of every row.
    pub fn visibility(&self, bound: &[f64]) -> Vec<Visibility> {
        let (n, l) = self.input.shape();
        let rows = self.output.nrows().min(bound.len());
        let mut state = DMatrix::<f64>::zeros(n, l);
        let mut largest = DMatrix::<f64>::zeros(rows, l);
        let mut found = vec![Visibility::default(); l];
        for instant in 0..=LONGEST {
            let response = &self.output * &state + &self.direct;
            let scale = response.amax().max(largest.amax());
            for (j, fault) in found.iter_mut().enumerate() {
                for i in 0..rows {
                    let size = response[(i, j)].abs();
                    largest[(i, j)] = largest[(i, j)].max(size);
                    if fault.first.is_none() && size > NO_RESPONSE * scale {
                        fault.first = Some(instant + 1);
                    }
                }
            }
            let next = self.closed * &state + &self.input;
            let settled = (&next - &state).amax() <= SETTLED * next.amax();
            state = next;
            let last = instant == LONGEST || settled && is_listed(instant);
            if is_listed(instant) || last {
                let scale = largest.amax();
                for (j, fault) in found.iter_mut().enumerate() {
                    fault.by_row = (0..rows)
                        .map(|i| match largest[(i, j)] {
                            peak if peak > NO_RESPONSE * scale => 2.0 * bound[i] / peak,
                            _ => f64::INFINITY,
                        })
                        .collect();
                    let size = fault.by_row.iter().copied().fold(f64::INFINITY, f64::min);
                    let before = fault.smallest().unwrap_or(f64::INFINITY);
                    if size.is_finite() && size < before * (1.0 - WORTH_NOTING) {
                        fault.delays.push((instant, size));
                    }
                }
            }
            if last {
                break;
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn a_lag_shows_smaller_and_smaller_faults_until_its_gain_is_reached() {
        // e⁺ = 0.9 e + 0.1 f, r = e: s_t = 1 - 0.9ᵗ.
        let response = StepResponse {
            closed: &dmatrix![0.9],
            input: dmatrix![0.1],
            output: dmatrix![1.0],
            direct: dmatrix![0.0],
        };
        let found = &response.visibility(&[0.5])[0];
        assert_eq!(found.first, Some(2), "nothing at the onset");
        assert!((found.smallest().unwrap() - 1.0).abs() < 2e-6);
        for (instants, size) in &found.delays {
            let expected = 1.0 / (1.0 - 0.9_f64.powi(*instants as i32));
            assert!((size - expected).abs() < 1e-12 * expected, "{instants}: {size}");
        }
        assert_eq!(found.delays[0].0, 1);
        assert!(found.delays.len() <= 9, "{:?}", found.delays);
    }

    #[test]
    fn a_fault_that_reaches_no_residual_is_never_seen() {
        let response = StepResponse {
            closed: &dmatrix![0.5, 0.0; 0.0, 0.5],
            input: dmatrix![1.0, 0.0; 0.0, 1.0],
            output: dmatrix![1.0, 0.0],
            direct: dmatrix![0.0, 0.0],
        };
        let found = response.visibility(&[1.0]);
        assert!(found[0].smallest().is_some());
        assert_eq!((found[1].smallest(), found[1].first), (None, None));
    }
}
