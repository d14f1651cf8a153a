//! Whether numbers are finite, without a branch per number.

/// Independent partial results.
const LANES: usize = 8;

/// Whether every number is finite: 0 v is 0 for a finite v and not a number for any other.
pub(super) fn all_finite(values: &[f64]) -> bool {
    let blocks = values.chunks_exact(LANES);
    let rest: f64 = blocks.remainder().iter().map(|value| value * 0.0).sum();
    let mut partial = [0.0; LANES];
    for block in blocks {
        for (partial, value) in partial.iter_mut().zip(block) {
            *partial += value * 0.0;
        }
    }
    partial.iter().sum::<f64>() + rest == 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_number_that_is_not_finite_is_found_wherever_it_is() {
        for length in 0..40 {
            let mut values = vec![-f64::MAX; length];
            assert!(all_finite(&values));
            for place in 0..length {
                for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                    let kept = std::mem::replace(&mut values[place], wrong);
                    assert!(!all_finite(&values), "{wrong} at {place} of {length}");
                    values[place] = kept;
                }
            }
        }
    }
}
