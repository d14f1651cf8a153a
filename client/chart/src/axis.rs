//! Which range and which scale an axis has.

use std::ops::Range;

use crate::chart::Scale;

/// Beyond this ratio of largest to smallest value an axis is logarithmic.
const LOGARITHMIC: f64 = 50.0;
/// A logarithmic axis shows at most this many decades below the largest value.
const DECADES: i32 = 12;

/// What an axis shows.
pub(crate) struct Axis {
    /// From its beginning to its end.
    pub(crate) range: Range<f64>,
    /// Whether it is logarithmic.
    pub(crate) logarithmic: bool,
}

impl Axis {
    /// The axis of these values: logarithmic if it may be and they are positive, or nearly all zero, and span decades.
    pub(crate) fn of(values: impl Iterator<Item = f64> + Clone, scale: Scale) -> Self {
        let largest = values.clone().fold(f64::NEG_INFINITY, f64::max);
        let smallest = values.clone().fold(f64::INFINITY, f64::min);
        let least_shown = largest * 10f64.powi(-DECADES);
        let positive = values
            .filter(|value| *value > least_shown)
            .fold(f64::INFINITY, f64::min);
        if scale == Scale::ByValues && smallest >= 0.0 && largest > LOGARITHMIC * positive {
            return Self {
                range: positive / 1.2..largest * 1.2,
                logarithmic: true,
            };
        }
        let room = match largest - smallest {
            0.0 => largest.abs().max(1.0) * 0.1,
            span => span * 0.05,
        };
        let low = if smallest >= 0.0 { 0.0 } else { smallest - room };
        Self {
            range: low..largest + room,
            logarithmic: false,
        }
    }
}

/// A label of an axis.
pub(crate) fn number(value: &f64) -> String {
    let size = value.abs();
    if *value == 0.0 || (1e-3..1e5).contains(&size) {
        let text = format!("{value:.4}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{value:.1e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_over_decades_make_a_logarithmic_axis_that_ignores_zeros() {
        let axis = Axis::of([0.0, 1e-3, 10.0].into_iter(), Scale::ByValues);
        assert!(axis.logarithmic && axis.range.start > 1e-4);
        let axis = Axis::of([0.0, 1.0, 10.0].into_iter(), Scale::ByValues);
        assert!(!axis.logarithmic && axis.range.start == 0.0);
        let axis = Axis::of([0.0, 1e-3, 10.0].into_iter(), Scale::Linear);
        assert!(!axis.logarithmic && axis.range.contains(&10.0));
    }
}
