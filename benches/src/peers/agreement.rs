//! That two programs did the same work: their numbers agree.

use anyhow::{Result, ensure};

/// The largest difference of two lists of rows, relative to the largest entry of its column in `expected`.
///
/// # Errors
/// The lists have other shapes, or an entry is not a number on one side only.
pub fn largest_difference(expected: &[Vec<f64>], found: &[Vec<f64>]) -> Result<f64> {
    ensure!(
        expected.len() == found.len(),
        "{} rows instead of {}",
        found.len(),
        expected.len()
    );
    let columns = expected.first().map_or(0, Vec::len);
    let mut largest = 0.0_f64;
    let mut scales = vec![0.0_f64; columns];
    for (k, row) in expected.iter().enumerate() {
        ensure!(
            row.len() == columns && found[k].len() == columns,
            "row {k} has {} columns instead of {columns}",
            found[k].len()
        );
        for (scale, value) in scales.iter_mut().zip(row).filter(|(_, value)| value.is_finite()) {
            *scale = scale.max(value.abs());
        }
    }
    for (k, (left, right)) in expected.iter().zip(found).enumerate() {
        for (j, (left, right)) in left.iter().zip(right).enumerate() {
            if left == right || left.is_nan() && right.is_nan() {
                continue;
            }
            let difference = (left - right).abs() / scales[j].max(f64::MIN_POSITIVE);
            ensure!(
                difference.is_finite(),
                "row {k}, column {j}: {right} instead of {left}"
            );
            largest = largest.max(difference);
        }
    }
    Ok(largest)
}

/// [`largest_difference`], refused above `tolerance`.
///
/// # Errors
/// The numbers do not agree.
pub fn agree(expected: &[Vec<f64>], found: &[Vec<f64>], tolerance: f64) -> Result<f64> {
    let difference = largest_difference(expected, found)?;
    ensure!(
        difference <= tolerance,
        "the numbers differ by {difference:e} of the largest entry of their column, more than {tolerance:e}"
    );
    Ok(difference)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_relative_to_the_largest_entry_of_a_column() {
        let expected = [vec![100.0, 1e-3], vec![0.0, 0.0]];
        let found = [vec![100.0, 1e-3], vec![1.0, 1e-6]];
        assert!((largest_difference(&expected, &found).unwrap() - 1e-2).abs() < 1e-15);
        let found = [vec![100.0, 1e-3], vec![0.0, 1e-4]];
        assert!((largest_difference(&expected, &found).unwrap() - 0.1).abs() < 1e-15);
    }

    #[test]
    fn other_shapes_and_lone_nans_do_not_agree() {
        let expected = [vec![1.0, f64::NAN]];
        assert!(agree(&expected, &[vec![1.0, f64::NAN]], 0.0).is_ok());
        assert!(agree(&expected, &[vec![1.0, 0.0]], 1.0).is_err());
        assert!(agree(&expected, &[vec![f64::NAN, f64::NAN]], 1.0).is_err());
        assert!(agree(&expected, &[vec![1.0]], 1.0).is_err());
        assert!(agree(&expected, &[], 1.0).is_err());
    }

    #[test]
    fn a_difference_above_the_tolerance_is_refused_with_both_numbers() {
        let refused = agree(&[vec![1.0]], &[vec![1.1]], 1e-9).unwrap_err().to_string();
        assert!(refused.contains("1e-9"), "{refused}");
        assert!(agree(&[vec![1.0]], &[vec![1.0 + 1e-12]], 1e-9).is_ok());
    }
}
