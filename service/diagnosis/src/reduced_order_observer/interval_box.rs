//! Boxes [lower, upper] of states, disturbances and commands.

use super::error::ConstructionError;
use crate::tables::vector;
use nalgebra::DVector;

/// A box as its centre and its half widths, both of one length.
#[derive(Clone, Debug, PartialEq)]
pub struct IntervalBox {
    /// (lower + upper) / 2.
    pub centre: DVector<f64>,
    /// (upper - lower) / 2, never negative.
    pub radius: DVector<f64>,
}

impl IntervalBox {
    /// The box between two lists of `length` entries; `meaning` tells what the entries stand for.
    ///
    /// # Errors
    /// [`ConstructionError::Table`] for a wrong length or an entry that is not finite,
    /// [`ConstructionError::EmptyBox`] where lower > upper.
    pub fn new(
        (lower_key, upper_key): (&'static str, &'static str),
        (lower, upper): (&[f64], &[f64]),
        length: usize,
        meaning: &'static str,
    ) -> Result<Self, ConstructionError> {
        let low = vector(lower_key, lower, length, meaning)?;
        let high = vector(upper_key, upper, length, meaning)?;
        if let Some(index) = (0..length).find(|&i| low[i] > high[i]) {
            return Err(ConstructionError::EmptyBox {
                lower_key,
                upper_key,
                index,
                lower: low[index],
                upper: high[index],
            });
        }
        Ok(Self {
            centre: (&low + &high) / 2.0,
            radius: (high - low) / 2.0,
        })
    }

    /// The box of two optional lists, which must be there together.
    ///
    /// # Errors
    /// As [`Self::new`]; [`ConstructionError::Missing`] if only one of both is given.
    pub fn optional(
        (lower_key, upper_key): (&'static str, &'static str),
        bounds: (&Option<Vec<f64>>, &Option<Vec<f64>>),
        length: usize,
        meaning: &'static str,
    ) -> Result<Option<Self>, ConstructionError> {
        let missing = |key| {
            Err(ConstructionError::Missing {
                key,
                reason: "lower and upper bound belong together; give both or none",
            })
        };
        match bounds {
            (Some(lower), Some(upper)) => {
                Self::new((lower_key, upper_key), (lower, upper), length, meaning).map(Some)
            }
            (None, None) => Ok(None),
            (None, Some(_)) => missing(lower_key),
            (Some(_), None) => missing(upper_key),
        }
    }
}
