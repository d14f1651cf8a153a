//! How well a model predicts recordings, one step ahead.

use super::Likelihood;
use crate::identify::run_data::Piece;

/// One-step predictions over some runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Prediction {
    /// Number of received elements that were predicted, all outputs together.
    pub elements: usize,
    /// Root mean square of the innovation of each output, units of y.
    pub rms: Vec<f64>,
    /// Mean of e' S⁻¹ e per element: 1 if the covariances are right.
    pub normalised_square: f64,
    /// Correlation of each output's innovation with the one before: 0 if the model leaves nothing to predict.
    pub correlation: Vec<f64>,
}

impl Likelihood<'_> {
    /// The predictions of θ over some pieces; `None` if its filter fails.
    pub(in crate::identify) fn prediction<'p>(
        &self,
        theta: &[f64],
        pieces: impl Iterator<Item = &'p Piece>,
    ) -> Option<Prediction> {
        let mut filter = self.filter(theta)?;
        let outputs = self.measurement.start_deviations().len();
        let (mut squares, mut counts) = (vec![0.0; outputs], vec![0_usize; outputs]);
        let (mut products, mut pairs) = (vec![0.0; outputs], vec![0_usize; outputs]);
        let (mut normalised, mut elements) = (0.0, 0_usize);
        for piece in pieces {
            filter.restart();
            let mut before: Vec<Option<f64>> = vec![None; outputs];
            for k in 0..piece.transitions() {
                let innovation = filter.step(piece, k)?;
                let mut present = vec![None; outputs];
                for (&i, &e) in innovation.received.iter().zip(innovation.e.iter()) {
                    // The first instants of a piece tell the initial state, not the quality of the model.
                    present[i] = (k >= START).then_some(e);
                }
                if k >= START {
                    normalised += innovation.square();
                    elements += innovation.e.len();
                }
                for i in 0..outputs {
                    if let Some(e) = present[i] {
                        squares[i] += e * e;
                        counts[i] += 1;
                    }
                    if let (Some(e), Some(last)) = (present[i], before[i]) {
                        products[i] += e * last;
                        pairs[i] += 1;
                    }
                }
                before = present;
            }
        }
        let mean = |sum: f64, count: usize| sum / count.max(1) as f64;
        let square = |i: usize| mean(squares[i], counts[i]);
        let correlation = |i: usize| {
            if squares[i] > 0.0 {
                mean(products[i], pairs[i]) / square(i)
            } else {
                0.0
            }
        };
        Some(Prediction {
            elements,
            rms: (0..outputs).map(|i| square(i).sqrt()).collect(),
            normalised_square: mean(normalised, elements),
            correlation: (0..outputs).map(correlation).collect(),
        })
    }
}

/// Instants of a piece that are left out of the figures.
const START: usize = 3;

impl Prediction {
    /// Several of the same outputs as one; empty without any.
    pub(in crate::identify) fn pooled(parts: &[Self]) -> Self {
        let total: usize = parts.iter().map(|part| part.elements).sum();
        let mean = |of: &dyn Fn(&Self) -> f64| {
            let sum: f64 = parts.iter().map(|part| of(part) * part.elements as f64).sum();
            sum / total.max(1) as f64
        };
        let outputs = parts.first().map_or(0, |part| part.rms.len());
        Self {
            elements: total,
            rms: (0..outputs)
                .map(|i| mean(&|part| part.rms[i] * part.rms[i]).sqrt())
                .collect(),
            normalised_square: mean(&|part| part.normalised_square),
            correlation: (0..outputs).map(|i| mean(&|part| part.correlation[i])).collect(),
        }
    }
}
