//! Thresholds of every statistic (method sheet 3).

use super::{
    engine::Statistic,
    options::{ChiSquareOptions, StatisticKind, ThresholdMode},
    quantile::chi_square_upper_quantile,
};

/// The upper bounds in force. Lists are indexed by degrees of freedom; entry 0 is infinite: no test.
#[derive(Clone, Debug, PartialEq)]
pub struct Thresholds {
    /// t_d of the residual test.
    pub residual: Vec<f64>,
    /// t_d of the plain state test.
    pub plain: Vec<f64>,
    /// t_d of the propagator pair.
    pub pair: Vec<f64>,
    /// t_d of each state window.
    pub window: Vec<f64>,
    /// t_d that the channel of the bank divides by.
    pub bank_reference: Vec<f64>,
    /// Upper bound of λ / `bank_reference`.
    pub bank: f64,
    /// h of the likelihood ratio.
    pub glr: f64,
    /// h of the cumulative sums.
    pub cusum: f64,
    /// c: half width of the innovations' channels in standard deviations.
    pub deviations: f64,
}

/// What a simulation found: h of `glr` and `cusum`, and λ/t_d of the chi-square statistics, where they are calibrated.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Calibrated {
    pub bounds: Vec<(StatisticKind, f64)>,
}

impl Calibrated {
    fn bound(&self, kind: StatisticKind) -> Option<f64> {
        self.bounds
            .iter()
            .find(|(other, _)| *other == kind)
            .map(|(_, bound)| *bound)
    }
}

/// isf(`probability`, d) for d = 0 .. `degrees`.
pub(super) fn table(probability: f64, degrees: usize) -> Vec<f64> {
    (0..=degrees)
        .map(|d| chi_square_upper_quantile(probability, d))
        .collect()
}

impl Thresholds {
    /// Thresholds for up to `degrees` degrees of freedom.
    pub(super) fn new(options: &ChiSquareOptions, degrees: usize, calibrated: &Calibrated) -> Self {
        let probability = options.threshold.false_alarm_probability;
        let single = table(probability, degrees);
        let scaled = |kind| {
            let factor = calibrated.bound(kind).unwrap_or(1.0);
            single.iter().map(|t| factor * t).collect()
        };
        let windows = options.statistics.window_steps.len().max(1);
        let fixed = Some(options.threshold.bank).filter(|bound| *bound > 0.0);
        let per_run = options.threshold.mode == ThresholdMode::PerRun;
        let bank = calibrated
            .bound(StatisticKind::StateWindow)
            .or(fixed.filter(|_| per_run));
        // Without a calibrated bound the union bound shares the probability out among the windows.
        let bank_reference = match bank {
            Some(_) => single.clone(),
            None => table(probability / windows as f64, degrees),
        };
        let bank = bank.unwrap_or(1.0);
        let bound = |kind, fixed: f64| calibrated.bound(kind).unwrap_or(fixed);
        Self {
            residual: scaled(StatisticKind::Residual),
            plain: scaled(StatisticKind::StatePlain),
            pair: scaled(StatisticKind::StateTwoPropagator),
            window: bank_reference.iter().map(|t| bank * t).collect(),
            bank_reference,
            bank,
            glr: bound(StatisticKind::Glr, options.threshold.glr),
            cusum: bound(StatisticKind::Cusum, options.threshold.cusum),
            deviations: chi_square_upper_quantile(probability, 1).sqrt(),
        }
    }
}

/// The threshold of a statistic from a list by degrees of freedom.
pub(super) fn threshold(list: &[f64], statistic: &Statistic) -> f64 {
    list.get(statistic.degrees).copied().unwrap_or(f64::INFINITY)
}
