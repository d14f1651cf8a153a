//! Mode probabilities in the log domain (paper (76)-(78), method sheet 4.2, step 7).

/// (76) in the log domain: g = log c + ℓ, log μ = (g - max g) - ln Σ e^{g - max g}; true if no g is finite, so
/// that log μ = log c.
pub fn update_probability(
    log_predicted: &[f64],
    log_likelihood: &[f64],
    room: &mut [f64],
    log_probability: &mut [f64],
) -> bool {
    let terms = log_predicted.iter().zip(log_likelihood);
    for (g, (log_c, likelihood)) in room.iter_mut().zip(terms) {
        let sum = log_c + likelihood;
        *g = if sum.is_finite() { sum } else { f64::NEG_INFINITY };
    }
    let largest = room.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        log_probability.copy_from_slice(log_predicted);
        return true;
    }
    room.iter_mut().for_each(|g| *g -= largest);
    let total = log_sum_exp(room);
    for (log_mu, g) in log_probability.iter_mut().zip(room.iter()) {
        *log_mu = g - total;
    }
    false
}

/// log Σ e^{v}, -∞ of nothing but -∞.
pub(super) fn log_sum_exp(values: &[f64]) -> f64 {
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return largest;
    }
    largest
        + values
            .iter()
            .map(|value| (value - largest).exp())
            .sum::<f64>()
            .ln()
}
